// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/bag_sequence.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <iterator>
#include <set>
#include <stdexcept>
#include <utility>

#include "ros/bag/bag_images.h"
#include "ros/bag/read_message.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"

namespace nerf_pose_refiner {
namespace {

// Poses of the topic with the truth are looked up as TF is, under a unique name.
constexpr char kTruthFrame[] = "nerf_pose_refiner/recorded_truth";
constexpr double kKeepAll_s = 1e8;
// Reasons are counted, so TF's own words, in which times differ from image to image, do not do.
constexpr char kNoPlace[] = "TF does not know its place";

geometry_msgs::TransformStamped transformOf(const std_msgs::Header& header,
                                            const geometry_msgs::Pose& pose) {
  geometry_msgs::PoseStamped stamped;
  stamped.header = header;
  stamped.pose = pose;
  return toTransform(stamped, kTruthFrame);
}

geometry_msgs::TransformStamped truthOf(const rosbag::MessageInstance& message) {
  geometry_msgs::TransformStamped transform;
  if (const auto pose = readMessage<geometry_msgs::PoseStamped>(message)) {
    transform = transformOf(pose->header, pose->pose);
  } else if (const auto wide = readMessage<geometry_msgs::PoseWithCovarianceStamped>(message)) {
    transform = transformOf(wide->header, wide->pose.pose);
  } else if (const auto direct = readMessage<geometry_msgs::TransformStamped>(message)) {
    transform = *direct;
    transform.child_frame_id = kTruthFrame;
  }
  transform.header.frame_id = withoutSlash(transform.header.frame_id);
  return transform;
}

}  // namespace

BagSequence::BagSequence(const std::string& path, const BagTopics& topics)
    : path_(path), topics_(topics), transforms_(ros::Duration(kKeepAll_s)) {
  try {
    bag_.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& e) {
    throw std::runtime_error("cannot read the bag '" + path + "': " + e.what());
  }
  completeTopics();
  requireTopics();
  image_view_ = std::make_unique<rosbag::View>(bag_, rosbag::TopicQuery(topics_.image));
  for (const rosbag::MessageInstance& message : *image_view_) images_.push_back(message);
  readTransforms();
  readCameraInfos();
  readMasks();
  readCompanions();
  readInitialPoses();
  readTruth();
}

/// Whether a topic was named as that of depth or of a further camera.
bool BagSequence::isOfOtherCamera(const std::string& topic) const {
  const std::vector<std::string>& cameras = topics_.cameras;
  return topic == topics_.depth || std::count(cameras.begin(), cameras.end(), topic) > 0;
}

std::string BagSequence::theOnlyImageTopic() {
  std::set<std::string> found;
  rosbag::View view(bag_);
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (isImage(connection->datatype) && !isOfOtherCamera(connection->topic)) {
      found.insert(connection->topic);
    }
  }
  if (found.empty()) throw std::runtime_error("the bag '" + path_ + "' holds no images");
  std::string all;
  for (const std::string& topic : found) all += (all.empty() ? "" : ", ") + topic;
  if (found.size() > 1) {
    const std::string frame = frameOfTruth();
    for (auto topic = found.begin(); topic != found.end();) {
      rosbag::View images(bag_, rosbag::TopicQuery(*topic));
      const bool fits =
          images.size() > 0 && withoutSlash(headerOf(*images.begin()).frame_id) == frame;
      topic = fits ? std::next(topic) : found.erase(topic);
    }
  }
  if (found.size() != 1) {
    throw std::runtime_error("the bag '" + path_ +
                             "' holds images of several topics, name one: " + all);
  }
  return *found.begin();
}

/// In which the true poses are stated; empty: there are none.
std::string BagSequence::frameOfTruth() {
  if (!topics_.truth.empty()) {
    rosbag::View poses(bag_, rosbag::TopicQuery(topics_.truth));
    return poses.size() > 0 ? truthOf(*poses.begin()).header.frame_id : "";
  }
  rosbag::View view(bag_, rosbag::TopicQuery(std::vector<std::string>{"/tf", "/tf_static"}));
  for (const rosbag::MessageInstance& message : view) {
    const auto transforms = readMessage<tf2_msgs::TFMessage>(message);
    if (!transforms) continue;
    for (const geometry_msgs::TransformStamped& transform : transforms->transforms) {
      if (withoutSlash(transform.child_frame_id) == withoutSlash(topics_.truth_frame)) {
        return withoutSlash(transform.header.frame_id);
      }
    }
  }
  return "";
}

void BagSequence::completeTopics() {
  if (topics_.truth.empty() == topics_.truth_frame.empty()) {
    throw std::invalid_argument("name a topic or a TF frame with the true pose, one of them");
  }
  if (topics_.image.empty()) topics_.image = theOnlyImageTopic();
  if (topics_.camera_info.empty()) {
    topics_.camera_info = siblingInfo(topics_.image);
  }
}

void BagSequence::requireTopics() {
  const auto isInfo = [](const std::string& type) { return type == "sensor_msgs/CameraInfo"; };
  const auto isPose = [](const std::string& type) {
    return type == "geometry_msgs/PoseStamped" || type == "geometry_msgs/PoseWithCovarianceStamped";
  };
  const auto isTruth = [&](const std::string& type) {
    return isPose(type) || type == "geometry_msgs/TransformStamped";
  };
  requireTopic(topics_.image, isImage);
  requireTopic(topics_.camera_info, isInfo);
  requireTopic(topics_.mask, isImage);
  requireTopic(topics_.depth, isImage);
  for (const std::string& camera : topics_.cameras) requireTopic(camera, isImage);
  requireTopic(topics_.initial_pose, isPose);
  requireTopic(topics_.truth, isTruth);
}

void BagSequence::requireTopic(const std::string& topic,
                               const std::function<bool(const std::string&)>& is_of_type) const {
  if (topic.empty()) return;
  rosbag::View view(bag_, rosbag::TopicQuery(topic));
  if (view.size() == 0) {
    throw std::runtime_error("the bag '" + path_ + "' holds nothing on " + topic);
  }
  const std::string& type = view.getConnections().front()->datatype;
  if (!is_of_type(type)) throw std::runtime_error(topic + " in '" + path_ + "' is of type " + type);
}

void BagSequence::readTransforms() {
  for (const char* topic : {"/tf", "/tf_static"}) {
    rosbag::View view(bag_, rosbag::TopicQuery(topic));
    for (const rosbag::MessageInstance& message : view) {
      const auto transforms = readMessage<tf2_msgs::TFMessage>(message);
      if (!transforms) continue;
      for (geometry_msgs::TransformStamped transform : transforms->transforms) {
        transform.header.frame_id = withoutSlash(transform.header.frame_id);
        transform.child_frame_id = withoutSlash(transform.child_frame_id);
        transforms_.setTransform(transform, path_, std::string(topic) == "/tf_static");
      }
    }
  }
}

void BagSequence::readCameraInfos() {
  rosbag::View view(bag_, rosbag::TopicQuery(topics_.camera_info));
  for (const rosbag::MessageInstance& message : view) {
    const auto info = readMessage<sensor_msgs::CameraInfo>(message);
    if (info) infos_[info->header.stamp] = info;
  }
}

void BagSequence::readMasks() {
  if (topics_.mask.empty()) return;
  mask_view_ = std::make_unique<rosbag::View>(bag_, rosbag::TopicQuery(topics_.mask));
  for (const rosbag::MessageInstance& message : *mask_view_) {
    masks_.emplace(headerOf(message).stamp, message);
  }
}

void BagSequence::readCompanions() {
  using Kind = BagCompanion::Kind;
  if (!topics_.depth.empty()) {
    depth_.emplace(bag_, topics_.depth, Kind::kDepth, topics_.depth_tolerance_s);
  }
  for (const std::string& topic : topics_.cameras) {
    cameras_.emplace_back(bag_, topic, Kind::kColour, topics_.cameras_tolerance_s);
  }
}

void BagSequence::addDepth(BagFrame* frame) const {
  if (!depth_) return;
  const ros::Time stamp = frame->image->header.stamp;
  frame->depth = depth_->nearest(frame->index, stamp);
  frame->T_C_D = placeOf(&frame->depth, *frame->image, stamp);
}

void BagSequence::addSideViews(BagFrame* frame) const {
  for (const BagCompanion& camera : cameras_) {
    BagSideView view;
    static_cast<Companion&>(view) = camera.nearest(frame->index, frame->image->header.stamp);
    if (view.image) view.T_C_V = placeOf(&view, *frame->image, view.image->header.stamp);
    frame->side_views.push_back(std::move(view));
  }
}

/// A companion's camera in an image's at a time [m]. Where TF does not know it, as where it ends
/// before the last image, the companion is left out.
Pose BagSequence::placeOf(Companion* companion, const sensor_msgs::Image& image,
                          const ros::Time& stamp) const {
  if (!companion->image) return {};
  const std::string& camera = companion->image->header.frame_id;
  if (camera == image.header.frame_id) return {};
  try {
    return fromMessage(transforms_.lookupTransform(image.header.frame_id, camera, stamp).transform);
  } catch (const tf2::TransformException&) {
    companion->image = nullptr;
    companion->why_none = kNoPlace;
    return {};
  }
}

std::optional<Pose> BagSequence::cameraInFixed(const std::string& camera_frame,
                                               const ros::Time& stamp) const {
  if (topics_.fixed_frame.empty()) return std::nullopt;
  try {
    return fromMessage(
        transforms_.lookupTransform(withoutSlash(topics_.fixed_frame), camera_frame, stamp)
            .transform);
  } catch (const tf2::TransformException&) {
    return std::nullopt;
  }
}

void BagSequence::readInitialPoses() {
  if (topics_.initial_pose.empty()) return;
  rosbag::View view(bag_, rosbag::TopicQuery(topics_.initial_pose));
  for (const rosbag::MessageInstance& message : view) {
    TimedPose start;
    try {
      if (const auto pose = readMessage<geometry_msgs::PoseStamped>(message)) {
        start = initialPoseFrom(*pose);
      } else if (const auto wide = readMessage<geometry_msgs::PoseWithCovarianceStamped>(message)) {
        start = initialPoseFrom(*wide);
      }
    } catch (const InputError& e) {  // of the bag, not of the caller
      throw std::runtime_error(topics_.initial_pose + " in '" + path_ + "': " + e.what());
    }
    if (start.stamp_ns == 0) start.stamp_ns = toNanoseconds(message.getTime());
    initial_poses_[toTime(start.stamp_ns)] = start;
  }
}

void BagSequence::readTruth() {
  if (topics_.truth.empty()) return;
  rosbag::View view(bag_, rosbag::TopicQuery(topics_.truth));
  for (const rosbag::MessageInstance& message : view) {
    const geometry_msgs::TransformStamped transform = truthOf(message);
    if (!transforms_.setTransform(transform, path_)) {
      throw std::runtime_error(topics_.truth + " in '" + path_ + "': the pose " +
                               std::to_string(truth_stamps_.size()) + " makes no sense");
    }
    truth_stamps_.push_back(transform.header.stamp);
  }
  std::sort(truth_stamps_.begin(), truth_stamps_.end());
}

BagFrame BagSequence::frame(int index) const {
  BagFrame frame;
  frame.index = index;
  try {
    frame.image = decodeImage(images_.at(index), sensor_msgs::image_encodings::RGB8);
  } catch (const std::exception& e) {
    throw std::runtime_error(topics_.image + ", frame " + std::to_string(index) + ": " + e.what());
  }
  const ros::Time stamp = frame.image->header.stamp;
  frame.image->header.frame_id = withoutSlash(frame.image->header.frame_id);
  const auto info = infos_.size() == 1 ? infos_.begin() : infos_.find(stamp);
  if (info == infos_.end()) {
    throw std::runtime_error(topics_.camera_info + ": nothing with the stamp of " +
                             frameText(index, stamp));
  }
  frame.info = info->second;
  const auto mask = masks_.find(stamp);
  if (mask != masks_.end()) {
    try {
      frame.mask = decodeImage(mask->second, sensor_msgs::image_encodings::MONO8);
    } catch (const std::exception& e) {
      throw std::runtime_error(topics_.mask + ", " + frameText(index, stamp) + ": " + e.what());
    }
  }
  addDepth(&frame);
  addSideViews(&frame);
  return frame;
}

Pose BagSequence::truth(const std::string& camera_frame, const ros::Time& stamp) const {
  if (!topics_.truth.empty()) {
    const auto next = std::lower_bound(truth_stamps_.begin(), truth_stamps_.end(), stamp);
    const bool exact = next != truth_stamps_.end() && *next == stamp;
    const bool between = next != truth_stamps_.begin() && next != truth_stamps_.end();
    if (!exact && !(between && (*next - *(next - 1)).toSec() <= topics_.truth_gap_s)) {
      throw std::runtime_error(topics_.truth + " says nothing of this time");
    }
  }
  const std::string frame = topics_.truth.empty() ? topics_.truth_frame : kTruthFrame;
  try {
    return fromMessage(transforms_.lookupTransform(camera_frame, frame, stamp).transform);
  } catch (const tf2::TransformException& e) {
    throw std::runtime_error(std::string("no true pose: ") + e.what());
  }
}

std::optional<Pose> BagSequence::initialPose(const std::string& camera_frame,
                                             const ros::Time& stamp, double max_age_s) const {
  auto next = initial_poses_.upper_bound(stamp);
  if (next == initial_poses_.begin()) return std::nullopt;
  --next;
  if ((stamp - next->first).toSec() > max_age_s) return std::nullopt;
  const TimedPose& start = next->second;
  const std::string& fixed = topics_.fixed_frame.empty() ? start.frame_id : topics_.fixed_frame;
  try {
    const geometry_msgs::TransformStamped T_C_P =
        transforms_.lookupTransform(camera_frame, stamp, start.frame_id, next->first, fixed);
    return fromMessage(T_C_P.transform) * start.T_P_U;
  } catch (const tf2::TransformException& e) {
    throw std::runtime_error(std::string("no way to the initial pose: ") + e.what());
  }
}

}  // namespace nerf_pose_refiner
