// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tf2/buffer_core.h>

#include <boost/signals2/connection.hpp>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/pose.h"
#include "ros/conversions/parameters.h"
#include "tracking/transforms.h"

namespace nerf_pose_refiner {

/// Transforms between TF frames, the camera and the object. Waits up to ~tf_timeout_s of wall time
/// for late transforms: never call it from a callback.
class TfBridge : public Transforms {
 public:
  /// @param buffer filled by another thread; must outlive this object.
  TfBridge(tf2::BufferCore& buffer, const FrameSettings& frames);

  /// The camera in ~output_frame (T_W_C, metres) at an image's time.
  /// @throws InputError if TF does not say it in time.
  Pose cameraInOutput(const ImageStamp& image, const CancellationToken& cancellation) const;

  /// The camera in ~fixed_frame at an image's time [m]; nothing: there is no such frame, or TF does
  /// not know it in time.
  std::optional<Pose> cameraInFixed(const ImageStamp& image,
                                    const CancellationToken& cancellation) const;

  /// Between the times of the estimate and the image, the object stands still in ~fixed_frame, or
  /// in the frame of the pose if that is not set.
  /// @throws InputError if TF does not know the transform in time.
  Pose inCamera(const TimedPose& estimate, const ImageStamp& image,
                const CancellationToken& cancellation) const override;

  /// Another camera at the time of its own image, in the camera of an image [m]; in between, it
  /// stands still as above. @throws as inCamera.
  Pose cameraInCamera(const ImageStamp& other, const ImageStamp& image,
                      const CancellationToken& cancellation) const;

  void clear() override { buffer_.clear(); }

  /// The frame in which poses of this camera are published.
  std::string outputFrame(const std::string& camera_frame) const;

 private:
  /// Counts the transforms that the buffer received.
  struct Changes {
    std::mutex mutex;  ///< guards count
    std::condition_variable changed;
    std::uint64_t count = 0;
  };

  using Lookup = std::function<geometry_msgs::TransformStamped()>;
  Pose wait(const std::string& what, const Lookup& lookup,
            const CancellationToken& cancellation) const;

  tf2::BufferCore& buffer_;
  FrameSettings frames_;
  std::shared_ptr<Changes> changes_;  ///< shared with callbacks that may be running
  boost::signals2::scoped_connection listening_;
};

}  // namespace nerf_pose_refiner
