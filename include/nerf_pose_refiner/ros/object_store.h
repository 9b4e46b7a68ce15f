// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "nerf_pose_refiner/field/field.h"

namespace nerf_pose_refiner {

/// @throws std::invalid_argument unless the name is made of letters, digits, "_", "-" and ".", of
/// at most 100 characters, the first being a letter or a digit.
void requireObjectName(const std::string& name);

/// Models of objects with metric scale in a folder: <root>/<name>.safetensors. May be used from
/// many threads at once.
class ObjectStore {
 public:
  explicit ObjectStore(const std::string& root) : root_(root) {}

  /// @throws InputError (REASON_MODEL_*) naming the file and what is wrong with it.
  std::shared_ptr<const Field> load(const std::string& name) const;

  /// The model, or null if there is no such file. @throws InputError as `load`, but not for the
  /// lack of a scale.
  std::shared_ptr<const Field> find(const std::string& name) const;

  /// Writes under the name in its metadata; creates the folder.
  /// @throws std::invalid_argument for a bad name, std::runtime_error if it cannot be written.
  void save(const Field& field) const;

 private:
  std::string pathOf(const std::string& name) const;

  std::string root_;
};

}  // namespace nerf_pose_refiner
