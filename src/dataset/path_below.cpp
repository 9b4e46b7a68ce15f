// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/path_below.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

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

}  // namespace nerf_pose_refiner
