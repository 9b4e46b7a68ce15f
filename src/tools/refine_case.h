// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// An image to be explained, where the search starts, and the truth if it is known.
struct RefineCase {
  std::string name;
  Image8 image;  ///< undistorted: RGB, or RGBA with straight alpha; empty: depth alone
  Image8 mask;   ///< undistorted, [h][w][1]; empty: none
  Camera camera;
  std::shared_ptr<const DepthImage> depth;  ///< of `camera`; null: none
  Pose start_T_O_C;
  std::optional<Pose> true_T_O_C;
};

/// A photo as the camera took it, with a mask drawn on it.
/// @param mask empty: none. @throws std::invalid_argument if a size is not the camera's.
RefineCase caseOfPhoto(const Image8& photo, const Image8& mask, const Camera& camera,
                       const Distortion& distortion);

/// Adds what a depth camera measured in the pixels of the case's camera.
/// @param values [h][w][1]; 0: nothing was measured. @param unit_m length that 1 stands for [m].
/// @throws std::invalid_argument if the size is not the camera's, or for a unit or noise out of
/// range.
void addDepth(ImageOf<std::uint16_t> values, double unit_m, const DepthNoise& noise,
              RefineCase* input);

/// A view of a dataset, with a mask drawn on the photo in the view's file.
/// @param mask empty: none. @throws std::invalid_argument if its size is not the photo's.
RefineCase caseOfView(const PosedView& view, const Image8& mask);

/// Depth alone where there is no image, and else what the case says about the background: a mask
/// (and the image's own alpha, if it has one), or else one colour (three numbers, 0..1; empty:
/// none), or else transparency of the image, or else nothing.
Observation observationOf(const RefineCase& input, const std::vector<float>& background);

}  // namespace nerf_pose_refiner
