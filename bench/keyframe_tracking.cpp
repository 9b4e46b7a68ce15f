// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Tracks an object through a recorded sequence by aligning keyframes, and measures how far off the
// start may be: accuracy, time and basin of alignment alone, without a tracker's recovery.

#include <time.h>
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>

#include <cmath>
#include <cstdio>
#include <exception>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "backend/keyframe_aligner.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_metadata.h"
#include "image/io.h"
#include "math/angle.h"
#include "recorded_sequence.h"
#include "refinement/keyframe_settings.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model, sequence;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  double renew_deg = 10, renew_distance = 0.1;  // of the distance
  double start_deg = 2, start_fraction = 0.02;
  int repeat = 1;
  bool predict = true, verbose = false;
  int basin_frames = 0;  // every so many-th; 0: the basin is not measured
  int starts = 0;        // that are aligned at once, at coarse levels; 0: that is not measured
  KeyframeSettings keyframe;
  KeyframeAlignmentSettings alignment;
};

double milliseconds(clockid_t clock) {
  timespec now;
  clock_gettime(clock, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

// Time by the wall's clock, and what this thread was given of it: other programs do not count.
class Stopwatch {
 public:
  double wall_ms() const { return milliseconds(CLOCK_MONOTONIC) - wall_; }
  double thread_ms() const { return milliseconds(CLOCK_THREAD_CPUTIME_ID) - thread_; }

 private:
  double wall_ = milliseconds(CLOCK_MONOTONIC);
  double thread_ = milliseconds(CLOCK_THREAD_CPUTIME_ID);
};

struct Measured {
  std::vector<double> deg, fraction, frame_ms, convert_ms, prepare_ms, align_ms, evaluations,
      render_ms, visible, score;
  int right = 0;  // within 2 degrees and 2 % of the diameter
};

// The camera turned about the object's centre and moved, by so much.
Pose perturbed(const Pose& T_O_C, const FieldMetadata& object, const Eigen::Vector3d& turn_rad,
               const Eigen::Vector3d& shift) {
  const Eigen::Matrix3d turn = expSO3(turn_rad);
  return {turn * T_O_C.R, object.centre + shift + turn * (T_O_C.t - object.centre)};
}

class Benchmark {
 public:
  explicit Benchmark(const Options& options)
      : options_(options),
        sequence_(readSequence(options.sequence)),
        backend_(makeBackend(options.backend)),
        field_(backend_->load(std::make_shared<const Field>(loadField(options.model)))),
        object_(field_->field().metadata),
        aligner_(backend_->makeKeyframeAligner()) {
    const double unit_m = object_.metres_per_unit > 0 ? object_.metres_per_unit : 1;
    for (const RecordedFrame& frame : sequence_.frames) {
      const Pose& T_C_O = frame.T_C_O;
      images_.push_back(readImage(frame.file));
      truth_.push_back(Pose(T_C_O.R, T_C_O.t / unit_m).inverse());
    }
  }

  void track() {
    const double rotation = options_.start_deg * kDegree / std::sqrt(3.0);
    const double shift = options_.start_fraction * object_.diameter / std::sqrt(3.0);
    Pose found = perturbed(truth_[0], object_, Eigen::Vector3d(rotation, -rotation, rotation),
                           Eigen::Vector3d(-shift, shift, shift));
    std::optional<Pose> before;
    renew(found);
    for (std::size_t i = 0; i < truth_.size(); ++i) {
      const bool moves = options_.predict && before;
      const Pose start = moves ? found * (before->inverse() * found) : found;
      if (isFar(start)) renew(start);
      const Hypothesis aligned = alignFrame(static_cast<int>(i), start);
      if (i > 0) before = found;
      found = aligned.T_O_C;
    }
  }

  // Shares of starts that come back, by how far off they were about and along each axis.
  void measureBasin() {
    std::mt19937_64 random(1);
    for (const double width : {2.0, 4.0, 6.0, 8.0, 10.0}) {
      int trials = 0, back = 0, half_back = 0;
      for (std::size_t i = 0; i < truth_.size(); i += options_.basin_frames) {
        renew(truth_[i]);
        for (int k = 0; k < 20; ++k, ++trials) {
          std::uniform_real_distribution<double> uniform(-1, 1);
          Eigen::Vector3d turn, shift;
          for (int a = 0; a < 3; ++a) turn[a] = width * kDegree * uniform(random);
          for (int a = 0; a < 3; ++a) shift[a] = 0.01 * width * object_.diameter * uniform(random);
          const Pose start = perturbed(truth_[i], object_, turn, shift);
          aligner_->observe(observe(images_[i], sequence_.camera),
                            frameWindowFor(*keyframe_, sequence_.camera, start));
          const Hypothesis aligned = align(start);
          const PoseError error =
              poseError(aligned.T_O_C, truth_[i], object_.centre, sequence_.camera);
          back += error.rotation_rad < 0.3 * kDegree;
          half_back += error.rotation_rad < 2 * kDegree;
        }
      }
      std::printf(
          "basin: up to %.0f deg and %.0f %% per axis: %.2f of %d back within 0.3 deg, "
          "%.2f within 2 deg\n",
          width, width, static_cast<double>(back) / trials, trials,
          static_cast<double>(half_back) / trials);
    }
  }

  // Poses all around the true ones, aligned together at the coarse levels.
  void alignManyStarts() {
    constexpr int kFinest = 2;
    constexpr double kTurn_deg = 8;
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(-kTurn_deg * kDegree, kTurn_deg * kDegree);
    KeyframeAlignmentSettings settings = options_.alignment;
    settings.finest_level = kFinest;
    std::vector<double> align_ms;
    for (std::size_t i = 0; i < truth_.size(); ++i) {
      if (i == 0 || isFar(truth_[i])) renew(truth_[i]);
      std::vector<KeyframeStart> starts;
      for (int k = 0; k < options_.starts; ++k) {
        const Eigen::Vector3d turn(uniform(random), uniform(random), uniform(random));
        starts.push_back({number_, perturbed(truth_[i], object_, turn, Eigen::Vector3d::Zero())});
      }
      aligner_->observe(observe(images_[i], sequence_.camera),
                        frameWindowFor(*keyframe_, sequence_.camera, truth_[i]));
      const Stopwatch watch;
      aligner_->align(starts, settings, {});
      align_ms.push_back(watch.wall_ms());
    }
    std::printf("%d starts at coarse levels, by the wall: median %.3f ms, p99 %.3f ms\n",
                options_.starts, percentile(align_ms, 0.5), percentile(align_ms, 0.99));
  }

  void print() const {
    const auto row = [](const char* name, const std::vector<double>& v) {
      std::printf("%-24s median %8.4f  p95 %8.4f  p99 %8.4f  max %8.4f\n", name, percentile(v, 0.5),
                  percentile(v, 0.95), percentile(v, 0.99), percentile(v, 1));
    };
    std::printf("%s; %d of %zu frames within 2 deg and 2 %%\n",
                backend_->info().description.c_str(), measured_.right, measured_.deg.size());
    row("rotation [deg]", measured_.deg);
    row("offset [% of diameter]", measured_.fraction);
    row("frame, by the wall [ms]", measured_.frame_ms);
    row("conversion, thread [ms]", measured_.convert_ms);
    row("preparation, thread [ms]", measured_.prepare_ms);
    row("alignment, thread [ms]", measured_.align_ms);
    row("evaluations", measured_.evaluations);
    row("visible", measured_.visible);
    row("score", measured_.score);
    row("keyframe [ms]", measured_.render_ms);
    std::printf("%zu keyframes of", measured_.render_ms.size());
    for (const KeyframeLevel& level : keyframe_->levels) {
      std::printf(" %dx%d (%d points, %d chosen)", level.width, level.height, level.shown.size(),
                  level.chosen.size());
    }
    std::printf("\n");
  }

 private:
  bool isFar(const Pose& T_O_C) const {
    KeyframeSearchSettings limits;
    limits.renew_rotation_deg = options_.renew_deg;
    limits.renew_distance = options_.renew_distance;
    return limits.wantsKeyframe(viewDistance(*keyframe_, T_O_C));
  }

  void renew(const Pose& T_O_C) {
    const Stopwatch watch;
    keyframe_ = std::make_shared<const KeyframePoints>(
        renderKeyframe(*field_, {sequence_.camera, T_O_C}, options_.keyframe));
    aligner_->remove(number_);
    number_ = aligner_->add(keyframe_);
    measured_.render_ms.push_back(watch.wall_ms());
  }

  Hypothesis align(const Pose& start) {
    return aligner_->align({{number_, start}}, options_.alignment, {}).front();
  }

  Hypothesis alignFrame(int i, const Pose& start) {
    const Stopwatch watch;
    const Observation observation = observe(images_[i], sequence_.camera);
    const double converted = watch.thread_ms();
    aligner_->observe(observation, frameWindowFor(*keyframe_, sequence_.camera, start));
    const double prepared = watch.thread_ms();
    const Hypothesis aligned = align(start);
    const double done = watch.thread_ms();
    const PoseError error = poseError(aligned.T_O_C, truth_[i], object_.centre, sequence_.camera);
    measured_.deg.push_back(error.rotation_rad / kDegree);
    measured_.fraction.push_back(100 * error.object_offset / object_.diameter);
    measured_.convert_ms.push_back(converted);
    measured_.prepare_ms.push_back(prepared - converted);
    measured_.align_ms.push_back(done - prepared);
    measured_.frame_ms.push_back(watch.wall_ms());
    measured_.evaluations.push_back(aligned.iterations);
    measured_.visible.push_back(aligned.visible_fraction);
    measured_.score.push_back(aligned.score);
    measured_.right += measured_.deg.back() < 2 && measured_.fraction.back() < 2;
    if (options_.verbose) {
      std::printf("%3d: %.3f deg %.3f %%, loss %.4f, visible %.3f, %d evaluations, %.2f ms\n", i,
                  measured_.deg.back(), measured_.fraction.back(), aligned.loss,
                  aligned.visible_fraction, aligned.iterations, done);
    }
    return aligned;
  }

  Options options_;
  RecordedSequence sequence_;
  std::vector<Image8> images_;
  std::shared_ptr<Backend> backend_;
  std::shared_ptr<const LoadedField> field_;
  const FieldMetadata& object_;
  std::vector<Pose> truth_;  // T_O_C [model units]
  std::unique_ptr<KeyframeAligner> aligner_;
  std::shared_ptr<const KeyframePoints> keyframe_;
  int number_ = -1;  // of the keyframe
  Measured measured_;
};

void addOptions(CLI::App* app, Options* options) {
  app->add_option("model", options->model, "the object's .safetensors")->required();
  app->add_option("sequence", options->sequence, "folder with sequence.json and frames/")
      ->required();
  app->add_option("--backend", options->backend.backend, "auto, cpu or cuda");
  app->add_option("--device", options->backend.device, "number of the GPU");
  app->add_option("--threads", options->backend.threads, "0: all cores");
  app->add_option("--instruction-set", options->backend.instruction_set, "auto, baseline or avx2");
  app->add_option("--renew-deg", options->renew_deg, "viewpoint's motion that renews a keyframe");
  app->add_option("--renew-distance", options->renew_distance, "the same of the distance, 0..1");
  app->add_option("--start-deg", options->start_deg, "error of the first pose");
  app->add_option("--start-fraction", options->start_fraction, "the same, of the diameter");
  app->add_option("--repeat", options->repeat, "times that the sequence is tracked");
  app->add_option("--points", options->keyframe.max_points, "chosen points of a level");
  app->add_option("--shown", options->keyframe.max_shown, "pixels that local colours are of");
  app->add_option("--levels", options->keyframe.levels, "of a keyframe");
  app->add_option("--max-side", options->keyframe.max_side_px, "of a keyframe [px]");
  app->add_option("--rays", options->keyframe.rays_per_side, "along a pixel of a keyframe");
  app->add_option("--finest-window", options->keyframe.finest_window_px, "half width [px]");
  app->add_option("--coarsest-window", options->keyframe.coarsest_window_px, "half width [px]");
  app->add_option("--depth-step", options->keyframe.max_depth_step, "of neighbours [px]");
  app->add_option("--evaluations", options->alignment.max_evaluations, "at most, a level");
  app->add_option("--robust-scale", options->alignment.robust_scale, "[local deviations]");
  app->add_option("--robust-growth", options->alignment.robust_growth, "a level");
  app->add_option("--observed", options->alignment.observed_fraction, "of gradients, finest level");
  app->add_option("--coarse-observed", options->alignment.coarse_observed_fraction, "of gradients");
  app->add_option("--convergence", options->alignment.convergence_px, "[px]");
  app->add_option("--coarse-convergence", options->alignment.coarse_convergence_px, "[px]");
  app->add_option("--look-around", options->alignment.look_around_px, "[px]");
  app->add_option("--relaxation", options->alignment.over_relaxation, "of steps");
  app->add_option("--basin", options->basin_frames,
                  "measures the basin in every so many-th frame, and nothing else");
  app->add_option("--starts", options->starts,
                  "aligns so many at once at coarse levels, and nothing else");
  app->add_flag("--predict,!--no-predict", options->predict, "constant velocity");
  app->add_flag("--verbose", options->verbose, "a line for each frame");
}

int run(int argc, char** argv) {
  CLI::App app("Tracks an object through a recorded sequence by keyframes alone.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark benchmark(options);
    if (options.basin_frames > 0) {
      benchmark.measureBasin();
      return 0;
    }
    if (options.starts > 0) {
      benchmark.alignManyStarts();
      return 0;
    }
    for (int i = 0; i < options.repeat; ++i) benchmark.track();
    benchmark.print();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "keyframe_tracking: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
