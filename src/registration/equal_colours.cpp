// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/equal_colours.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "concurrency/seconds_since.h"
#include "math/random.h"
#include "registration/photo_gains.h"
#include "registration/trainer_setup.h"
#include "registration/training_run.h"

namespace nerf_pose_refiner {
namespace {

// Photos of different exposure are compared with a model that knows no directions: with them it
// could show each photo in its own colours. kGainSpread is above what such models of photos of one
// exposure give; rounds end when what is left is small.
// A share of the registration's samples and time, for each comparison.
constexpr double kExposureTime = 1.0 / 16;
constexpr double kMattSamples = 1 << 21;  // at least, where that is no more than a rough training
constexpr double kMaxMattSamples = 1 << 24;  // more show exposures no better
constexpr double kMinMattSamples = 1e6;      // models of fewer samples say nothing of photos
constexpr double kMattSteps = 512;   // at least: more of them, with fewer samples, learn faster ..
constexpr double kMattBatch = 4096;  // .. than samples of this number
constexpr double kGainSpread = 0.04, kGainSettled = 0.01;
constexpr int kGainRounds = 3;

// What a model with directions does not foretell of photos that it has not seen.
constexpr double kLeftOut = 0.2;                      // of the photos
constexpr std::uint64_t kLeaveOut = 0x6c65667465ull;  // stream of random numbers
// Measured: 0.4 to 0.65 of the spread for a shiny object, 1 to 1.3 for exposures.
constexpr double kUnforeseen = 0.8;

/// Compares views with models of them that are learned in a short time.
class ExposureComparison {
 public:
  /// All that it is given outlives it.
  ExposureComparison(Backend* backend, const Dataset& dataset, const RegistrationOptions& settings,
                     const std::function<void(const RegistrationProgress&)>& progress,
                     const CancellationToken& cancellation)
      : backend_(backend),
        dataset_(dataset),
        rough_(settings),
        progress_(progress),
        cancellation_(cancellation) {
    const double all = static_cast<double>(settings.steps) * settings.samples_per_step;
    const double samples = std::min(
        kMaxMattSamples, std::clamp(kMattSamples, all * kExposureTime, all / kRoughFraction));
    rough_.samples_per_step = static_cast<int>(
        std::min<double>(settings.samples_per_step, std::max(kMattBatch, samples / kMattSteps)));
    rough_.steps = std::max(1, static_cast<int>(samples / rough_.samples_per_step));
    rough_.max_seconds = settings.max_seconds * kExposureTime;
    rough_.target_psnr_db = 0;
    least_ = static_cast<int>(kMinMattSamples / rough_.samples_per_step);
    if (isPossible()) {
      hull_ = hullOf(dataset, settings, settings.refine_poses ? kSlackAfter : 0, cancellation);
    }
  }

  bool isPossible() const { return rough_.steps > least_; }

  /// Gains against a model that knows no directions; none if the time was too short for one.
  std::vector<PhotoGain> gains(const std::vector<PosedView>& views) {
    return gains(views, views, {dataset_.has_alpha, true});
  }

  /// Whether the gains are those of exposures: large, and not those of a shiny object. Nothing, if
  /// that cannot be told: of few photos, or in a short time.
  std::optional<bool> areOfExposures(const std::vector<PhotoGain>& gains_of_all) {
    if (gains_of_all.empty()) return std::nullopt;
    if (gainSpread(gains_of_all) < kGainSpread) return false;
    const std::vector<PosedView>& views = dataset_.views;
    std::vector<PosedView> seen;
    std::vector<std::size_t> left_out;
    for (std::size_t i = 0; i < views.size(); ++i) {
      // At random: exposures may repeat after so many photos.
      if (randomUniform(rough_.seed, kLeaveOut, i) < kLeftOut) {
        left_out.push_back(i);
      } else {
        seen.push_back(views[i]);
      }
    }
    if (left_out.empty()) return std::nullopt;
    const std::vector<PhotoGain> found = gains(seen, views, {dataset_.has_alpha});
    if (found.empty()) return std::nullopt;
    std::vector<PhotoGain> unforeseen, expected;
    for (const std::size_t i : left_out) {
      unforeseen.push_back(found[i]);
      expected.push_back(gains_of_all[i]);
    }
    return gainSpread(unforeseen) > kUnforeseen * gainSpread(expected);
  }

 private:
  std::vector<PhotoGain> gains(const std::vector<PosedView>& learned,
                               const std::vector<PosedView>& compared, const TrainerKind& kind) {
    const auto trainer = trainerOf(backend_, learned, kind, rough_, hull_);
    const SplitViews views = {learned, {}};
    TrainingRun run(backend_, trainer.get(), rough_, views, progress_);
    run.run("rough training", cancellation_);
    if (trainer->stepsDone() <= least_) return {};
    run.report("exposure");
    const auto model = std::make_shared<Field>(trainer->finish(cancellation_));
    if (!(model->metadata.diameter > 0)) return {};  // nothing is opaque yet
    return photoGains(*backend_->load(model), compared, rough_.threads, cancellation_);
  }

  Backend* backend_;
  const Dataset& dataset_;
  RegistrationOptions rough_;
  const std::function<void(const RegistrationProgress&)>& progress_;
  const CancellationToken& cancellation_;
  int least_ = 0;  ///< steps
  Hull hull_;
};

}  // namespace

EqualColours withEqualColours(Backend* backend, const Dataset& dataset,
                              const RegistrationOptions& settings,
                              const std::function<void(const RegistrationProgress&)>& progress,
                              const CancellationToken& cancellation) {
  const auto start = std::chrono::steady_clock::now();
  EqualColours equal;
  equal.dataset = dataset;
  if (settings.keep_colours) return equal;
  ExposureComparison comparison(backend, dataset, settings, progress, cancellation);
  if (!comparison.isPossible()) return equal;
  std::vector<PhotoGain> gains = comparison.gains(dataset.views);
  const std::optional<bool> differ = comparison.areOfExposures(gains);
  if (differ) equal.spread = 0;
  std::vector<PhotoGain> total(dataset.views.size());
  for (int round = 1; differ == true; ++round) {
    for (std::size_t i = 0; i < total.size(); ++i) total[i] = combined(total[i], gains[i]);
    equal.spread = gainSpread(total);
    equal.dataset.views = withGains(dataset.views, total, settings.threads);
    if (round == kGainRounds) break;
    gains = comparison.gains(equal.dataset.views);
    if (gains.empty() || gainSpread(gains) < kGainSettled) break;
  }
  equal.seconds = secondsSince(start);
  return equal;
}

}  // namespace nerf_pose_refiner
