// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/message_tracker.h"

#include <utility>

#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"

namespace nerf_pose_refiner {

MessageTracker::MessageTracker(const PoseRefinerParameters& parameters,
                               std::unique_ptr<ObjectSearch> search, tf2::BufferCore* transforms,
                               Report report, Clock clock)
    : image_is_rectified_(parameters.image_is_rectified),
      clock_(std::move(clock)),
      tf_(std::make_shared<TfBridge>(*transforms, parameters.frames)),
      input_(parameters.image_is_rectified),
      tracker_(std::move(search), parameters.tracker,
               {tf_, [this] { return toNanoseconds(clock_()); },
                [report = std::move(report)](const TrackStatus& status) {
                  report(toMessage(status));
                }}) {}

std::optional<std::string> MessageTracker::refusal(const sensor_msgs::Image& image,
                                                   const sensor_msgs::CameraInfo& info) {
  try {
    checkImage(image, cameraFromMessage(info, image_is_rectified_).camera);
    tracker_.imageArrived();
    return std::nullopt;
  } catch (const InputError& e) {
    tracker_.imageRefused(e.reason(), e.what());
    return e.what();
  }
}

std::optional<FrameResult> MessageTracker::process(const CameraFrame& frame) {
  TrackerImage image;
  image.at = imageStampOf(frame.image->header);
  image.clock_jumps = frame.clock_jumps;
  std::optional<Pose> T_W_C;
  std::string no_transform;
  image.observe = [&](bool use_mask) {
    // Looked up now: when the refinement is done, the buffer may have forgotten.
    try {
      T_W_C = tf_->cameraInOutput(image.at, image.cancel);
    } catch (const InputError& e) {
      no_transform = e.what();
    }
    ImageMasks masks = frame.masks;
    if (!use_mask) masks.object = nullptr;
    return input_.observe(frame.image, *frame.info, masks);
  };
  FrameResult result;
  result.track = tracker_.process(image);
  if (!result.track.refined) return std::nullopt;
  TrackOutcome& track = result.track;
  const bool nothing_else =
      track.reason == TrackReason::kNone || track.reason == TrackReason::kPriorIgnored;
  if (nothing_else && !no_transform.empty()) {
    track.reason = TrackReason::kNoTransform;
    track.message = no_transform;
  }
  result.status = toMessage(static_cast<const TrackStatus&>(track));
  result.status.score = static_cast<float>(track.refinement.score);
  result.status.visible_fraction = static_cast<float>(track.refinement.visible_fraction);
  result.status.refinement_s = static_cast<float>(track.refinement.seconds);
  result.status.latency_s = static_cast<float>((ros::WallTime::now() - frame.arrival).toSec());
  result.status.image_age_s =
      static_cast<float>(clock_().toSec() - frame.image->header.stamp.toSec());
  if (T_W_C && track.found) place(*T_W_C, &result);
  return result;
}

/// @param T_W_C the camera in ~output_frame [m].
void MessageTracker::place(const Pose& T_W_C, FrameResult* result) {
  const TrackOutcome& track = result->track;
  const FieldMetadata& object = track.field->metadata;
  std_msgs::Header header = toHeader(track.image);
  header.frame_id = tf_->outputFrame(track.image.camera_frame);
  result->hypotheses = toMessage(track.refinement.hypotheses, T_W_C, object);
  result->hypotheses.object = object.name;
  result->hypotheses.header = header;
  if (!track.trusted) return;
  result->pose.emplace();
  result->pose->header = header;
  result->pose->pose = toMessage(track.refinement, T_W_C, object);
  estimateVelocity(result);
}

void MessageTracker::estimateVelocity(FrameResult* result) {
  if (moving_ != result->track.field) {  // its frame may be another one
    velocity_.reset();
    moving_ = result->track.field;
  }
  using Covariance = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  const geometry_msgs::PoseWithCovariance& pose = result->pose->pose;
  const std::optional<Velocity> velocity =
      velocity_.add(result->track.image.stamp_ns, fromMessage(pose.pose),
                    Eigen::Map<const Covariance>(pose.covariance.data()));
  if (!velocity) return;
  result->twist.emplace();
  result->twist->header = result->pose->header;
  result->twist->twist = toMessage(*velocity);
}

}  // namespace nerf_pose_refiner
