// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "field/field.h"

namespace nerf_pose_refiner {

/// A model in memory.
struct CachedModel {
  std::string path;
  FieldMetadata metadata;
  std::size_t bytes = 0;       ///< of its numbers
  bool in_use = false;         ///< outside of the cache
  bool outdated = false;       ///< the file is another one by now, or gone
  std::string metadata_error;  ///< why the object's present metadata is not in use; empty: it is
};

/// Models in memory with their objects' metadata (ObjectMetadata), shared by all users of a file:
/// each is read once. A file that was changed is read again for the next request; users of the old
/// model keep it unchanged.
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
  /// @throws std::runtime_error as loadField, and if it does not fit beside what is in use.
  std::shared_ptr<const Field> load(const std::string& path);

  /// The same model, once its object's metadata differs from when it was loaded, and the file
  /// that says so has not changed for a moment: who edits it may be writing yet.
  /// @return null: all is as it was, or the model's own file is another one, which waits for
  /// `load`.
  /// @throws std::runtime_error naming what is wrong with the file, or that the model lost its
  /// scale thereby; once, until it changes again.
  std::shared_ptr<const Field> renewed(const std::shared_ptr<const Field>& field);

  /// Makes known what a file holds, by whom it was written.
  /// @return it with the object's metadata. @throws std::runtime_error as readObjectMetadata,
  /// and if it does not fit beside what is in use.
  std::shared_ptr<const Field> put(const std::string& path, std::shared_ptr<const Field> field);

  /// Forgets what was read of a file. @return whether anything was.
  /// @throws std::runtime_error if it is in use.
  bool unload(const std::string& path);

  /// The file of a model that was handed out; empty if it was none of these.
  std::string pathOf(const std::shared_ptr<const Field>& field) const;

  /// All models in memory, in no special order.
  std::vector<CachedModel> list() const;

  /// How often a file was read.
  std::uint64_t filesRead() const;

 private:
  /// Device, inode, size and time of the last change: what another content differs in.
  using FileIdentity = std::tuple<std::uint64_t, std::uint64_t, std::uint64_t, std::int64_t>;

  struct Identity {
    FileIdentity model;
    std::optional<FileIdentity> metadata;  ///< nothing: there is no such file

    bool operator==(const Identity& other) const {
      return model == other.model && metadata == other.metadata;
    }
  };

  /// A change of an object's metadata that `renewed` has seen.
  struct Change {
    Identity identity;
    std::chrono::steady_clock::time_point seen;
    std::string error;  ///< why it cannot be used
  };

  struct Entry {
    std::string path;
    Identity identity;
    std::shared_ptr<const Field> field;
    std::size_t bytes;
    std::uint64_t used_at;    ///< of use_counter_
    bool superseded = false;  ///< the file was read again since: this one will not be requested
    std::optional<Change> change;
  };

  static Identity identityOf(const std::string& path);
  void forgetSuperseded() const;
  void supersede(const std::string& path);
  Entry* entryOf(const std::shared_ptr<const Field>& field);
  std::shared_ptr<const Field> find(const std::string& path, const Identity& identity);
  std::shared_ptr<const Field> findLooks(const std::string& path, const Identity& identity) const;
  std::shared_ptr<const Field> read(const std::string& path, const Identity& identity);
  bool isSettled(const std::shared_ptr<const Field>& field, const Identity& identity);
  void makeRoom(const std::string& path, std::size_t bytes);
  void insert(const std::string& path, const Identity& identity,
              std::shared_ptr<const Field> field);

  std::mutex reading_;        ///< held while files are read
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
