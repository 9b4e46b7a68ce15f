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
      depth_(parameters.depth),
      clock_(std::move(clock)),
      tf_(std::make_shared<TfBridge>(*transforms, parameters.frames)),
      input_(parameters.image_is_rectified),
      cameras_(parameters.cameras),
      camera_names_(cameras_.names()),
      beside_(camera_names_.size(), SideInput{CameraInput(parameters.cameras.are_rectified)}),
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

/// A companion's camera in the image's, at their times [m].
Pose MessageTracker::placeOf(const Companion& companion, const ImageStamp& at,
                             bool* was_placed) const {
  const ImageStamp of_companion = imageStampOf(companion.image->header);
  TimedPose camera;
  camera.frame_id = of_companion.camera_frame;
  camera.stamp_ns = of_companion.stamp_ns;
  // A transform that was missing before is not waited for: images would come late for nothing.
  CancellationToken impatient;
  if (!*was_placed) impatient.requestCancel();
  *was_placed = false;
  const Pose T_C_D = tf_->inCamera(camera, at, impatient);
  *was_placed = true;
  return T_C_D;
}

/// Null: there is none, or it cannot be used, and why.
std::shared_ptr<const DepthImage> MessageTracker::depthOf(const CameraFrame& frame,
                                                          const ImageStamp& at,
                                                          std::string* why_not) {
  *why_not = frame.depth.why_none;
  if (!frame.depth.image) return nullptr;
  try {
    return depthFromMessage(frame.depth, placeOf(frame.depth, at, &depth_was_placed_), depth_);
  } catch (const InputError& e) {
    *why_not = e.what();
    return nullptr;
  }
}

/// Empty: it cannot be used, and why.
std::optional<SideView> MessageTracker::sideView(const CameraFrame& frame, std::size_t i,
                                                 const ImageStamp& at, std::string* why_not) {
  const Companion& companion = frame.beside[i];
  *why_not = companion.why_none;
  if (!companion.image) return std::nullopt;
  try {
    SideView view;
    view.T_C_V = placeOf(companion, at, &beside_[i].was_placed);
    view.position_dev_m = cameras_.position_dev_m;
    view.rotation_dev_rad = cameras_.rotation_dev_deg * kDegree;
    view.observation = std::make_shared<const Observation>(
        beside_[i].input.observe(companion.image, *companion.info));
    return view;
  } catch (const InputError& e) {
    *why_not = e.what();
    return std::nullopt;
  }
}

std::optional<FrameResult> MessageTracker::process(const CameraFrame& frame) {
  TrackerImage image;
  image.at = imageStampOf(frame.image->header);
  image.clock_jumps = frame.clock_jumps;
  std::optional<Pose> T_W_C;
  std::string no_transform, no_depth, no_views;
  std::vector<std::size_t> looked_at;  // of the further cameras
  image.observe = [&](bool use_mask) {
    // Looked up now: when the refinement is done, the buffer may have forgotten.
    try {
      T_W_C = tf_->cameraInOutput(image.at, image.cancel);
    } catch (const InputError& e) {
      no_transform = e.what();
    }
    ImageMasks masks = frame.masks;
    if (!use_mask) masks.object = nullptr;
    Observation observation = input_.observe(frame.image, *frame.info, masks);
    observation.depth = depthOf(frame, image.at, &no_depth);
    for (std::size_t i = 0; i < beside_.size() && i < frame.beside.size(); ++i) {
      std::string why_not;
      if (auto view = sideView(frame, i, image.at, &why_not)) observation.beside.push_back(*view);
      if (!why_not.empty())
        no_views += (no_views.empty() ? "" : "; ") + camera_names_[i] + ": " + why_not;
      if (why_not.empty()) looked_at.push_back(i);
    }
    return observation;
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
  depthToMessage(track.refinement.depth, no_depth, &result.status);
  result.status.cameras = track.found ? 1 : 0;
  for (std::size_t i = 0; i < track.refinement.beside.size() && i < looked_at.size(); ++i) {
    const SideViewReport& view = track.refinement.beside[i];
    result.status.cameras += view.used;
    if (view.used) continue;
    no_views += (no_views.empty() ? "" : "; ") + camera_names_[looked_at[i]] + ": " + view.message;
  }
  result.status.cameras_message = no_views;
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
  if (moving_.lock() != result->track.field) {  // its frame may be another one
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
