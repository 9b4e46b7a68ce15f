// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "evaluation/model_points.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

/// How far a pose is from the truth, in every way that is reported. All infinite: there is none.
struct PoseMetrics {
  static constexpr double kNone = std::numeric_limits<double>::infinity();

  double rotation_deg = kNone;
  double offset_m = kNone;          ///< of the object's centre as the camera sees it
  double offset_diameters = kNone;  ///< the same
  double add_m = kNone;             ///< @see ModelPoints
  double add_s_m = kNone;
  double reprojection_px = kNone;  ///< mean of the model's points
  double along_m = kNone;   ///< of offset_m, along the line of sight to the true centre, >= 0
  double across_m = kNone;  ///< of offset_m, across that line
};

/// The object that poses are compared by, in its users' frame U: points, centre and diameter, all
/// in metres.
struct EvaluatedObject {
  ModelPoints points_m;
  Eigen::Vector3d centre_m;
  double diameter_m;
  Symmetries symmetries_m;  ///< errors are modulo these, as poseError has it

  /// @param T_U_C, true_T_U_C [m]. @param camera of the image that reprojection is measured in.
  PoseMetrics compare(const Pose& T_U_C, const Pose& true_T_U_C, const Camera& camera) const;
};

/// One evaluated image of a sequence.
struct EvaluatedFrame {
  int index = 0;  ///< of the image in the sequence, from 0
  std::uint64_t stamp_ns = 0;
  std::string outcome;     ///< "refined", or why there is no pose
  bool trusted = false;    ///< there is a pose, and its score passes
  bool from_last = false;  ///< started from the result of the image before
  double score = 0;
  PoseMetrics start;  ///< of the pose that the search began with
  PoseMetrics found;  ///< of the result, trusted or not
  Pose T_C_U;         ///< the result [m]; of no meaning where nothing was found
  double along_dev_m = PoseMetrics::kNone;  ///< standard deviation that was stated of along_m
  /// e^T C^-1 e / 6 of the pose's error e and its stated covariance C: 1 on average.
  double normalised_error = PoseMetrics::kNone;
  double latency_s = 0;  ///< of the refinement alone
};

/// Values of one kind over a sequence; infinite where nothing was found.
struct Distribution {
  double median = 0, p75 = 0, p90 = 0, p95 = 0, p99 = 0, most = 0;
};
Distribution distribution(const std::vector<double>& values);

/// A rule by which a pose counts as right, and the fraction of images that fulfil it.
struct Recall {
  std::string rule;
  double fraction = 0;
};

/// What a sequence comes to. Fractions are of all images: one without a pose counts as wrong.
struct SequenceSummary {
  int frames = 0;
  int found = 0;             ///< there is a pose
  int trusted = 0;           ///< and it is trusted
  int losses = 0;            ///< changes from a trusted image to one that is not
  double duration_s = 0;     ///< from the first image to the last
  double time_lost_s = 0;    ///< without a trusted pose; an image's state holds until the next one
  double trusted_right = 0;  ///< of the trusted poses: within 5 degrees and 5 % of the diameter
  double right_trusted = 0;  ///< of the poses within that: trusted

  Distribution rotation_deg, offset_m, offset_diameters, along_m, across_m;
  Distribution add_m, add_s_m, reprojection_px;
  /// Mean of EvaluatedFrame::normalised_error over the poses within 5 degrees and 5 % of the
  /// diameter; infinite: there are none.
  double normalised_error = PoseMetrics::kNone;
  Distribution latency_s;
  std::vector<Recall> recalls;  ///< jointly: 5 deg and 5 cm, 5 deg and 5 %; ADD, ADD-S below 10 %
  double add_area = 0;          ///< areaUnderRecall of ADD up to 10 % of the diameter
  double add_s_area = 0;
};

/// @param frames in the order of their stamps. @throws std::invalid_argument for none.
SequenceSummary summarise(const std::vector<EvaluatedFrame>& frames, double diameter_m);

/// Values of one error, frame by frame.
std::vector<double> column(const std::vector<EvaluatedFrame>& frames, double PoseMetrics::*error);

}  // namespace nerf_pose_refiner
