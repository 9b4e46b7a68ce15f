// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdio>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "field/object_metadata.h"
#include "ros/bag/trust_trials.h"
#include "tools/tool.h"

// A model and recordings to how far published poses can be believed.

namespace nerf_pose_refiner {
namespace {

struct TrustOptions {
  std::string model;
  std::vector<std::string> bags;
  std::vector<std::string> gone;
  int runs = 50;
  double published_right = 0.99, right_published = 0.9;
  bool json = false;
  BagTopics topics;
  TrustSettings trials;
  PoseRefinerParameters node;
  BackendOptions backend;
};

void declareRuns(CLI::App* app, TrustOptions* options) {
  TrustSettings& t = options->trials;
  app->add_option("--runs", options->runs, "Runs of each recording")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app->add_option("--images", t.images, "Images of a run in which the object stays")
      ->capture_default_str();
  app->add_option("--every", t.every, "Process every n-th image, as a slower computer would")
      ->capture_default_str();
  app->add_option("--before", t.before, "Images of a run before the object disappears")
      ->capture_default_str();
  app->add_option("--limit", t.limit,
                  "Images after the disappearance within which the object must be lost")
      ->capture_default_str();
  app->add_option(
         "--after", t.after,
         "Images after the disappearance in which the object is searched for, up to --limit")
      ->capture_default_str();
  app->add_option("--start-rotation", t.start_rotation_deg,
                  "Largest error of an initial pose about each axis [degrees]")
      ->capture_default_str();
  app->add_option("--start-translation", t.start_translation,
                  "Largest error of an initial pose along each axis [object diameters]")
      ->capture_default_str();
  app->add_option("--seed", t.seed, "Seed of the runs: same seed, same numbers")
      ->capture_default_str();
  app->add_option("--published-right", options->published_right,
                  "Fraction of the published poses that must be right: within 5 degrees and 5 % of "
                  "the diameter")
      ->capture_default_str();
  app->add_option("--right-published", options->right_published,
                  "Fraction of the right poses that must be published")
      ->capture_default_str();
}

void declare(CLI::App* app, TrustOptions* options) {
  const std::string name = app->get_name();
  app->description(
      "Measures how far the poses that the node publishes can be trusted.\n\n"
      "The node's tracker tracks the object through recordings, image after image, from initial\n"
      "poses with an error: are published poses right, and right ones published? And when the\n"
      "object disappears from one image to the next (recordings with the same camera motion,\n"
      "without the object, with it covered, or with another in its place): is it lost soon?");
  app->footer(
      "Example:\n  " + name + " kiosk.safetensors kiosk.bag dim.bag --gone absent.bag\n\n" +
      "Exit code: 0 all requirements are met, 1 some are not or the run failed, 2 wrong usage.");
  app->add_option("model", options->model, "Model file with metric scale")
      ->required()
      ->check(CLI::ExistingFile);
  app->add_option("bags", options->bags, "Recordings of the object with its true pose")
      ->required()
      ->check(CLI::ExistingFile);
  app->add_option("--gone", options->gone,
                  "Recordings without the object that continue the first bag, with its stamps")
      ->check(CLI::ExistingFile);
  app->add_option(
      "--image", options->topics.image,
      "Topic of images, raw or compressed; default: the only one of the bag, or of those "
      "in the frame of the true poses");
  auto* truth = app->add_option("--truth", options->topics.truth, "Topic of true poses");
  app->add_option("--truth-frame", options->topics.truth_frame,
                  "TF frame of the object, instead of --truth")
      ->excludes(truth);
  app->add_flag("--rectified", options->node.image_is_rectified,
                "The images are rectified: P applies, not K and D");
  app->add_option("--preset", options->node.tracker.initial.preset, "The node's ~refiner/preset")
      ->check(CLI::IsMember(RefinerSettings::presetNames()))
      ->capture_default_str();
  app->add_option("--trust-score", options->node.tracker.rules.trust_score,
                  "The node's ~tracker/trust_score")
      ->capture_default_str();
  app->add_option("--min-score", options->node.tracker.rules.min_score,
                  "The node's ~tracker/min_score")
      ->capture_default_str();
  declareRuns(app, options);
  options->backend.addTo(app);
  app->add_flag("--json", options->json, "Print the results as JSON");
}

double fraction(int part, int whole) { return whole > 0 ? static_cast<double>(part) / whole : 0; }

/// What was measured, and whether it is enough.
struct Report {
  nlohmann::json json = {{"stays", nlohmann::json::object()}, {"goes", nlohmann::json::object()}};
  bool holds = true;
  bool print = true;  ///< a line for people, as soon as it is known

  void say(const std::string& line) const {
    if (!print) return;
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
  }
};

void print(const std::string& name, const PublishedPoses& poses, Report* report) {
  const double right = fraction(poses.published_right, poses.published);
  const double published = fraction(poses.published_right, poses.right);
  report->json["stays"][name] = {{"images", poses.images},
                                 {"right", poses.right},
                                 {"published", poses.published},
                                 {"published_right", poses.published_right}};
  char line[240];
  std::snprintf(line, sizeof line,
                ": %d images; %d poses published, %.2f %% of them right; %d right, %.2f %% of them "
                "published",
                poses.images, poses.published, 100 * right, poses.right, 100 * published);
  report->say(name + line);
}

void print(const std::string& name, const std::vector<Disappearance>& runs, int limit,
           Report* report) {
  int tracked = 0, soon = 0, last = 0, published = 0;
  for (const Disappearance& run : runs) {
    tracked += run.tracked;
    soon += run.tracked && run.lost_after > 0 && run.lost_after <= limit;
    last = std::max(last, run.lost_after);
    published += run.published;
  }
  const int count = static_cast<int>(runs.size());
  report->json["goes"][name] = {{"runs", count},
                                {"tracked", tracked},
                                {"lost_soon", soon},
                                {"images_until_lost", last},
                                {"published", published}};
  report->holds = report->holds && soon == count;
  char line[240];
  std::snprintf(line, sizeof line,
                ": tracked in %d of %d runs when the object went, lost soon enough in %d, after %d "
                "images at most; %d poses published of what was not there",
                tracked, count, soon, last, published);
  report->say(name + line);
}

/// Runs in which the object stays, and their report. @return the first recording.
Recording trackAll(const TrustOptions& options, TrustTrials* trials,
                   const CancellationToken& cancellation, Report* report) {
  ProgressLine line;
  Recording first;
  PublishedPoses all;
  for (const std::string& path : options.bags) {
    Recording recording = Recording::of(BagSequence(path, options.topics));
    PublishedPoses poses;
    for (int run = 0; run < options.runs; ++run) {
      cancellation.check();
      line.show(1.0 * run / options.runs, path);
      poses += trials->track(recording, run);
    }
    line.end();
    print(fileName(path), poses, report);
    all += poses;
    if (first.images.empty()) first = std::move(recording);
  }
  if (options.bags.size() > 1) print("all", all, report);
  report->holds = report->holds && all.published > 0 &&
                  fraction(all.published_right, all.published) >= options.published_right &&
                  fraction(all.published_right, all.right) >= options.right_published;
  return first;
}

void check(const TrustOptions& options, const CancellationToken& cancellation) {
  const auto field = std::make_shared<const Field>(loadField(options.model));
  PoseRefinerParameters node = options.node;
  node.tracker.initial.refiner = RefinerSettings::named(node.tracker.initial.preset);
  TrustTrials trials(options.backend.make(), field, node, options.trials);
  Report report;
  report.print = !options.json;
  const Recording first = trackAll(options, &trials, cancellation, &report);
  ProgressLine line;
  for (const std::string& path : options.gone) {
    const Recording gone = Recording::of(BagSequence(path, options.topics));
    std::vector<Disappearance> runs;
    for (int run = 0; run < options.runs; ++run) {
      cancellation.check();
      line.show(1.0 * run / options.runs, path);
      runs.push_back(trials.lose(first, gone, run));
    }
    line.end();
    print(fileName(path), runs, options.trials.limit, &report);
  }
  if (options.json) {
    report.json["holds"] = report.holds;
    printJson(report.json);
  }
  if (!report.holds) throw std::runtime_error("less than was asked for");
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::check);
}
