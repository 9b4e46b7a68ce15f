// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/object_store.h"

#include <nerf_pose_refiner/RefinementStatus.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <stdexcept>

#include "nerf_pose_refiner/dataset/path_below.h"
#include "nerf_pose_refiner/field/model_file.h"
#include "nerf_pose_refiner/ros/input_error.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Status = RefinementStatus;

}  // namespace

void requireObjectName(const std::string& name) {
  const auto plain = [](unsigned char c) {
    return c < 128 && (std::isalnum(c) || c == '_' || c == '-' || c == '.');
  };
  if (name.empty() || name.size() > 100 || !std::all_of(name.begin(), name.end(), plain) ||
      !std::isalnum(static_cast<unsigned char>(name[0]))) {
    throw std::invalid_argument("the object's name '" + name +
                                "' must be made of letters, digits, '_', '-' and '.', at most 100, "
                                "and begin with a letter or a digit");
  }
}

std::string ObjectStore::pathOf(const std::string& name) const {
  requireObjectName(name);
  if (root_.empty()) throw std::invalid_argument("~model_root is not set");
  return pathBelow(root_, name + ".safetensors");
}

std::shared_ptr<const Field> ObjectStore::find(const std::string& name) const {
  try {
    const std::string path = pathOf(name);
    if (!fs::exists(path)) return nullptr;
    auto field = std::make_shared<Field>(loadModel(path));
    field->metadata.name = name;  // the file may have been renamed
    return field;
  } catch (const std::exception& e) {
    throw InputError(Status::REASON_MODEL_UNREADABLE, e.what());
  }
}

std::shared_ptr<const Field> ObjectStore::load(const std::string& name) const {
  std::shared_ptr<const Field> field = find(name);
  if (!field) {
    throw InputError(Status::REASON_MODEL_UNREADABLE,
                     "there is no model '" + name + "' below " + root_);
  }
  if (!(field->metadata.metres_per_unit > 0)) {
    throw InputError(Status::REASON_MODEL_NO_SCALE,
                     "the model '" + name +
                         "' does not know how long its unit is: register it with metres_per_unit");
  }
  return field;
}

void ObjectStore::save(const Field& field) const {
  const std::string path = pathOf(field.metadata.name);
  fs::create_directories(fs::path(path).parent_path());
  saveModel(field, path);
}

}  // namespace nerf_pose_refiner
