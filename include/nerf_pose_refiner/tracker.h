// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/object.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/track_status.h"

namespace nerf_pose_refiner {

class Backend;

/// How an object is tracked. The defaults are those of the ROS node.
struct TrackerOptions {
  double search_rotation_rad =
      0.26179938779914941;           ///< around an initial pose, half width per axis
  double search_translation = 0.15;  ///< around an initial pose, half width per axis [diameters]
  double trust_score = 0.18;         ///< a track begins with a pose that scores so well, 0..1
  double min_score = 0.1;  ///< and does not go on with one that scores worse, 0..trust_score
  int max_failures = 2;    ///< so many images in a row without a trusted pose are bridged
  bool predict = true;     ///< look where the last two poses point to
  double recover_s = 5;    ///< so long after the last trusted pose it is looked for again
  /// Images come from a camera: none waits for a rendering that is late. False: they may come
  /// faster than they were taken, from a file, and the same ones give the same poses.
  bool real_time = false;
  std::uint64_t seed = 1;  ///< of searches
};

/// What came of an image.
struct TrackResult {
  TrackState state = TrackState::kWaiting;
  TrackReason reason = TrackReason::kNone;
  std::string message;   ///< the reason in words; empty if there is none
  bool trusted = false;  ///< the pose explains the image well enough to act on it
  Pose T_C_O;            ///< the object in the camera's optical frame [m]
  /// Of the position of O's origin and of the rotation about the axes of C, in the order x, y, z,
  /// about x, about y, about z [m^2, rad^2] (REP-103).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double score = 0;  ///< 0: as badly as wrong poses of this object; 1: as well as right ones
  double visible_fraction = 0;  ///< of the object's silhouette that agrees with the image, 0..1
  double seconds = 0;           ///< spent on the image
};

/// Tracks one object through the images of one camera: predicts where it is, finds it there, judges
/// the pose, bridges bad images, and looks for an object that was lost.
///
/// Not thread-safe; trackers of several threads may share a backend.
class Tracker {
 public:
  /// @param object one that knows its scale. @throws std::invalid_argument if it does not, or for
  /// options out of their range; std::runtime_error where the backend has no memory for it.
  Tracker(std::shared_ptr<Backend> backend, const Object& object,
          const TrackerOptions& options = {});
  ~Tracker();
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;

  /// Where the object is thought to be in the next image [m]. Replaces a track.
  void setInitialPose(const Pose& T_C_O);

  /// @param stamp_ns when the image was taken, by any clock. Stamps increase; one that goes back by
  /// more than half a second ends the track.
  /// @throws std::invalid_argument for an image that makes no sense.
  TrackResult track(const Observation& observation, std::int64_t stamp_ns,
                    const CancellationToken& cancellation = {});

  /// Forgets where the object is.
  void reset();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace nerf_pose_refiner
