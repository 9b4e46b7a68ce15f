// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kAllHalves = 1 << 16;
const float kInfinity = std::numeric_limits<float>::infinity();

bool isNan(int half) { return (half & 0x7fff) > 0x7c00; }

// The definition of the format: 1 sign, 5 exponent and 10 mantissa bits.
double valueOf(int half) {
  const int exponent = half >> 10 & 31, mantissa = half & 1023;
  const double sign = half >> 15 ? -1 : 1;
  if (exponent == 31) return sign * std::numeric_limits<double>::infinity();
  if (exponent == 0) return sign * std::ldexp(mantissa, -24);
  return sign * std::ldexp(1024 + mantissa, exponent - 25);
}

TEST(Half, EveryHalfBecomesItsValue) {
  for (int half = 0; half < kAllHalves; ++half) {
    const float value = halfToFloat(static_cast<std::uint16_t>(half));
    if (isNan(half)) {
      EXPECT_TRUE(std::isnan(value)) << half;
    } else {
      EXPECT_EQ(value, valueOf(half)) << half;
      EXPECT_EQ(std::signbit(value), half >> 15 == 1) << half;
    }
  }
}

TEST(Half, EveryHalfSurvivesTheRoundTrip) {
  for (int half = 0; half < kAllHalves; ++half) {
    const int back = floatToHalf(halfToFloat(static_cast<std::uint16_t>(half)));
    if (isNan(half)) {
      EXPECT_TRUE(isNan(back)) << half;
    } else {
      EXPECT_EQ(back, half);
    }
  }
}

TEST(Half, KnownValues) {
  EXPECT_EQ(floatToHalf(1.0f), 0x3c00);
  EXPECT_EQ(floatToHalf(-2.0f), 0xc000);
  EXPECT_EQ(floatToHalf(0.1f), 0x2e66);  // 0.0999755859375
  EXPECT_EQ(floatToHalf(-0.0f), 0x8000);
  EXPECT_EQ(floatToHalf(65504.0f), 0x7bff);           // the largest
  EXPECT_EQ(floatToHalf(std::ldexp(1, -14)), 0x400);  // the smallest normal one
  EXPECT_EQ(floatToHalf(std::ldexp(1, -24)), 0x001);  // the smallest
  EXPECT_EQ(floatToHalf(-kInfinity), 0xfc00);
}

TEST(Half, TiesGoToTheEvenNeighbour) {
  const float tie = std::ldexp(1.0f, -11);  // half of the step behind 1
  EXPECT_EQ(floatToHalf(1 + tie), 0x3c00);
  EXPECT_EQ(floatToHalf(std::nextafter(1 + tie, 2.0f)), 0x3c01);
  EXPECT_EQ(floatToHalf(1 + 3 * tie), 0x3c02);
  EXPECT_EQ(floatToHalf(std::nextafter(1 + 3 * tie, 0.0f)), 0x3c01);
  EXPECT_EQ(floatToHalf(-1 - 3 * tie), 0xbc02);
  EXPECT_EQ(floatToHalf(2 - tie), 0x4000);  // carries into the exponent
}

TEST(Half, SubnormalTiesGoToTheEvenNeighbour) {
  const float step = std::ldexp(1.0f, -24);
  EXPECT_EQ(floatToHalf(0.5f * step), 0);
  EXPECT_EQ(floatToHalf(std::nextafter(0.5f * step, 1.0f)), 1);
  EXPECT_EQ(floatToHalf(1.5f * step), 2);
  EXPECT_EQ(floatToHalf(-2.5f * step), 0x8002);
  EXPECT_EQ(floatToHalf(1023.5f * step), 0x400);  // becomes a normal number
}

TEST(Half, TooLargeBecomesInfinite) {
  // Half way to 65536, which would be the next one.
  EXPECT_EQ(floatToHalf(std::nextafter(65520.0f, 0.0f)), 0x7bff);
  EXPECT_EQ(floatToHalf(65520.0f), 0x7c00);
  EXPECT_EQ(floatToHalf(-1e30f), 0xfc00);
}

TEST(Half, TheNearestHalfIsTaken) {
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const int exponent = static_cast<int>(randomIndex(1, 1, i, 42)) - 26;
    const float value = std::ldexp(1 + randomUniform(1, 2, i), exponent);
    if (value >= 65504.0f) continue;
    const int half = floatToHalf(value);
    const double error = std::abs(value - valueOf(half));
    EXPECT_LE(error, std::abs(value - valueOf(half + 1))) << value;
    if (half > 0) {
      EXPECT_LE(error, std::abs(value - valueOf(half - 1))) << value;
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
