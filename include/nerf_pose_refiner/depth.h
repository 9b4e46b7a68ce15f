// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Errors of a depth camera. The defaults suit a stereo camera on a robot.
///
/// A measured distance z has independent errors, whose variances add. Each pixel has noise with the
/// standard deviations constant_m and quadratic_per_m z^2, and is rounded to steps of step_m z^2
/// and to the steps of the image's format. All pixels of an image share a bias with the standard
/// deviations bias_m and bias_fraction z.
struct DepthNoise {
  double constant_m = 0.0005;      ///< deviation of a pixel at any distance [m], >= 0
  double quadratic_per_m = 0.003;  ///< deviation of a pixel per square of the distance [1/m], >= 0
  double step_m = 0;               ///< sensor's quantisation step at 1 m [m], >= 0; 0: none
  double correlation_px = 5;       ///< errors of pixels closer than this are correlated [px], >= 1
  double bias_m = 0.001;           ///< deviation of the bias at any distance [m], >= 0
  double bias_fraction = 0.002;    ///< deviation of the bias per distance [fraction], >= 0

  /// Standard deviation of a pixel's error at a distance [m], without the bias.
  /// @param format_step_m difference between neighbouring values of the image's format [m].
  double deviation_m(double distance_m, double format_step_m = 0) const;
  /// Standard deviation of the bias at a distance [m].
  double biasDeviation_m(double distance_m) const;
};

/// A depth image (REP-118). A pixel's depth is the distance along the optical axis of the depth
/// camera D, which may be another camera than the colour camera C and have another resolution.
///
/// The image need not be registered to the colour image: the object's surface is projected into it.
struct DepthImage {
  enum class Format {
    kFloat,  ///< float: depth in metres; NaN, infinity, 0 and negative values mean no measurement
    kUint16  ///< std::uint16_t: depth in multiples of `unit_m`; 0 means no measurement
  };

  const void* data = nullptr;         ///< pixels, [height][width]
  std::shared_ptr<const void> owner;  ///< keeps `data` alive
  Format format = Format::kUint16;    ///< type and meaning of the pixels
  std::size_t row_bytes = 0;          ///< from the start of one row to the start of the next
  double unit_m = 0.001;              ///< length that the value 1 stands for in kUint16 [m]
  Camera camera;                      ///< the depth camera's intrinsics; there is no distortion
  Pose T_C_D;                         ///< the depth camera D in the colour camera C [m]
  DepthNoise noise;                   ///< errors of the depth camera

  /// Depth of a pixel inside of the image [m]; 0 where nothing was measured.
  float at(int x, int y) const;

  /// @throws std::invalid_argument naming what is missing or out of its range.
  void validate() const;
};

/// A depth image that keeps its own pixels.
/// @param metres depth [m], [camera.height][camera.width][1]; where nothing was measured: NaN,
/// infinity, 0 or a negative value.
/// @throws std::invalid_argument if sizes do not match, or for an invalid camera or pose.
std::shared_ptr<const DepthImage> depthImage(ImageOf<float> metres, const Camera& camera,
                                             const Pose& T_C_D = {}, const DepthNoise& noise = {});
/// The same in millimetres. @param millimetres depth [mm]; 0 where nothing was measured.
std::shared_ptr<const DepthImage> depthImage(ImageOf<std::uint16_t> millimetres,
                                             const Camera& camera, const Pose& T_C_D = {},
                                             const DepthNoise& noise = {});

/// What became of an observation's depth.
enum class DepthUse {
  kNone,     ///< there was no depth, or no pose to compare it with
  kUsed,     ///< depth took part in the pose
  kRefused,  ///< depth contradicts the colour image or shows nothing: the pose is that of colours
             ///< alone, if there are any
};

/// How depth agrees with a pose.
struct DepthReport {
  DepthUse use = DepthUse::kNone;
  std::string message;  ///< why depth was refused; empty otherwise
  double measured = 0;  ///< fraction of the object's visible surface that has depth, 0..1
  double agreeing = 0;  ///< fraction of the measured surface that lies where the pose puts it, 0..1
  double nearer = 0;    ///< fraction of the measured surface that something hides, 0..1
  double farther = 0;   ///< fraction of the measured surface that contradicts the pose, 0..1
  double bias_m = 0;    ///< estimated bias of the camera: measured minus true distance [m]
  double bias_dev_m = 0;  ///< standard deviation of that estimate [m]
};

}  // namespace nerf_pose_refiner
