// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/keyframe_scores.h"

#include <gtest/gtest.h>

#include "backend/make_backend.h"
#include "support/analytic_scene.h"

namespace nerf_pose_refiner {
namespace {

TEST(KeyframeScores, OfATexturedObjectSeparateRightFromWrong) {
  const auto backend = makeCpuBackend(1);
  const auto scene = makeAnalyticScene();
  const KeyframeScores scores = measureKeyframeScores(backend.get(), *scene, {});
  EXPECT_EQ(scores.poses, 24);  // three kinds of images of eight sides
  EXPECT_GT(scores.wrong_mean, 0);
  EXPECT_LT(scores.wrong_mean + 2 * scores.wrong_deviation,
            scores.right_mean - scores.right_deviation);
}

TEST(KeyframeScores, AreTheSameEachTime) {
  const auto backend = makeCpuBackend(2);
  const auto scene = makeAnalyticScene();
  const KeyframeScores one = measureKeyframeScores(backend.get(), *scene, {});
  const KeyframeScores two = measureKeyframeScores(backend.get(), *scene, {});
  EXPECT_EQ(one.wrong_mean, two.wrong_mean);
  EXPECT_EQ(one.wrong_deviation, two.wrong_deviation);
  EXPECT_EQ(one.right_mean, two.right_mean);
  EXPECT_EQ(one.right_deviation, two.right_deviation);
}

TEST(KeyframeScores, CanBeCancelled) {
  const auto backend = makeCpuBackend(1);
  const auto scene = makeAnalyticScene();
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(measureKeyframeScores(backend.get(), *scene, cancellation), Cancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
