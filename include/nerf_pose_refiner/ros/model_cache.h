// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <vector>

#include "nerf_pose_refiner/field/field.h"

namespace nerf_pose_refiner {

/// A model in memory.
struct CachedModel {
  std::string path;
  FieldMetadata metadata;
  std::size_t bytes = 0;  ///< of its numbers
  bool in_use = false;    ///< by somebody beside the cache
  bool outdated = false;  ///< the file is another one by now, or gone
};

/// Models in memory, shared by everybody who asks for the same file: each is read once. A file that
/// was changed is read again for who asks next; whoever has the old one keeps it whole.
///
/// With a budget the least recently used go first, and never one in use. (In use is what somebody
/// beside the cache has a pointer to.) May be used from many threads at once.
class ModelCache {
 public:
  /// The most memory that models may take. The first who sets it decides.
  /// @param bytes 0: leaves it as it is, at the beginning without a limit.
  /// @param owner who sets it, for the error. @throws std::invalid_argument naming both, if another
  /// budget was set.
  void setBudget(std::size_t bytes, const std::string& owner);

  /// The model in a file, called as the file is. Files are read one after the other.
  /// @throws std::runtime_error as loadModel, and if it does not fit beside what is in use.
  std::shared_ptr<const Field> load(const std::string& path);

  /// Makes known what a file holds, by whom it was written.
  /// @throws std::runtime_error if it does not fit beside what is in use.
  void put(const std::string& path, std::shared_ptr<const Field> field);

  /// Forgets what was read of a file. @return whether anything was.
  /// @throws std::runtime_error if it is in use.
  bool unload(const std::string& path);

  /// All models in memory, in no special order.
  std::vector<CachedModel> list() const;

  /// How often a file was read.
  std::uint64_t filesRead() const;

 private:
  /// Device, inode, size and time of the last change: what another content differs in.
  using FileIdentity = std::tuple<std::uint64_t, std::uint64_t, std::uint64_t, std::int64_t>;

  struct Entry {
    std::string path;
    FileIdentity identity;
    std::shared_ptr<const Field> field;
    std::size_t bytes;
    std::uint64_t used_at;    ///< of use_counter_
    bool superseded = false;  ///< the file was read again since: nobody will ask for this one
  };

  static FileIdentity identityOf(const std::string& path);
  void forgetSuperseded() const;
  std::shared_ptr<const Field> find(const std::string& path, const FileIdentity& identity);
  void makeRoom(const std::string& path, std::size_t bytes);
  void insert(const std::string& path, const FileIdentity& identity,
              std::shared_ptr<const Field> field);

  std::mutex reading_;        ///< held while a file is read
  mutable std::mutex mutex_;  ///< guards all below
  mutable std::vector<Entry> entries_;
  std::uint64_t use_counter_ = 0;
  std::uint64_t files_read_ = 0;
  std::size_t budget_bytes_ = 0;  ///< 0: none
  std::string budget_owner_;
};

/// Memory that a field's numbers take [bytes].
std::size_t memoryBytes(const Field& field);

}  // namespace nerf_pose_refiner
