// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/frame_input.h"

#include <algorithm>
#include <utility>

#include "math/angle.h"
#include "ros/conversions/depth_input.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {

FrameInput::FrameInput(const PoseRefinerParameters& parameters,
                       std::shared_ptr<TfBridge> transforms)
    : depth_(parameters.depth),
      cameras_(parameters.cameras),
      keeps_views_(parameters.tracker.window.views > 0),
      tf_(std::move(transforms)),
      names_(cameras_.names()),
      input_(parameters.image_is_rectified, depth_),
      side_inputs_(names_.size(), SideInput{CameraInput(parameters.cameras.are_rectified)}),
      places_(1 + names_.size()) {}

/// @param camera 0: `image`; others as in CameraFrame::camera.
std::string FrameInput::nameOf(std::size_t camera) const {
  return camera == 0 ? topics::kImage : names_.at(camera - 1);
}

void FrameInput::note(std::string* notes, std::size_t camera, const std::string& why) const {
  *notes += (notes->empty() ? "" : "; ") + nameOf(camera) + ": " + why;
}

/// A companion's camera in the image's, at the time of `at` [m].
Pose FrameInput::placeOf(const Companion& companion, const ImageStamp& at,
                         const CancellationToken& cancellation, bool* was_placed) const {
  // A transform that was missing before is not waited for: images would come late for nothing.
  const CancellationToken waiting = cancellation.child();
  if (!*was_placed) waiting.requestCancel();
  *was_placed = false;
  const Pose T_C_D = tf_->cameraInCamera(imageStampOf(companion.image->header), at, waiting);
  *was_placed = true;
  return T_C_D;
}

/// Null: there is none, or it cannot be used; `no_depth_` says why.
std::shared_ptr<const DepthImage> FrameInput::depthOf(const CameraFrame& frame,
                                                      const ImageStamp& at,
                                                      const CancellationToken& cancellation) {
  no_depth_ = frame.depth.why_none;
  if (!frame.depth.image) return nullptr;
  try {
    const Pose T_C_D = placeOf(frame.depth, at, cancellation, &depth_was_placed_);
    return depthFromMessage(frame.depth.image, *frame.depth.info, T_C_D, depth_);
  } catch (const InputError& e) {
    no_depth_ = e.what();
    return nullptr;
  }
}

/// Empty: it cannot be used, and why.
std::optional<SideView> FrameInput::sideView(const CameraFrame& frame, std::size_t i,
                                             const ImageStamp& at,
                                             const CancellationToken& cancellation,
                                             std::string* why_not) {
  const Companion& companion = frame.side_views[i];
  *why_not = companion.why_none;
  if (!companion.image) return std::nullopt;
  try {
    SideView view;
    const std::int64_t stamp_ns = toNanoseconds(companion.image->header.stamp);
    // Both at the time of this image: the tracker knows how the object moves in between.
    view.T_C_V =
        placeOf(companion, {at.camera_frame, stamp_ns}, cancellation, &side_inputs_[i].was_placed);
    if (frame.camera == 0) places_[i + 1] = view.T_C_V;
    view.after_s = 1e-9 * static_cast<double>(stamp_ns - at.stamp_ns);
    view.camera = static_cast<int>(i) + 1;
    view.position_dev_m = cameras_.position_dev_m;
    view.rotation_dev_rad = cameras_.rotation_dev_deg * kDegree;
    view.observation = std::make_shared<const Observation>(
        side_inputs_[i].input.observe(companion.image, *companion.info));
    return view;
  } catch (const InputError& e) {
    *why_not = e.what();
    return std::nullopt;
  }
}

Observation FrameInput::observe(const CameraFrame& frame, const ImageStamp& at, bool use_mask,
                                const CancellationToken& cancellation) {
  no_depth_.clear();
  no_views_.clear();
  looked_at_.clear();
  after_s_.clear();
  ImageMasks masks = frame.masks;
  if (!use_mask) masks.object = nullptr;
  if (frame.camera != 0) masks.boxes.clear();  // they are of the first camera's image
  CameraInput& input = frame.camera == 0 ? input_ : side_inputs_.at(frame.camera - 1).input;
  Observation observation = input.observe(frame.image, *frame.info, masks);
  if (observation.isDepthAlone()) {
    if (!side_inputs_.empty()) no_views_ = "depth alone takes no further cameras";
    return observation;
  }
  if (keeps_views_) observation.T_W_C = tf_->cameraInFixed(at, cancellation);
  observation.depth = depthOf(frame, at, cancellation);
  if (frame.camera != 0) note(&no_views_, 0, "no image comes");
  for (std::size_t i = 0; i < side_inputs_.size() && i < frame.side_views.size(); ++i) {
    if (frame.camera == i + 1) continue;
    std::string why_not;
    if (auto view = sideView(frame, i, at, cancellation, &why_not)) {
      looked_at_.push_back(i + 1);
      after_s_.push_back(view->after_s);
      observation.side_views.push_back(std::move(*view));
    } else if (!why_not.empty()) {
      note(&no_views_, i + 1, why_not);
    }
  }
  return observation;
}

void FrameInput::report(const CameraFrame& frame, const TrackOutcome& track,
                        RefinementStatus* status) const {
  const Refinement& found = track.refinement;
  depthToMessage(found.depth, no_depth_, status);
  status->cameras_message = no_views_;
  if (!track.found) return;
  std::vector<std::size_t> used;
  if (found.side_views.empty() || found.own) {
    used.push_back(frame.camera);
  } else {
    note(&status->cameras_message, frame.camera, "its image does not show the object as rendered");
  }
  for (std::size_t i = 0; i < found.side_views.size(); ++i) {
    const SideViewReport& view = found.side_views[i];
    if (i >= looked_at_.size()) {  // a past view
      status->window += view.used;
    } else if (view.used) {
      used.push_back(looked_at_[i]);
    } else {
      note(&status->cameras_message, looked_at_[i], view.message);
    }
  }
  std::sort(used.begin(), used.end());
  status->cameras = static_cast<std::uint8_t>(used.size());
  for (const std::size_t camera : used) {
    status->cameras_used += (status->cameras_used.empty() ? "" : " ") + nameOf(camera);
  }
}

std::vector<PlacedView> FrameInput::placed(const CameraFrame& frame,
                                           const TrackOutcome& track) const {
  const Refinement& found = track.refinement;
  const std::vector<SideView>& views = track.observation->side_views;
  std::vector<PlacedView> placed = {
      {frame.camera, toHeader(track.image), track.observation, found.T_O_C}};
  for (std::size_t i = 0; i < looked_at_.size(); ++i) {
    const Companion& companion = frame.side_views.at(looked_at_[i] - 1);
    Pose T_C_V = views.at(i).T_C_V;
    if (i < found.side_views.size()) T_C_V = found.side_views[i].T_C_V.value_or(T_C_V);
    T_C_V.t /= track.field->metadata.metres_per_unit;
    if (!T_C_V.isFinite()) continue;  // the model has no scale
    placed.push_back({looked_at_[i], toHeader(imageStampOf(companion.image->header)),
                      views.at(i).observation, found.T_O_C * T_C_V});
  }
  return placed;
}

RigSighting FrameInput::sightings(const CameraFrame& frame, const TrackOutcome& track) const {
  if (frame.camera != 0 || !track.trusted) return RigSighting(places_.size());
  return sightingOf(track.refinement, track.field->metadata, looked_at_, places_.size());
}

double FrameInput::newestAfter_s(const TrackOutcome& track) const {
  const std::vector<SideViewReport>& views = track.refinement.side_views;
  double newest_s = 0;
  for (std::size_t i = 0; i < std::min(after_s_.size(), views.size()); ++i) {
    if (views[i].used) newest_s = std::max(newest_s, after_s_[i]);
  }
  return newest_s;
}

}  // namespace nerf_pose_refiner
