// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/pose_service.h"

#include <future>
#include <limits>
#include <utility>

#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

/// A track of one image, whatever the age of its initial pose.
TrackerSettings settingsForOneImage(TrackerSettings settings) {
  settings.rules.once = true;
  settings.rules.initial_pose_max_age_s = std::numeric_limits<double>::infinity();
  return settings;
}

/// An estimate as it is for the camera at an image's time. @param T_C_U the same pose there [m].
TimedPose seenFrom(const ImageStamp& image, const TimedPose& estimate, const Pose& T_C_U) {
  TimedPose seen = {T_C_U, image.camera_frame, image.stamp_ns, false, estimate.covariance};
  if (seen.covariance && T_C_U.R != estimate.T_P_U.R) {
    seen.covariance = rotated(*estimate.covariance, T_C_U.R * estimate.T_P_U.R.transpose());
  }
  return seen;
}

}  // namespace

PoseService::PoseService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
                         FindObject find_object, MakeSearch make_search,
                         tf2::BufferCore& transforms)
    : make_search_(std::move(make_search)),
      service_(nodes, parameters, std::move(find_object), transforms) {
  service_.serve<RefinePose::Request, RefinePose::Response>(
      topics::kRefine, [this](const RefinePose::Request& request, const ImageCall& call,
                              RefinePose::Response* response) { refine(request, call, response); });
}

/// @throws InputError for what cannot be used.
void PoseService::refine(const RefinePose::Request& request, const ImageCall& call,
                         RefinePose::Response* response) {
  const TrackerSettings settings = settingsForOneImage(call.parameters.tracker);
  const TimedPose given = initialPoseFrom(request.initial);
  ImageOfCall image = service_.imageOf(request, call);
  ObjectTracker tracker(make_search_(settings), settings);
  std::future<void> in_use = tracker.offerModel(call.object);
  tracker.applyModels();
  in_use.get();
  tracker.offer(seenFrom(image.at, given,
                         service_.transforms().inCamera(given, image.at, call.cancellation)));
  const TrackOutcome result = tracker.track(
      {image.at, [&](bool) { return std::move(image.observation); }, call.cancellation});

  response->success = result.trusted;
  response->reason = toMessage(result.reason);
  response->message = result.message;
  response->score = static_cast<float>(result.score);
  response->pose.header = image.header;
  if (!result.found) return;
  const FieldMetadata& object = call.object->metadata;
  response->pose.pose = toMessage(result.refinement, image.T_W_C, object);
  response->hypotheses = toMessage(result.refinement.hypotheses, image.T_W_C, object).hypotheses;
}

}  // namespace nerf_pose_refiner
