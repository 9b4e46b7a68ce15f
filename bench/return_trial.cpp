// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "return_trial.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "evaluation/aimed_view.h"
#include "evaluation/disturbance.h"
#include "evaluation/placement.h"
#include "evaluation/trial_observation.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kSway_px = 6, kSwayRoll_rad = 2 * kDegree, kSwayPeriod_s = 4;

/// Draws one trial.
class Drawing {
 public:
  Drawing(const std::vector<PosedView>& views, const ReturnDraw& draw)
      : views_(views), draw_(draw), random_(draw.seed) {}

  ReturnTrial make() {
    ReturnTrial trial;
    trial.seed = draw_.seed;
    trial.gone_s = between(draw_.least_gone_s, draw_.most_gone_s);
    aim();
    trial.camera = camera_;
    trial.before = drawn(draw_.view);
    trial.after = draw_.is_near ? near(trial.before) : elsewhere(trial.before);
    return trial;
  }

 private:
  double between(double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random_);
  }

  /// So that the view that is seen before is as large as is drawn, and can be turned in the image.
  void aim() {
    constexpr double kMostOfHeight = 0.9, kLeastFocal = 0.6;  // [widths], as of a wide-angle lens
    const Placement placement;
    const PosedView& view = views_.at(draw_.view);
    const Eigen::Vector2d sizes = silhouetteBox(view).sizes();
    const double ratio = placement.most_width / placement.least_width;
    const double size_px = placement.width * placement.least_width * std::pow(ratio, between(0, 1));
    const double most = kMostOfHeight * (placement.height - 2 * kSway_px) / sizes.norm();
    const double scale = std::min(most, size_px / sizes.maxCoeff());
    const double focal = std::max(scale * view.camera.fx, kLeastFocal * placement.width);
    camera_ = {placement.width,
               placement.height,
               focal,
               focal,
               (placement.width - 1) / 2.0,
               (placement.height - 1) / 2.0};
  }

  Eigen::Vector2d sizesOf(std::size_t view) const {
    return camera_.fx / views_[view].camera.fx * silhouetteBox(views_[view]).sizes();
  }

  /// A place where the object is wholly in the image, if there is one: the one nearest to another.
  Eigen::Vector2d inside(std::size_t view, const Eigen::Vector2d& middle) const {
    const double radius = sizesOf(view).norm() / 2 + kSway_px;
    const auto along = [&](double value, int side) {
      const double margin = std::min(radius, (side - 1) / 2.0);
      return std::clamp(value, margin, side - 1 - margin);
    };
    return {along(middle.x(), camera_.width), along(middle.y(), camera_.height)};
  }

  ShownPlace drawn(std::size_t view) {
    constexpr double kMostRoll = 20 * kDegree;
    const double x = between(0, camera_.width), y = between(0, camera_.height);
    return {view, inside(view, {x, y}), between(-kMostRoll, kMostRoll)};
  }

  /// Two thirds as far as the default search reaches about each axis.
  ShownPlace near(const ShownPlace& before) {
    constexpr double kRoll = 10 * kDegree, kShift = 0.1;  // [diameters]
    const double shift = kShift * sizesOf(before.view).maxCoeff();
    const Eigen::Vector2d away(between(-shift, shift), between(-shift, shift));
    return {before.view, inside(before.view, before.middle + away),
            before.roll_rad + between(-kRoll, kRoll)};
  }

  /// Another view, far away in the image if the object leaves room for that.
  ShownPlace elsewhere(const ShownPlace& before) {
    constexpr int kTries = 10;
    const std::size_t others = views_.size() - 1;
    const std::size_t other =
        std::min<std::size_t>(others - 1, static_cast<std::size_t>(between(0, others)));
    const std::size_t view = (before.view + 1 + other) % views_.size();
    ShownPlace farthest = drawn(view);
    for (int i = 1; i < kTries; ++i) {
      const ShownPlace place = drawn(view);
      const auto distance = [&](const ShownPlace& one) {
        return (one.middle - before.middle).norm();
      };
      if (distance(place) > distance(farthest)) farthest = place;
    }
    return farthest;
  }

  const std::vector<PosedView>& views_;
  const ReturnDraw& draw_;
  std::mt19937_64 random_;
  Camera camera_;
};

}  // namespace

ReturnTrial drawReturn(const std::vector<PosedView>& views, const ReturnDraw& draw) {
  return Drawing(views, draw).make();
}

ReturnImage imageAt(const ReturnTrial& trial, double time_s, const std::vector<PosedView>& views,
                    const std::vector<std::string>& photos) {
  TrialObservation how = TrialObservation::named("photo", "alpha");
  how.photos = photos;
  PosedView seen;
  seen.camera = seen.photo_camera = trial.camera;
  const bool is_back = time_s >= trial.seen_s + trial.gone_s;
  if (time_s < trial.seen_s || is_back) {
    const ShownPlace& place = is_back ? trial.after : trial.before;
    const double phase = 2 * kPi * time_s / kSwayPeriod_s;
    const Eigen::Vector2d sway(std::cos(phase), std::sin(phase));
    const PosedView& view = views.at(place.view);
    const Eigen::Matrix3d R = rotationToPlace(view, trial.camera, place.middle + kSway_px * sway,
                                              place.roll_rad + kSwayRoll_rad * std::sin(phase));
    const AimedView aimed = aimedView(view, R, trial.camera);
    seen.T_O_C = aimed.T_O_C;
    seen.rgba = std::make_shared<const Image8>(straightBytes(aimed.object));
  } else {
    seen.rgba = std::make_shared<const Image8>(trial.camera.width, trial.camera.height, 4);
  }
  ReturnImage image = {how.of(seen, trial.seed), seen.T_O_C};
  // As of a sensor: no two images are the same, so that each is looked at anew.
  constexpr double kNoise = 0.004;
  const auto number = static_cast<std::uint64_t>(std::llround(1e3 * time_s));
  addGaussianNoise(kNoise, {trial.seed, number}, &image.observation.image);
  return image;
}

}  // namespace nerf_pose_refiner
