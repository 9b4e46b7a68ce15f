// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/loaded_field.h"
#include "dataset/dataset.h"

namespace nerf_pose_refiner {

/// Poses of photos come from a robot's kinematics or a calibrated fixture, and are off by some
/// millimetres and tenths of a degree: too much for a sharp model, as errors differ from view to
/// view. A model learned from all views averages them; so each view is aligned with it.

/// Where each view's camera is, judging by how the model looks (direct alignment from the pose that
/// the view has, coarse to fine) and by where it was measured: both weigh by how exact they are,
/// the measurement being taken for one of 0.5 degrees and 1 % of the object's diameter per axis.
/// @param measured T_O_C of each view.
/// @return T_O_C of each view, in order; one that cannot be aligned (the object is behind its
/// camera, or it would move by more than a few degrees) keeps its pose.
/// @throws Cancelled.
std::vector<Pose> alignViews(const LoadedField& field, const std::vector<PosedView>& views,
                             const std::vector<Pose>& measured, bool has_alpha,
                             const CancellationToken& cancellation);

/// Moves poses as one, so that the cameras' centres lie as near as can be to where they were
/// measured. Alignment with a model says nothing of where and how large the whole is; the measured
/// poses do, together. The similarity is Umeyama's (PAMI 1991).
/// @param refined, measured T_O_C of the same views.
/// @return the refined poses as they are where the centres define no frame: fewer than three, or
/// all on a line.
std::vector<Pose> inMeasuredFrame(const std::vector<Pose>& refined,
                                  const std::vector<Pose>& measured);

}  // namespace nerf_pose_refiner
