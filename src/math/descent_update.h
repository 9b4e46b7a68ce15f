// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

#include "math/adam.h"
#include "math/projection.h"
#include "math/so3.h"
#include "math/twist.h"

namespace nerf_pose_refiner {

/// What Adam moves in an inversion.
enum class PoseUpdate {
  kAboutCamera,  ///< SO(3) x T(3), rotation about the camera's centre (Lin et al., section IV-A)
  kAboutObject,  ///< the same about the object's: turning it does not move it in the image
  kTwist,  ///< xi of se(3) in exp(xi) T_start, about O's origin (Yen-Chen et al., iNeRF, III-C)
};

/// Name of an update in settings: "about_camera", "about_object", "twist".
inline const char* poseUpdateName(PoseUpdate update) {
  constexpr const char* kNames[] = {"about_camera", "about_object", "twist"};
  return kNames[static_cast<int>(update)];
}

/// The update of that name. @throws std::invalid_argument listing the names that exist.
inline PoseUpdate poseUpdateFromName(const std::string& name) {
  for (int i = 0; i < 3; ++i) {
    const PoseUpdate update = static_cast<PoseUpdate>(i);
    if (name == poseUpdateName(update)) return update;
  }
  throw std::invalid_argument("no update is called '" + name +
                              "'; there are about_camera, about_object, twist");
}

/// How far an update goes. Lengths are in units of `length_unit` [model units].
struct DescentRates {
  PoseUpdate update;
  Vec3<double> object_centre;  ///< in O [model units]
  double length_unit;
  double translation, rotation;  ///< learning rates, decayed
  double regularisation;         ///< L2, on the offset from the start
  AdamConstants<double> adam;
};

/// How learning rates fall over a run: by `decay` every `decay_updates` updates (Lin et al.,
/// section V), and, which is not the paper's, to zero in a straight line over the last
/// `anneal_fraction` of it: a pose trembles by as much as its last updates move it.
struct RateSchedule {
  double decay = 0.33;
  int decay_updates = 256;
  double anneal_fraction = 0;  ///< 0: none, as the paper
  int run_updates = 0;         ///< of the whole run; 0: unknown, and nothing is annealed

  /// Of the learning rates at an update, from 0 on.
  NPR_HOST_DEVICE double rateFactor(int update) const {
    const double decayed = pow(decay, static_cast<double>(update / decay_updates));
    const double left = run_updates - update, annealed = anneal_fraction * run_updates;
    return annealed > 0 && left < annealed ? decayed * (left > 0 ? left : 0) / annealed : decayed;
  }
};

/// Where an inversion began and what Adam carries on; fresh in a hypothesis that was just seeded.
/// Translations are in the length unit, all vectors in the axes of O.
struct DescentMotion {
  CameraPose<double> start;  ///< T_O_C: the regularisation attracts to it
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
  const double unit = rates.length_unit, regularisation = rates.regularisation;
  const bool twist = rates.update == PoseUpdate::kTwist;
  // What the rotation is about.
  const Vec3<double> centre = rates.update == PoseUpdate::kAboutCamera   ? pose->o
                              : rates.update == PoseUpdate::kAboutObject ? rates.object_centre
                                                                         : Vec3<double>{0, 0, 0};
  Twist<double> gradient = {force, torque + cross((1 / unit) * (pose->o - centre), force)};
  Twist<double> offset = motion->twist;
  if (twist) {
    gradient = gradientByTwist(motion->twist, gradient);
  } else {
    const Mat3<double> turned = timesTransposed(pose->R, motion->start.R);
    offset.w = logSO3(turned);
    // What it moved by besides what turning about the object did.
    const bool about_object = rates.update == PoseUpdate::kAboutObject;
    const Vec3<double> led =
        about_object ? centre + turned * (motion->start.o - centre) : motion->start.o;
    offset.v = (1 / unit) * (pose->o - led);
  }
  gradient = gradient + regularisation * offset;
  ++motion->updates;
  const Vec3<double> v = -rates.translation * adamDirection(rates.adam, gradient.v, motion->updates,
                                                            &motion->translation);
  const Vec3<double> w =
      -rates.rotation * adamDirection(rates.adam, gradient.w, motion->updates, &motion->rotation);
  const double sum = v.x + v.y + v.z + w.x + w.y + w.z;
  if (!(sum - sum == 0)) return false;
  if (twist) {
    motion->twist = motion->twist + Twist<double>{v, w};
    *pose = expTimes(Twist<double>{unit * motion->twist.v, motion->twist.w}, motion->start);
  } else {
    *pose = moveCamera(*pose, centre, unit * v, w);
    pose->R = orthonormalized(pose->R);
  }
  return true;
}

}  // namespace nerf_pose_refiner
