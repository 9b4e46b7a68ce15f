// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>

#include "backend/cost_counters.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/loaded_field.h"
#include "field/field.h"
#include "support/cpu_processor.h"

namespace nerf_pose_refiner {

/// Another scene whose rays are counted; requests cancellation when so many have been cast. What is
/// done after that is counted apart: a measure of the delay that no load disturbs.
class StoppingScene final : public RayRenderer {
 public:
  /// @param threads that work on it.
  StoppingScene(std::shared_ptr<const RayRenderer> scene, std::uint64_t stop_after, int threads)
      : RayRenderer(cpuProcessor(threads)), scene_(std::move(scene)), stop_after_(stop_after) {}

  const CancellationToken cancellation;

  std::uint64_t rays() const { return rays_; }
  std::uint64_t raysAfterTheStop() const { return late_rays_; }  ///< of calls that began after it
  int maxRaysPerCall() const { return max_; }

  const Field& field() const override { return scene_->field(); }

  CostCounters renderRays(RaySpan rays, const RenderOptions& options,
                          RayResult* results) const override {
    count(rays.size);
    return scene_->renderRays(rays, options, results);
  }

  CostCounters rayGradients(RaySpan rays, const RenderOptions& options, bool direction_gradient,
                            const RayLoss& loss, RayGradient* gradients) const override {
    count(rays.size);
    return scene_->rayGradients(rays, options, direction_gradient, loss, gradients);
  }

 private:
  void count(int n) const {
    if (cancellation.cancelRequested()) late_rays_ += static_cast<std::uint64_t>(n);
    for (int most = max_; most < n && !max_.compare_exchange_weak(most, n);) {
    }
    if ((rays_ += static_cast<std::uint64_t>(n)) >= stop_after_) cancellation.requestCancel();
  }

  std::shared_ptr<const RayRenderer> scene_;
  std::uint64_t stop_after_;
  mutable std::atomic<std::uint64_t> rays_{0}, late_rays_{0};
  mutable std::atomic<int> max_{0};
};

}  // namespace nerf_pose_refiner
