// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/keyframe_points.h"
#include "field/field.h"
#include "nerf_pose_refiner/backend.h"

namespace nerf_pose_refiner {

/// What a keyframe is made of.
struct KeyframeSettings {
  int levels = 4;              ///< each half as fine as the one before, >= 1
  int max_side_px = 400;       ///< of the finest level; larger images are reduced to it
  int rays_per_side = 1;       ///< rays along a pixel of the finest level: 1, 2 or 4
  int finest_window_px = 10;   ///< half width of the neighbourhood of local colours, finest level
  int coarsest_window_px = 3;  ///< the same, coarsest level; linear between
  int max_points = 2000;       ///< that a level may choose
  int max_outline = 240;       ///< places on the outline, at a level
  int max_shown = 4000;        ///< pixels that local colours are taken of
  float min_alpha = 0.97f;     ///< less: the pixel does not show the object for certain
  float max_depth_step = 4;    ///< between neighbours, in pixels as wide as their depth makes them
  bool grey = false;           ///< for grey images: all channels have the colours' brightness

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// The camera of a keyframe: the object's window of an image of `camera`, reduced to a size that is
/// worth its cost. @param reduction pixels of the image along a pixel of it.
Camera keyframeCamera(const Camera& camera, const Pose& T_O_C, const FieldMetadata& object,
                      const KeyframeSettings& settings, int* reduction);

/// Renders a keyframe of the object for images of a camera.
/// @throws std::invalid_argument if the object is not before the camera.
KeyframePoints renderKeyframe(const LoadedField& field, const View& view,
                              const KeyframeSettings& settings = {},
                              const CancellationToken& stop = {});

/// A keyframe of a rendering. @param camera of the finest level, as keyframeCamera has it; the
/// rendering has `rays_per_side` pixels along each pixel of it.
KeyframePoints makeKeyframe(const Rendering& rendering, const Camera& camera, const Pose& T_O_C,
                            const FieldMetadata& object, const KeyframeSettings& settings);

}  // namespace nerf_pose_refiner
