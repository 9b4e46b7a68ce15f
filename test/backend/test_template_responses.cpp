// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/template_responses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "backend/cpu/template_kernels.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr float kDegree = 3.14159265f / 180;

TEST(OrientationBin, IsTheNearestOfEightModulo180Degrees) {
  EXPECT_EQ(orientationBin(0), 0);
  EXPECT_EQ(orientationBin(11 * kDegree), 0);
  EXPECT_EQ(orientationBin(12 * kDegree), 1);
  EXPECT_EQ(orientationBin(22.5f * kDegree), 1);
  EXPECT_EQ(orientationBin(90 * kDegree), 4);
  EXPECT_EQ(orientationBin(168 * kDegree), 7);
  EXPECT_EQ(orientationBin(170 * kDegree), 0);
  EXPECT_EQ(orientationBin(180 * kDegree), 0);
  EXPECT_EQ(orientationBin(-90 * kDegree), 4);
  EXPECT_EQ(orientationBin(-22.5f * kDegree), 7);
  EXPECT_EQ(orientationBin(382.5f * kDegree), 1);
}

// Dark to the left of column 10, bright from there on.
Image verticalStep(float dark, float bright) {
  Image image(20, 16, 3, dark);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 10; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = bright;
    }
  }
  return image;
}

int responseAt(const OrientationResponses& responses, int bin, int x, int y) {
  return responses.plane(bin)[y * responses.width + x];
}

TEST(OrientationResponses, SayWhereAnEdgeIsAndHowItIsDirected) {
  const OrientationResponses responses = orientationResponses(verticalStep(0.2f, 0.8f));
  EXPECT_EQ(responseAt(responses, 0, 9, 8), kMaxResponse);
  EXPECT_EQ(responseAt(responses, 0, 10, 8), kMaxResponse);
  // 22.5 degrees off: (cos 45 - 0.302) / 0.7 of all.
  EXPECT_NEAR(responseAt(responses, 1, 10, 8), 0.579 * kMaxResponse, 1);
  EXPECT_NEAR(responseAt(responses, 7, 10, 8), 0.579 * kMaxResponse, 1);
  for (const int bin : {2, 3, 4, 5, 6}) EXPECT_EQ(responseAt(responses, bin, 10, 8), 0) << bin;
  for (int bin = 0; bin < kOrientations; ++bin) EXPECT_EQ(responseAt(responses, bin, 3, 8), 0);
  EXPECT_EQ(responseAt(responses, kFlatBin, 10, 8), 0);
  EXPECT_EQ(responseAt(responses, kFlatBin, 3, 8), kMaxResponse);
}

TEST(OrientationResponses, SayHalfOfAnEdgeAndOfNoneAtAGradientThatCountsHalf) {
  Image ramp(16, 16, 3);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      for (int c = 0; c < 3; ++c) ramp.at(x, y, c) = 0.03f * static_cast<float>(x);
    }
  }
  // All gradients are the median. Eight orientations have 0.302 in the mean.
  const OrientationResponses responses = orientationResponses(ramp);
  EXPECT_NEAR(responseAt(responses, 0, 8, 8), 0.5 * kMaxResponse, 1);
  EXPECT_NEAR(responseAt(responses, kFlatBin, 8, 8), 0.5 * kMaxResponse, 1);
}

TEST(OrientationResponses, DoNotDependOnTheContrastOrItsSign) {
  const OrientationResponses strong = orientationResponses(verticalStep(0.2f, 0.8f));
  const OrientationResponses inverse = orientationResponses(verticalStep(0.8f, 0.2f));
  const OrientationResponses weak = orientationResponses(verticalStep(0.4f, 0.6f));
  EXPECT_EQ(strong.values, inverse.values);
  EXPECT_GE(responseAt(weak, 0, 10, 8), kMaxResponse - 1);
}

TEST(OrientationResponses, AreWeakInATexture) {
  Image noise(40, 40, 3);
  for (std::size_t i = 0; i < noise.values.size(); ++i) {
    noise.values[i] = randomUniform(1, 2, i / 3);
  }
  const OrientationResponses texture = orientationResponses(noise);
  const auto end =
      texture.values.begin() + kOrientations * static_cast<std::ptrdiff_t>(noise.pixels());
  const double sum = std::accumulate(texture.values.begin(), end, 0.0);
  // A place where one orientation alone is seen has a mean of 2 * (1 + 2 * 0.58) / 16 of all.
  EXPECT_LT(sum / static_cast<double>(end - texture.values.begin()), 0.2 * kMaxResponse);
}

TEST(OrientationResponses, OfABlackImageSayThatThereIsNoEdge) {
  const OrientationResponses responses = orientationResponses(Image(30, 20, 3));
  for (int bin = 0; bin < kTemplateBins; ++bin) {
    const int expected = bin == kFlatBin ? kMaxResponse : 0;
    EXPECT_TRUE(std::all_of(responses.plane(bin), responses.plane(bin) + 30 * 20, [&](int value) {
      return value == expected;
    })) << bin;
  }
}

TEST(OrientationResponses, AreNoneOfATinyImage) {
  for (const Image& image : {Image(2, 2, 3, 0.5f), Image(1, 9, 3)}) {
    const OrientationResponses responses = orientationResponses(image);
    ASSERT_EQ(responses.values.size(), kTemplateBins * image.pixels());
    EXPECT_EQ(*std::max_element(responses.values.begin(), responses.values.end()), 0);
  }
}

TEST(ResponseMemory, GivesEachPositionWhatIsAroundIt) {
  OrientationResponses responses;
  responses.width = 11;
  responses.height = 7;
  for (int i = 0; i < kTemplateBins * 11 * 7; ++i) {
    responses.values.push_back(static_cast<std::uint8_t>(1 + i % 15));
  }
  for (const int stride : {1, 2, 3}) {
    const int margin = 6;
    const ResponseMemory memory(responses, stride, margin);
    for (int row = 0; row * stride < 7; ++row) {
      for (int column = 0; column * stride < 11; ++column) {
        for (int bin = 0; bin < kTemplateBins; ++bin) {
          for (int y = -margin; y <= margin; ++y) {
            for (int x = -margin; x <= margin; ++x) {
              const int u = column * stride + x, v = row * stride + y;
              const bool inside = u >= 0 && v >= 0 && u < 11 && v < 7;
              ASSERT_EQ(memory.place(column, row)[memory.order().offsetOf({bin, x, y})],
                        inside ? responseAt(responses, bin, u, v) : 0)
                  << stride << " " << bin << " " << u << " " << v;
            }
          }
        }
      }
    }
    EXPECT_EQ(memory.order().offsetOf({3, 100, -100}),
              memory.order().offsetOf({3, margin, -margin}));
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
