// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/message_tracker.h"

#include <utility>

#include "math/angle.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"

namespace nerf_pose_refiner {

MessageTracker::MessageTracker(const PoseRefinerParameters& parameters,
                               std::unique_ptr<ObjectSearch> search, tf2::BufferCore* transforms,
                               Report report, Clock clock)
    : image_is_rectified_(parameters.image_is_rectified),
      others_are_rectified_(parameters.cameras.are_rectified),
      depth_(parameters.depth),
      output_in_camera_(parameters.frames.output_frame.empty()),
      clock_(std::move(clock)),
      tf_(std::make_shared<TfBridge>(*transforms, parameters.frames)),
      input_(parameters, tf_),
      tracker_(std::move(search), parameters.tracker,
               {tf_, [this] { return toNanoseconds(clock_()); },
                [report = std::move(report)](const TrackStatus& status) {
                  report(toMessage(status));
                }}) {}

std::optional<std::string> MessageTracker::refusal(const sensor_msgs::Image& image,
                                                   const sensor_msgs::CameraInfo& info,
                                                   std::size_t camera) {
  try {
    const bool is_rectified = camera == 0 ? image_is_rectified_ : others_are_rectified_;
    if (camera == 0 && isDepthImage(image)) {
      checkDepthImage(image, info, depth_);
    } else {
      checkImage(image, cameraFromMessage(info, is_rectified).camera);
    }
    tracker_.imageArrived();
    return std::nullopt;
  } catch (const InputError& e) {
    tracker_.imageRefused(e.reason(), e.what());
    return e.what();
  }
}

/// Where poses of a camera are published: in the frame of `image`, though another camera leads.
std::string MessageTracker::outputFrame(const std::string& camera_frame) const {
  if (output_in_camera_ && !first_frame_.empty()) return first_frame_;
  return tf_->outputFrame(camera_frame);
}

/// The camera in that frame. @throws InputError if TF does not say it in time.
Pose MessageTracker::cameraInOutput(const ImageStamp& at,
                                    const CancellationToken& cancellation) const {
  if (!output_in_camera_ || first_frame_.empty()) return tf_->cameraInOutput(at, cancellation);
  TimedPose camera;
  camera.frame_id = at.camera_frame;
  camera.stamp_ns = at.stamp_ns;
  return tf_->inCamera(camera, {first_frame_, at.stamp_ns}, cancellation);
}

std::optional<FrameResult> MessageTracker::process(const CameraFrame& frame) {
  TrackerImage image;
  image.at = imageStampOf(frame.image->header);
  image.clock_jumps = frame.clock_jumps;
  std::optional<Pose> T_W_C;
  std::string no_transform;
  if (frame.camera == 0) first_frame_ = image.at.camera_frame;
  image.observe = [&](bool use_mask) {
    // Looked up now: when the refinement is done, the buffer may have forgotten.
    try {
      T_W_C = cameraInOutput(image.at, image.cancel);
    } catch (const InputError& e) {
      no_transform = e.what();
    }
    return input_.observe(frame, image.at, use_mask, image.cancel);
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
  input_.report(frame, track, &result.status);
  if (track.trusted) remember(frame, track);
  if (track.found) result.views = input_.placed(frame, track);
  if (T_W_C && track.found) place(*T_W_C, &result);
  return result;
}

/// Keeps what the cameras saw, for their calibration.
void MessageTracker::remember(const CameraFrame& frame, const TrackOutcome& track) {
  if (frame.side_views.empty()) return;
  const FieldMetadata& object = track.field->metadata;
  const RigSighting seen = input_.sightings(frame, track);
  std::lock_guard<std::mutex> lock(sightings_mutex_);
  if (sighted_.lock() != track.field) sightings_.clear();
  sighted_ = track.field;
  sightings_.add(seen, input_.places(), object.metres_per_unit * object.diameter);
}

CameraCalibration MessageTracker::calibrate(std::size_t camera, const CalibrationSettings& settings,
                                            Pose* stated) const {
  std::lock_guard<std::mutex> lock(sightings_mutex_);
  if (sightings_.size() == 0) {
    CameraCalibration nothing;
    nothing.message = "no two cameras have seen the object at once";
    return nothing;
  }
  *stated = sightings_.places().at(camera);
  return sightings_.calibrate(camera, settings);
}

/// @param T_W_C the camera in ~output_frame [m].
void MessageTracker::place(const Pose& T_W_C, FrameResult* result) {
  const TrackOutcome& track = result->track;
  const FieldMetadata& object = track.field->metadata;
  std_msgs::Header header = toHeader(track.image);
  header.frame_id = outputFrame(track.image.camera_frame);
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
  const bool is_other = moving_.lock() != result->track.field;  // its frame may be another one
  if (is_other || result->track.refinement.is_turned) {
    velocity_.reset();
    moving_ = result->track.field;
  }
  const geometry_msgs::PoseWithCovariance& pose = result->pose->pose;
  const std::optional<Velocity> velocity = velocity_.add(
      result->track.image.stamp_ns, fromMessage(pose.pose), fromMessage(pose.covariance));
  if (!velocity) return;
  const double newest_s = input_.newestAfter_s(result->track);
  if (newest_s > 0) moveOn(newest_s, *velocity, result);
  result->twist.emplace();
  result->twist->header = result->pose->header;
  result->twist->twist = toMessage(*velocity);
}

/// Moves the pose on to the stamp of the newest image that took part in it.
void MessageTracker::moveOn(double seconds, const Velocity& velocity, FrameResult* result) const {
  geometry_msgs::PoseWithCovarianceStamped& message = *result->pose;
  Pose pose = fromMessage(message.pose.pose);
  pose.t += seconds * velocity.linear;
  pose.R = nearestRotation(expSO3(Eigen::Vector3d(seconds * velocity.angular)) * pose.R);
  message.pose.pose = toMessage(pose);
  message.header.stamp += ros::Duration(seconds);
  message.pose.covariance = toMessage(
      Matrix6(fromMessage(message.pose.covariance) + seconds * seconds * velocity.covariance));
}

}  // namespace nerf_pose_refiner
