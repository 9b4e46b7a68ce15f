// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "backend/keyframe_points.h"
#include "backend/loaded_field.h"
#include "field/field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// The part of an image that shows an object from a pose, reduced so far that renderings of many
/// poses can be compared with it.
struct ObjectImage {
  Camera camera;
  Image colour;       ///< [h][w][3]
  Image weight;       ///< [h][w][1]: 0 shows nothing
  bool grey = false;  ///< from a camera without colours
};

/// @param object_px that the object's diameter spans at most; images that show it smaller are not
/// enlarged. @return nothing: the object is behind the camera, or not in the image.
std::optional<ObjectImage> objectImage(const Observation& observation, const Pose& T_O_C,
                                       const FieldMetadata& object, int object_px);

/// Compares poses by the same pixels of an image. Keyframes choose the points that say most about
/// their own pose, so that the score of one that shows less of the object's pattern is no lower;
/// here what a pose leaves unexplained counts, too.
///
/// Colours are compared without their mean over a neighbourhood, and up to a gain: shading and
/// light say little.
class PoseEvidence {
 public:
  explicit PoseEvidence(ObjectImage image);

  const Camera& camera() const { return image_.camera; }

  /// A rendering from another pose, by the camera of the image.
  void add(const Rendering& rendering);

  /// Renders an object from several poses, and adds that. @throws Cancelled.
  void addAll(const LoadedField& field, const std::vector<Pose>& poses_T_O_C,
              const CancellationToken& cancellation);

  /// Adds what a keyframe shows from several poses near its own, without rendering.
  void addAll(const KeyframePoints& keyframe, const std::vector<Pose>& poses_T_O_C);

  int poses() const { return static_cast<int>(shown_.size()); }

  /// Logarithm of the factor by which the image changes the odds of a pose against another one.
  /// @param noise deviation of colours that right poses leave unexplained, 0..1, at least: what
  /// remains at the better of the two poses counts where it is more.
  double of(int pose, int against, double noise) const;

 private:
  /// What a pose leaves unexplained.
  struct Shown {
    std::vector<char> is_object;  ///< pixel by pixel
    std::vector<float> squares;   ///< of the residual, sum over the channels, where it is
  };

  Shown compared(const Rendering& rendering) const;

  ObjectImage image_;
  std::vector<Shown> shown_;
};

}  // namespace nerf_pose_refiner
