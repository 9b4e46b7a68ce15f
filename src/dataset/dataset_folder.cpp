// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/dataset_folder.h"

#include <algorithm>
#include <stdexcept>

#include "dataset/path_below.h"
#include "files/input_file.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxEntries = 100000;  // of a folder: a directory can be endless

}  // namespace

DatasetFolder::DatasetFolder(const std::string& path, bool confined)
    : path_(path), confined_(confined) {}

std::string DatasetFolder::path(const std::string& relative) const {
  return confined_ ? pathBelow(path_.empty() ? "." : path_, relative)
                   : (fs::path(path_) / relative).lexically_normal().string();
}

bool DatasetFolder::hasFile(const std::string& relative) const {
  std::error_code ignored;
  return fs::is_regular_file(fs::path(path_) / relative, ignored) &&
         fs::is_regular_file(path(relative), ignored);
}

bool DatasetFolder::hasFolder(const std::string& relative) const {
  std::error_code ignored;
  return fs::is_directory(fs::path(path_) / relative, ignored) &&
         fs::is_directory(path(relative), ignored);
}

std::vector<std::string> DatasetFolder::names(const std::string& relative,
                                              fs::file_type type) const {
  std::vector<std::string> result;
  if (!hasFolder(relative)) return result;
  std::size_t entries = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(path(relative))) {
    if (++entries > kMaxEntries) {
      throw std::runtime_error("'" + path(relative) + "' has more than " +
                               std::to_string(kMaxEntries) + " entries");
    }
    std::error_code ignored;
    if (entry.status(ignored).type() == type) result.push_back(entry.path().filename().string());
  }
  std::sort(result.begin(), result.end());
  return result;
}

std::vector<std::string> DatasetFolder::files(const std::string& relative) const {
  return names(relative, fs::file_type::regular);
}

std::vector<std::string> DatasetFolder::folders(const std::string& relative) const {
  return names(relative, fs::file_type::directory);
}

std::string DatasetFolder::read(const std::string& relative, std::uint64_t max_bytes) const {
  const std::string file = path(relative);
  try {
    return readWhole(InputFile(file), max_bytes);
  } catch (const std::exception& error) {
    throw std::runtime_error("cannot read '" + file + "': " + error.what());
  }
}

std::string joined(const std::string& a, const std::string& b) {
  return (std::filesystem::path(a) / b).lexically_normal().string();
}

}  // namespace nerf_pose_refiner
