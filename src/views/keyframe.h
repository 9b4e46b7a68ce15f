// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/keyframe_points.h"
#include "backend/loaded_field.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// Settings of a keyframe.
struct KeyframeSettings {
  int levels = 4;              ///< each with half the resolution of the one before, 1..8
  int max_side_px = 400;       ///< of the finest level; larger windows are reduced
  int rays_per_side = 1;       ///< least rays per pixel side of the finest level: 1, 2 or 4
  int max_rays_of_side = 400;  ///< rays are doubled, up to 4, while a side has at most so many
  int finest_window_px = 10;   ///< half width of the window of local colours, finest level
  int coarsest_window_px = 3;  ///< the same for the coarsest level; linear in between
  int max_points = 2000;       ///< chosen points per level
  int max_outline = 240;       ///< outline points per level
  int max_shown = 4000;        ///< pixels per level from which local colours are computed
  float min_alpha = 0.97f;     ///< below this, a pixel may show the background, too
  float max_depth_step = 4;    ///< between neighbouring pixels, in widths of a pixel at that depth
  bool for_starts = false;     ///< compared with images from so far aside that outlines differ
  bool grey = false;           ///< for grey images: all channels hold the brightness

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

bool operator==(const KeyframeSettings& a, const KeyframeSettings& b);

/// Whether a keyframe of a view can be compared with its image: the object is in front of the
/// camera, at most a few times as large as the image, and more than a few pixels wide.
bool fitsKeyframe(const View& view, const FieldMetadata& object);

/// The camera of a keyframe: the window of `camera` that contains the object, reduced by a power of
/// two until it is at most `max_side_px` wide, about.
/// @param reduction set to the number of image pixels along a pixel of the keyframe.
/// @throws std::invalid_argument if `fitsKeyframe` does not hold.
Camera keyframeCamera(const Camera& camera, const Pose& T_O_C, const FieldMetadata& object,
                      const KeyframeSettings& settings, int* reduction);

/// What is rendered for a keyframe: the window that contains the object.
struct RenderedWindow {
  View view;            ///< of the image
  Rendering rendering;  ///< has 1, 2 or 4 pixels along each pixel of `camera`
  Camera camera;        ///< of the keyframe's finest level, @see keyframeCamera
  int reduction = 1;    ///< pixels of the image along one of the keyframe
};

/// Renders what a keyframe of a view is made from.
/// @throws std::invalid_argument if `fitsKeyframe` does not hold. @throws Cancelled.
RenderedWindow renderWindow(const LoadedField& field, const View& view,
                            const KeyframeSettings& settings = {},
                            const CancellationToken& cancellation = {});

/// Makes keyframes of views from what was rendered for them with the same settings. Computers of
/// eight cores and more share the rows between several threads.
std::vector<KeyframePoints> keyframesOf(const std::vector<RenderedWindow>& windows,
                                        const FieldMetadata& object,
                                        const KeyframeSettings& settings = {});
KeyframePoints keyframeOf(const RenderedWindow& window, const FieldMetadata& object,
                          const KeyframeSettings& settings = {});

/// Renders a keyframe of the object for images of a camera.
/// @throws std::invalid_argument if `fitsKeyframe` does not hold.
KeyframePoints renderKeyframe(const LoadedField& field, const View& view,
                              const KeyframeSettings& settings = {},
                              const CancellationToken& cancellation = {});

/// Keyframes of several views. @throws as `renderKeyframe`.
std::vector<KeyframePoints> renderKeyframes(const LoadedField& field,
                                            const std::vector<View>& views,
                                            const KeyframeSettings& settings = {},
                                            const CancellationToken& cancellation = {});

}  // namespace nerf_pose_refiner
