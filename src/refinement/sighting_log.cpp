// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/sighting_log.h"

#include <algorithm>

#include "field/object_frame.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

// Sightings that are nearer to each other share their errors.
constexpr double kApart = 0.1, kApart_rad = 6 * kDegree;  // [diameters]
constexpr double kSamePlace_m = 1e-4, kSamePlace_rad = 1e-4;
constexpr std::size_t kMax = 300;

bool areAlike(const Pose& a, const Pose& b, double position, double rotation_rad) {
  return (a.t - b.t).norm() < position && rotationDistance(a.R, b.R) < rotation_rad;
}

}  // namespace

RigSighting sightingOf(const Refinement& found, const FieldMetadata& object,
                       const std::vector<std::size_t>& numbers, std::size_t cameras) {
  constexpr double kMinScore = 0.5;  // of an image that shows the object well
  RigSighting seen(cameras);
  if (!found.own) return seen;
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  seen.at(0) =
      CameraSighting{frame.objectInCamera(found.own->T_O_C),
                     covarianceInCamera(found.own->covariance, found.own->T_O_C, object, frame)};
  for (std::size_t i = 0; i < std::min(numbers.size(), found.side_views.size()); ++i) {
    const SideViewReport& view = found.side_views[i];
    if (view.score < kMinScore) continue;
    seen.at(numbers[i]) = CameraSighting{view.T_V_O, view.covariance};
  }
  return seen;
}

void SightingLog::add(const RigSighting& sighting, const std::vector<Pose>& T_C_V,
                      double diameter_m) {
  const auto saw = std::count_if(sighting.begin(), sighting.end(),
                                 [](const auto& camera) { return camera.has_value(); });
  if (saw < 2 || sighting.size() != T_C_V.size()) return;
  const bool same_rig =
      T_C_V.size() == T_C_V_.size() &&
      std::equal(T_C_V.begin(), T_C_V.end(), T_C_V_.begin(), [](const Pose& a, const Pose& b) {
        return areAlike(a, b, kSamePlace_m, kSamePlace_rad);
      });
  if (!same_rig) {
    T_C_V_ = T_C_V;
    kept_.clear();
    poses_.clear();
  }
  std::size_t first = 0;
  while (!sighting[first]) ++first;
  const Pose T_C_O = T_C_V[first] * sighting[first]->T_V_O;
  const bool known = std::any_of(poses_.begin(), poses_.end(), [&](const Pose& other) {
    return areAlike(T_C_O, other, kApart * diameter_m, kApart_rad);
  });
  if (known || kept_.size() >= kMax) return;
  kept_.push_back(sighting);
  poses_.push_back(T_C_O);
}

}  // namespace nerf_pose_refiner
