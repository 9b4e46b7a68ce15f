// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/keyframe_scores.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "backend/keyframe_aligner.h"
#include "image/filter.h"
#include "math/random.h"
#include "refinement/covariance.h"
#include "refinement/look_alike_poses.h"
#include "trust/clutter_blocks.h"
#include "trust/other_light.h"
#include "trust/shown_sides.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kScoreSeed = 5;
enum ScoreStream : std::uint64_t { kScoreNoise, kScoreTurn, kScoreShift };

constexpr int kViews = 8, kSide_px = 128;
constexpr PoseBounds kRight = {0.087, 0.05};
constexpr double kNear_rad = 0.03, kNearOffset = 0.02;     // of starts
constexpr double kBeside_rad = 0.7, kBesideOffset = 0.15;  // of starts of wrong poses
constexpr int kWrongStarts = 4;

using Change = std::function<void(const Image& alpha, std::uint64_t index, Image* image)>;

void addNoise(float deviation, std::uint64_t index, Image* image) {
  const float half_width = std::sqrt(3.0f) * deviation;  // of uniform noise
  for (std::size_t i = 0; i < image->values.size(); ++i) {
    const float drawn = 2 * randomUniform(kScoreSeed + index, kScoreNoise, i) - 1;
    image->values[i] = std::clamp(image->values[i] + half_width * drawn, 0.0f, 1.0f);
  }
}

void coverLeftHalf(const Image&, std::uint64_t, Image* image) {
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width / 2; ++x) std::fill_n(image->pixel(x, y), 3, 0.1f);
  }
}

void coverUpperHalf(const Image&, std::uint64_t index, Image* image) {
  const Camera size = {image->width, image->height, 1, 1, 0, 0};
  const Image before = clutterBlocks(size, 100 + index);
  std::copy_n(before.values.begin(), before.values.size() / 2, image->values.begin());
}

void defocus(const Image&, std::uint64_t index, Image* image) {
  Image scratch;
  blur(gaussianKernel(1.5), image, &scratch);
  addNoise(0.02f, index, image);
}

/// Something plain in the object's place.
void replace(const Image& alpha, std::uint64_t index, Image* image) {
  for (std::size_t i = 0; i < alpha.pixels(); ++i) {
    if (alpha.values[i] > 0.5f) std::fill_n(image->values.begin() + 3 * i, 3, 0.1f);
  }
  addNoise(0.02f, index, image);
}

Image imageOf(const ShownSide& side, std::uint64_t index, const Change& change) {
  Image image = beforeClutter(side, index);
  change(side.alpha, index, &image);
  return image;
}

std::pair<double, double> meanAndDeviation(const std::vector<double>& scores) {
  double sum = 0, squares = 0;
  for (const double score : scores) {
    sum += score;
    squares += score * score;
  }
  const double count = std::max<double>(1, static_cast<double>(scores.size()));
  const double mean = sum / count;
  return {mean, std::sqrt(std::max(0.0, squares / count - mean * mean))};
}

class ScoreTrials {
 public:
  ScoreTrials(Backend* backend, const LoadedField& field, const CancellationToken& cancellation)
      : object_(field.field().metadata),
        cancellation_(cancellation),
        aligner_(backend->makeKeyframeAligner()) {
    ViewBankSettings settings;
    settings.views = kViews;
    settings.object_px = kSide_px;
    settings.keyframe = KeyframeSettings();
    sides_ = renderSides(field, settings, cancellation);
    for (const ShownSide& side : sides_) keyframes_.push_back(aligner_->add(side.points));
  }

  KeyframeScores measure() {
    const Change as_it_is = [](const Image&, std::uint64_t, Image*) {};
    const Change dimmed = [](const Image&, std::uint64_t, Image* image) { dim(image); };
    const Change noisy = [](const Image&, std::uint64_t i, Image* image) {
      addNoise(0.05f, i, image);
    };
    const Change behind = [this](const Image&, std::uint64_t i, Image* image) {
      *image = clutterBlocks(sides_.front().points->camera, 200 + i);
    };
    for (int i = 0; i < kViews; ++i) {
      for (const Change& change :
           {dimmed, Change(coverLeftHalf), Change(coverUpperHalf), Change(defocus), noisy}) {
        tryRight(i, imageOf(sides_[i], i, change));
      }
      tryWrong(i, imageOf(sides_[i], i, as_it_is), true);
      tryWrong(i, imageOf(sides_[i], i, replace), false);
      tryWrong(i, imageOf(sides_[i], i, behind), false);
    }
    return summary();
  }

 private:
  Eigen::Vector3d drawn(ScoreStream stream) {
    Eigen::Vector3d v;
    for (int a = 0; a < 3; ++a) v[a] = 2.0 * randomUniform(kScoreSeed, stream, draws_++) - 1;
    return v;
  }

  Pose besideOf(const Pose& T_O_C, double turn_rad, double offset) {
    const Eigen::Matrix3d R = expSO3(Eigen::Vector3d(turn_rad * drawn(kScoreTurn)));
    const Eigen::Vector3d shift = offset * object_.diameter * drawn(kScoreShift);
    return {nearestRotation(R * T_O_C.R), object_.centre + shift + R * (T_O_C.t - object_.centre)};
  }

  bool isRight(const Pose& T_O_C, const Pose& truth) const {
    return mayBeTakenFor(T_O_C, truth, object_, LookAlikes(), kRight);
  }

  /// Right, or a pose that the object may be taken for: which of these it is in is asked on its
  /// own.
  bool isRightOrAlike(const Pose& T_O_C, const Pose& truth) const {
    return mayBeTakenFor(T_O_C, truth, object_, object_.look_alikes, kRight);
  }

  std::vector<Hypothesis> align(const ShownSide& side, const Image& image,
                                const std::vector<KeyframeStart>& starts) {
    Observation observation;
    observation.image = image;
    observation.camera = side.points->camera;
    aligner_->observe(observation,
                      frameWindowFor(*side.points, observation.camera, side.points->T_O_C, 1));
    return aligner_->align(starts, {}, cancellation_);
  }

  void tryRight(int number, const Image& image) {
    const ShownSide& side = sides_[number];
    const Pose& truth = side.points->T_O_C;
    const Hypothesis found =
        align(side, image, {{keyframes_[number], besideOf(truth, kNear_rad, kNearOffset)}}).front();
    if (found.state != HypothesisState::kLive) return;
    if (isRight(found.T_O_C, truth)) right_.push_back(found.score);
  }

  /// The best wrong pose, from beside the right one and from other sides.
  void tryWrong(int number, const Image& image, bool shows_object) {
    const ShownSide& side = sides_[number];
    std::vector<KeyframeStart> starts;
    for (int k = 0; k < kWrongStarts; ++k) {
      starts.push_back(
          {keyframes_[number], besideOf(side.points->T_O_C, kBeside_rad, kBesideOffset)});
      const int other = (number + 1 + k) % kViews;
      starts.push_back({keyframes_[other], sides_[other].points->T_O_C});
    }
    double best = 0;
    for (const Hypothesis& found : align(side, image, starts)) {
      const Pose& truth = side.points->T_O_C;
      const bool is_wrong = !shows_object || !isRightOrAlike(found.T_O_C, truth);
      if (found.state == HypothesisState::kLive && is_wrong) best = std::max(best, found.score);
    }
    wrong_.push_back(best);
  }

  KeyframeScores summary() {
    KeyframeScores scores;
    scores.poses = static_cast<int>(wrong_.size());
    std::tie(scores.wrong_mean, scores.wrong_deviation) = meanAndDeviation(wrong_);
    std::tie(scores.right_mean, scores.right_deviation) = meanAndDeviation(right_);
    return scores;
  }

  const FieldMetadata& object_;
  const CancellationToken& cancellation_;
  std::unique_ptr<KeyframeAligner> aligner_;
  std::vector<ShownSide> sides_;
  std::vector<int> keyframes_;  // of the sides, in the aligner
  std::vector<double> right_, wrong_;
  std::uint64_t draws_ = 0;
};

}  // namespace

KeyframeScores measureKeyframeScores(Backend* backend, const LoadedField& field,
                                     const CancellationToken& cancellation) {
  return ScoreTrials(backend, field, cancellation).measure();
}

KeyframeScores keyframeScoresOf(Backend* backend, const LoadedField& field,
                                const CancellationToken& cancellation) {
  const KeyframeScores& scores = field.field().metadata.pose.keyframes;
  return scores.poses > 0 ? scores : measureKeyframeScores(backend, field, cancellation);
}

}  // namespace nerf_pose_refiner
