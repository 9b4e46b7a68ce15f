// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/object_store.h"

#include <nerf_pose_refiner/RefinementStatus.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <stdexcept>

#include "nerf_pose_refiner/field/model_file.h"
#include "nerf_pose_refiner/ros/input_error.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Status = RefinementStatus;

/// Whether a normalised path is `root` or below it, name by name.
bool isBelow(const fs::path& path, const fs::path& root) {
  return std::mismatch(root.begin(), root.end(), path.begin(), path.end()).first == root.end();
}

/// Whether a part of a path, with all links resolved that lead somewhere, is a link to nowhere.
bool holdsLink(const fs::path& path) {
  fs::path part;
  for (const fs::path& name : path) {
    part /= name;
    if (fs::is_symlink(fs::symlink_status(part))) return true;
  }
  return false;
}

}  // namespace

std::string pathBelow(const std::string& root, const std::string& relative) {
  if (root.empty()) throw std::invalid_argument("no root folder is set for '" + relative + "'");
  const fs::path wanted(relative);
  if (relative.empty() || wanted.is_absolute() ||
      std::find(wanted.begin(), wanted.end(), "..") != wanted.end()) {
    throw std::invalid_argument("the path '" + relative + "' must be relative and without '..'");
  }
  fs::path base = fs::weakly_canonical(fs::absolute(root));
  if (!base.has_filename()) base = base.parent_path();  // a slash at the end counts as a name
  const fs::path path = fs::weakly_canonical(base / wanted);
  if (!isBelow(path, base) || holdsLink(path)) {
    throw std::invalid_argument("the path '" + relative + "' leads out of " + root);
  }
  return path.string();
}

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
