// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "backend/common/frame_part.h"
#include "backend/common/scratch_pool.h"

namespace nerf_pose_refiner {

/// The parts of images that the aligners of a backend look at. Where several look at one image
/// (the same CameraPixels), each part of it is made once, by the first that needs it: together with
/// what others of the same thread are expected to look at after it, if that saves work. Readers in
/// other threads are left out: making their own part takes them less time than waiting for this
/// one. What a reader sees does not depend on the others. Thread-safe.
/// @tparam Frame makes parts, in memory that it reuses.
template <typename Frame>
class SharedFrames {
 public:
  /// @param work_to_begin what making a part costs beside its pixels, @see makingWork.
  explicit SharedFrames(double work_to_begin)
      : work_to_begin_(work_to_begin), memory_([] { return std::make_unique<Frame>(); }) {}

 private:
  using PixelsPtr = std::shared_ptr<const CameraPixels>;

  // A part that is there, or is being made.
  struct Made {
    FramePart part;
    std::weak_ptr<const CameraPixels> pixels;
    typename ScratchPool<Frame>::Lease memory;
    std::promise<void> promise;
    std::shared_future<void> is_ready = promise.get_future().share();

    Made(const FramePart& made, const PixelsPtr& from, typename ScratchPool<Frame>::Lease lease)
        : part(made), pixels(from), memory(std::move(lease)) {}
  };

  // What a reader looked at first in its last image.
  struct Look {
    std::weak_ptr<const CameraPixels> pixels;
    FramePart part;
    int width, height;  // of the image
    std::thread::id thread;
  };

 public:
  /// One aligner's. It keeps what it looked at last, until the next. Not thread-safe.
  class Reader {
   public:
    explicit Reader(std::shared_ptr<SharedFrames> frames) : frames_(std::move(frames)) {}
    ~Reader() { frames_->forget(this); }
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;

    /// A part that holds some levels of an observation. An ignored part of the image (weight) is
    /// the reader's own affair: such frames are not shared.
    /// @param make fills a frame: void(const FramePart&, Frame*). @throws what it throws.
    template <typename Make>
    void look(const Observation& observation, const FrameLevels& levels, const Make& make) {
      const bool is_shared = observation.pixels != nullptr && observation.weight.empty();
      bool is_new = false;
      current_ = frames_->take(this, is_shared ? observation.pixels : nullptr, levels,
                               std::move(current_), &is_new);
      try {
        if (is_new) {
          make(current_->part, current_->memory.get());
          current_->promise.set_value();
        }
        current_->is_ready.get();
      } catch (...) {
        if (is_new) current_->promise.set_exception(std::current_exception());
        current_.reset();
        throw;
      }
    }

    /// What `look` took.
    const FramePart& part() const { return current_->part; }
    const Frame& frame() const { return *current_->memory.get(); }

   private:
    std::shared_ptr<SharedFrames> frames_;
    std::shared_ptr<Made> current_;
  };

 private:
  static bool areEqual(const std::weak_ptr<const CameraPixels>& a,
                       const std::weak_ptr<const CameraPixels>& b) {
    return !a.owner_before(b) && !b.owner_before(a);
  }

  // The part that a reader looks at. @param before what it has. @param is_new it is to be made.
  std::shared_ptr<Made> take(const Reader* reader, const PixelsPtr& pixels,
                             const FrameLevels& levels, std::shared_ptr<Made> before,
                             bool* is_new) {
    const std::lock_guard<std::mutex> lock(mutex_);
    FramePart part = partFor(levels);
    if (pixels != nullptr) {
      if (std::shared_ptr<Made> found = find(pixels, levels)) {
        note(reader, pixels, part, levels.camera());
        return found;
      }
      part = withOthers(reader, pixels, part, levels.camera());
      note(reader, pixels, partFor(levels), levels.camera());
    }
    before.reset();  // its memory may be used again
    *is_new = true;
    auto made = std::make_shared<Made>(part, pixels, memory_.borrow());
    if (pixels != nullptr) made_.push_back(made);
    return made;
  }

  std::shared_ptr<Made> find(const PixelsPtr& pixels, const FrameLevels& levels) {
    std::shared_ptr<Made> found;
    const auto is_gone = [&](const std::weak_ptr<Made>& weak) {
      const std::shared_ptr<Made> made = weak.lock();
      if (made != nullptr && areEqual(made->pixels, pixels) && made->part.holds(levels)) {
        found = made;
      }
      return made == nullptr;
    };
    made_.erase(std::remove_if(made_.begin(), made_.end(), is_gone), made_.end());
    return found;
  }

  // With the parts of those of this thread who looked at the same image before this one.
  FramePart withOthers(const Reader* reader, const PixelsPtr& pixels, FramePart part,
                       const Camera& camera) const {
    const auto own = looks_.find(reader);
    if (own == looks_.end() || areEqual(own->second.pixels, pixels)) return part;
    for (const auto& [other, look] : looks_) {
      const bool is_expected = other != reader && look.thread == std::this_thread::get_id() &&
                               areEqual(look.pixels, own->second.pixels) &&
                               look.width == camera.width && look.height == camera.height;
      // (What looks at the same object, as this reader's own, finds nearly all in its part.)
      constexpr double kSame = 0.75;
      if (!is_expected || shareWithin(look.part, own->second.part) > kSame) continue;
      constexpr int kMoves = 8;  // by that fraction of its size, from an image to the next
      const PixelWindow& window = look.part.window;
      const FramePart expected =
          widened(look.part, std::max(window.width, window.height) / kMoves, camera);
      const FramePart both = together(part, expected, camera);
      if (makingWork(both) <= makingWork(part) + makingWork(look.part) + work_to_begin_) {
        part = both;
      }
    }
    return part;
  }

  void note(const Reader* reader, const PixelsPtr& pixels, const FramePart& part,
            const Camera& camera) {
    Look& look = looks_[reader];
    if (areEqual(look.pixels, pixels)) return;
    look = {pixels, part, camera.width, camera.height, std::this_thread::get_id()};
  }

  void forget(const Reader* reader) {
    const std::lock_guard<std::mutex> lock(mutex_);
    looks_.erase(reader);
  }

  double work_to_begin_;
  ScratchPool<Frame> memory_;
  std::mutex mutex_;                       // guards all below
  std::vector<std::weak_ptr<Made>> made_;  // of shared images
  std::map<const Reader*, Look> looks_;
};

}  // namespace nerf_pose_refiner
