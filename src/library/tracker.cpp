// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/tracker.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "backend/backend.h"
#include "math/angle.h"
#include "math/require.h"
#include "tracking/object_tracker.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {
namespace {

const char kCameraFrame[] = "camera";  // the only frame

TrackerSettings settingsOf(const TrackerOptions& options) {
  require(options.search_rotation_rad > 0 && options.search_rotation_rad <= M_PI,
          "search_rotation_rad", options.search_rotation_rad, "above 0 and at most pi");
  require(options.search_translation > 0 && options.search_translation <= 100, "search_translation",
          options.search_translation, "above 0 and at most 100");
  TrackerSettings settings;
  settings.initial.rotation_deg = kDegreesPerRad * options.search_rotation_rad;
  settings.initial.translation = options.search_translation;
  settings.initial.refiner.seed = settings.tracking.refiner.seed = options.seed;
  settings.tracking.refiner.keyframes.real_time = options.real_time;
  settings.rules.trust_score = options.trust_score;
  settings.rules.min_score = options.min_score;
  settings.rules.max_failures = options.max_failures;
  settings.rules.predict = options.predict;
  settings.rules.recover_s = options.recover_s;
  settings.window.views = options.window;
  settings.rules.initial_pose_policy = InitialPosePolicy::kAlways;
  return settings;
}

}  // namespace

struct Tracker::Parts {
  ObjectTracker tracker;
};

Tracker::Tracker(std::shared_ptr<Backend> backend, const Object& object,
                 const TrackerOptions& options) {
  if (!backend) throw std::invalid_argument("Tracker: the backend is null");
  parts_.reset(new Parts{
      ObjectTracker(std::move(backend), ObjectInside::field(object), settingsOf(options))});
}

Tracker::~Tracker() = default;
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;

void Tracker::setInitialPose(const Pose& T_C_O) {
  if (!T_C_O.isFinite() || !T_C_O.isRigid()) {
    throw std::invalid_argument("Tracker: the initial pose is not a rigid transform");
  }
  TimedPose pose;
  pose.T_P_U = T_C_O;
  pose.frame_id = kCameraFrame;
  parts_->tracker.reset();
  parts_->tracker.offer(pose);
}

TrackResult Tracker::track(const Observation& observation, std::int64_t stamp_ns,
                           const CancellationToken& cancellation) {
  observation.validate();
  const TrackOutcome outcome = parts_->tracker.track(
      {{kCameraFrame, stamp_ns}, [&](bool) { return observation; }, cancellation.child()});
  cancellation.check();
  if (outcome.refined && outcome.reason == TrackReason::kInternal) {
    throw std::runtime_error(outcome.message);
  }
  TrackResult result;
  result.processed = outcome.refined;
  result.found = outcome.found;
  result.state = outcome.state;
  result.reason = outcome.reason;
  result.message = outcome.message;
  result.trusted = outcome.trusted;
  result.T_C_O = outcome.T_C_O_m;
  result.covariance = outcome.covariance;
  result.score = outcome.score;
  result.visible_fraction = outcome.refinement.visible_fraction;
  result.depth = outcome.refinement.depth;
  result.side_views = outcome.refinement.side_views;
  result.seconds = outcome.refinement.seconds;
  return result;
}

void Tracker::reset() { parts_->tracker.reset(); }

}  // namespace nerf_pose_refiner
