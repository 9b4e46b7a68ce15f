// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "support/dual.h"

namespace nerf_pose_refiner {

/// Volume rendering along a ray whose samples stay where they are: compositing and the pull of a
/// loss (Lin et al., eq. 2 and 3) in double precision, as plain as can be.

/// An interval of a ray, sampled at distance `t` from the ray's origin.
struct FrozenSample {
  double t;
  double length;
};

/// What is at a sample, with derivatives by its position.
struct OccupiedVolume {
  Dual density;  ///< [1 / unit of length]
  Dual rgb[3];
};

/// A colour on the ray, or derivatives of a loss by it.
struct RayColour {
  Eigen::Vector3d rgb = Eigen::Vector3d::Zero();  ///< premultiplied
  double alpha = 0;
};

struct FrozenGradient {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< [1 / unit of length]
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< [1 / rad]
};

inline RayColour composite(const std::vector<FrozenSample>& samples,
                           const std::vector<OccupiedVolume>& occupied_volume) {
  RayColour sum;
  double transmittance = 1;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double opacity = 1 - std::exp(-occupied_volume[i].density.value * samples[i].length);
    for (int c = 0; c < 3; ++c)
      sum.rgb[c] += transmittance * opacity * occupied_volume[i].rgb[c].value;
    sum.alpha += transmittance * opacity;
    transmittance *= 1 - opacity;
  }
  return sum;
}

/// @param gradient derivatives of the loss by the ray's colour.
/// @param direction_gradient adds the term of the viewing direction to the torque.
inline FrozenGradient gradientOf(const Eigen::Vector3d& direction,
                                 const std::vector<FrozenSample>& samples,
                                 const std::vector<OccupiedVolume>& occupied_volume,
                                 const RayColour& gradient, bool direction_gradient) {
  std::vector<double> transmittance = {1};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double passed = std::exp(-occupied_volume[i].density.value * samples[i].length);
    transmittance.push_back(transmittance.back() * passed);
  }
  FrozenGradient sum;
  double behind = 0;  // what the samples behind this one add to the loss, to first order
  for (int i = static_cast<int>(samples.size()) - 1; i >= 0; --i) {
    const double weight = transmittance[i] - transmittance[i + 1];
    double worth = gradient.alpha;
    for (int c = 0; c < 3; ++c) worth += gradient.rgb[c] * occupied_volume[i].rgb[c].value;
    const double by_density = samples[i].length * (transmittance[i + 1] * worth - behind);
    behind += weight * worth;

    Eigen::Matrix<double, 6, 1> d = by_density * occupied_volume[i].density.d;
    for (int c = 0; c < 3; ++c) d += weight * gradient.rgb[c] * occupied_volume[i].rgb[c].d;
    const Eigen::Vector3d by_position = d.head<3>();
    sum.force += by_position;
    sum.torque += samples[i].t * direction.cross(by_position);
    if (direction_gradient) sum.torque += d.tail<3>();
  }
  return sum;
}

}  // namespace nerf_pose_refiner
