// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/depth.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {

/// What is known about the pixels that do not show the object.
enum class Background {
  kUnknown,      ///< nothing is known: an ordinary camera image
  kKnownColour,  ///< one colour everywhere
  kKnownAlpha,   ///< `alpha` holds the exact opacity of the object (a synthetic view)
  kMask,  ///< `alpha` holds a segmentation: 1 on the object, 0 elsewhere, inexact at its edge
};

/// A part of an image [px]. The centre of the first pixel is (0, 0): the whole image is
/// [-0.5, width - 0.5] x [-0.5, height - 0.5].
struct ImageBox {
  double x_min = 0, y_min = 0, x_max = 0, y_max = 0;
};

struct Observation;

/// An image of another camera, or of the same one from elsewhere, at the moment of an observation.
struct SideView {
  std::shared_ptr<const Observation> observation;  ///< the image; without side views or depth
  /// The view's camera V in the observation's camera C, both at the moment of this view [m].
  Pose T_C_V;
  double position_dev_m = 0.0005;    ///< standard deviation of T_C_V, along each axis [m]
  double rotation_dev_rad = 0.0005;  ///< standard deviation of T_C_V, about each axis [rad]
  /// Time from the observation's own image to this one [s]: a tracker moves the object on in
  /// between.
  double after_s = 0;
  /// Number of its camera. Views of one number share keyframes; 0 is the observation's own camera,
  /// from elsewhere, while the object stood still: such views never show alone where the object is,
  /// and the deviations are those of both places. -1: the place in `Observation::side_views`
  /// counts.
  int camera = -1;
};

/// What became of a side view.
struct SideViewReport {
  bool used = false;    ///< it took part in the pose
  std::string message;  ///< why it did not; empty if it did
  double score = 0;     ///< how well the pose explains the image, 0..1, 1: perfectly
  double apart = 0;     ///< distance from what others show [standard deviations]; 0: not compared
  /// SideView::T_C_V with the object's motion until the view was taken, so that T_C_V^-1 T_C_O is
  /// where its image should show the object [m]. Nothing: the view was not looked at.
  std::optional<Pose> T_C_V;
  Pose T_V_O;  ///< the object in its camera by this image alone [m], where `score` > 0
  /// Covariance of T_V_O, without the error of T_C_V, in the order of RefineResult::covariance
  /// [m^2, rad^2].
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// An undistorted camera image, and what is known about its background.
struct Observation {
  Image image;  ///< [h][w][3] RGB, sRGB-encoded, 0..1; premultiplied by `alpha` for kKnownAlpha,
                ///< not premultiplied otherwise
  /// The image in the original bytes of a camera; replaces `image`, which is then empty. Both are
  /// empty where nothing but `depth` shows the object.
  std::shared_ptr<const CameraPixels> pixels;
  Image alpha;   ///< [h][w][1], 0..1, for kKnownAlpha and kMask; empty otherwise
  Image weight;  ///< [h][w][1], 0..1, weight of each pixel (0: the robot's gripper); empty: all 1
  /// Parts of the image that may show the object, as a 2-D detector gives them, best first: where
  /// it is looked for without an initial pose. Empty: everywhere.
  std::vector<ImageBox> boxes;
  std::shared_ptr<const DepthImage> depth;  ///< depth at the same moment; null: there is none
  std::vector<SideView> side_views;         ///< images of further cameras that see the object
  /// The camera in a frame in which the object stands still [m]: a tracker that keeps past views
  /// needs it (TrackerOptions::window).
  std::optional<Pose> T_W_C;
  Camera camera;
  Background background = Background::kUnknown;
  Eigen::Vector3f background_colour = Eigen::Vector3f::Zero();  ///< for kKnownColour

  /// Whether there is no colour image.
  bool isDepthAlone() const { return depth && !pixels && image.empty(); }

  /// @throws std::invalid_argument naming what is missing, has a wrong size, is not finite or is
  /// out of its range.
  void validate() const;
};

/// An observation of a camera image, whose background is unknown unless a mask is given.
/// @param rgb [h][w][3], undistorted (undistorter.h); move it here to save a copy.
/// @param camera the camera of `rgb`. @param mask [h][w][1], non-zero on the object; empty: there
/// is none.
/// @throws std::invalid_argument if sizes or channels do not match, or for an invalid camera.
Observation observe(Image8 rgb, const Camera& camera, const Image8& mask = {});

/// The same of bytes that are held elsewhere, without a copy: a cv::Mat has the format kBgr.
/// @param owner keeps the bytes alive. They must not change as long as the observation exists.
/// @param mask as above; it is copied.
/// @throws std::invalid_argument if the bytes or the mask do not fit the format or the camera.
Observation observe(const Image8View& bytes, PixelFormat format, const Camera& camera,
                    std::shared_ptr<const void> owner, const Image8& mask = {});

/// An observation of a depth image alone, where there is no light: poses are those in the depth
/// camera. It takes neither mask nor side views.
/// @throws std::invalid_argument for an invalid depth image, or one that is placed in another
/// camera (DepthImage::T_C_D).
Observation observe(std::shared_ptr<const DepthImage> depth);

}  // namespace nerf_pose_refiner
