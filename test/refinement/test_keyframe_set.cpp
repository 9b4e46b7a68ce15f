// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/keyframe_set.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

const Eigen::Vector3d kCentre(0.3, -0.2, 0.5);

/// Counts keyframes and does no more.
class CountingAligner : public KeyframeAligner {
 public:
  int add(std::shared_ptr<const KeyframePoints>) override { return count_++; }
  void remove(int) override {}
  void observe(const Observation&, const FrameWindow&) override {}
  std::vector<Hypothesis> align(const std::vector<KeyframeStart>&, const KeyframeAlignmentSettings&,
                                const CancellationToken&) override {
    return {};
  }

 private:
  int count_ = 0;
};

/// A camera somewhere around the centre. (Its own rotation does not count.)
Pose drawnPose(std::uint64_t number) {
  const auto drawn = [&](std::uint64_t axis) { return 2 * randomUniform(3, axis, number) - 1; };
  Pose T_O_C;
  T_O_C.t = kCentre + (2 + drawn(3)) * Eigen::Vector3d(drawn(0), drawn(1), drawn(2)).normalized();
  return T_O_C;
}

std::shared_ptr<const KeyframePoints> keyframeAt(const Pose& T_O_C) {
  auto keyframe = std::make_shared<KeyframePoints>();
  keyframe->T_O_C = T_O_C;
  keyframe->centre = kCentre;
  return keyframe;
}

TEST(KeyframeSet, TheNearestIsTheOneOfLeastDistance) {
  constexpr int kKeyframes = 200, kPoses = 300;
  for (const ViewDistance& reach : {ViewDistance{0.4, 0.6}, {0.4, 1e3}, {4, 1e3}, {0.1, 0.3}}) {
    CountingAligner aligner;
    KeyframeSet set(&aligner, kKeyframes, reach);
    for (int i = 0; i < kKeyframes; ++i) set.add(keyframeAt(drawnPose(i)));
    int found = 0;
    for (int k = 0; k < kPoses; ++k) {
      const Pose pose = drawnPose(1000 + k);
      int best = -1;
      double least = 1;
      for (int i = 0; i < kKeyframes; ++i) {
        const ViewDistance away = viewDistance(drawnPose(i), pose, kCentre);
        const double cost =
            std::hypot(away.rotation_rad / reach.rotation_rad, away.scale / reach.scale);
        if (cost >= least) continue;
        least = cost;
        best = i;
      }
      const KeyframeSet::Entry* const nearest = set.nearest(pose);
      ASSERT_EQ(nearest == nullptr ? -1 : nearest->number, best) << reach.rotation_rad;
      found += best >= 0;
    }
    EXPECT_GT(found, 10);
  }
}

TEST(KeyframeSet, OfEqualOnesTheFirst) {
  CountingAligner aligner;
  KeyframeSet set(&aligner, 3, {0.4, 0.6});
  EXPECT_EQ(set.nearest(drawnPose(1)), nullptr);
  for (int i = 0; i < 3; ++i) set.add(keyframeAt(drawnPose(1)));
  ASSERT_NE(set.nearest(drawnPose(1)), nullptr);
  EXPECT_EQ(set.nearest(drawnPose(1))->number, 0);
}

TEST(KeyframeSet, NoneIsNearToNowhere) {
  CountingAligner aligner;
  KeyframeSet set(&aligner, 2, {0.4, 0.6});
  set.add(keyframeAt(drawnPose(1)));
  Pose nowhere = drawnPose(1);
  nowhere.t.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(set.nearest(nowhere), nullptr);
  nowhere.t = kCentre;
  EXPECT_EQ(set.nearest(nowhere), nullptr);
}

}  // namespace
}  // namespace nerf_pose_refiner
