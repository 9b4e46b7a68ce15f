// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kWidth = 64, kHeight = 48;

Image8 someBytes(int channels) {
  Image8 image(kWidth, kHeight, channels);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<std::uint8_t>(i * 37 % 251);
  }
  return image;
}

CameraPixels pixelsOf(const Image8& image, PixelFormat format,
                      std::shared_ptr<const Undistorter> undistorter = nullptr) {
  const auto owner = std::make_shared<const Image8>(image);
  return CameraPixels(viewOf(*owner), format, owner, std::move(undistorter));
}

TEST(CameraPixels, ReadsEveryFormatAsRgb) {
  const struct {
    PixelFormat format;
    int channels;
    int order[3];  // channels that hold red, green and blue
  } formats[] = {{PixelFormat::kGrey, 1, {0, 0, 0}},
                 {PixelFormat::kRgb, 3, {0, 1, 2}},
                 {PixelFormat::kBgr, 3, {2, 1, 0}},
                 {PixelFormat::kRgba, 4, {0, 1, 2}},
                 {PixelFormat::kBgra, 4, {2, 1, 0}}};
  for (const auto& of : formats) {
    const Image8 bytes = someBytes(of.channels);
    const Image8 part = pixelsOf(bytes, of.format).read({5, 7, 11, 13});
    ASSERT_EQ(part.width, 11);
    ASSERT_EQ(part.height, 13);
    ASSERT_EQ(part.channels, 3);
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(part.at(0, 0, c), bytes.at(5, 7, of.order[c]));
      EXPECT_EQ(part.at(10, 12, c), bytes.at(15, 19, of.order[c]));
    }
  }
}

TEST(CameraPixels, APartIsAsInTheWholeUndistortedImage) {
  const Camera camera = {kWidth, kHeight, 60, 58, 31, 24};
  const Distortion distortion = {{-0.25, 0.06, 0.002, -0.003}};
  const auto undistorter = std::make_shared<const Undistorter>(camera, distortion);
  const Image8 bytes = someBytes(3);
  const Image8 whole = undistorter->undistort(bytes);
  const CameraPixels pixels = pixelsOf(bytes, PixelFormat::kRgb, undistorter);
  for (const PixelWindow& window : {PixelWindow{0, 0, kWidth, kHeight}, PixelWindow{17, 9, 21, 5},
                                    PixelWindow{kWidth - 1, kHeight - 1, 1, 1}}) {
    const Image8 part = pixels.read(window);
    for (int y = 0; y < window.height; ++y) {
      for (int x = 0; x < window.width; ++x) {
        for (int c = 0; c < 3; ++c) {
          ASSERT_EQ(part.at(x, y, c), whole.at(window.x + x, window.y + y, c)) << x << ", " << y;
        }
      }
    }
  }
}

TEST(CameraPixels, RowsMayBeFurtherApartThanTheyAreLong) {
  const auto owner = std::make_shared<const Image8>(someBytes(3));
  Image8View view = viewOf(*owner);
  view.width = 40;  // the left part of the image
  const Image8 part = CameraPixels(view, PixelFormat::kRgb, owner).read({30, 20, 10, 2});
  EXPECT_EQ(part.at(9, 1, 2), owner->at(39, 21, 2));
}

TEST(CameraPixels, KeepsItsBytes) {
  auto owner = std::make_shared<const Image8>(someBytes(3));
  const std::weak_ptr<const Image8> watch = owner;
  auto pixels = std::make_unique<CameraPixels>(viewOf(*owner), PixelFormat::kRgb, owner);
  owner.reset();
  EXPECT_FALSE(watch.expired());
  pixels.reset();
  EXPECT_TRUE(watch.expired());
}

TEST(CameraPixels, RefusesWhatDoesNotFit) {
  EXPECT_THROW(pixelsOf(someBytes(3), PixelFormat::kGrey), std::invalid_argument);
  EXPECT_THROW(pixelsOf(Image8(), PixelFormat::kRgb), std::invalid_argument);
  const auto other =
      std::make_shared<const Undistorter>(Camera{20, 20, 10, 10, 9, 9}, Distortion());
  EXPECT_THROW(pixelsOf(someBytes(3), PixelFormat::kRgb, other), std::invalid_argument);
  const CameraPixels pixels = pixelsOf(someBytes(3), PixelFormat::kRgb);
  for (const PixelWindow& window :
       {PixelWindow{-1, 0, 4, 4}, PixelWindow{0, 0, kWidth + 1, 4}, PixelWindow{0, kHeight, 1, 1},
        PixelWindow{0, 0, -1, 4}, PixelWindow{2147483647, 0, 2, 2}}) {
    EXPECT_THROW(pixels.read(window), std::invalid_argument);
  }
  EXPECT_TRUE(pixels.read({3, 3, 0, 5}).empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
