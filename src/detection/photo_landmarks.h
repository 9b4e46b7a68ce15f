// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "detection/landmarks.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

struct FieldMetadata;

/// A photo that the field was learned from. It shows what the field blurs.
struct LandmarkPhoto {
  std::shared_ptr<const Image8> rgba;  ///< [h][w][4], straight alpha; 255 where nothing is known
  View view;                           ///< the photo's camera and its pose
};

/// The part of a camera's image that shows the object, reduced so that the object's diameter spans
/// at most `object_px`; nothing if the object is not before the camera.
std::optional<Camera> objectPart(const View& view, const FieldMetadata& object, int object_px);

/// The features of a photo that are landmarks, with the points that the field shows there. What
/// the photo's alpha leaves out is none of the object. @throws Cancelled.
Landmarks landmarksOf(const LandmarkPhoto& photo, const LoadedField& field,
                      const LandmarkSettings& settings, const CancellationToken& cancellation);

/// Features of photos, evenly chosen, and of renderings from all around. @throws Cancelled.
Landmarks makeLandmarks(const LoadedField& field, const std::vector<LandmarkPhoto>& photos,
                        const LandmarkSettings& settings, const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
