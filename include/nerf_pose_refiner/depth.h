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

/// How far a depth camera may be off. The defaults suit a stereo camera on a robot.
struct DepthNoise {
  double constant_m = 0.0005;      ///< deviation of a pixel at any distance [m], >= 0
  double quadratic_per_m = 0.003;  ///< the part that grows with distance squared [1 / m], >= 0
  double step_m = 0;               ///< of quantisation at 1 m, growing alike; 0: that of the format
  double correlation_px = 5;       ///< pixels that are nearer to each other share an error, >= 1
  double bias_m = 0.001;           ///< deviation of an error that all pixels share [m], >= 0
  double bias_fraction = 0.002;    ///< its part that grows with distance [fraction], >= 0

  /// Standard deviation of a pixel at a distance [m], without the bias.
  /// @param format_step_m from one value of the image to the next [m].
  double deviation_m(double distance_m, double format_step_m = 0) const;
  /// Standard deviation of the bias at a distance [m].
  double biasDeviation_m(double distance_m) const;
};

/// A depth image (REP-118): distances along the optical axis, of a camera that may be another one
/// than the colour image's, at another resolution.
///
/// It need not be registered to the colour image: the object's surface is projected into it.
struct DepthImage {
  /// Of a value: metres, not finite or <= 0 where there is none; or a multiple of `unit_m`, 0 where
  /// there is none.
  enum class Format { kFloat, kUint16 };

  const void* data = nullptr;         ///< [height][width]
  std::shared_ptr<const void> owner;  ///< keeps `data` alive
  Format format = Format::kUint16;
  std::size_t row_bytes = 0;  ///< from the start of one row to the start of the next
  double unit_m = 0.001;      ///< of kUint16 [m]
  Camera camera;              ///< of the depth image, without lens distortion
  Pose T_C_D;                 ///< of the depth camera D in the colour camera C [m]
  DepthNoise noise;

  /// Depth of a pixel inside of the image [m]; 0 where there is none.
  float at(int x, int y) const;

  /// @throws std::invalid_argument naming what is missing or out of its range.
  void validate() const;
};

/// A depth image of numbers that it keeps: camera.width x camera.height, row by row.
/// @throws std::invalid_argument if sizes do not match, or for an invalid camera or pose.
std::shared_ptr<const DepthImage> depthImage(ImageOf<float> metres, const Camera& camera,
                                             const Pose& T_C_D = {}, const DepthNoise& noise = {});
std::shared_ptr<const DepthImage> depthImage(ImageOf<std::uint16_t> millimetres,
                                             const Camera& camera, const Pose& T_C_D = {},
                                             const DepthNoise& noise = {});

/// What became of an observation's depth.
enum class DepthUse {
  kNone,     ///< there was none, or no pose to compare it with
  kUsed,     ///< it took part in the pose
  kRefused,  ///< it contradicts the colour image or shows nothing: the pose is that of colours
             ///< alone
};

/// What depth said of a pose.
struct DepthReport {
  DepthUse use = DepthUse::kNone;
  std::string message;    ///< why it was refused; empty otherwise
  double measured = 0;    ///< of the object's surface that faces the camera: there is depth, 0..1
  double agreeing = 0;    ///< of what is measured: lies where the pose puts it, 0..1
  double nearer = 0;      ///< of what is measured: something hides it, 0..1
  double farther = 0;     ///< of what is measured: speaks against the pose, 0..1
  double bias_m = 0;      ///< estimate of the sensor's bias: measured minus true distance [m]
  double bias_dev_m = 0;  ///< its standard deviation [m]
};

}  // namespace nerf_pose_refiner
