// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <string>

#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

struct Field;

/// A learned object: its radiance field and metadata. `loadObject` and `registerObject` make one.
/// Immutable; copies share the data, and any thread may use them.
///
/// O is the object's own frame: `frame_in_model` of its YAML file, or without that the frame of the
/// photos. Lengths are in metres if the object has a scale, in model units otherwise.
class Object {
 public:
  const std::string& name() const;
  /// Whether the length of the model unit in metres is known.
  bool hasScale() const;
  /// Extent of the occupied volume.
  double diameter() const;
  /// Centre of the occupied volume, in O.
  Eigen::Vector3d centre() const;
  /// Corners of the bounding box, in O. Bit i of an index: 0 for the minimum of axis i, 1 for the
  /// maximum.
  std::array<Eigen::Vector3d, 8> boxCorners() const;
  /// Motions after which the object looks the same, in O.
  Symmetries symmetries() const;
  /// Mean PSNR over the held-out photos [dB]; 0: none were held out.
  double psnr_db() const;

 private:
  friend struct ObjectInside;
  explicit Object(std::shared_ptr<const Field> field);

  std::shared_ptr<const Field> field_;
};

/// Reads a model file (.safetensors) and, if there is one, the YAML file of the same name beside
/// it (frame, scale, box, symmetries).
/// @throws std::runtime_error naming the file and what is wrong with it.
Object loadObject(const std::string& path);

/// Writes the model file (.safetensors) and, if the object has a frame, a box or symmetries of its
/// own, the YAML file of the same name beside it. A concurrent reader sees each as it was or
/// complete.
/// @throws std::runtime_error naming the file and the system's reason, or a YAML file that says
/// otherwise, which is never overwritten.
void saveObject(const Object& object, const std::string& path);

}  // namespace nerf_pose_refiner
