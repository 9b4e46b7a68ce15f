// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2/buffer_core.h>

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nerf_pose_refiner/pose.h"
#include "ros/bag/bag_companion.h"
#include "ros/conversions/depth_input.h"
#include "tracking/timed_pose.h"

namespace nerf_pose_refiner {

/// The topics of a bag that make a sequence. Names are absolute, as in the bag.
struct BagTopics {
  std::string image;  ///< Image or CompressedImage; empty: the only one of the bag, or the only
                      ///< one in the frame in which the true poses are stated
  std::string camera_info;  ///< empty: the image's sibling, as image_transport has it
  std::string mask;         ///< Image or CompressedImage, paired by exact stamp; empty: none
  std::string depth;  ///< Image, 16UC1 or 32FC1 (REP-118), with its own camera_info; empty: none
  double depth_tolerance_s = 0.015;    ///< between the stamps of an image and its depth
  std::vector<std::string> cameras;    ///< Image or CompressedImage of further cameras, with their
                                       ///< own camera_info
  double cameras_tolerance_s = 0.015;  ///< between the stamps of an image and theirs
  std::string initial_pose;            ///< PoseStamped or PoseWithCovarianceStamped; empty: none
  std::string truth;         ///< the same or TransformStamped: the true pose in any TF frame
  std::string truth_frame;   ///< TF frame of the object; alternative to `truth`
  std::string fixed_frame;   ///< where the object stands still, between an initial pose and its
                             ///< image, and for cameraInFixed; empty: the frame of the pose
  double truth_gap_s = 0.2;  ///< longest gap of `truth` that is bridged by interpolation
};

/// An image of a further camera; null: there is none, and why.
struct BagSideView : Companion {
  Pose T_C_V;  ///< its camera in that of the image it belongs to, at its own stamp [m]
};

/// One image of a bag, decoded, with what belongs to it.
struct BagFrame {
  int index = 0;  ///< of the image in the bag, from 0
  sensor_msgs::ImagePtr image;
  sensor_msgs::CameraInfoConstPtr info;
  sensor_msgs::ImagePtr mask;           ///< null: none with this stamp
  Companion depth;                      ///< the nearest in time within the tolerance; null: there
                                        ///< is none, or TF does not know its place
  Pose T_C_D;                           ///< of its camera in the image's [m]
  std::vector<BagSideView> side_views;  ///< as many as BagTopics::cameras
};

/// A recorded sequence of images, read from the bag file: no image is dropped or late, and the TF
/// of the whole bag is known. Not thread-safe.
class BagSequence {
 public:
  /// Reads all but the images. @throws std::runtime_error naming the file and the topic that is
  /// missing, ambiguous or of another type.
  BagSequence(const std::string& path, const BagTopics& topics);

  int size() const { return static_cast<int>(images_.size()); }
  const BagTopics& topics() const { return topics_; }  ///< with the names that were found

  /// @throws std::runtime_error naming topic and frame: an image or mask that cannot be decoded, or
  /// no camera_info with the image's stamp. (A single camera_info in the bag applies to all
  /// images.)
  BagFrame frame(int index) const;

  /// The object's true pose T_C_U [m]. @throws std::runtime_error naming what is missing.
  Pose truth(const std::string& camera_frame, const ros::Time& stamp) const;

  /// The camera in BagTopics::fixed_frame [m]; empty: there is no such frame, or TF does not know.
  std::optional<Pose> cameraInFixed(const std::string& camera_frame, const ros::Time& stamp) const;

  /// The newest recorded initial pose T_C_U [m] that is not newer than a time, nor older by more
  /// than `max_age_s`; empty: there is none.
  /// @throws std::runtime_error if TF cannot transform it.
  std::optional<Pose> initialPose(const std::string& camera_frame, const ros::Time& stamp,
                                  double max_age_s) const;

 private:
  void completeTopics();
  std::string theOnlyImageTopic();
  std::string frameOfTruth();
  bool isOfOtherCamera(const std::string& topic) const;
  void requireTopics();
  void requireTopic(const std::string& topic,
                    const std::function<bool(const std::string&)>& is_of_type) const;
  void readTransforms();
  void readCameraInfos();
  void readMasks();
  void readCompanions();
  void addDepth(BagFrame* frame) const;
  void addSideViews(BagFrame* frame) const;
  Pose placeOf(Companion* companion, const sensor_msgs::Image& image, const ros::Time& stamp) const;
  void readInitialPoses();
  void readTruth();

  std::string path_;
  BagTopics topics_;
  rosbag::Bag bag_;
  std::unique_ptr<rosbag::View> image_view_;     // what images_ refer to
  std::vector<rosbag::MessageInstance> images_;  // in the order of their recording
  std::unique_ptr<rosbag::View> mask_view_;      // what masks_ refer to
  std::map<ros::Time, rosbag::MessageInstance> masks_;
  std::optional<BagCompanion> depth_;
  std::vector<BagCompanion> cameras_;
  std::map<ros::Time, sensor_msgs::CameraInfoConstPtr> infos_;
  std::map<ros::Time, TimedPose> initial_poses_;
  std::vector<ros::Time> truth_stamps_;  // of topics_.truth, sorted
  tf2::BufferCore transforms_;
};

}  // namespace nerf_pose_refiner
