// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/orientation.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "image/image_size.h"
#include "support/expect_error.h"
#include "support/jpeg_files.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

class Orientation : public testing::Test {
 protected:
  int orientationOf(const std::string& content) const {
    return readExifOrientation(InputFile(folder.write("photo", content)));
  }
  TemporaryFolder folder;
};

TEST_F(Orientation, IsReadInBothByteOrders) {
  for (int orientation = 1; orientation <= 8; ++orientation) {
    EXPECT_EQ(orientationOf(jpegHead(exifSegment(orientation, false))), orientation);
    EXPECT_EQ(orientationOf(jpegHead(exifSegment(orientation, true))), orientation);
  }
}

TEST_F(Orientation, IsOneWhereNothingIsSaid) {
  EXPECT_EQ(orientationOf(""), 1);
  EXPECT_EQ(orientationOf("\x89PNG and so on"), 1);
  EXPECT_EQ(orientationOf(jpegHead("")), 1);
  EXPECT_EQ(orientationOf(jpegHead(exifSegment(0, false))), 1);
  EXPECT_EQ(orientationOf(jpegHead(exifSegment(9, false))), 1);
}

TEST_F(Orientation, CutOffDataAreNoHarm) {
  const std::string whole = jpegHead(exifSegment(6, true));
  for (std::size_t n = 0; n < whole.size(); ++n) {
    try {
      EXPECT_LE(orientationOf(whole.substr(0, n)), 8) << n;
    } catch (const std::runtime_error&) {  // a damaged file may be refused
    }
  }
  std::string far = exifSegment(6, true);
  far.replace(14, 4, std::string("\xff\xff\xff\xf0", 4));  // where the directory is
  EXPECT_EQ(orientationOf(jpegHead(far)), 1);
}

/// 1 2 3
/// 4 5 6
Image8 digits() {
  Image8 image(3, 2, 1);
  for (int i = 0; i < 6; ++i) image.values[static_cast<std::size_t>(i)] = std::uint8_t(1 + i);
  return image;
}

TEST(Upright, AllOrientations) {
  const std::vector<std::vector<std::uint8_t>> expected = {
      {1, 2, 3, 4, 5, 6}, {3, 2, 1, 6, 5, 4}, {6, 5, 4, 3, 2, 1}, {4, 5, 6, 1, 2, 3},
      {1, 4, 2, 5, 3, 6}, {4, 1, 5, 2, 6, 3}, {6, 3, 5, 2, 4, 1}, {3, 6, 2, 5, 1, 4}};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const Image8 image = upright(digits(), orientation);
    EXPECT_EQ(image.width, exchangesSides(orientation) ? 2 : 3);
    EXPECT_EQ(image.values, expected[static_cast<std::size_t>(orientation - 1)]) << orientation;
  }
}

TEST_F(Orientation, OtherFormatsAreNamed) {
  const auto refused = [this](const std::string& content, const std::string& name) {
    expectError<std::runtime_error>(
        [&] { readImageSize(InputFile(folder.write("photo", content))); }, name, "convert");
  };
  const std::string zeros(32, '\0');
  refused(std::string("\0\0\0\x18"
                      "ftypheic",
                      12) +
              zeros,
          "HEIC");
  refused(std::string("\0\0\0\x18"
                      "ftypavif",
                      12) +
              zeros,
          "AVIF");
  refused("RIFF1234WEBPVP8 " + zeros, "WebP");
  refused(std::string("II*\0", 4) + zeros, "TIFF");
}

}  // namespace
}  // namespace nerf_pose_refiner
