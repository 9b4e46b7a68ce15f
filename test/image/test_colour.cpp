// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/colour.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

Image8 onePixel(std::uint8_t r, std::uint8_t g, std::uint8_t b, std::uint8_t a) {
  Image8 image(1, 1, 4);
  image.values = {r, g, b, a};
  return image;
}

TEST(Colour, PremultiplyByHand) {
  const PremultipliedImage image = premultiply(onePixel(255, 102, 0, 51));
  EXPECT_FLOAT_EQ(image.alpha.values[0], 0.2f);
  EXPECT_FLOAT_EQ(image.colour.values[0], 0.2f);
  EXPECT_FLOAT_EQ(image.colour.values[1], 0.08f);
  EXPECT_FLOAT_EQ(image.colour.values[2], 0);
}

TEST(Colour, RgbIsOpaque) {
  const PremultipliedImage image = premultiply(Image8(2, 1, 3, 51));
  EXPECT_EQ(image.alpha.values, (std::vector<float>{1, 1}));
  EXPECT_FLOAT_EQ(image.colour.values[5], 0.2f);
  expectError<std::invalid_argument>([] { premultiply(Image8(2, 1, 1)); }, "2 x 1 x 1");
}

TEST(Colour, CompositeByHand) {
  const Image picture = composite(premultiply(onePixel(255, 102, 0, 51)), {0.5f, 0, 1});
  ASSERT_EQ(picture.channels, 3);
  EXPECT_FLOAT_EQ(picture.values[0], 0.6f);
  EXPECT_FLOAT_EQ(picture.values[1], 0.08f);
  EXPECT_FLOAT_EQ(picture.values[2], 0.8f);
}

TEST(Colour, StraightBytesUndoPremultiply) {
  for (int alpha = 1; alpha < 256; ++alpha) {
    const Image8 image = onePixel(7, 200, 255, static_cast<std::uint8_t>(alpha));
    EXPECT_EQ(straightBytes(premultiply(image)).values, image.values);
  }
  EXPECT_EQ(straightBytes(premultiply(onePixel(9, 9, 9, 0))).values, onePixel(0, 0, 0, 0).values);
}

TEST(Colour, BytesAreRoundedAndClamped) {
  Image image(6, 1, 1);
  image.values = {-0.1f, 0.49f / 255, 0.51f / 255, 1, 7, std::numeric_limits<float>::quiet_NaN()};
  EXPECT_EQ(toBytes(image).values, (std::vector<std::uint8_t>{0, 0, 1, 255, 255, 0}));
}

TEST(Colour, BytesComeBack) {
  Image8 image(256, 1, 1);
  for (int i = 0; i < 256; ++i) image.values[i] = static_cast<std::uint8_t>(i);
  EXPECT_EQ(toBytes(toFloat(image)).values, image.values);
}

TEST(Colour, PsnrByHand) {
  // An error of 0.1 everywhere: 20 dB. In one of four values: 6.02 dB more.
  const Image a(2, 2, 1, 0.5f);
  EXPECT_NEAR(psnr(a, Image(2, 2, 1, 0.6f)), 20, 1e-5);
  Image b = a;
  b.at(1, 0, 0) = 0.4f;
  EXPECT_NEAR(psnr(a, b), 26.0206, 1e-4);
  EXPECT_TRUE(std::isinf(psnr(a, a)));
  expectError<std::invalid_argument>([&] { psnr(a, Image(2, 1, 1)); }, "2 x 2 x 1", "2 x 1 x 1");
  expectError<std::invalid_argument>([] { psnr(Image(), Image()); }, "psnr");
}

}  // namespace
}  // namespace nerf_pose_refiner
