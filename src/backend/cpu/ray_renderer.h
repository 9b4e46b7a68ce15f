// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "backend/cost_counters.h"
#include "backend/cpu/cpu_processor.h"
#include "backend/loaded_field.h"
#include "backend/plans.h"
#include "backend/pose_solver.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A ray in the object's model frame O.
struct Ray {
  float origin[3];     ///< [model units]
  float direction[3];  ///< unit length
};

/// Rays side by side.
struct RaySpan {
  const Ray* data;
  int size;

  const Ray& operator[](int i) const { return data[i]; }
  RaySpan part(int first, int count) const { return {data + first, count}; }
};

/// What a ray sees: sums over its samples, with w the sample's weight (transmittance * opacity).
struct RayResult {
  float rgb[3];    ///< sum of w * colour: premultiplied, sRGB-encoded
  float alpha;     ///< sum of w
  float point[3];  ///< sum of w * p_O [model units]: divide by alpha for the expected point
};

/// The gradient of a loss at a ray (Lin et al., eq. 2 and 3).
struct RayGradient {
  float force[3];   ///< sum of dL/dp_i [1 / model unit]
  float torque[3];  ///< sum of t_i (d x dL/dp_i), t_i from the ray's origin [1 / rad]
};

/// Derivative of a loss with respect to what a ray saw.
struct RayLossGradient {
  float rgb[3];
  float alpha;
};

/// The derivative of a loss for ray i, which has this result.
using RayLoss = std::function<RayLossGradient(int i, const RayResult&)>;

/// A field in the CPU backend: whatever rays can be cast through is rendered and searched for. The
/// hash grid is one; an analytic scene takes its place in tests. The casting of rays may be called
/// from many threads at once.
class RayRenderer : public LoadedField {
 public:
  /// @param processor that works on it.
  explicit RayRenderer(std::shared_ptr<CpuProcessor> processor = std::make_shared<CpuProcessor>())
      : processor_(std::move(processor)) {}

  CpuProcessor& processor() const { return *processor_; }

  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const final;
  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const final;

  /// Renders rays, each into its own result. Results do not depend on how rays are grouped.
  /// @return what it cost.
  virtual CostCounters renderRays(RaySpan rays, const RenderOptions& options,
                                  RayResult* results) const = 0;

  /// Renders rays, calls `loss` once for each, and propagates its derivative back to the sample
  /// positions with the parameters frozen. Sample distances are held fixed; the viewing direction's
  /// own term is added to the torque if `direction_gradient`. @return what it cost.
  virtual CostCounters rayGradients(RaySpan rays, const RenderOptions& options,
                                    bool direction_gradient, const RayLoss& loss,
                                    RayGradient* gradients) const = 0;

 private:
  std::shared_ptr<CpuProcessor> processor_;
};

}  // namespace nerf_pose_refiner
