// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RefinementStatus.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "refinement/sighting_log.h"
#include "ros/conversions/camera_frame.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/parameters.h"
#include "ros/conversions/tf_bridge.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// An image of a camera, and where the pose that was found puts the object in it.
struct PlacedView {
  std::size_t camera = 0;   ///< that took it, @see CameraFrame
  std_msgs::Header header;  ///< of the image
  std::shared_ptr<const Observation> observation;
  Pose T_O_V;  ///< its camera [model units]
};

/// Makes observations of what all cameras saw at about one time, and says what became of it. Used
/// by the tracking thread only.
class FrameInput {
 public:
  FrameInput(const PoseRefinerParameters& parameters, std::shared_ptr<TfBridge> transforms);

  /// @param at of the frame's image. @param cancellation ends the wait for transforms.
  /// @throws InputError if that image cannot be used.
  Observation observe(const CameraFrame& frame, const ImageStamp& at, bool use_mask,
                      const CancellationToken& cancellation);

  /// Fills in what became of the frame that was observed last.
  void report(const CameraFrame& frame, const TrackOutcome& track, RefinementStatus* status) const;

  /// The images of all cameras that were looked at in the last observation, that of the frame
  /// first. Requires that the object was found in it.
  std::vector<PlacedView> placed(const CameraFrame& frame, const TrackOutcome& track) const;

  /// How much later than the frame's image the newest image was taken that took part in the pose of
  /// the last observation [s].
  double newestAfter_s(const TrackOutcome& track) const;

  /// What each camera saw alone in the last observation, by its number (CameraFrame::camera).
  RigSighting sightings(const CameraFrame& frame, const TrackOutcome& track) const;
  /// Places of all cameras in the first one, as TF told them last [m].
  const std::vector<Pose>& places() const { return places_; }

 private:
  /// A further camera.
  struct SideInput {
    CameraInput input;
    bool was_placed = true;  ///< TF knew its place in the last image
  };

  Pose placeOf(const Companion& companion, const ImageStamp& at,
               const CancellationToken& cancellation, bool* was_placed) const;
  std::shared_ptr<const DepthImage> depthOf(const CameraFrame& frame, const ImageStamp& at,
                                            const CancellationToken& cancellation);
  std::optional<SideView> sideView(const CameraFrame& frame, std::size_t i, const ImageStamp& at,
                                   const CancellationToken& cancellation, std::string* why_not);
  void note(std::string* notes, std::size_t camera, const std::string& why) const;
  std::string nameOf(std::size_t camera) const;

  const DepthSettings depth_;
  const CameraSettings cameras_;
  const bool keeps_views_;
  const std::shared_ptr<TfBridge> tf_;
  const std::vector<std::string> names_;  // of ~cameras/topics
  CameraInput input_;
  std::vector<SideInput> side_inputs_;  // of ~cameras/topics
  bool depth_was_placed_ = true;        // TF knew the last depth image's camera

  // Of the last observation.
  std::string no_depth_, no_views_;
  std::vector<std::size_t> looked_at_;  // numbers of the side views' cameras
  std::vector<double> after_s_;         // of the side views
  std::vector<Pose> places_;            // T_C_V, by the cameras' numbers
};

}  // namespace nerf_pose_refiner
