// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "dataset/dataset.h"
#include "evaluation/pose_error.h"
#include "evaluation/start.h"
#include "refinement/field_refiner.h"
#include "work_report.h"

namespace nerf_pose_refiner {

/// A refinement from a wrong pose, and what came of it.
struct Trial {
  int view = 0, start = 0;
  PoseError before, after;
  std::vector<double> error, deviation;  ///< of the twist to the truth, axes of C
  double normalised_error = 0;  ///< e^T C^-1 e / 6 of the reported covariance: 1 on average
  Refinement refinement;
  FloorFraction fraction;
};

/// The pose errors that a protocol starts from, how wide it searches, and what it accepts.
struct Protocol {
  StartSpread start;
  double search_rotation_rad, search_translation;  // the latter in diameters
  bool of_camera;                                  // the offset that counts: else the object's
  double offset_bound;                             // [model units]
};

/// Sets what is known of the error by the reported covariance.
void compareWithCovariance(const Pose& true_T_O_C, const Eigen::Vector3d& centre, Trial* trial);

nlohmann::json toJson(const Trial& trial);
nlohmann::json summaryOf(const std::vector<Trial>& trials, const Protocol& protocol);

/// A line, and one for each stage if that is asked for. @param centre of the object.
void printTrial(const Trial& trial, const PosedView& view, const Eigen::Vector3d& centre,
                bool with_trace);

}  // namespace nerf_pose_refiner
