// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <list>
#include <string>
#include <type_traits>

#include "device_memory.h"

namespace nerf_pose_refiner {

/// The key of a recorded graph: the bytes of all that is baked into it.
class GraphKey {
 public:
  /// @param value without references to what may change: pointers are to memory of the device.
  template <typename T>
  GraphKey& add(T value) {
    static_assert(std::is_trivially_copyable_v<T>, "its bytes must be all of it");
#if defined(__has_builtin)
#if __has_builtin(__builtin_clear_padding)
    __builtin_clear_padding(&value);  // or equal values may differ, and are recorded twice
#endif
#endif
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  bool operator==(const GraphKey& other) const { return bytes_ == other.bytes_; }

 private:
  std::string bytes_;
};

/// The graphs that were used last: a request for the same work reuses its graph.
class GraphCache {
 public:
  /// The graph of a key. @param enqueue what it records, to the stream, if it is not known.
  template <typename Enqueue>
  const CudaGraph& get(const GraphKey& key, cudaStream_t stream, const Enqueue& enqueue) {
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (!(entry->key == key)) continue;
      entries_.splice(entries_.begin(), entries_, entry);
      return entry->graph;
    }
    if (entries_.size() == kMaxGraphs) {
      NPR_CUDA_CHECK(cudaStreamSynchronize(stream));  // the oldest one may still run
      entries_.pop_back();
    }
    entries_.emplace_front();
    try {
      entries_.front().graph.record(stream, enqueue);
    } catch (...) {
      entries_.pop_front();
      throw;
    }
    entries_.front().key = key;
    return entries_.front().graph;
  }

 private:
  static constexpr std::size_t kMaxGraphs = 8;
  struct Entry {
    GraphKey key;
    CudaGraph graph;
  };
  std::list<Entry> entries_;  ///< the last used first
};

}  // namespace nerf_pose_refiner
