// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "field/field.h"

namespace nerf_pose_refiner {

/// What people say of an object, in a YAML file of its name beside the model's. All of it may be
/// left out.
struct ObjectMetadata {
  double metres_per_unit = 0;  ///< 0: the model's own counts
  Pose T_O_U;              ///< `frame_in_model`: the frame U that users mean by the object's, in
                           ///< that of the model [model units]
  std::optional<Box> box;  ///< `bounding_box`, in U [model units]
  Symmetries symmetries;   ///< in U [model units]
};

/// <name>.yaml of <name>.safetensors.
std::string metadataPathOf(const std::string& model_path);

/// Reads such a file, strictly: what is misspelt, of another type, not finite or impossible is an
/// error.
/// @return what an empty file says, if there is none.
/// @throws std::runtime_error naming file and line, what is wrong and what was expected.
ObjectMetadata readObjectMetadata(const std::string& path);

/// Writes such a file. @throws std::runtime_error naming the file and the system's reason.
void writeObjectMetadata(const ObjectMetadata& metadata, const std::string& path);

/// What a model file does not hold of an object.
ObjectMetadata metadataBesideModel(const FieldMetadata& object);

/// Whether both mean the same frame, box and symmetries. (Scales are not compared.)
bool sameFrame(const ObjectMetadata& a, const ObjectMetadata& b);

/// An object's metadata takes precedence over what its model knows.
void apply(const ObjectMetadata& metadata, FieldMetadata* object);

/// A model with the metadata of the file beside it.
/// @throws std::runtime_error as loadModel and readObjectMetadata.
Field loadField(const std::string& model_path);

/// The same without the model's numbers: @see readModelMetadata.
FieldMetadata readObject(const std::string& model_path);

}  // namespace nerf_pose_refiner
