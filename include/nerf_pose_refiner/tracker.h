// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/object.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/track_status.h"

namespace nerf_pose_refiner {

class Backend;

/// Settings of a tracker. The defaults are those of the ROS node, but for `real_time`.
struct TrackerOptions {
  /// Half width of the search around an initial pose, per axis [rad].
  double search_rotation_rad = kSearchRotation_rad;
  /// Half width of the search around an initial pose, per axis [object diameters].
  double search_translation = kSearchTranslation;
  double trust_score = 0.9;  ///< score at which tracking begins, 0..1
  double min_score = 0.5;    ///< while tracking, a lower score is not trusted, 0..trust_score
  int max_failures = 2;      ///< number of untrusted images in a row that are bridged
  /// Search around the pose at which the motion so far is expected to lead, and fuse the pose found
  /// with that one as far as the image leaves it open.
  bool predict = true;
  double recover_s = 5;  ///< a lost object is searched for during this time
  /// True for a live camera: no image waits for a keyframe that is rendered late. False for a file,
  /// whose images may be passed faster than they were taken: the same images give the same poses.
  bool real_time = false;
  /// Largest number of past images that act as further cameras while the object stands still and
  /// the camera moves; 0: none. Needs Observation::T_W_C.
  int window = 0;
  std::uint64_t seed = 1;  ///< the same seed and backend give the same poses
};

/// The result for one image.
struct TrackResult {
  TrackState state = TrackState::kWaiting;
  TrackReason reason = TrackReason::kNone;
  std::string message;  ///< the reason in words; empty if there is none
  /// The object was looked for. False: there was no pose to start from, or the image is older than
  /// one before.
  bool processed = false;
  bool found = false;    ///< there is a pose, trusted or not; else T_C_O is the identity
  bool trusted = false;  ///< the pose explains the image well enough to be used
  Pose T_C_O;            ///< the object in the camera's optical frame [m]
  /// Covariance of T_C_O: position of O's origin, then rotation, both along and about the axes of
  /// C, in the order x, y, z, about x, about y, about z [m^2, rad^2] (as geometry_msgs has it).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double score = 0;  ///< 0..1: probability that the pose is right, within 5 degrees and 5 %
  double visible_fraction = 0;  ///< fraction of the silhouette that agrees with the image, 0..1
  DepthReport depth;            ///< what became of the observation's depth
  std::vector<SideViewReport> side_views;  ///< what became of its side views, in their order
  double seconds = 0;                      ///< duration of the search in this image
};

/// Tracks one object through the images of one camera: predicts its pose, refines it, decides
/// whether to trust it, bridges images without a trusted pose, and searches for a lost object.
///
/// Not thread-safe; trackers of several threads may share a backend.
class Tracker {
 public:
  /// @param object must have a scale (Object::hasScale).
  /// @throws std::invalid_argument if it has none, or for options out of range; std::runtime_error
  /// if the backend has too little memory.
  Tracker(std::shared_ptr<Backend> backend, const Object& object,
          const TrackerOptions& options = {});
  ~Tracker();
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;

  /// Sets the approximate pose in the next image [m]. A present track ends.
  void setInitialPose(const Pose& T_C_O);

  /// Processes the next image.
  /// @param stamp_ns time of the image on any clock, increasing. An image that is not newer than
  /// the last one is ignored; one that is older by more than 0.5 s ends the track. After a gap of
  /// more than 2 s the object counts as lost: it is searched for (TrackerOptions::recover_s).
  /// @throws std::invalid_argument for an invalid image; std::runtime_error if the processor fails,
  /// after which the next image may be tried (not if it is lost for good, @see makeBackend);
  /// Cancelled.
  TrackResult track(const Observation& observation, std::int64_t stamp_ns,
                    const CancellationToken& cancellation = {});

  /// Forgets where the object is.
  void reset();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace nerf_pose_refiner
