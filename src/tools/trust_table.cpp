// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trust_table.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "field/object_metadata.h"
#include "runtime/shared_backend.h"
#include "tools/tool.h"

// A model and views of its object to what is published in bad images.

namespace nerf_pose_refiner {
namespace {

struct TableOptions {
  std::string model, views;
  std::vector<std::string> photos, rows;
  int count = 10, width = 480;
  std::uint64_t seed = 1;
  bool json = false, samples = false;
  TrackerSettings tracker;
  BackendOptions backend;
};

void declare(CLI::App* app, TableOptions* options) {
  const std::string name = app->get_name();
  app->description(
      "Shows a tracker with the node's defaults what misleads it, and counts what it publishes.\n\n"
      "Views of the object are put before photos, and then covered, masked wrongly, turned grey,\n"
      "blurred and so on; in some images the object is not there. A table says for each condition\n"
      "how many poses were found, published, and published though wrong (more than 5 degrees or\n"
      "5 % of the diameter off). Rows that are tracked also say how often the object was tracked\n"
      "again at the end.");
  app->footer("Example:\n  " + name +
              " kiosk.safetensors photos/transforms_test.json --photos *.jpg\n\n"
              "Exit code: 0 no wrong pose was published, 1 some were or the run failed, 2 wrong "
              "usage.");
  app->add_option("model", options->model, "Model file")->required()->check(CLI::ExistingFile);
  app->add_option("views", options->views, "transforms.json of images with alpha or masks")
      ->required()
      ->check(CLI::ExistingPath);
  app->add_option("--photos", options->photos, "Put behind the object; default: clutter")
      ->check(CLI::ExistingFile);
  app->add_option("--row", options->rows, "Only conditions whose names hold this text");
  app->add_option("--count", options->count, "Views that are tried, evenly among all")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app->add_option("--width", options->width, "Larger images are reduced to it [px]")
      ->check(CLI::Range(64, 4096))
      ->capture_default_str();
  app->add_option("--trust-score", options->tracker.rules.trust_score,
                  "The node's ~tracker/trust_score")
      ->capture_default_str();
  app->add_option("--min-score", options->tracker.rules.min_score, "The node's ~tracker/min_score")
      ->capture_default_str();
  app->add_option("--seed", options->seed, "Same seed, same numbers")->capture_default_str();
  options->backend.addTo(app);
  app->add_flag("--json", options->json, "Print the results as JSON");
  app->add_flag("--samples", options->samples,
                "Print a line for each image: row, view, image, shown, right, published, score, "
                "probability's terms, errors");
}

bool isAsked(const TableOptions& options, const std::string& row) {
  const auto holds = [&row](const std::string& text) {
    return row.find(text) != std::string::npos;
  };
  return options.rows.empty() || std::any_of(options.rows.begin(), options.rows.end(), holds);
}

void printSample(const std::string& row, int view, const TrustSample& s) {
  const Refinement& found = s.outcome.refinement;
  const Hypothesis best = found.hypotheses.empty() ? Hypothesis() : found.hypotheses.front();
  std::printf("%s,%d,%d,%d,%d,%d,%.4f,%.4f,%.4f,%.4f,%.3f,%.4f,%.3f\n", row.c_str(), view, s.number,
              s.image.shows_object, s.right, s.outcome.trusted, s.outcome.score, best.score,
              best.visible_fraction, best.residual_variance, s.rotation_deg, s.offset,
              s.squared_error);
}

void printRow(const std::string& name, const TrustCounts& counts) {
  std::printf("%-46s %4d images, %4d right, %4d published, %3d wrong", name.c_str(), counts.images,
              counts.right, counts.published, counts.wrong);
  if (counts.runs > 0) std::printf("; back in %d of %d runs", counts.back, counts.runs);
  std::printf("\n");
  std::fflush(stdout);
}

void makeTable(const TableOptions& options, const CancellationToken& cancellation) {
  auto field = std::make_shared<Field>(loadField(options.model));
  // Poses are compared in model units: the scale does not matter.
  if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
  const Dataset dataset =
      loadDataset(options.views, options.backend.datasetOptions(), cancellation);
  const BackendOptions& b = options.backend;
  const auto backend = std::make_shared<SharedBackend>(
      makeBackend({b.backend, b.threads, b.instruction_set, b.device}));
  TrustTable table(backend, field, options.tracker);
  const int size = static_cast<int>(dataset.views.size());
  const int count = std::min(options.count, size);
  nlohmann::json json;
  int wrong = 0;
  for (const TrustRow& row : trustRows()) {
    if (!isAsked(options, row.name)) continue;
    TrustCounts counts;
    for (int i = 0; i < count; ++i) {
      cancellation.check();
      const TrustScene scene =
          TrustScene::of(dataset.views[i * size / count], options.width, options.photos,
                         {options.seed, static_cast<std::uint64_t>(i)});
      counts += table.show(row, scene, [&](const TrustSample& sample) {
        if (options.samples) printSample(row.name, i, sample);
      });
    }
    wrong += counts.wrong;
    json[row.name] = {{"images", counts.images},       {"right", counts.right},
                      {"published", counts.published}, {"wrong", counts.wrong},
                      {"runs", counts.runs},           {"back", counts.back}};
    if (!options.json) printRow(row.name, counts);
  }
  if (options.json) printJson(json);
  if (wrong > 0) throw std::runtime_error(std::to_string(wrong) + " wrong poses were published");
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::makeTable);
}
