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

/// A learned object: its radiance field and what is known of it. Immutable; copies share it, and
/// any thread may use them.
///
/// Frame O is the object's own frame: the one that `frame_in_model` of its YAML file names, or else
/// the frame of the photos. Lengths are metres if the object knows its scale, model units if not.
class Object {
 public:
  /// @param field not null. The functions below make objects; this is for the library itself.
  explicit Object(std::shared_ptr<const Field> field);

  const std::string& name() const;
  /// Whether lengths are metres.
  bool hasScale() const;
  /// Extent of the occupied volume.
  double diameter() const;
  /// Centre of the occupied volume, in O.
  Eigen::Vector3d centre() const;
  /// Corners of the bounding box, in O; bit i of an index says at which end of axis i it lies.
  std::array<Eigen::Vector3d, 8> boxCorners() const;
  /// Motions after which the object looks the same, in O.
  Symmetries symmetries() const;
  /// Mean PSNR over the photos that training did not see [dB]; 0: none were held out.
  double psnr_dB() const;

  /// The field itself, for the library.
  const std::shared_ptr<const Field>& field() const { return field_; }
  /// Between this frame O and the field's frame: camera in the field's frame (model units) of the
  /// object in the camera, and back.
  Pose cameraInField(const Pose& T_C_O) const;
  Pose objectInCamera(const Pose& T_field_C) const;

 private:
  std::shared_ptr<const Field> field_;
};

/// Reads a model file (.safetensors) and, if there is one, the YAML file of the same name beside
/// it (frame, scale, box, symmetries).
/// @throws std::runtime_error naming the file and what is wrong with it.
Object loadObject(const std::string& path);

/// Writes the model file; whoever reads it meanwhile sees the old file or the whole new one.
/// @throws std::runtime_error naming the file and the system's reason.
void saveObject(const Object& object, const std::string& path);

}  // namespace nerf_pose_refiner
