// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/tf_bridge.h"

#include <tf2/exceptions.h>

#include <algorithm>
#include <chrono>

#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"

namespace nerf_pose_refiner {

TfBridge::TfBridge(tf2::BufferCore& buffer, const FrameSettings& frames)
    : buffer_(buffer),
      frames_(frames),
      changes_(std::make_shared<Changes>()),
      listening_(buffer._addTransformsChangedListener([changes = changes_] {
        {
          std::lock_guard<std::mutex> lock(changes->mutex);
          ++changes->count;
        }
        changes->changed.notify_all();
      })) {}

Pose TfBridge::wait(const std::string& what, const Lookup& lookup,
                    const CancellationToken& cancellation) const {
  // tf2_ros::Buffer waits by the ROS clock, which stands still in a simulation that is paused.
  using std::chrono::steady_clock;
  const auto deadline =
      steady_clock::now() + std::chrono::duration_cast<steady_clock::duration>(
                                std::chrono::duration<double>(frames_.tf_timeout_s));
  constexpr std::chrono::milliseconds kCancellationInterval(20);  // between checks for cancellation
  std::unique_lock<std::mutex> lock(changes_->mutex);
  while (true) {
    const std::uint64_t seen = changes_->count;
    lock.unlock();  // the buffer calls back under a lock of its own
    try {
      return fromMessage(lookup().transform);
    } catch (const tf2::TransformException& e) {
      if (cancellation.cancelRequested() || steady_clock::now() >= deadline) {
        throw InputError(TrackReason::kNoTransform, what + ": " + e.what());
      }
    }
    lock.lock();
    changes_->changed.wait_until(lock,
                                 std::min(deadline, steady_clock::now() + kCancellationInterval),
                                 [&] { return changes_->count != seen; });
  }
}

Pose TfBridge::cameraInCamera(const ImageStamp& other, const ImageStamp& image,
                              const CancellationToken& cancellation) const {
  TimedPose camera;
  camera.frame_id = other.camera_frame;
  camera.stamp_ns = other.stamp_ns;
  return inCamera(camera, image, cancellation);
}

std::string TfBridge::outputFrame(const std::string& camera_frame) const {
  return frames_.output_frame.empty() ? camera_frame : frames_.output_frame;
}

Pose TfBridge::cameraInOutput(const ImageStamp& image,
                              const CancellationToken& cancellation) const {
  const std::string output_frame = outputFrame(image.camera_frame);
  if (output_frame == image.camera_frame) return Pose();
  return wait(
      "no transform from " + image.camera_frame + " to " + output_frame,
      [&] {
        return buffer_.lookupTransform(output_frame, image.camera_frame, toTime(image.stamp_ns));
      },
      cancellation);
}

std::optional<Pose> TfBridge::cameraInFixed(const ImageStamp& image,
                                            const CancellationToken& cancellation) const {
  if (frames_.fixed_frame.empty()) return std::nullopt;
  try {
    return wait(
        "no transform to " + frames_.fixed_frame,
        [&] {
          return buffer_.lookupTransform(frames_.fixed_frame, image.camera_frame,
                                         toTime(image.stamp_ns));
        },
        cancellation);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

Pose TfBridge::inCamera(const TimedPose& estimate, const ImageStamp& image,
                        const CancellationToken& cancellation) const {
  const std::int64_t since_ns = estimate.stamp_ns == 0 ? image.stamp_ns : estimate.stamp_ns;
  const bool same_frame = estimate.frame_id == image.camera_frame;
  if (same_frame && (frames_.fixed_frame.empty() || since_ns == image.stamp_ns)) {
    return estimate.T_P_U;
  }
  const std::string& fixed = frames_.fixed_frame.empty() ? estimate.frame_id : frames_.fixed_frame;
  const Pose T_C_P = wait(
      "no transform from " + estimate.frame_id + " to " + image.camera_frame + " through " + fixed,
      [&] {
        return buffer_.lookupTransform(image.camera_frame, toTime(image.stamp_ns),
                                       estimate.frame_id, toTime(since_ns), fixed);
      },
      cancellation);
  return T_C_P * estimate.T_P_U;
}

}  // namespace nerf_pose_refiner
