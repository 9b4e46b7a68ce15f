// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// The folder of a dataset. Readers find files through it alone, so that a confined dataset names
/// none that lies elsewhere.
class DatasetFolder {
 public:
  /// @param confined whether what is not below the folder is refused.
  DatasetFolder(const std::string& path, bool confined);

  const std::string& path() const { return path_; }
  bool confined() const { return confined_; }

  /// The path of something in the folder.
  /// @throws std::invalid_argument if the folder is confined and it lies elsewhere, as do all
  /// others.
  std::string path(const std::string& relative) const;

  /// Whether something is there and of that kind.
  bool hasFile(const std::string& relative) const;
  bool hasFolder(const std::string& relative) const;

  /// Names of what a folder in it holds, sorted: files, or folders. Empty if it is not there.
  /// @throws std::runtime_error for a folder of more than 100,000 entries.
  std::vector<std::string> files(const std::string& relative) const;
  std::vector<std::string> folders(const std::string& relative) const;

  /// The content of a file. @throws std::runtime_error naming it and the reason.
  std::string read(const std::string& relative, std::uint64_t max_bytes) const;

 private:
  std::vector<std::string> names(const std::string& relative, std::filesystem::file_type) const;

  std::string path_;
  bool confined_;
};

/// a/b, without "." and "..".
std::string joined(const std::string& a, const std::string& b);

}  // namespace nerf_pose_refiner
