// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

class PoseSolver;
struct Field;
struct ImageLevel;
struct Observation;

/// How an image is rendered.
struct RenderOptions {
  float near = 0;                   ///< rays begin at this distance [model units]
  float step_scale = 1;             ///< multiplies the field's sample intervals
  float min_transmittance = 1e-4f;  ///< a ray ends when its transmittance falls below this
  float min_weight = 1e-4f;         ///< samples with a smaller weight are ignored
  bool use_occupancy = true;        ///< skip the cells that the occupancy grid marks as empty
};

/// The viewpoint from which a field is rendered.
struct View {
  Camera camera;
  Pose T_O_C;  ///< [model units]
};

/// An image of a field: premultiplied sRGB-encoded RGB, alpha, and the expected point per pixel.
struct Rendering {
  Image colour;  ///< [h][w][3], premultiplied
  Image alpha;   ///< [h][w][1]
  Image point;   ///< [h][w][3], sum of weight * p_O [model units]: divide by alpha
};

/// A field in the memory of a backend's processor. Its users share it, one caller at a time. It may
/// outlive its backend.
class LoadedField {
 public:
  virtual ~LoadedField() = default;

  virtual const Field& field() const = 0;

  /// Returns when the image is complete. @throws std::invalid_argument for an invalid camera or
  /// pose, Cancelled.
  virtual Rendering render(const View& view, const RenderOptions& options,
                           const CancellationToken& cancellation) const = 0;

  /// Renderings from several places, in their order. @throws as `render`.
  virtual std::vector<Rendering> renderAll(const Camera& camera,
                                           const std::vector<Pose>& poses_T_O_C,
                                           const RenderOptions& options,
                                           const CancellationToken& cancellation) const;
  /// Whether these take less time together than one after the other.
  virtual bool rendersTogether() const { return false; }

  /// A solver for at most `capacity` hypotheses. The field must outlive it.
  /// @param levels resized parts of the observation, on which the stages work.
  /// @throws std::invalid_argument for an invalid observation, level or capacity.
  virtual std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                                 const std::vector<ImageLevel>& levels,
                                                 int capacity) const = 0;
};

}  // namespace nerf_pose_refiner
