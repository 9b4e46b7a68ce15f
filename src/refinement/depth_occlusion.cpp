// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_occlusion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "nerf_pose_refiner/depth.h"

namespace nerf_pose_refiner {
namespace {

constexpr float kNothing = std::numeric_limits<float>::max();

/// The nearest that the object comes to a depth camera, in cells of its image.
class NearestDepth {
 public:
  NearestDepth(const KeyframePoints& keyframe, const Pose& T_D_O_m, const DepthImage& depth)
      : size_px_(cellSize(keyframe, T_D_O_m, depth.camera)),
        columns_(depth.camera.width / size_px_ + 1),
        rows_(depth.camera.height / size_px_ + 1),
        nearest_(static_cast<std::size_t>(columns_) * rows_, kNothing) {
    if (keyframe.levels.empty()) return;
    const PointColumns& shown = keyframe.levels.front().shown;
    for (int i = 0; i < shown.size(); ++i) {
      const Eigen::Vector3d p_D = T_D_O_m * Eigen::Vector3d(shown.x[i], shown.y[i], shown.z[i]);
      if (!(p_D.z() > 0)) continue;
      const Eigen::Vector2d at = depth.camera.project(p_D);
      const int x = static_cast<int>(std::floor((at.x() + 0.5) / size_px_));
      const int y = static_cast<int>(std::floor((at.y() + 0.5) / size_px_));
      add(x, y, static_cast<float>(p_D.z()));
    }
  }

  int size_px() const { return size_px_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  float at(int x, int y) const { return nearest_[static_cast<std::size_t>(y) * columns_ + x]; }

 private:
  /// So wide that the surface leaves no cell out.
  static int cellSize(const KeyframePoints& keyframe, const Pose& T_D_O_m, const Camera& camera) {
    if (keyframe.levels.empty()) return 1;
    const double now = camera.fx / std::max(1e-6, T_D_O_m.t.norm());
    const double then = keyframe.camera.fx / keyframe.reduction;
    const double distance = (keyframe.T_O_C.t - keyframe.centre).norm() * T_D_O_m.R.col(0).norm();
    const double per_px = now * distance / then;
    return std::max(2, static_cast<int>(std::ceil(2 * keyframe.levels.front().spacing * per_px)));
  }

  // The object may be a cell beside.
  void add(int x, int y, float depth_m) {
    for (int v = std::max(0, y - 1); v <= std::min(rows_ - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(columns_ - 1, x + 1); ++u) {
        float& nearest = nearest_[static_cast<std::size_t>(v) * columns_ + u];
        nearest = std::min(nearest, depth_m);
      }
    }
  }

  int size_px_, columns_, rows_;
  std::vector<float> nearest_;
};

/// Takes the weight of the colour pixels that show what a depth pixel does.
void cover(const DepthImage& depth, const Camera& camera, const Eigen::Vector3d& p_D,
           Image* weight) {
  const Eigen::Vector3d p_C = depth.T_C_D * p_D;
  if (!(p_C.z() > 0)) return;
  const Eigen::Vector2d at = camera.project(p_C);
  const double half = 0.5 * camera.fx / p_C.z() * p_D.z() / depth.camera.fx + 1;
  const auto clamped = [](double value, int size) {
    return static_cast<int>(std::clamp(std::lround(value), 0L, static_cast<long>(size)));
  };
  const int right = clamped(at.x() + half + 1, camera.width);
  const int bottom = clamped(at.y() + half + 1, camera.height);
  for (int y = clamped(at.y() - half, camera.height); y < bottom; ++y) {
    for (int x = clamped(at.x() - half, camera.width); x < right; ++x) weight->at(x, y, 0) = 0;
  }
}

Image weightOf(const Observation& observation) {
  if (!observation.weight.empty()) return observation.weight;
  return Image(observation.camera.width, observation.camera.height, 1, 1.0f);
}

/// The depth pixels of the object's place that show something before it.
class Occluders {
 public:
  Occluders(const NearestDepth& nearest, const DepthImage& depth, double slack_m)
      : nearest_(nearest), depth_(depth), slack_m_(slack_m) {
    for (int row = 0; row < nearest.rows(); ++row) {
      for (int column = 0; column < nearest.columns(); ++column) addCell(column, row);
    }
  }

  const std::vector<Eigen::Vector3d>& points_D() const { return points_D_; }
  /// Of the pixels that have a depth.
  double fraction() const {
    return measured_ > 0 ? static_cast<double>(points_D_.size()) / measured_ : 0;
  }

 private:
  void addCell(int column, int row) {
    constexpr double kDeviations = 4;
    const float object_m = nearest_.at(column, row);
    if (object_m == kNothing) return;
    const double limit_m = object_m - slack_m_ - kDeviations * depth_.noise.deviation_m(object_m);
    const int size = nearest_.size_px();
    const int right = std::min((column + 1) * size, depth_.camera.width);
    const int bottom = std::min((row + 1) * size, depth_.camera.height);
    for (int y = row * size; y < bottom; ++y) {
      for (int x = column * size; x < right; ++x) {
        const double measured_m = depth_.at(x, y);
        if (!(measured_m > 0)) continue;
        ++measured_;
        if (measured_m < limit_m) points_D_.push_back(measured_m * depth_.camera.direction(x, y));
      }
    }
  }

  const NearestDepth& nearest_;
  const DepthImage& depth_;
  double slack_m_;
  std::vector<Eigen::Vector3d> points_D_;
  int measured_ = 0;
};

}  // namespace

std::optional<Image> weightWithoutOccluders(const Observation& observation,
                                            const KeyframePoints& keyframe, const Pose& T_O_C,
                                            const OcclusionSlack& slack) {
  constexpr double kMax = 0.7;  // if more is hidden, depth may be wrong: colours must tell
  const DepthImage& depth = *observation.depth;
  const Pose T_C_O = T_O_C.inverse(), T_D_C = depth.T_C_D.inverse();
  // Of points relative to the object's centre, in model units: its rotation has their scale.
  const Pose T_D_O_m = {slack.metres_per_unit * T_D_C.R * T_C_O.R,
                        T_D_C * (slack.metres_per_unit * (T_C_O * keyframe.centre))};
  const NearestDepth nearest(keyframe, T_D_O_m, depth);
  const Occluders occluders(nearest, depth, slack.slack_m);
  if (occluders.points_D().empty() || occluders.fraction() > kMax) return std::nullopt;
  Image weight = weightOf(observation);
  for (const Eigen::Vector3d& p_D : occluders.points_D()) {
    cover(depth, observation.camera, p_D, &weight);
  }
  return weight;
}

}  // namespace nerf_pose_refiner
