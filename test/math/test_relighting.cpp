// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/relighting.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace nerf_pose_refiner {
namespace {

const LightChange kChange = {0.5f, -0.3f, 0.2f};
constexpr float kMean = -0.4f;

// Of a ball, seen from afar: normals away from the camera, evenly over its image.
std::vector<LightSample> ballIn(const LightChange& change) {
  std::vector<LightSample> samples;
  constexpr int kHalf = 9;
  for (int y = -kHalf; y <= kHalf; ++y) {
    for (int x = -kHalf; x <= kHalf; ++x) {
      const float u = static_cast<float>(x) / kHalf, v = static_cast<float>(y) / kHalf;
      const float rest = 1 - u * u - v * v;
      if (rest < 0) continue;
      const Vec3<float> normal = {-u, -v, std::sqrt(rest)};
      samples.push_back({normal, kMean + dot(change, normal), 1});
    }
  }
  return samples;
}

void expectNear(const LightChange& a, const LightChange& b, float most) {
  EXPECT_NEAR(a.x, b.x, most);
  EXPECT_NEAR(a.y, b.y, most);
  EXPECT_NEAR(a.z, b.z, most);
}

TEST(Relighting, FindsAChangeOfTheLight) {
  const LightEstimate found = estimateLight(ballIn(kChange));
  expectNear(found.change, kChange, 0.05f);  // no change is a little likelier
  EXPECT_NEAR(found.mean, kMean, 0.05f);
}

TEST(Relighting, TheSameLightIsNoChange) {
  expectNear(estimateLight(ballIn({0, 0, 0})).change, {0, 0, 0}, 1e-5f);
}

TEST(Relighting, LeavesOutWhatCoversTheObject) {
  std::vector<LightSample> samples = ballIn(kChange);
  for (LightSample& sample : samples) {
    if (sample.normal.x > 0.6f) sample.log_ratio = sample.normal.y > 0 ? 1.2f : -1.5f;
  }
  expectNear(estimateLight(samples).change, kChange, 0.12f);
}

TEST(Relighting, WhatIsNotSeenTellsNothing) {
  std::vector<LightSample> samples = ballIn(kChange);
  for (LightSample& sample : samples) {
    if (sample.normal.x > 0.4f) sample = {sample.normal, 5, 0};
  }
  expectNear(estimateLight(samples).change, kChange, 0.08f);
}

TEST(Relighting, AFaceTellsOnlyItsOwnBrightness) {
  // All that a plane shows is darker by e^-0.4: how much of that is due to its normal is not known.
  std::vector<LightSample> samples(100, {{0.6f, 0, 0.8f}, -0.4f, 1});
  const LightEstimate found = estimateLight(samples);
  EXPECT_NEAR(found.mean + dot(found.change, samples[0].normal), -0.4f, 0.01f);
  EXPECT_LT(norm(found.change), 0.01f);
}

TEST(Relighting, IsBelievedWhereItExplainsMostOfTheObject) {
  expectNear(estimateLight(ballIn(kChange)).change, kChange, 0.05f);
  std::vector<LightSample> wrong = ballIn(kChange);  // another object, say
  for (std::size_t i = 0; i < wrong.size(); ++i) wrong[i].log_ratio += i % 2 ? 0.5f : -0.5f;
  expectNear(estimateLight(wrong).change, {0, 0, 0}, 0);
}

TEST(Relighting, IsNotBelievedWhereHalfIsCovered) {
  std::vector<LightSample> samples = ballIn(kChange);
  for (LightSample& sample : samples) {
    if (sample.normal.x > 0) sample.log_ratio = sample.normal.y > 0 ? 1.2f : -1.5f;
  }
  EXPECT_LT(norm(estimateLight(samples).change), 0.5f * norm(kChange));
}

TEST(Relighting, NothingSeenIsNoChange) { expectNear(estimateLight({}).change, {0, 0, 0}, 0); }

TEST(Relighting, TooFewPlacesTellNothing) {
  std::vector<LightSample> samples = ballIn(kChange);
  samples.resize(static_cast<std::size_t>(kMinLightSamples) - 1);
  const LightEstimate found = estimateLight(samples);
  expectNear(found.change, {0, 0, 0}, 0);
  EXPECT_EQ(found.mean, 0);
}

TEST(Relighting, UnknownNormalsAndNumbersThatAreNoneDoNoHarm) {
  std::vector<LightSample> samples(100, {{0, 0, 0}, 1, 1});
  expectNear(estimateLight(samples).change, {0, 0, 0}, 1e-6f);
  samples[3].log_ratio = NAN;
  expectNear(estimateLight(samples).change, {0, 0, 0}, 0);
}

TEST(Relighting, AGainIsBounded) {
  const Vec3<float> normal = {0, 0, 1};
  EXPECT_EQ(lightGain({0, 0, 0}, normal), 1);
  EXPECT_NEAR(lightGain({5, 5, std::log(2.0f)}, normal), 2, 1e-6);
  EXPECT_NEAR(lightGain({0, 0, 50}, normal) * lightGain({0, 0, -50}, normal), 1, 1e-6);
  EXPECT_LT(lightGain({0, 0, 50}, normal), 4);
}

TEST(Relighting, BlackHasABrightness) {
  const float black[3] = {0, 0, 0}, below[3] = {-0.1f, -0.1f, -0.1f}, grey[3] = {0.5f, 0.5f, 0.5f};
  EXPECT_TRUE(std::isfinite(logBrightness(black)));
  EXPECT_EQ(logBrightness(below), logBrightness(black));
  EXPECT_NEAR(logBrightness(grey) - logBrightness(black), std::log(26.0f), 1e-5);
}

TEST(Relighting, NormalsLookAwayFromTheCamera) {
  const Vec3<float> plane[2] = {{2, 0, 0}, {0, 3, 0}};  // to the right and down
  const Vec3<float> normal = surfaceNormal(plane);
  EXPECT_EQ(normal.z, 1);
  const Vec3<float> line[2] = {{2, 0, 0}, {1, 0, 0}};
  expectNear(surfaceNormal(line), {0, 0, 0}, 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
