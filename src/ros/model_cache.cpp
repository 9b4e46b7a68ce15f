// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/model_cache.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "nerf_pose_refiner/field/model_file.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kAttempts = 5;  // to read a file that changes while it is read

std::string megabytes(std::size_t bytes) { return std::to_string((bytes + 999999) / 1000000); }

}  // namespace

std::size_t memoryBytes(const Field& field) {
  return field.grid.size() * sizeof(std::uint16_t) +
         (field.density_weights.size() + field.colour_weights.size()) * sizeof(float) +
         field.occupancy.bits.size();
}

ModelCache::FileIdentity ModelCache::identityOf(const std::string& path) {
  struct stat file {};
  if (stat(path.c_str(), &file) != 0) {
    throw std::runtime_error("cannot load the model '" + path + "': " + std::strerror(errno));
  }
  const std::int64_t changed_ns = file.st_mtim.tv_sec * 1000000000LL + file.st_mtim.tv_nsec;
  return {file.st_dev, file.st_ino, static_cast<std::uint64_t>(file.st_size), changed_ns};
}

void ModelCache::setBudget(std::size_t bytes, const std::string& owner) {
  if (bytes == 0) return;
  std::lock_guard<std::mutex> lock(mutex_);
  if (budget_bytes_ != 0 && budget_bytes_ != bytes) {
    throw std::invalid_argument("parameter ~model_memory_mb of " + owner + " is " +
                                megabytes(bytes) + ", but " + budget_owner_ + " has set " +
                                megabytes(budget_bytes_) + " for all refiners of this process");
  }
  if (budget_bytes_ == 0) budget_owner_ = owner;
  budget_bytes_ = bytes;
}

std::shared_ptr<const Field> ModelCache::find(const std::string& path,
                                              const FileIdentity& identity) {
  std::lock_guard<std::mutex> lock(mutex_);
  for (Entry& entry : entries_) {
    if (entry.path != path || entry.identity != identity) continue;
    entry.used_at = ++use_counter_;
    return entry.field;
  }
  return nullptr;
}

/// Frees what was kept for its users alone, and has none any more. Called with mutex_ held.
void ModelCache::forgetSuperseded() const {
  entries_.erase(std::remove_if(entries_.begin(), entries_.end(),
                                [](const Entry& entry) {
                                  return entry.superseded && entry.field.use_count() == 1;
                                }),
                 entries_.end());
}

/// Forgets models until another one, which takes the place of what was read of its file, fits.
/// Called with mutex_ held.
void ModelCache::makeRoom(const std::string& path, std::size_t bytes) {
  for (Entry& entry : entries_) {
    if (entry.path == path) entry.superseded = true;
    if (entry.field.use_count() > 1) entry.used_at = ++use_counter_;  // it is used now
  }
  forgetSuperseded();
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
                               " MB, models in use take " + megabytes(sum - bytes) +
                               " MB, and the ~model_memory_mb that " + budget_owner_ +
                               " has set is " + megabytes(budget_bytes_));
    }
    sum -= oldest->bytes;
    entries_.erase(oldest);
  }
}

void ModelCache::insert(const std::string& path, const FileIdentity& identity,
                        std::shared_ptr<const Field> field) {
  std::lock_guard<std::mutex> lock(mutex_);
  const std::size_t bytes = memoryBytes(*field);
  makeRoom(path, bytes);
  entries_.push_back({path, identity, std::move(field), bytes, ++use_counter_});
}

std::shared_ptr<const Field> ModelCache::load(const std::string& path) {
  std::lock_guard<std::mutex> reading(reading_);
  for (int attempt = 0;; ++attempt) {
    const FileIdentity identity = identityOf(path);
    if (std::shared_ptr<const Field> known = find(path, identity)) return known;
    {
      // Before it is read, by the file's size: the budget counts while two are in memory, too.
      std::lock_guard<std::mutex> lock(mutex_);
      makeRoom(path, std::get<2>(identity));
      ++files_read_;
    }
    auto field = std::make_shared<Field>(loadModel(path));
    // Another file may have been put in its place meanwhile: then it is not known which was read.
    if (identityOf(path) != identity && attempt < kAttempts) continue;
    field->metadata.name = std::filesystem::path(path).stem().string();  // it may be renamed
    insert(path, identity, field);
    return field;
  }
}

void ModelCache::put(const std::string& path, std::shared_ptr<const Field> field) {
  insert(path, identityOf(path), std::move(field));
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

std::vector<CachedModel> ModelCache::list() const {
  std::lock_guard<std::mutex> lock(mutex_);
  forgetSuperseded();
  std::vector<CachedModel> models;
  for (const Entry& entry : entries_) {
    const bool in_use = entry.field.use_count() > 1;
    bool outdated = true;
    try {
      outdated = identityOf(entry.path) != entry.identity;
    } catch (const std::runtime_error&) {  // it is gone
    }
    models.push_back({entry.path, entry.field->metadata, entry.bytes, in_use, outdated});
  }
  return models;
}

std::uint64_t ModelCache::filesRead() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return files_read_;
}

}  // namespace nerf_pose_refiner
