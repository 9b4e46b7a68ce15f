// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/shared_features.h"

#include <algorithm>
#include <chrono>
#include <tuple>

#include "math/checksum.h"

namespace nerf_pose_refiner {
namespace {

std::uint64_t checksumOf(const Image8& grey, const Image8& where) {
  Checksum checksum;
  checksum.add(grey.values.data(), grey.values.size());
  checksum.add(where.values.data(), where.values.size());
  return checksum.value();
}

}  // namespace

bool SharedFeatures::isEqual(const Key& a, const Key& b) {
  const auto all = [](const Key& key) {
    return std::tie(key.checksum, key.width, key.height, key.settings.kind,
                    key.settings.max_features, key.settings.contrast);
  };
  return all(a) == all(b);
}

std::shared_ptr<const ImageFeatures> SharedFeatures::of(const Image8& grey, const Image8& where,
                                                        const FeatureSettings& settings,
                                                        const CancellationToken& cancellation) {
  constexpr std::chrono::milliseconds kTick(2);
  const Key key = {checksumOf(grey, where), grey.width, grey.height, settings};
  std::promise<std::shared_ptr<const ImageFeatures>> promise;
  {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto known = std::find_if(entries_.begin(), entries_.end(),
                                    [&](const Entry& entry) { return isEqual(entry.key, key); });
    if (known != entries_.end()) {
      const auto features = known->features;
      entries_.splice(entries_.begin(), entries_, known);
      lock.unlock();
      do {
        cancellation.check();
      } while (features.wait_for(kTick) != std::future_status::ready);
      return features.get();
    }
    entries_.push_front({key, promise.get_future().share()});
    if (entries_.size() > kImages) entries_.pop_back();
  }
  try {
    const auto features =
        std::make_shared<const ImageFeatures>(findFeatures(grey, where, settings));
    promise.set_value(features);
    return features;
  } catch (...) {
    promise.set_exception(std::current_exception());
    const std::lock_guard<std::mutex> lock(mutex_);
    entries_.remove_if([&](const Entry& entry) { return isEqual(entry.key, key); });
    throw;
  }
}

SharedFeatures& SharedFeatures::ofProcess() {
  static SharedFeatures features;
  return features;
}

}  // namespace nerf_pose_refiner
