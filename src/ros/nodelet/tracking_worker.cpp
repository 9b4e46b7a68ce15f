// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/tracking_worker.h"

#include <ros/console.h>

#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "ros/conversions/status.h"

namespace nerf_pose_refiner {
namespace {

/// Without images, the worker looks for other work at this interval: a model that was loaded, a
/// clock that has advanced.
constexpr std::chrono::milliseconds kTick(100);

}  // namespace

TrackingWorker::TrackingWorker(const PoseRefinerParameters& parameters,
                               std::unique_ptr<ObjectSearch> search, tf2::BufferCore* transforms,
                               const Outputs& outputs)
    : outputs_(outputs),
      class_id_(parameters.detections.class_id),
      tracker_(parameters, std::move(search), transforms,
               [this](const RefinementStatus& status) { report(status); }),
      pairing_(
          parameters.tracker.mask_mode, parameters.mask_timeout_s,
          [this](CameraFrame frame) { mailbox_.put(std::move(frame)); }, parameters.usesBoxes()),
      first_side_view_(parameters.depth.use ? 1 : 0),
      lead_(1 + parameters.cameras.names().size(), parameters.cameras.timeout_s) {
  if (parameters.depth.use) {
    const DepthSettings& depth = parameters.depth;
    addPairing({depth.tolerance_s, depth.timeout_s, depth.timeout_s, "depth image"},
               [](CameraFrame* frame) { return &frame->depth; });
  }
  const CameraSettings& cameras = parameters.cameras;
  const std::size_t count = cameras.names().size();
  for (std::size_t i = 0; i < count; ++i) {
    addPairing({cameras.tolerance_s, cameras.timeout_s, cameras.wait_s, "image"},
               [i, count](CameraFrame* frame) {
                 frame->side_views.resize(count);
                 return frame->camera == i + 1 ? nullptr : &frame->side_views[i];
               });
  }
  thread_ = std::thread([this] { work(); });
}

void TrackingWorker::addPairing(const CompanionPairing::Settings& settings,
                                CompanionPairing::Slot slot) {
  const std::size_t next = companions_.size();
  companions_.push_back(std::make_unique<CompanionPairing>(
      settings, std::move(slot),
      [this, next](CameraFrame frame) { pairUp(std::move(frame), next); }));
}

/// Hands a frame that has the companions from a number on to where it gets the others.
void TrackingWorker::pairUp(CameraFrame frame, std::size_t companion) {
  const ros::WallTime now = ros::WallTime::now();
  if (companion > 0) {
    companions_[companion - 1]->add(std::move(frame), now);
  } else {
    pairing_.add(frame, now);
  }
}

TrackingWorker::~TrackingWorker() {
  stopping_ = true;
  tracker().stop();
  mailbox_.wake();
  thread_.join();
}

void TrackingWorker::addImage(const sensor_msgs::ImageConstPtr& image,
                              const sensor_msgs::CameraInfoConstPtr& info) {
  CameraFrame frame;
  frame.image = image;
  frame.info = info;
  frame.arrival = ros::WallTime::now();
  lead_.leads(0, frame.arrival);
  addFrame(std::move(frame));
}

/// Begins to track in an image of the camera that leads.
void TrackingWorker::addFrame(CameraFrame frame) {
  frame.clock_jumps = tracker().readClock();
  outputs_.diagnostics->imageArrived(frame.image->header.stamp);
  if (const auto reason = tracker_.refusal(*frame.image, *frame.info, frame.camera)) {
    if (refusals_.passes()) ROS_ERROR("image: %s", reason->c_str());
    outputs_.diagnostics->count(&ImageCounts::refused);
    wake();
    return;
  }
  pairUp(std::move(frame), companions_.size());
}

void TrackingWorker::addMask(const sensor_msgs::ImageConstPtr& mask) {
  pairing_.addMask(mask, ros::WallTime::now());
}

void TrackingWorker::addIgnoreMask(const sensor_msgs::ImageConstPtr& mask) {
  pairing_.addIgnoreMask(mask, ros::WallTime::now());
}

void TrackingWorker::addDetections(const DetectionArray& detections) {
  pairing_.addBoxes(std::make_shared<const StampedBoxes>(boxesOf(detections, class_id_)),
                    ros::WallTime::now());
}

void TrackingWorker::addDepth(const Companion& depth) {
  companions_.front()->addCompanion(depth, ros::WallTime::now());
}

void TrackingWorker::addSideView(std::size_t camera, const Companion& image) {
  const ros::WallTime now = ros::WallTime::now();
  companions_.at(first_side_view_ + camera)->addCompanion(image, now);
  if (!lead_.leads(camera + 1, now)) return;
  CameraFrame frame;
  frame.image = image.image;
  frame.info = image.info;
  frame.arrival = now;
  frame.camera = camera + 1;
  addFrame(std::move(frame));
}

void TrackingWorker::work() {
  while (!stopping_) outputs_.diagnostics->guard("refinement", [this] { workOnce(); });
}

void TrackingWorker::workOnce() {
  tracker().applyModels();
  const std::optional<CameraFrame> frame = mailbox_.take(kTick);
  for (const auto& companion : companions_) companion->tick(ros::WallTime::now());
  pairing_.tick(ros::WallTime::now());
  tracker().readClock();
  if (!frame) {
    tracker().reportChange({"", toNanoseconds(ros::Time::now())});
  } else if (const std::optional<FrameResult> result = tracker_.process(*frame)) {
    publish(*result);
  } else {
    outputs_.diagnostics->count(&ImageCounts::skipped);
  }
}

void TrackingWorker::publish(const FrameResult& result) {
  outputs_.results->publish(result);
  if (result.pose) outputs_.diagnostics->posePublished(result.pose->header.stamp);
  report(result.status);
  if (!result.track.found) return;
  OverlayPublisher::Job overlays;
  overlays.field = result.track.field;
  for (const PlacedView& view : result.views) {
    overlays.views.push_back({view.header, view.observation, view.T_O_V, {view.camera}});
  }
  if (result.views.front().camera != 0) {  // it leads in place of `image`
    overlays.views.front().cameras.push_back(0);
  }
  outputs_.overlay->draw(std::move(overlays));
}

void TrackingWorker::report(const RefinementStatus& status) {
  RefinementStatus full = status;
  full.dropped = mailbox_.dropped() + pairing_.dropped();
  for (const auto& companion : companions_) full.dropped += companion->dropped();
  pairing_.setTracking(full.state == RefinementStatus::STATE_TRACKING);
  outputs_.diagnostics->statusIs(full);
  outputs_.results->publish(full);
  if (full.message.empty()) return;
  // A normal state is not a warning and is logged rarely.
  if (full.reason == RefinementStatus::REASON_NONE ||
      full.reason == RefinementStatus::REASON_PRIOR_IGNORED) {
    if (states_.passes()) ROS_INFO("%s", full.message.c_str());
  } else if (warnings_.passes()) {
    ROS_WARN("%s", full.message.c_str());
  }
}

}  // namespace nerf_pose_refiner
