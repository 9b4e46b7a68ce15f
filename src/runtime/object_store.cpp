// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/object_store.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <set>
#include <stdexcept>
#include <system_error>

#include "dataset/path_below.h"
#include "field/model_file.h"
#include "field/object_metadata.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr char kExtension[] = ".safetensors";

StoredObject onDisk(const std::string& root, const fs::path& file) {
  StoredObject object;
  object.name = file.stem().string();
  try {
    pathBelow(root, file.filename().string());
    object.bytes = fs::file_size(file);
    object.metadata = readObject(file.string());
  } catch (const std::exception& e) {
    object.message = e.what();
  }
  return object;
}

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
  if (root_.empty()) throw std::invalid_argument("the root folder of models is not set");
  // Both files may be links, if these stay below the root. The metadata is the file beside the
  // link, not the one beside its target.
  const std::string file = name + kExtension;
  pathBelow(root_, file);
  pathBelow(root_, metadataPathOf(file));
  return (fs::path(pathBelow(root_, ".")) / file).string();
}

std::shared_ptr<const Field> ObjectStore::find(const std::string& name) const {
  try {
    const std::string path = pathOf(name);
    if (!fs::exists(path)) return nullptr;
    return cache_->load(path);
  } catch (const std::exception& e) {
    throw ModelError(ModelError::Reason::kUnreadable, e.what());
  }
}

std::shared_ptr<const Field> ObjectStore::load(const std::string& name) const {
  std::shared_ptr<const Field> field = find(name);
  if (!field) {
    throw ModelError(ModelError::Reason::kUnreadable,
                     "there is no model '" + name + "' below " + root_);
  }
  if (!(field->metadata.metres_per_unit > 0)) {
    throw ModelError(ModelError::Reason::kNoScale,
                     "the model '" + name +
                         "' has no scale: register it with metres_per_unit, or set metres_per_unit "
                         "in " +
                         name + ".yaml beside it");
  }
  return field;
}

std::shared_ptr<const Field> ObjectStore::renewed(const std::shared_ptr<const Field>& field) const {
  return cache_->renewed(field);
}

ObjectMetadata ObjectStore::metadataOf(const std::string& name) const {
  return readObjectMetadata(metadataPathOf(pathOf(name)));
}

void ObjectStore::requireWritable(const std::string& name, const FieldConfig& config) const {
  const std::string path = pathOf(name);
  fs::create_directories(fs::path(path).parent_path());
  requireModelWritable(config, path);
}

std::shared_ptr<const Field> ObjectStore::save(std::shared_ptr<const Field> field) const {
  const std::string path = pathOf(field->metadata.name);
  fs::create_directories(fs::path(path).parent_path());
  saveModel(*field, path);
  return cache_->put(path, std::move(field));
}

void ObjectStore::unload(const std::string& name) const {
  if (cache_->unload(pathOf(name))) return;
  throw std::runtime_error("the model '" + name + "' is not in memory");
}

std::vector<StoredObject> ObjectStore::list() const {
  std::vector<StoredObject> objects;
  if (root_.empty()) return objects;
  const fs::path root = pathBelow(root_, ".");
  std::set<std::string> known;
  for (const CachedModel& model : cache_->list()) {
    const fs::path path(model.path);
    if (path.parent_path() != root) continue;  // from the folder of another refiner
    StoredObject object{path.stem().string(), true, model.in_use, model.bytes, model.metadata, ""};
    if (model.outdated) object.message = "the file has changed since it was read";
    if (!model.metadata_error.empty()) {
      object.message = "its earlier metadata is in use: " + model.metadata_error;
    }
    if (!model.outdated) known.insert(model.path);
    objects.push_back(object);
  }
  std::error_code no_folder;
  for (const fs::directory_entry& file : fs::directory_iterator(root, no_folder)) {
    if (file.path().extension() != kExtension || known.count(file.path().string()) > 0) continue;
    objects.push_back(onDisk(root_, file.path()));
  }
  std::sort(objects.begin(), objects.end(),
            [](const StoredObject& a, const StoredObject& b) { return a.name < b.name; });
  return objects;
}

}  // namespace nerf_pose_refiner
