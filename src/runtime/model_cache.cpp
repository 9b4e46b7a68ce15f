// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/model_cache.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "field/object_metadata.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kAttempts = 5;  // at reading a file that changes meanwhile
constexpr std::chrono::milliseconds kSettled(
    300);  // a file that has not changed for this time is complete

std::string megabytes(std::size_t bytes) { return std::to_string((bytes + 999999) / 1000000); }

}  // namespace

std::size_t memoryBytes(const Field& field) {
  return field.grid.size() * sizeof(std::uint16_t) +
         (field.density_weights.size() + field.colour_weights.size()) * sizeof(float) +
         field.occupancy.bits.size();
}

ModelCache::Identity ModelCache::identityOf(const std::string& path) {
  const auto fileAt = [](const std::string& file_path) -> std::optional<FileIdentity> {
    struct stat file {};
    if (stat(file_path.c_str(), &file) != 0) return std::nullopt;
    const std::int64_t changed_ns = file.st_mtim.tv_sec * 1000000000LL + file.st_mtim.tv_nsec;
    return FileIdentity{file.st_dev, file.st_ino, static_cast<std::uint64_t>(file.st_size),
                        changed_ns};
  };
  const std::optional<FileIdentity> model = fileAt(path);
  if (!model) {
    throw std::runtime_error("cannot load the model '" + path + "': " + std::strerror(errno));
  }
  return {*model, fileAt(metadataPathOf(path))};
}

void ModelCache::setBudget(std::size_t bytes, const std::string& owner) {
  if (bytes == 0) return;
  std::lock_guard<std::mutex> lock(mutex_);
  if (budget_bytes_ != 0 && budget_bytes_ != bytes) {
    throw std::invalid_argument(owner + " limits the memory of models to " + megabytes(bytes) +
                                " MB, but " + budget_owner_ + " has limited it to " +
                                megabytes(budget_bytes_) + " MB for all refiners of this process");
  }
  if (budget_bytes_ == 0) budget_owner_ = owner;
  budget_bytes_ = bytes;
}

std::shared_ptr<const Field> ModelCache::find(const std::string& path, const Identity& identity) {
  std::lock_guard<std::mutex> lock(mutex_);
  for (Entry& entry : entries_) {
    if (entry.path != path || !(entry.identity == identity)) continue;
    entry.used_at = ++use_counter_;
    return entry.field;
  }
  return nullptr;
}

/// The field that was read from the same model file, possibly with other metadata.
std::shared_ptr<const Field> ModelCache::findSameModel(const std::string& path,
                                                       const Identity& identity) const {
  std::lock_guard<std::mutex> lock(mutex_);
  for (const Entry& entry : entries_) {
    if (entry.path == path && entry.identity.model == identity.model) return entry.field;
  }
  return nullptr;
}

/// Null if the cache does not hold it. Called with mutex_ held.
ModelCache::Entry* ModelCache::entryOf(const std::shared_ptr<const Field>& field) {
  for (Entry& entry : entries_) {
    if (entry.field == field) return &entry;
  }
  return nullptr;
}

/// Frees superseded models that have no users any more. Called with mutex_ held.
void ModelCache::forgetSuperseded() const {
  entries_.erase(std::remove_if(entries_.begin(), entries_.end(),
                                [](const Entry& entry) {
                                  return entry.superseded && entry.field.use_count() == 1;
                                }),
                 entries_.end());
}

/// Marks the models that were read from a file before as superseded. Called with mutex_ held.
void ModelCache::supersede(const std::string& path) {
  for (Entry& entry : entries_) {
    if (entry.path == path) entry.superseded = true;
    if (entry.field.use_count() > 1) entry.used_at = ++use_counter_;  // it is used now
  }
  forgetSuperseded();
}

/// Frees models until a new one fits, which supersedes those of the same file. Called with mutex_
/// held.
void ModelCache::makeRoom(const std::string& path, std::size_t bytes) {
  supersede(path);
  if (budget_bytes_ == 0) return;
  std::size_t sum = bytes;
  for (const Entry& entry : entries_) sum += entry.bytes;
  while (sum > budget_bytes_) {
    auto oldest = entries_.end();
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (entry->field.use_count() > 1) continue;
      if (oldest == entries_.end() || entry->used_at < oldest->used_at) oldest = entry;
    }
    if (oldest == entries_.end()) {
      throw std::runtime_error("the model '" + path + "' takes " + megabytes(bytes) +
                               " MB, models in use take " + megabytes(sum - bytes) + " MB, and " +
                               budget_owner_ + " has limited the memory of models to " +
                               megabytes(budget_bytes_) + " MB");
    }
    sum -= oldest->bytes;
    entries_.erase(oldest);
  }
}

void ModelCache::insert(const std::string& path, const Identity& identity,
                        std::shared_ptr<const Field> field) {
  std::lock_guard<std::mutex> lock(mutex_);
  const std::size_t bytes = memoryBytes(*field);
  makeRoom(path, bytes);
  entries_.push_back({path, identity, std::move(field), bytes, ++use_counter_, false, {}});
}

/// Reads the model, or only the object's metadata if the model is in memory. Called with reading_
/// held. @return null if the files changed meanwhile: try again.
std::shared_ptr<const Field> ModelCache::read(const std::string& path, const Identity& identity) {
  std::shared_ptr<Field> field;
  const std::shared_ptr<const Field> same_model = findSameModel(path, identity);
  if (same_model) {
    // Not counted against the budget: the old one is freed as soon as its users have the new one.
    field = std::make_shared<Field>(*same_model);
    field->metadata = readObject(path);
  } else {
    {
      // Before it is read, by the file's size: the budget also holds while both are in memory.
      std::lock_guard<std::mutex> lock(mutex_);
      makeRoom(path, std::get<2>(identity.model));
      ++files_read_;
    }
    field = std::make_shared<Field>(loadField(path));
  }
  if (!(identityOf(path) == identity)) return nullptr;
  field->metadata.name =
      std::filesystem::path(path).stem().string();  // the file may have been renamed
  if (!same_model) {
    insert(path, identity, field);
    return field;
  }
  std::lock_guard<std::mutex> lock(mutex_);
  supersede(path);
  entries_.push_back({path, identity, field, memoryBytes(*field), ++use_counter_, false, {}});
  return field;
}

std::shared_ptr<const Field> ModelCache::load(const std::string& path) {
  std::lock_guard<std::mutex> reading(reading_);
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const Identity identity = identityOf(path);
    if (std::shared_ptr<const Field> known = find(path, identity)) return known;
    if (std::shared_ptr<const Field> field = read(path, identity)) return field;
  }
  throw std::runtime_error("cannot load the model '" + path +
                           "': it changed during each attempt to read it");
}

/// Whether an object's metadata changed, has been stable for kSettled, and was not reported as
/// unusable yet. Records the change.
bool ModelCache::isSettled(const std::shared_ptr<const Field>& field, const Identity& identity) {
  const auto now = std::chrono::steady_clock::now();
  std::lock_guard<std::mutex> lock(mutex_);
  Entry* entry = entryOf(field);
  if (!entry) return false;
  if (entry->identity == identity) {
    entry->change.reset();
    return false;
  }
  if (!entry->change || !(entry->change->identity == identity)) {
    entry->change = Change{identity, now, ""};
    return false;
  }
  return entry->change->error.empty() && now - entry->change->seen >= kSettled;
}

std::shared_ptr<const Field> ModelCache::renewed(const std::shared_ptr<const Field>& field) {
  std::lock_guard<std::mutex> reading(reading_);
  std::string path;
  Identity known;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    const Entry* entry = entryOf(field);
    if (!entry) return nullptr;
    path = entry->path;
    known = entry->identity;
  }
  if (!std::filesystem::exists(path)) return nullptr;
  const Identity now = identityOf(path);
  if (now.model != known.model || !isSettled(field, now)) return nullptr;
  try {
    std::shared_ptr<const Field> renewed = find(path, now);  // another caller has read it
    if (!renewed) renewed = read(path, now);
    if (renewed && field->metadata.metres_per_unit > 0 &&
        !(renewed->metadata.metres_per_unit > 0)) {
      throw std::runtime_error("neither the model '" + path +
                               "' nor the YAML file beside it has metres_per_unit any more");
    }
    return renewed;
  } catch (const std::exception& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (Entry* entry = entryOf(field)) entry->change->error = e.what();
    throw;
  }
}

std::shared_ptr<const Field> ModelCache::put(const std::string& path,
                                             std::shared_ptr<const Field> field) {
  const Identity identity = identityOf(path);
  if (identity.metadata) {
    auto described = std::make_shared<Field>(*field);
    apply(readObjectMetadata(metadataPathOf(path)), &described->metadata);
    field = std::move(described);
  }
  insert(path, identity, field);
  return field;
}

bool ModelCache::unload(const std::string& path) {
  std::lock_guard<std::mutex> lock(mutex_);
  const std::size_t before = entries_.size();
  entries_.erase(std::remove_if(entries_.begin(), entries_.end(),
                                [&](const Entry& entry) {
                                  return entry.path == path && entry.field.use_count() == 1;
                                }),
                 entries_.end());
  const bool in_use = std::any_of(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return entry.path == path; });
  if (in_use) throw std::runtime_error("the model '" + path + "' is in use");
  return entries_.size() < before;
}

std::string ModelCache::pathOf(const std::shared_ptr<const Field>& field) const {
  std::lock_guard<std::mutex> lock(mutex_);
  for (const Entry& entry : entries_) {
    if (entry.field == field) return entry.path;
  }
  return {};
}

std::vector<CachedModel> ModelCache::list() const {
  std::vector<CachedModel> models;
  std::vector<Identity> identities;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    forgetSuperseded();
    for (const Entry& entry : entries_) {
      const bool in_use = entry.field.use_count() > 1;
      models.push_back({entry.path, entry.field->metadata, entry.bytes, in_use, /*outdated=*/true,
                        entry.change ? entry.change->error : std::string()});
      identities.push_back(entry.identity);
    }
  }
  // Without the lock: to look at a file takes as long as its disk or network.
  for (std::size_t i = 0; i < models.size(); ++i) {
    try {
      models[i].outdated = identityOf(models[i].path).model != identities[i].model;
    } catch (const std::runtime_error&) {  // the file has been removed
    }
  }
  return models;
}

std::uint64_t ModelCache::filesRead() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return files_read_;
}

}  // namespace nerf_pose_refiner
