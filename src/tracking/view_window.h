// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>

#include "nerf_pose_refiner/observation.h"
#include "refinement/field_refiner.h"
#include "tracking/settings.h"

namespace nerf_pose_refiner {

/// One moving camera as several: past images of an object that stands still, spread over the
/// directions that it was seen from, beside the present one. Not thread-safe.
///
///     window.addTo(stamp_ns, &observation);
///     const Refinement found = refiner.follow({observation, stamp_ns}, prior);
///     window.learn(observation, stamp_ns, object, found);
///
/// Once some present images in a row contradict the past ones together, the object was moved: these
/// are dropped.
class ViewWindow {
 public:
  void configure(const ViewWindowSettings& settings);

  /// Gives an observation whose camera's place is known (Observation::T_W_C) the past images that
  /// show the object from elsewhere.
  void addTo(std::int64_t stamp_ns, Observation* observation);

  /// Keeps the observation's own image if it shows the object from a new side.
  /// @param observation as addTo left it. @param found a pose that is trusted.
  void learn(const Observation& observation, std::int64_t stamp_ns, const FieldMetadata& object,
             const Refinement& found);

  void clear();

  int size() const { return static_cast<int>(views_.size()); }

 private:
  struct View {
    std::shared_ptr<const Observation> observation;
    std::int64_t stamp_ns;
    Pose T_W_V;                               // [m]
    double position_dev_m, rotation_dev_rad;  // of T_W_V
  };

  void noteMotion(std::int64_t stamp_ns, const Pose& T_W_C);
  double angleBetween(const Pose& T_W_A, const Pose& T_W_B) const;
  void keep(const Observation& observation, std::int64_t stamp_ns);

  ViewWindowSettings settings_;
  std::deque<View> views_;                   // oldest first
  std::optional<Eigen::Vector3d> centre_W_;  // of the object, as it was found last [m]
  std::optional<Pose> last_T_W_C_;
  std::int64_t last_ns_ = 0;
  int contradictions_ = 0;                    // in a row
  double speed_m_s_ = 0, turning_rad_s_ = 0;  // of the camera
};

}  // namespace nerf_pose_refiner
