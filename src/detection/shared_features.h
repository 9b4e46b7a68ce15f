// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <future>
#include <list>
#include <memory>
#include <mutex>

#include "detection/image_features.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

/// Features of the images that were asked for last, so that detectors of several objects find those
/// of an image once. Any thread; who asks for an image that another thread is at waits for it.
class SharedFeatures {
 public:
  /// As findFeatures. @throws what that throws, Cancelled.
  std::shared_ptr<const ImageFeatures> of(const Image8& grey, const Image8& where,
                                          const FeatureSettings& settings,
                                          const CancellationToken& cancellation);

  /// Those of this process.
  static SharedFeatures& ofProcess();

 private:
  static constexpr std::size_t kImages = 4;  // that are kept: up to 4 MiB each

  /// What features depend on.
  struct Key {
    std::uint64_t checksum;
    int width, height;
    FeatureSettings settings;
  };
  struct Entry {
    Key key;
    std::shared_future<std::shared_ptr<const ImageFeatures>> features;
  };

  static bool isEqual(const Key& a, const Key& b);

  std::mutex mutex_;          // guards what follows
  std::list<Entry> entries_;  // the latest first
};

}  // namespace nerf_pose_refiner
