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

/// @throws std::invalid_argument unless the name is made of letters, digits, "_", "-" and ".", of
/// at most 100 characters, the first being a letter or a digit.
void requireObjectName(const std::string& name);

/// A model that cannot be tracked.
class ModelError : public std::runtime_error {
 public:
  enum class Reason {
    kUnreadable,  ///< its file is missing, damaged or foreign
    kNoScale,     ///< it does not know how many metres its unit has
  };
  ModelError(Reason reason, const std::string& message)
      : std::runtime_error(message), reason_(reason) {}
  Reason reason() const { return reason_; }

 private:
  Reason reason_;
};

/// A model that is there, in a file or in memory.
struct StoredObject {
  std::string name;
  bool in_memory = false;
  bool in_use = false;     ///< by a refiner of this process
  std::size_t bytes = 0;   ///< in memory, or of the file
  FieldMetadata metadata;  ///< as far as it can be read
  std::string message;     ///< what is wrong with it; empty: nothing
};

/// Models of objects with metric scale in a folder: <root>/<name>.safetensors. May be used from
/// many threads at once; copies share what is in memory.
class ObjectStore {
 public:
  /// @param cache where models are kept, shared with other stores; outlives this object.
  ObjectStore(const std::string& root, ModelCache* cache) : root_(root), cache_(cache) {}

  const std::string& root() const { return root_; }
  const ModelCache& cache() const { return *cache_; }

  /// @throws ModelError naming the file and what is wrong with it.
  std::shared_ptr<const Field> load(const std::string& name) const;

  /// The model, or null if there is no such file. @throws ModelError as `load`, but not for the
  /// lack of a scale.
  std::shared_ptr<const Field> find(const std::string& name) const;

  /// The same model, once its object's metadata has changed: as ModelCache::renewed.
  std::shared_ptr<const Field> renewed(const std::shared_ptr<const Field>& field) const;

  /// The metadata of an object, whose model need not be there yet.
  /// @throws std::runtime_error as readObjectMetadata.
  ObjectMetadata metadataOf(const std::string& name) const;

  /// Makes sure that a model of this shape can be saved under a name; creates the folder.
  /// @throws as `save`.
  void requireWritable(const std::string& name, const FieldConfig& config) const;

  /// Writes under the name in its metadata; creates the folder.
  /// @return it with the object's metadata.
  /// @throws std::invalid_argument for a bad name, std::runtime_error if it cannot be written: then
  /// the file that was there stays.
  std::shared_ptr<const Field> save(std::shared_ptr<const Field> field) const;

  /// Frees the memory of a model; the file stays.
  /// @throws std::invalid_argument for a bad name, std::runtime_error if it is in use or not in
  /// memory.
  void unload(const std::string& name) const;

  /// All models of the folder, by name, and those in memory whose files are gone.
  std::vector<StoredObject> list() const;

 private:
  /// @throws std::invalid_argument also if the object's metadata is elsewhere.
  std::string pathOf(const std::string& name) const;

  std::string root_;
  ModelCache* cache_;
};

}  // namespace nerf_pose_refiner
