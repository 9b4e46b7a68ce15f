// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/adam.h"

namespace nerf_pose_refiner {

/// The planar example of Lin et al., Fig. 2: why rotation and translation are updated apart.
///
/// A pose of the plane is the 3 x 3 matrix [R t; 0 1]. Gradient descent with momentum minimises the
/// mean squared error between the elements of the current and the target matrix. In SO(2) x T(2)
/// the momentum of the translation keeps its direction. In SE(2) an update is multiplied from the
/// right, T exp(xi), and the momentum, a vector of se(2), turns with the pose.

/// A pose in the plane, the angle standing for its rotation.
struct PlanarPose {
  double x = 0;
  double y = 0;
  double angle = 0;  ///< [rad]
};

/// A vector of t(2) and so(2), or of se(2): (v, w).
struct PlanarVector {
  double x = 0;
  double y = 0;
  double angle = 0;
};

/// Mean squared error between the nine elements of two poses' matrices.
inline double planarError(const PlanarPose& pose, const PlanarPose& target) {
  const double x = pose.x - target.x;
  const double y = pose.y - target.y;
  return (4 - 4 * std::cos(pose.angle - target.angle) + x * x + y * y) / 9;
}

/// Gradient of planarError by (x, y, angle).
inline PlanarVector planarGradient(const PlanarPose& pose, const PlanarPose& target) {
  return {2 * (pose.x - target.x) / 9, 2 * (pose.y - target.y) / 9,
          4 * std::sin(pose.angle - target.angle) / 9};
}

/// The vector turned by `angle`: from the frame of the pose to the plane's, by the pose's angle.
inline PlanarVector turned(const PlanarVector& v, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {c * v.x - s * v.y, s * v.x + c * v.y, v.angle};
}

/// SO(2) x T(2): adds the vector.
struct SeparateUpdate {
  static PlanarVector gradient(const PlanarPose& pose, const PlanarPose& target) {
    return planarGradient(pose, target);
  }
  static PlanarPose apply(const PlanarPose& pose, const PlanarVector& v) {
    return {pose.x + v.x, pose.y + v.y, pose.angle + v.angle};
  }
};

/// SE(2): T exp(xi), the gradient taken in the same coordinates, those of the pose's own frame.
struct CoupledUpdate {
  static PlanarVector gradient(const PlanarPose& pose, const PlanarPose& target) {
    return turned(planarGradient(pose, target), -pose.angle);
  }
  static PlanarPose apply(const PlanarPose& pose, const PlanarVector& xi) {
    const double w = xi.angle;
    // V of exp(xi) = [Exp(w) V v; 0 1]: its diagonal sin(w)/w and its off-diagonal (1 - cos(w))/w.
    const double half_sine = std::sin(w / 2);
    const double a = w != 0 ? std::sin(w) / w : 1;
    const double b = w != 0 ? 2 * half_sine * half_sine / w : 0;
    const PlanarVector v = turned({a * xi.x - b * xi.y, b * xi.x + a * xi.y, w}, pose.angle);
    return {pose.x + v.x, pose.y + v.y, pose.angle + v.angle};
  }
};

/// Heavy-ball momentum (Polyak 1964): m <- beta m + g, step -rate m.
struct PlanarHeavyBall {
  double rate = 0.1;
  double beta = 0.9;
  PlanarVector momentum;

  PlanarVector step(const PlanarVector& g) {
    momentum = {beta * momentum.x + g.x, beta * momentum.y + g.y, beta * momentum.angle + g.angle};
    return {-rate * momentum.x, -rate * momentum.y, -rate * momentum.angle};
  }
};

/// Adam, element by element.
struct PlanarAdam {
  double rate = 0.05;
  AdamConstants<double> constants;
  Vec3<AdamMoments<double>> moments;
  int updates = 0;

  PlanarVector step(const PlanarVector& g) {
    const Vec3<double> d = adamDirection(constants, {g.x, g.y, g.angle}, ++updates, &moments);
    return {-rate * d.x, -rate * d.y, -rate * d.z};
  }
};

/// When an optimisation in the plane ends.
struct PlanarTermination {
  double tolerance;  ///< of planarError
  int max_steps;
};

/// Optimises from `start` until the termination's tolerance or number of steps is reached.
/// @param visit called with the pose before the first and after every step.
/// @return steps taken.
template <typename Update, typename Optimiser, typename Visit>
int optimiseInPlane(const PlanarPose& start, const PlanarPose& target, Optimiser optimiser,
                    const PlanarTermination& termination, const Visit& visit) {
  PlanarPose pose = start;
  visit(pose);
  int steps = 0;
  while (steps < termination.max_steps && !(planarError(pose, target) < termination.tolerance)) {
    pose = Update::apply(pose, optimiser.step(Update::gradient(pose, target)));
    ++steps;
    visit(pose);
  }
  return steps;
}

}  // namespace nerf_pose_refiner
