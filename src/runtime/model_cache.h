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
  std::size_t bytes = 0;       ///< of its parameters
  bool in_use = false;         ///< by somebody other than the cache
  bool outdated = false;       ///< the file has changed or been removed
  std::string metadata_error;  ///< why the present metadata cannot be used; empty: they are in use
};

/// The models in memory, with the metadata of their objects (ObjectMetadata). All users of a file
/// share one model, which is read once. After a change of the file, the next request reads it
/// again; users of the old model keep it unchanged.
///
/// Under a memory budget, the least recently used models are freed first, but none that is in use
/// (to which somebody other than the cache holds a pointer). Thread-safe.
class ModelCache {
 public:
  /// Limits the memory of models. The first caller who sets a limit decides.
  /// @param bytes 0: leaves the limit as it is; at first there is none.
  /// @param owner of the limit, for error messages. @throws std::invalid_argument naming both
  /// owners, if another limit was set before.
  void setBudget(std::size_t bytes, const std::string& owner);

  /// The model in a file, named after the file. Files are read one after another.
  /// @throws std::runtime_error as loadField, and if it does not fit beside the models in use.
  std::shared_ptr<const Field> load(const std::string& path);

  /// The same model with new metadata, if its YAML file has changed since it was loaded and has
  /// been stable for a moment (an editor may still be writing).
  /// @return null if nothing has changed, or if the model file itself has: `load` reads that.
  /// @throws std::runtime_error naming what is wrong with the file, or if the model would lose its
  /// scale; once for each change.
  std::shared_ptr<const Field> renewed(const std::shared_ptr<const Field>& field);

  /// Adds a model that the caller has just written to a file.
  /// @return the model with the metadata of its YAML file. @throws std::runtime_error as
  /// readObjectMetadata, and if it does not fit beside the models in use.
  std::shared_ptr<const Field> put(const std::string& path, std::shared_ptr<const Field> field);

  /// Frees the model of a file. @return whether there was one.
  /// @throws std::runtime_error if it is in use.
  bool unload(const std::string& path);

  /// The file of a model that was handed out; empty if it was none of these.
  std::string pathOf(const std::shared_ptr<const Field>& field) const;

  /// All models in memory, in no special order.
  std::vector<CachedModel> list() const;

  /// Number of model files read so far.
  std::uint64_t filesRead() const;

 private:
  /// Device, inode, size and modification time: they tell different contents apart.
  using FileIdentity = std::tuple<std::uint64_t, std::uint64_t, std::uint64_t, std::int64_t>;

  struct Identity {
    FileIdentity model;
    std::optional<FileIdentity> metadata;  ///< empty: there is no such file

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
    std::uint64_t used_at;    ///< value of use_counter_ at the last use
    bool superseded = false;  ///< the file was read again since then
    std::optional<Change> change;
  };

  static Identity identityOf(const std::string& path);
  void forgetSuperseded() const;
  void supersede(const std::string& path);
  Entry* entryOf(const std::shared_ptr<const Field>& field);
  std::shared_ptr<const Field> find(const std::string& path, const Identity& identity);
  std::shared_ptr<const Field> findSameModel(const std::string& path,
                                             const Identity& identity) const;
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

/// Memory of a field's parameters [bytes].
std::size_t memoryBytes(const Field& field);

}  // namespace nerf_pose_refiner
