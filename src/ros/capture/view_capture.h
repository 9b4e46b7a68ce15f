// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/CaptureStatus.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2/buffer_core.h>

#include <Eigen/Core>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "dataset/dataset_writer.h"
#include "dataset/view_selection.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/param_reader.h"

namespace nerf_pose_refiner {

/// Parameters of the node capture_views. Meanings and advice: config/capture_views.yaml.
struct CaptureParameters {
  std::string name;                    ///< of the object, and of its dataset
  std::string dataset_root;            ///< the folder <name> is created below it
  std::string object_reference_frame;  ///< TF frame that is rigid to the object
  bool use_masks = false;              ///< from the topic `mask`
  bool has_box = false;                ///< of the object, in object_reference_frame [m]
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> object_centre;  ///< default: the box's, or the frame's origin
  bool image_is_rectified = false;
  std::string image_transport = "raw";
  int min_views = 20;         ///< a dataset is not finished with fewer
  int max_views = 0;          ///< the capture then ends by itself; 0: only on ~finish
  double min_coverage = 0.5;  ///< fraction of the directions around the object, 0..1
  double tf_timeout_s = 0.5;  ///< ROS time that an image waits for TF
  ViewSelectionSettings selection;
  std::string register_service;  ///< empty: the dataset is only written

  static CaptureParameters read(ParamReader* reader);

  /// @throws std::invalid_argument naming the parameter that is missing or out of range.
  void validate() const;
  Eigen::Vector3d centre() const;
};

/// An image with what belongs to it.
struct CapturedImage {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
  sensor_msgs::ImageConstPtr mask;  ///< null: none is used
};

/// Chooses images of a moving camera, or of a moved object, and writes them as a metric dataset
/// with poses from TF. CaptureNode is its ROS interface. Not thread-safe.
class ViewCapture {
 public:
  /// @param transforms outlives this object.
  ViewCapture(const CaptureParameters& parameters, const tf2::BufferCore& transforms);

  /// Begins a dataset. @param info of the camera, which must not change.
  /// @throws std::exception if a capture is running, the camera is not supported, the folder
  /// exists, or TF does not connect ~object_reference_frame and the camera.
  void start(const sensor_msgs::CameraInfo& info);

  /// Queues an image for `process`. If the queue is full, the oldest image is dropped.
  void add(const CapturedImage& image);

  /// Processes the queued images whose poses are known. An image that cannot be used or written is
  /// counted as refused, with the reason. @param now on the clock of the images.
  /// @return whether there are ~max_views views and the dataset can be finished.
  bool process(const ros::Time& now);

  /// Writes the dataset; `status().dataset` is its name, with a number at its end if the wanted one
  /// was taken meanwhile. @throws std::runtime_error why not: too few views, directions without
  /// any, which it names, or a disk that is full. The capture then goes on.
  void finish();

  /// Ends the capture and removes what it wrote.
  void abort();

  bool capturing() const { return writer_ != nullptr; }

  /// Counts and coverage; state and message are the node's.
  CaptureStatus status() const;

 private:
  enum class Lookup { kFound, kWait, kNever };
  Lookup lookUp(const CapturedImage& image, const ros::Time& now, Pose* T_O_C);
  void judge(const CapturedImage& image, const Pose& T_O_C);
  std::string incompleteness() const;

  CaptureParameters parameters_;
  const tf2::BufferCore& transforms_;
  std::deque<CapturedImage> waiting_;
  std::unique_ptr<DatasetWriter> writer_;  ///< null: nothing is captured
  std::optional<ViewSelection> selection_;
  CameraModel camera_;
  CaptureStatus counts_;  ///< its message: the last problem with an image
};

}  // namespace nerf_pose_refiner
