// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/bag_sequence.h"

#include <cv_bridge/cv_bridge.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_msgs/TFMessage.h>

#include <stdexcept>
#include <string>

#include "ros/conversions/camera_input.h"
#include "ros/conversions/pose_conversions.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

const ros::Time kFirst(1700000000, 123456789);

/// Time of an image, a tenth of a second apart.
ros::Time stampOf(int index) { return kFirst + ros::Duration(0.1 * index); }

template <typename Message>
Message stamped(Message message, const ros::Time& stamp, const std::string& frame) {
  message.header.stamp = stamp;
  message.header.frame_id = frame;
  return message;
}

/// An image of one colour, whose red is its number.
cv_bridge::CvImage picture(int index) {
  cv_bridge::CvImage image;
  image.encoding = sensor_msgs::image_encodings::RGB8;
  image.image = cv::Mat(6, 8, CV_8UC3, cv::Scalar(10 * index, 100, 200));
  return image;
}

geometry_msgs::PoseStamped poseAt(double x, double z, const ros::Time& stamp,
                                  const std::string& frame) {
  geometry_msgs::PoseStamped pose;
  pose.pose = toMessage(Pose(Eigen::Matrix3d::Identity(), {x, 0, z}));
  return stamped(pose, stamp, frame);
}

/// Three images with camera_info; the object stands at x = 1 of the world, the camera moves along x
/// by 0.1 an image; the true pose is said in the world's frame twice a second.
class RecordedBag : public testing::Test {
 protected:
  RecordedBag() : path(folder.file("recorded.bag")), bag(path, rosbag::bagmode::Write) {
    topics.truth = "/truth";
    for (int i = 0; i < 3; ++i) writeCamera(i, stampOf(i));
    bag.write("/truth", kFirst, poseAt(1, 2, stampOf(0), "world"));
    bag.write("/truth", kFirst, poseAt(1, 2, stampOf(2), "world"));
  }

  void writeCamera(int index, const ros::Time& stamp) {
    const Camera camera = {8, 6, 5, 5, 3.5, 2.5};
    bag.write("/camera/camera_info", stamp, stamped(toMessage(camera), stamp, "optical"));
    tf2_msgs::TFMessage transforms;
    transforms.transforms.push_back(toTransform(poseAt(0.1 * index, 0, stamp, "world"), "optical"));
    bag.write("/tf", stamp, transforms);
  }

  void writeImages(int count = 3) {
    for (int i = 0; i < count; ++i) {
      bag.write("/camera/image_raw", stampOf(i),
                stamped(*picture(i).toImageMsg(), stampOf(i), "optical"));
    }
  }

  BagSequence open() {
    bag.close();
    return BagSequence(path, topics);
  }

  TemporaryFolder folder;
  std::string path;
  rosbag::Bag bag;
  BagTopics topics;
};

TEST_F(RecordedBag, FindsWhatBelongsToAnImage) {
  writeImages();
  const BagSequence sequence = open();
  EXPECT_EQ(sequence.topics().image, "/camera/image_raw");
  EXPECT_EQ(sequence.topics().camera_info, "/camera/camera_info");
  ASSERT_EQ(sequence.size(), 3);
  const BagFrame frame = sequence.frame(2);
  EXPECT_EQ(frame.image->data[0], 20);
  EXPECT_EQ(frame.image->header.stamp, stampOf(2));
  EXPECT_EQ(frame.info->header.stamp, stampOf(2));
  EXPECT_FALSE(frame.mask);
}

TEST_F(RecordedBag, DecodesCompressedImagesAndMasks) {
  for (int i = 0; i < 3; ++i) {
    const auto compressed = picture(i).toCompressedImageMsg(cv_bridge::PNG);
    bag.write("/camera/image/compressed", stampOf(i), stamped(*compressed, stampOf(i), "/optical"));
  }
  cv_bridge::CvImage mask;
  mask.encoding = sensor_msgs::image_encodings::MONO8;
  mask.image = cv::Mat(6, 8, CV_8UC1, cv::Scalar(255));
  bag.write("/mask", stampOf(1), stamped(*mask.toImageMsg(), stampOf(1), "optical"));
  topics.image = "/camera/image/compressed";
  topics.mask = "/mask";
  const BagSequence sequence = open();
  EXPECT_EQ(sequence.topics().camera_info, "/camera/camera_info");
  const BagFrame frame = sequence.frame(1);
  EXPECT_EQ(frame.image->encoding, "rgb8");
  EXPECT_EQ(frame.image->header.frame_id, "optical");
  EXPECT_EQ(frame.image->data[0], 10);
  EXPECT_EQ(frame.image->data[2], 200);
  ASSERT_TRUE(frame.mask);
  EXPECT_EQ(frame.mask->data[0], 255);
  EXPECT_FALSE(sequence.frame(2).mask);
}

TEST_F(RecordedBag, TheTruthIsInterpolatedInItsOwnFrame) {
  writeImages();
  const BagSequence sequence = open();
  // Seen from the camera at x = 0.1.
  EXPECT_NEAR(sequence.truth("optical", stampOf(1)).t.x(), 0.9, 1e-9);
  EXPECT_NEAR(sequence.truth("optical", stampOf(1)).t.z(), 2, 1e-9);
  expectError<std::runtime_error>([&] { sequence.truth("optical", stampOf(3)); }, "/truth");
  expectError<std::runtime_error>([&] { sequence.truth("elsewhere", stampOf(1)); }, "elsewhere");
}

TEST_F(RecordedBag, ALongGapOfTheTruthIsNotBridged) {
  writeImages();
  topics.truth_gap_s = 0.15;
  const BagSequence sequence = open();
  expectError<std::runtime_error>([&] { sequence.truth("optical", stampOf(1)); }, "/truth");
  EXPECT_NEAR(sequence.truth("optical", stampOf(2)).t.x(), 0.8, 1e-9);
}

TEST_F(RecordedBag, TheTruthMayComeFromTf) {
  writeImages();
  tf2_msgs::TFMessage fixed;
  fixed.transforms.push_back(toTransform(poseAt(1, 2, kFirst, "world"), "mug"));
  bag.write("/tf_static", kFirst, fixed);
  topics.truth.clear();
  topics.truth_frame = "mug";
  EXPECT_NEAR(open().truth("optical", stampOf(2)).t.x(), 0.8, 1e-9);
}

TEST_F(RecordedBag, TheNewestInitialPoseCounts) {
  writeImages();
  bag.write("/start", stampOf(0), poseAt(1.5, 2, stampOf(0), "world"));
  bag.write("/start", stampOf(1), poseAt(1.2, 2, stampOf(1), "world"));
  topics.initial_pose = "/start";
  const BagSequence sequence = open();
  // Given in the world, in which the object stands still while the camera moves on.
  EXPECT_NEAR(sequence.initialPose("optical", stampOf(2), 0.5)->t.x(), 1.0, 1e-9);
  EXPECT_NEAR(sequence.initialPose("optical", stampOf(0), 0.5)->t.x(), 1.5, 1e-9);
  EXPECT_FALSE(sequence.initialPose("optical", stampOf(2), 0.05));
  EXPECT_FALSE(sequence.initialPose("optical", stampOf(-1), 0.5));
}

/// What a second camera adds, 0.5 beside the first one of the image 0: at the stamps of the images
/// 0 and 1, 4 ms later.
class BagOfTwoCameras : public RecordedBag {
 protected:
  BagOfTwoCameras() {
    writeImages();
    topics.image = "/camera/image_raw";
    topics.cameras = {"/side/image/compressed"};
    for (int i = 0; i < 2; ++i) {
      const ros::Time stamp = stampOf(i) + ros::Duration(0.004);
      bag.write("/side/image/compressed", stamp,
                stamped(*picture(5 + i).toCompressedImageMsg(cv_bridge::PNG), stamp, "/side"));
    }
    tf2_msgs::TFMessage place;
    place.transforms.push_back(toTransform(poseAt(0.5, 0, kFirst, "world"), "side"));
    bag.write("/tf_static", kFirst, place);
  }

  void writeSideInfo() {
    const Camera camera = {8, 6, 5, 5, 3.5, 2.5};
    bag.write("/side/camera_info", kFirst, stamped(toMessage(camera), kFirst, "side"));
  }
};

TEST_F(BagOfTwoCameras, TheNearestImageComesWithItsPlace) {
  writeSideInfo();
  const BagSequence sequence = open();
  const BagFrame frame = sequence.frame(1);
  ASSERT_EQ(frame.side_views.size(), 1u);
  const BagSideView& view = frame.side_views.front();
  ASSERT_TRUE(view.image) << view.why_none;
  EXPECT_EQ(view.image->encoding, "rgb8");
  EXPECT_EQ(view.image->data[0], 60);
  EXPECT_EQ(view.image->header.frame_id, "side");
  EXPECT_EQ(view.info->header.stamp, kFirst) << "the only one";
  // The first camera is at 0.1, and moves by 0.004 until the second one's image.
  EXPECT_NEAR(view.T_C_V.t.x(), 0.396, 1e-9);
  const BagFrame last = sequence.frame(2);
  EXPECT_FALSE(last.side_views.front().image);
  EXPECT_EQ(last.side_views.front().why_none, "");
}

TEST_F(BagOfTwoCameras, WithoutItsPlaceAnImageIsLeftOut) {
  writeSideInfo();
  const ros::Time late = stampOf(2) + ros::Duration(0.004);  // TF ends before
  bag.write("/side/image/compressed", late,
            stamped(*picture(7).toCompressedImageMsg(cv_bridge::PNG), late, "side"));
  const BagFrame frame = open().frame(2);
  EXPECT_FALSE(frame.side_views.front().image);
  EXPECT_EQ(frame.side_views.front().why_none, "TF does not know its place");
}

TEST_F(RecordedBag, WithoutItsPlaceADepthImageIsLeftOut) {
  writeImages();
  topics.image = "/camera/image_raw";
  topics.depth = "/depth/image";
  cv_bridge::CvImage depth;
  depth.encoding = sensor_msgs::image_encodings::TYPE_16UC1;
  depth.image = cv::Mat(6, 8, CV_16UC1, cv::Scalar(2000));
  for (int i = 0; i < 2; ++i) {
    bag.write("/depth/image", stampOf(i), stamped(*depth.toImageMsg(), stampOf(i), "depth"));
  }
  bag.write("/depth/camera_info", kFirst,
            stamped(toMessage(Camera{8, 6, 5, 5, 3.5, 2.5}), kFirst, "depth"));
  tf2_msgs::TFMessage place;  // of the first image alone
  place.transforms.push_back(toTransform(poseAt(0.5, 0, stampOf(0), "world"), "depth"));
  bag.write("/tf", kFirst, place);
  const BagSequence sequence = open();
  const BagFrame first = sequence.frame(0);
  EXPECT_TRUE(first.depth.image) << first.depth.why_none;
  EXPECT_NEAR(first.T_C_D.t.x(), 0.5, 1e-9);
  const BagFrame second = sequence.frame(1);
  EXPECT_TRUE(second.image);
  EXPECT_FALSE(second.depth.image);
  EXPECT_EQ(second.depth.why_none, "TF does not know its place");
  EXPECT_EQ(sequence.frame(2).depth.why_none, "") << "there is none";
}

TEST_F(BagOfTwoCameras, NamesWhatIsMissing) {
  bag.close();
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "/side/camera_info");
  topics.cameras = {"/truth"};
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "/truth",
                                  "geometry_msgs/PoseStamped");
  topics.cameras = {"/none"};
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "/none");
}

TEST_F(BagOfTwoCameras, TheOnlyImageTopicIsNoFurtherCamera) {
  writeSideInfo();
  topics.image.clear();
  EXPECT_EQ(open().topics().image, "/camera/image_raw");
}

TEST_F(RecordedBag, TheCameraInTheFixedFrame) {
  writeImages();
  topics.fixed_frame = "/world";
  const BagSequence sequence = open();
  EXPECT_NEAR(sequence.cameraInFixed("optical", stampOf(2))->t.x(), 0.2, 1e-9);
  EXPECT_FALSE(sequence.cameraInFixed("optical", stampOf(3)));
  topics.fixed_frame.clear();
  EXPECT_FALSE(BagSequence(path, topics).cameraInFixed("optical", stampOf(2)));
}

TEST_F(RecordedBag, NamesTopicAndFrameOfWhatIsDamaged) {
  auto image = stamped(*picture(0).toCompressedImageMsg(), stampOf(0), "optical");
  image.data.resize(20);
  bag.write("/camera/image/compressed", stampOf(0), image);
  bag.write("/camera/image/compressed", stampOf(9),
            stamped(*picture(9).toCompressedImageMsg(), stampOf(9), "optical"));
  const BagSequence sequence = open();
  expectError<std::runtime_error>([&] { sequence.frame(0); }, "/camera/image/compressed",
                                  "frame 0");
  expectError<std::runtime_error>([&] { sequence.frame(1); }, "/camera/camera_info", "frame 1",
                                  "1700000001.023456789");
}

TEST_F(RecordedBag, NamesTopicsThatAreMissingOrOfAnotherType) {
  writeImages();
  bag.write("/other/image_raw", kFirst, stamped(*picture(0).toImageMsg(), kFirst, "optical"));
  expectError<std::runtime_error>([&] { open(); }, "/camera/image_raw", "/other/image_raw");
  topics.image = "/none";
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "/none");
  topics.image = "/truth";
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "/truth",
                                  "geometry_msgs/PoseStamped");
}

TEST_F(RecordedBag, OfSeveralImagesThoseInTheFrameOfTheTruthCount) {
  writeImages();
  bag.write("/other/image_raw", stampOf(0), stamped(*picture(0).toImageMsg(), stampOf(0), "other"));
  bag.write("/seen", stampOf(0), poseAt(0, 2, stampOf(0), "/optical"));
  tf2_msgs::TFMessage seen;
  seen.transforms.push_back(toTransform(poseAt(0, 2, stampOf(0), "/optical"), "thing"));
  bag.write("/tf", stampOf(0), seen);
  bag.close();
  expectError<std::runtime_error>([&] { BagSequence(path, topics); },
                                  "several topics, name one: /camera/image_raw, /other/image_raw");
  topics.truth = "/seen";
  EXPECT_EQ(BagSequence(path, topics).topics().image, "/camera/image_raw");
  topics.truth.clear();
  topics.truth_frame = "optical";  // in the world: no camera's frame
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "name one");
  topics.truth_frame = "nowhere";
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "name one");
  topics.truth_frame = "thing";
  EXPECT_EQ(BagSequence(path, topics).topics().image, "/camera/image_raw");
}

TEST_F(RecordedBag, WantsOneTruth) {
  writeImages();
  topics.truth_frame = "mug";
  expectError<std::invalid_argument>([&] { open(); }, "true pose");
}

TEST(BagSequence, RefusesWhatIsNoBag) {
  const TemporaryFolder folder;
  BagTopics topics;
  topics.truth_frame = "mug";
  const std::string path = folder.write("no.bag", "#ROSBAG V2.0\nnonsense");
  expectError<std::runtime_error>([&] { BagSequence(path, topics); }, "no.bag");
}

}  // namespace
}  // namespace nerf_pose_refiner
