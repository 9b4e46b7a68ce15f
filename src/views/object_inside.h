// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>

#include "field/field.h"
#include "field/object_frame.h"
#include "nerf_pose_refiner/object.h"

namespace nerf_pose_refiner {

/// What the library itself knows of an object, and its users need not.
struct ObjectInside {
  /// @throws std::invalid_argument if the field is null.
  static Object make(std::shared_ptr<const Field> field) { return Object(std::move(field)); }

  static const std::shared_ptr<const Field>& field(const Object& object) { return object.field_; }

  /// Converts between poses of the object and those of the camera in the field.
  static ObjectFrame frame(const Object& object) {
    return ObjectFrame::ofUsers(object.field_->metadata);
  }
};

}  // namespace nerf_pose_refiner
