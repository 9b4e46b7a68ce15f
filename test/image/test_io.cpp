// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/io.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

Image8 pattern(int width, int height, int channels) {
  Image8 image(width, height, channels);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<std::uint8_t>(37 * i + 11);
  }
  return image;
}

void expectEqual(const Image8& a, const Image8& b) {
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.channels, b.channels);
  EXPECT_EQ(a.values, b.values);
}

TEST(ImageIo, PngKeepsEveryByte) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.png");
  for (const int channels : {3, 4}) {
    writePng(pattern(7, 5, channels), path);
    expectEqual(readImage(path), pattern(7, 5, channels));
  }
}

TEST(ImageIo, WritingLeavesTheImageAlone) {
  const TemporaryFolder folder;
  const Image8 image = pattern(7, 5, 3);
  writePng(image, folder.file("a.png"));
  expectEqual(image, pattern(7, 5, 3));
}

TEST(ImageIo, GreyBecomesRgb) {
  const TemporaryFolder folder;
  const std::string path = folder.file("grey.png");
  writePng(pattern(3, 2, 1), path);
  const Image8 image = readImage(path);
  ASSERT_EQ(image.channels, 3);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(image.at(1, 0, c), 48);
}

TEST(ImageIo, SixteenBitsAreRoundedToEight) {
  const TemporaryFolder folder;
  const std::string path = folder.file("deep.png");
  const cv::Mat deep = (cv::Mat_<cv::Vec4w>(1, 2) << cv::Vec4w(65535, 0, 257, 385),
                        cv::Vec4w(128, 129, 40000, 65535));
  ASSERT_TRUE(cv::imwrite(path, deep));
  const Image8 image = readImage(path);  // RGBA; the file was written from BGRA
  ASSERT_EQ(image.channels, 4);
  EXPECT_EQ(image.values, (std::vector<std::uint8_t>{1, 0, 255, 1, 156, 1, 0, 255}));
}

TEST(ImageIo, JpegIsRgb) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.jpg");
  ASSERT_TRUE(cv::imwrite(path, cv::Mat(16, 16, CV_8UC3, cv::Scalar(20, 60, 200))));
  const Image8 image = readImage(path);
  ASSERT_EQ(image.channels, 3);
  EXPECT_NEAR(image.at(8, 8, 0), 200, 3);
  EXPECT_NEAR(image.at(8, 8, 1), 60, 3);
  EXPECT_NEAR(image.at(8, 8, 2), 20, 3);
}

TEST(ImageIo, OrientationTagsTurnNothing) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> jpeg;
  ASSERT_TRUE(cv::imencode(".jpg", cv::Mat(8, 16, CV_8UC3, cv::Scalar(0, 0, 0)), jpeg));
  // An EXIF segment with one entry, orientation 6: "turn a quarter to show it upright".
  const std::string exif(
      "\xff\xe1\x00\x22"
      "Exif\x00\x00II*\x00\x08\x00\x00\x00\x01\x00"
      "\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00\x00\x00\x00\x00",
      36);
  jpeg.insert(jpeg.begin() + 2, exif.begin(), exif.end());
  const std::string path = folder.write("turned.jpg", std::string(jpeg.begin(), jpeg.end()));
  ASSERT_EQ(cv::imread(path).cols, 8);  // the tag is there and OpenCV heeds it
  EXPECT_EQ(readImage(path).width, 16);
  EXPECT_EQ(readMask(path).width, 16);
}

TEST(ImageIo, MaskOfZeroAndOneIsStretched) {
  const TemporaryFolder folder;
  const std::string path = folder.file("mask.png");
  Image8 mask(2, 1, 1);
  mask.values = {0, 1};
  writePng(mask, path);
  EXPECT_EQ(readMask(path).values, (std::vector<std::uint8_t>{0, 255}));
  mask.values = {1, 200};
  writePng(mask, path);
  EXPECT_EQ(readMask(path).values, (std::vector<std::uint8_t>{1, 200}));
}

TEST(ImageIo, ColourMaskIsItsBrightness) {
  const TemporaryFolder folder;
  const std::string path = folder.file("mask.png");
  Image8 mask(2, 1, 3, 255);
  for (int c = 0; c < 3; ++c) mask.at(0, 0, c) = 0;
  writePng(mask, path);
  const Image8 read = readMask(path);
  EXPECT_EQ(read.channels, 1);
  EXPECT_EQ(read.values, (std::vector<std::uint8_t>{0, 255}));
}

TEST(ImageIo, DepthIsMillimetresOfSixteenBits) {
  const TemporaryFolder folder;
  const std::string path = folder.file("depth.png");
  Image depth_m(4, 1, 1);
  depth_m.values = {0, 0.0014f, 1.2345f, 70};
  writeDepthPng(depth_m, path);
  const cv::Mat read = cv::imread(path, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(read.type(), CV_16UC1);
  const std::vector<std::uint16_t> expected = {0, 1, 1234, 65535};  // farther than 65 m saturates
  for (int x = 0; x < 4; ++x) EXPECT_NEAR(read.at<std::uint16_t>(0, x), expected[x], x == 2);
  expectError<std::invalid_argument>([&] { writeDepthPng(Image(2, 2, 3), path); }, "one channel");
}

TEST(ImageIo, DepthIsReadAsItIs) {
  const TemporaryFolder folder;
  const std::string path = folder.file("depth.png");
  const cv::Mat_<std::uint16_t> stored = (cv::Mat_<std::uint16_t>(2, 2) << 0, 1, 1234, 65535);
  ASSERT_TRUE(cv::imwrite(path, stored));
  const ImageOf<std::uint16_t> depth = readDepthPng(path);
  EXPECT_EQ(depth.width, 2);
  EXPECT_EQ(depth.height, 2);
  EXPECT_EQ(depth.channels, 1);
  EXPECT_EQ(depth.values, (std::vector<std::uint16_t>{0, 1, 1234, 65535}));
  for (const int type : {CV_8UC1, CV_16UC3}) {
    ASSERT_TRUE(cv::imwrite(path, cv::Mat(2, 2, type, cv::Scalar(7, 7, 7))));
    expectError<std::runtime_error>([&] { readDepthPng(path); }, "depth.png", "16-bit grey");
  }
  expectError<std::runtime_error>([&] { readDepthPng(path, 3); }, "depth.png", "at most 3");
}

TEST(ImageIo, BadFilesAreNamed) {
  const TemporaryFolder folder;
  const auto expectBad = [](const std::string& path, const std::string& reason) {
    expectError<std::runtime_error>([&] { readImage(path); }, path, reason);
    expectError<std::runtime_error>([&] { readMask(path); }, path, reason);
  };
  expectBad(folder.file("missing.png"), "No such file");
  expectBad(folder.path(), "");
  expectBad(folder.write("empty.png", ""), "empty");
  expectBad(folder.write("text.png", "this is no image"), "not an image");

  const std::string whole = folder.file("whole.png");
  writePng(pattern(64, 64, 3), whole);
  const std::string bytes = readFile(whole);
  expectBad(folder.write("cut.png", bytes.substr(0, bytes.size() / 2)), "damaged");
}

TEST(ImageIo, JpegsThatWereCutOffAreRefused) {
  const TemporaryFolder folder;
  cv::Mat noise(64, 64, CV_8UC3);
  cv::randu(noise, 0, 256);
  std::vector<std::uint8_t> thumbnail, bytes;
  ASSERT_TRUE(cv::imencode(".jpg", noise(cv::Rect(0, 0, 8, 8)), thumbnail));
  for (const bool progressive : {false, true}) {
    ASSERT_TRUE(cv::imencode(
        ".jpg", noise, bytes,
        {cv::IMWRITE_JPEG_PROGRESSIVE, progressive, cv::IMWRITE_JPEG_RST_INTERVAL, 2}));
    // A thumbnail, which has an end of its own, in a segment of the application's.
    std::string text(bytes.begin(), bytes.begin() + 2);
    const std::size_t length = thumbnail.size() + 2;
    text += {'\xff', '\xe1', static_cast<char>(length >> 8), static_cast<char>(length & 255)};
    text.append(thumbnail.begin(), thumbnail.end());
    text.append(bytes.begin() + 2, bytes.end());
    EXPECT_NO_THROW(readImage(folder.write("whole.jpg", text)));
    EXPECT_NO_THROW(readImage(folder.write("more.jpg", text + std::string(100, '\0'))));
    for (const std::size_t size : {text.size() - 1, text.size() - 2, text.size() * 9 / 10}) {
      const std::string path = folder.write("cut.jpg", text.substr(0, size));
      expectError<std::runtime_error>([&] { readImage(path); }, path, "end is missing");
      expectError<std::runtime_error>([&] { readMask(path); }, path, "end is missing");
    }
  }
}

// A PNG of 16000 x 16000 equal pixels has a few hundred kB, and decoded 1 GB.
TEST(ImageIo, LargeImagesAreRefusedBeforeTheyAreDecoded) {
  const TemporaryFolder folder;
  const std::string path = folder.file("huge.png");
  cv::Mat_<std::uint8_t> huge(16000, 16000, std::uint8_t{0});
  ASSERT_TRUE(cv::imwrite(path, huge));
  huge.release();
  EXPECT_EQ(imageSizeOf(path).pixels(), 256000000u);
  rlimit before;
  getrlimit(RLIMIT_AS, &before);
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlimit limited = {pages * 4096 + (std::uint64_t{100} << 20), before.rlim_max};
  setrlimit(RLIMIT_AS, &limited);
  expectError<std::runtime_error>([&] { readImage(path); }, path, "16000 x 16000", "67108864");
  expectError<std::runtime_error>([&] { readMask(path, 1000); }, path, "at most 1000");
  setrlimit(RLIMIT_AS, &before);
}

TEST(ImageIo, SizesAreReadFromHeaders) {
  const TemporaryFolder folder;
  writePng(pattern(7, 5, 4), folder.file("a.png"));
  EXPECT_EQ(imageSizeOf(folder.file("a.png")).width, 7u);
  EXPECT_EQ(imageSizeOf(folder.file("a.png")).height, 5u);
  for (const bool progressive : {false, true}) {
    ASSERT_TRUE(cv::imwrite(folder.file("a.jpg"), cv::Mat3b(5, 300),
                            {cv::IMWRITE_JPEG_PROGRESSIVE, progressive}));
    EXPECT_EQ(imageSizeOf(folder.file("a.jpg")).width, 300u);
    EXPECT_EQ(imageSizeOf(folder.file("a.jpg")).height, 5u);
  }
  const std::string jpeg = readFile(folder.file("a.jpg"));
  for (std::size_t n = 0; n < 150; n += 10) {  // anywhere before the frame's header
    const std::string cut = folder.write("cut.jpg", jpeg.substr(0, n));
    expectError<std::runtime_error>([&] { imageSizeOf(cut); }, cut);
  }
  ASSERT_EQ(mkfifo(folder.file("pipe.png").c_str(), 0600), 0);
  expectError<std::runtime_error>([&] { readImage(folder.file("pipe.png")); }, "pipe.png",
                                  "no regular file");
}

TEST(ImageIo, WritingTellsWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/missing/a.png";
  expectError<std::runtime_error>([&] { writePng(pattern(2, 2, 3), path); }, path, "No such file");
  expectError<std::invalid_argument>([&] { writePng(pattern(2, 2, 2), path); }, "2 channels");
  expectError<std::invalid_argument>([&] { writePng(Image8(), path); }, "0 x 0");
  if (std::filesystem::exists("/dev/full")) {
    expectError<std::runtime_error>([&] { writePng(pattern(2, 2, 3), "/dev/full"); }, "/dev/full",
                                    "No space left");
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
