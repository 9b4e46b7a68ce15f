// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "field/field.h"
#include "field/object_metadata.h"
#include "runtime/model_cache.h"

namespace nerf_pose_refiner {

/// @throws std::invalid_argument unless the name has 1 to 100 letters, digits, "_", "-" and ".",
/// the first of them a letter or a digit.
void requireObjectName(const std::string& name);

/// A model that cannot be tracked.
class ModelError : public std::runtime_error {
 public:
  enum class Reason {
    kUnreadable,  ///< its file is missing, damaged or of another kind
    kNoScale,     ///< the length of its unit in metres is unknown
  };
  ModelError(Reason reason, const std::string& message)
      : std::runtime_error(message), reason_(reason) {}
  Reason reason() const { return reason_; }

 private:
  Reason reason_;
};

/// A model in a file or in memory.
struct StoredObject {
  std::string name;
  bool in_memory = false;
  bool in_use = false;     ///< by a refiner of this process
  std::size_t bytes = 0;   ///< in memory, or of the file
  FieldMetadata metadata;  ///< empty if the file cannot be read
  std::string message;     ///< what is wrong with it; empty: nothing
};

/// The models in a folder, <root>/<name>.safetensors. Thread-safe; copies share the models in
/// memory.
class ObjectStore {
 public:
  /// @param cache holds the models in memory, shared with other stores; must outlive this object.
  ObjectStore(const std::string& root, ModelCache* cache) : root_(root), cache_(cache) {}

  const std::string& root() const { return root_; }
  const ModelCache& cache() const { return *cache_; }

  /// The model with metric scale. @throws ModelError naming the file and what is wrong with it.
  std::shared_ptr<const Field> load(const std::string& name) const;

  /// The model, or null if there is no such file. It may lack a scale. @throws ModelError as
  /// `load`.
  std::shared_ptr<const Field> find(const std::string& name) const;

  /// @see ModelCache::renewed.
  std::shared_ptr<const Field> renewed(const std::shared_ptr<const Field>& field) const;

  /// The metadata in the YAML file of an object, which need not have a model yet.
  /// @throws std::runtime_error as readObjectMetadata.
  ObjectMetadata metadataOf(const std::string& name) const;

  /// Checks that a model of this shape can be saved under a name; creates the folder.
  /// @throws as `save`.
  void requireWritable(const std::string& name, const FieldConfig& config) const;

  /// Writes a model under the name in its metadata; creates the folder.
  /// @return the model with the metadata of its YAML file.
  /// @throws std::invalid_argument for a bad name, std::runtime_error if it cannot be written: an
  /// existing file is then unchanged.
  std::shared_ptr<const Field> save(std::shared_ptr<const Field> field) const;

  /// Frees the memory of a model; the file stays.
  /// @throws std::invalid_argument for a bad name, std::runtime_error if it is in use or not in
  /// memory.
  void unload(const std::string& name) const;

  /// All models in the folder, sorted by name, and those in memory whose files were removed.
  std::vector<StoredObject> list() const;

 private:
  /// @throws std::invalid_argument for a bad name, or if the metadata is outside the folder.
  std::string pathOf(const std::string& name) const;

  std::string root_;
  ModelCache* cache_;
};

}  // namespace nerf_pose_refiner
