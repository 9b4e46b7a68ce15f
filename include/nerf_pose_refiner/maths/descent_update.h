// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/maths/adam.h"
#include "nerf_pose_refiner/maths/projection.h"
#include "nerf_pose_refiner/maths/so3.h"
#include "nerf_pose_refiner/maths/twist.h"

namespace nerf_pose_refiner {

/// What Adam moves in an inversion.
enum class PoseUpdate {
  kSeparate,  ///< SO(3) x T(3), rotation about the camera's centre (Lin et al., section IV-A)
  kTwist,     ///< xi of se(3) in exp(xi) T_start, about O's origin (Yen-Chen et al., iNeRF, III-C)
};

/// How far an update goes. Lengths are in units of `length_unit` [model units].
struct DescentRates {
  PoseUpdate update;
  double length_unit;
  double translation, rotation;  ///< learning rates, decayed
  double regularisation;         ///< L2, on the offset from the start
  AdamConstants<double> adam;
};

/// Where an inversion began and what Adam carries on; fresh in a hypothesis that was just seeded.
/// Translations are in the length unit, all vectors in the axes of O.
struct DescentMotion {
  CameraPose<double> start;  ///< T_O_C: the regularisation pulls there
  int updates;
  Vec3<AdamMoments<double>> translation, rotation;
  Twist<double> twist;  ///< from the start, of PoseUpdate::kTwist
};

/// An update of Adam of a camera's pose T_O_C.
/// @param force, torque mean derivatives of the loss by the camera's centre [1 / length unit] and
/// by a rotation from the left about it [1 / rad] (Lin et al., eq. 2 and 3).
/// @return false if a number is not finite: the pose stays where it is.
NPR_HOST_DEVICE inline bool updatePose(const DescentRates& rates, const Vec3<double>& force,
                                       const Vec3<double>& torque, DescentMotion* motion,
                                       CameraPose<double>* pose) {
  const double unit = rates.length_unit, pull = rates.regularisation;
  const bool separate = rates.update == PoseUpdate::kSeparate;
  Twist<double> gradient = {force, torque}, offset = motion->twist;
  if (separate) {
    offset.v = (1 / unit) * (pose->o - motion->start.o);
    offset.w = logSO3(timesTransposed(pose->R, motion->start.R));
  } else {
    gradient.w = torque + cross((1 / unit) * pose->o, force);  // about the origin of O
    gradient = gradientByTwist(motion->twist, gradient);
  }
  gradient = gradient + pull * offset;
  ++motion->updates;
  const Vec3<double> v = -rates.translation * adamDirection(rates.adam, gradient.v, motion->updates,
                                                            &motion->translation);
  const Vec3<double> w =
      -rates.rotation * adamDirection(rates.adam, gradient.w, motion->updates, &motion->rotation);
  const double sum = v.x + v.y + v.z + w.x + w.y + w.z;
  if (!(sum - sum == 0)) return false;
  if (separate) {
    pose->o += unit * v;
    pose->R = orthonormalized(expSO3(w) * pose->R);
  } else {
    motion->twist = motion->twist + Twist<double>{v, w};
    *pose = expTimes(Twist<double>{unit * motion->twist.v, motion->twist.w}, motion->start);
  }
  return true;
}

}  // namespace nerf_pose_refiner
