// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/sequence.h"

#include <gtest/gtest.h>

#include <map>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

/// A frame a tenth of a second after the one before.
EvaluatedFrame frame(int index, double degrees, double offset_m, bool trusted) {
  EvaluatedFrame f;
  f.index = index;
  f.stamp_ns = 1700000000000000000ull + 100000000ull * index;
  f.trusted = trusted;
  f.found = {degrees, offset_m, offset_m / 0.2, offset_m, offset_m / 2, 100 * offset_m};
  f.latency_s = 0.01 * (index + 1);
  return f;
}

/// Diameter 0.2 m: 5 % of it are 0.01 m, 2 % are 0.004 m.
std::vector<EvaluatedFrame> frames() {
  EvaluatedFrame none = frame(3, 0, 0, false);
  none.found = PoseMetrics();
  return {frame(0, 1, 0.002, true), frame(1, 4, 0.03, true), frame(2, 3, 0.008, false), none,
          frame(4, 6, 0.001, true)};
}

TEST(Sequence, SharesAreOfAllFrames) {
  const SequenceSummary summary = summarise(frames(), 0.2);
  std::map<std::string, double> fractions;
  for (const Recall& recall : summary.recalls) fractions[recall.rule] = recall.fraction;
  EXPECT_DOUBLE_EQ(fractions.at("5 deg and 5 cm"), 0.6);
  EXPECT_DOUBLE_EQ(fractions.at("5 deg and 5 %"), 0.4);
  EXPECT_DOUBLE_EQ(fractions.at("2 deg and 2 %"), 0.2);
  EXPECT_DOUBLE_EQ(fractions.at("ADD 10 %"), 0.6);
  EXPECT_DOUBLE_EQ(fractions.at("ADD-S 10 %"), 0.8);
  EXPECT_DOUBLE_EQ(fractions.at("5 px"), 0.8);
  // ADD of 2, 30, 8, none and 1 mm up to 20 mm: (0.9 + 0 + 0.6 + 0 + 0.95) / 5.
  EXPECT_NEAR(summary.add_area, 0.49, 1e-12);
  EXPECT_NEAR(summary.add_s_area, (0.95 + 0.25 + 0.8 + 0 + 0.975) / 5, 1e-12);
}

TEST(Sequence, ErrorsAndLatencies) {
  const SequenceSummary summary = summarise(frames(), 0.2);
  EXPECT_DOUBLE_EQ(summary.rotation_deg.median, 4);  // of 1, 3, 4, 6 and infinity
  EXPECT_EQ(summary.rotation_deg.p95, PoseMetrics::kNone);
  EXPECT_DOUBLE_EQ(summary.latency_s.median, 0.03);
  EXPECT_DOUBLE_EQ(summary.latency_s.most, 0.05);
}

TEST(Sequence, ErrorsAgainstCovariancesAreThoseOfRightPoses) {
  std::vector<EvaluatedFrame> of = frames();
  EXPECT_EQ(summarise(of, 0.2).normalised_error, PoseMetrics::kNone);  // none is stated
  of[0].normalised_error = 0.5;
  of[1].normalised_error = 100;  // 15 % of the diameter off
  of[2].normalised_error = 2;    // right, though it is not trusted
  EXPECT_DOUBLE_EQ(summarise(of, 0.2).normalised_error, 1.25);
}

TEST(Sequence, TrustAndTimeLost) {
  const SequenceSummary summary = summarise(frames(), 0.2);
  EXPECT_EQ(summary.frames, 5);
  EXPECT_EQ(summary.found, 4);
  EXPECT_EQ(summary.trusted, 3);
  EXPECT_EQ(summary.losses, 1);
  EXPECT_DOUBLE_EQ(summary.duration_s, 0.4);
  EXPECT_DOUBLE_EQ(summary.time_lost_s, 0.2);        // frames 2 and 3, until frame 4
  EXPECT_DOUBLE_EQ(summary.trusted_right, 1.0 / 3);  // of frames 0, 1, 4: frame 0
  EXPECT_DOUBLE_EQ(summary.right_trusted, 1.0 / 2);  // of frames 0, 2: frame 0
}

TEST(Sequence, RefusesNone) { EXPECT_THROW(summarise({}, 0.2), std::invalid_argument); }

// An object 1 m in front of the camera, moved sideways by 1 cm.
TEST(Sequence, ComparesPosesInMetres) {
  const EvaluatedObject object = {ModelPoints({{0.05, 0, 0}, {-0.05, 0, 0}}), {0, 0, 0}, 0.2, {}};
  const Camera camera = {640, 480, 500, 500, 319.5, 239.5};
  const Pose truth = {Eigen::Matrix3d::Identity(), {0, 0, -1}};
  const Pose moved = {Eigen::Matrix3d::Identity(), {0.01, 0, -1}};
  const PoseMetrics metrics = object.compare(moved, truth, camera);
  EXPECT_NEAR(metrics.rotation_deg, 0, 1e-9);
  EXPECT_NEAR(metrics.offset_m, 0.01, 1e-12);
  EXPECT_NEAR(metrics.offset_diameters, 0.05, 1e-12);
  EXPECT_NEAR(metrics.add_m, 0.01, 1e-12);
  EXPECT_NEAR(metrics.add_s_m, 0.01, 1e-12);
  EXPECT_NEAR(metrics.reprojection_px, 5, 1e-9);
}

// Seen 1 m away at an angle whose sine is 0.6, moved by 1 cm along the camera's axis.
TEST(Sequence, ErrorsAlongTheLineOfSight) {
  const EvaluatedObject object = {ModelPoints({{0, 0, 0}}), {0, 0, 0}, 0.2, {}};
  const Camera camera = {640, 480, 500, 500, 319.5, 239.5};
  const Pose truth = {Eigen::Matrix3d::Identity(), {-0.6, 0, -0.8}};
  for (const double away_m : {0.01, -0.01}) {
    const Pose moved = {Eigen::Matrix3d::Identity(), {-0.6, 0, -0.8 + away_m}};
    const PoseMetrics metrics = object.compare(moved, truth, camera);
    EXPECT_NEAR(metrics.along_m, 0.008, 1e-12);
    EXPECT_NEAR(metrics.across_m, 0.006, 1e-12);
  }
}

// Two points on the x axis, and a half turn about z: they change places.
TEST(Sequence, ComparesModuloSymmetries) {
  EvaluatedObject object = {ModelPoints({{0.05, 0, 0}, {-0.05, 0, 0}}), {0, 0, 0}, 0.2, {}};
  const Camera camera = {640, 480, 500, 500, 319.5, 239.5};
  const Pose truth = {Eigen::Matrix3d::Identity(), {0, 0, -1}};
  const Pose turned = turnAbout(SymmetryAxis(), M_PI) * truth;
  EXPECT_NEAR(object.compare(turned, truth, camera).rotation_deg, 180, 1e-5);
  EXPECT_NEAR(object.compare(turned, truth, camera).add_m, 0.1, 1e-12);
  object.symmetries_m = Symmetries(std::nullopt, {turnAbout(SymmetryAxis(), M_PI)});
  const PoseMetrics metrics = object.compare(turned, truth, camera);
  EXPECT_NEAR(metrics.rotation_deg, 0, 1e-5);
  EXPECT_NEAR(metrics.add_m, 0, 1e-7);
  EXPECT_NEAR(metrics.reprojection_px, 0, 1e-4);
}

}  // namespace
}  // namespace nerf_pose_refiner
