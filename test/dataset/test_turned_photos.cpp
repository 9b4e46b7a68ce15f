// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "dataset/dataset.h"
#include "support/expect_error.h"
#include "support/jpeg_files.h"
#include "support/temporary_folder.h"

// A phone that was held upright stores its photos lying, with a note that they are to be turned.

namespace nerf_pose_refiner {
namespace {

/// A photo of 32 x 16 pixels whose left half is white, to be turned a quarter clockwise.
class TurnedPhotos : public testing::Test {
 protected:
  Dataset load(int width, int height, int orientation) const {
    cv::Mat photo(16, 32, CV_8UC3, cv::Scalar::all(0));
    photo.colRange(0, 16) = cv::Scalar::all(255);
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", photo, bytes);
    folder.write("a.jpg", withSegment(std::string(bytes.begin(), bytes.end()),
                                      exifSegment(orientation, true)));
    nlohmann::json scene = {{"fl_x", 20}, {"w", width}, {"h", height}};
    scene["frames"].push_back(
        {{"file_path", "a.jpg"},
         {"transform_matrix", {{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}, {0, 0, 0, 1}}}});
    return loadDataset(folder.write("transforms.json", scene.dump()));
  }

  TemporaryFolder folder;
};

TEST_F(TurnedPhotos, AreTurnedIfThePosesAreOfTurnedPhotos) {
  const Dataset dataset = load(16, 32, 6);
  const Image8& photo = *dataset.views[0].rgba;
  ASSERT_EQ(photo.width, 16);
  ASSERT_EQ(photo.height, 32);
  EXPECT_GT(photo.at(8, 2, 0), 250) << "the left half is on top";
  EXPECT_LT(photo.at(8, 29, 0), 5);
  EXPECT_EQ(dataset.views[0].camera.width, 16);
}

TEST_F(TurnedPhotos, AreLeftAloneIfThePosesAreOfStoredPhotos) {
  const Dataset dataset = load(32, 16, 6);
  EXPECT_EQ(dataset.views[0].rgba->width, 32);
  EXPECT_GT(dataset.views[0].rgba->at(2, 8, 0), 250);
}

TEST_F(TurnedPhotos, WithoutANoteTheSizesDoNotFit) {
  expectError<std::runtime_error>([this] { load(16, 32, 1); }, "a.jpg", "16 x 32", "32 x 16",
                                  "turned");
  expectError<std::runtime_error>([this] { load(64, 32, 6); }, "64 x 32", "32 x 16", "scale it");
}

}  // namespace
}  // namespace nerf_pose_refiner
