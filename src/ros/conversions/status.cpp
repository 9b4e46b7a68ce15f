// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/status.h"

#include <map>

#include "ros/conversions/pose_conversions.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

const std::map<TrackState, std::uint8_t> kStates = {
    {TrackState::kNoModel, Status::STATE_NO_MODEL},
    {TrackState::kLoading, Status::STATE_LOADING},
    {TrackState::kWaiting, Status::STATE_WAITING},
    {TrackState::kRefining, Status::STATE_REFINING},
    {TrackState::kTracking, Status::STATE_TRACKING},
    {TrackState::kLost, Status::STATE_LOST},
    {TrackState::kError, Status::STATE_ERROR},
};

const std::map<TrackReason, std::uint8_t> kReasons = {
    {TrackReason::kNone, Status::REASON_NONE},
    {TrackReason::kNoOverlap, Status::REASON_NO_OVERLAP},
    {TrackReason::kDiverged, Status::REASON_DIVERGED},
    {TrackReason::kLowScore, Status::REASON_LOW_SCORE},
    {TrackReason::kCancelled, Status::REASON_STOPPED},
    {TrackReason::kPriorNotFinite, Status::REASON_PRIOR_NOT_FINITE},
    {TrackReason::kPriorNotUnit, Status::REASON_PRIOR_NOT_UNIT},
    {TrackReason::kPriorBadCovariance, Status::REASON_PRIOR_BAD_COVARIANCE},
    {TrackReason::kPriorNoFrame, Status::REASON_PRIOR_NO_FRAME},
    {TrackReason::kPriorTooOld, Status::REASON_PRIOR_TOO_OLD},
    {TrackReason::kPriorInFuture, Status::REASON_PRIOR_IN_FUTURE},
    {TrackReason::kPriorIgnored, Status::REASON_PRIOR_IGNORED},
    {TrackReason::kUncalibrated, Status::REASON_UNCALIBRATED},
    {TrackReason::kBadCameraInfo, Status::REASON_BAD_CAMERA_INFO},
    {TrackReason::kBadImage, Status::REASON_BAD_IMAGE},
    {TrackReason::kNoImages, Status::REASON_NO_IMAGES},
    {TrackReason::kClockJumped, Status::REASON_CLOCK_JUMPED},
    {TrackReason::kNoTransform, Status::REASON_NO_TRANSFORM},
    {TrackReason::kBadMask, Status::REASON_BAD_MASK},
    {TrackReason::kModelUnreadable, Status::REASON_MODEL_UNREADABLE},
    {TrackReason::kModelNoScale, Status::REASON_MODEL_NO_SCALE},
    {TrackReason::kReset, Status::REASON_RESET},
    {TrackReason::kDisabled, Status::REASON_DISABLED},
    {TrackReason::kInternal, Status::REASON_INTERNAL},
};

}  // namespace

std::uint8_t toMessage(TrackState state) { return kStates.at(state); }

std::uint8_t toMessage(TrackReason reason) { return kReasons.at(reason); }

TrackReason reasonOf(const ModelError& error) {
  return error.reason() == ModelError::Reason::kNoScale ? TrackReason::kModelNoScale
                                                        : TrackReason::kModelUnreadable;
}

std::int64_t toNanoseconds(const ros::Time& time) {
  return static_cast<std::int64_t>(time.toNSec());
}

ros::Time toTime(std::int64_t stamp_ns) {
  return ros::Time().fromNSec(static_cast<std::uint64_t>(stamp_ns));
}

ImageStamp imageStampOf(const std_msgs::Header& header) {
  return {withoutSlash(header.frame_id), toNanoseconds(header.stamp)};
}

std_msgs::Header toHeader(const ImageStamp& image) {
  std_msgs::Header header;
  header.frame_id = image.camera_frame;
  header.stamp = toTime(image.stamp_ns);
  return header;
}

RefinementStatus toMessage(const TrackStatus& status) {
  RefinementStatus message;
  message.header = toHeader(status.image);
  message.object = status.object;
  message.state = toMessage(status.state);
  message.reason = toMessage(status.reason);
  message.message = status.message;
  message.processed = status.processed;
  return message;
}

void depthToMessage(const DepthReport& depth, const std::string& why_none,
                    RefinementStatus* message) {
  message->depth = depth.use == DepthUse::kUsed      ? Status::DEPTH_USED
                   : depth.use == DepthUse::kRefused ? Status::DEPTH_REFUSED
                                                     : Status::DEPTH_NONE;
  message->depth_message = depth.use == DepthUse::kNone ? why_none : depth.message;
  message->depth_agreement = static_cast<float>(depth.agreeing);
  message->depth_bias_m = static_cast<float>(depth.bias_m);
}

}  // namespace nerf_pose_refiner
