// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/sighting.h"

#include <algorithm>
#include <cstddef>

namespace nerf_pose_refiner {
namespace {

struct Pair {
  double offset;  // of the two centres, as the camera sees them [model units]
  std::size_t instance, pose;
};

}  // namespace

std::vector<Sighting> sightingsOf(const std::vector<ShownInstance>& shown,
                                  const std::vector<Refinement>& found, const Camera& camera,
                                  const FieldMetadata& object) {
  std::vector<Sighting> sightings;
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const Eigen::Vector3d centre_C = shown[i].T_O_C.inverse() * object.centre;
    const double width = object.diameter * camera.fx / centre_C.norm() / camera.width;
    sightings.push_back({static_cast<int>(i), width, shown[i].visible, std::nullopt, 0});
    for (std::size_t k = 0; k < found.size(); ++k) {
      const double offset = (found[k].T_O_C.inverse() * object.centre - centre_C).norm();
      if (offset < object.diameter / 2) pairs.push_back({offset, i, k});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.offset < b.offset; });
  std::vector<char> is_taken(found.size(), 0);
  for (const Pair& pair : pairs) {
    Sighting& sighting = sightings[pair.instance];
    if (sighting.error || is_taken[pair.pose]) continue;
    const Refinement& pose = found[pair.pose];
    is_taken[pair.pose] = 1;
    sighting.error =
        poseError(pose.T_O_C, shown[pair.instance].T_O_C, object.centre, camera, object.symmetries);
    sighting.score = pose.score;
  }
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (!is_taken[k]) sightings.push_back({std::nullopt, 0, 0, std::nullopt, found[k].score});
  }
  return sightings;
}

}  // namespace nerf_pose_refiner
