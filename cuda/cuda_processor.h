// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "align.h"
#include "backend/common/scratch_pool.h"
#include "backend/cost_counters.h"
#include "backend/loaded_field.h"
#include "cuda_field.h"
#include "cuda_frame.h"
#include "device_memory.h"
#include "graph_cache.h"
#include "hypotheses.h"
#include "image_level.h"
#include "optimise.h"
#include "render.h"
#include "unknown_background.h"

namespace nerf_pose_refiner {

/// An image on the device, and where it is copied from.
struct StagedImage {
  PinnedBuffer<float> staged;
  DeviceBuffer<float> image;
};

/// A level of an observation on the device.
struct CudaLevel {
  CudaCamera camera = {};
  double blur_px = 0;
  DeviceBuffer<float4> image;    ///< [h][w]: RGB, premultiplied by alpha, and alpha; not blurred
  DeviceBuffer<float> weight;    ///< [h][w]
  DeviceBuffer<float4> blurred;  ///< [h][w][2], @see image_level.h
};

/// A moment in the stream, and what had been spent by then.
struct CudaMoment {
  CudaTimer time;
  PinnedBuffer<CudaWork> work;
};

/// Hypotheses on their way to the host.
struct CudaSnapshot {
  CudaMoment moment;
  PinnedBuffer<CudaHypothesis> items;  ///< [bound]
  PinnedBuffer<int> count;
};

/// Memory of a solver. The next one gets it, so that for the same shape all addresses stay.
struct CudaSolverMemory {
  std::vector<CudaLevel> levels;  ///< at least as many as the solver has
  DeviceBuffer<CudaHypothesis> items, scratch;
  DeviceBuffer<int> order, count;
  DeviceBuffer<double> samples_per_ray;
  CudaMoment start;
  std::vector<std::unique_ptr<CudaSnapshot>> snapshots;  ///< at least as many as are kept
};

/// Memory that a call needs for a while; it grows and stays. Calls that follow each other in the
/// stream use the same.
struct CudaWorkspace {
  StagedImage image, alpha, weight;
  CudaEvent uploaded;  ///< behind the images that were enqueued last
  DeviceBuffer<float> kernel, window;
  DeviceBuffer<CameraPose<double>> poses, priors;

  // Rendering.
  DeviceBuffer<CudaView> views;
  DeviceBuffer<RayHit> hits;
  DeviceBuffer<unsigned> hit_count;
  DeviceBuffer<float4> images, scratch, rays;
  PinnedBuffer<float4> pinned_image;
  CudaMoment rendered;

  // Alignment.
  DeviceBuffer<AlignmentSearch> searches;
  DeviceBuffer<int> active;
  PinnedBuffer<int> pinned_active;
  DeviceBuffer<double> partial_sums;
  DeviceBuffer<float> opacity, inside_weight, background_density;
  DeviceBuffer<float4> behind, statistics, observed;
  DeviceBuffer<ColourCounts> counts;
  CudaEvent evaluated[2];  ///< behind the evaluations that were enqueued last

  // Inversion.
  DeviceBuffer<int> live;
  DeviceBuffer<double2> scores;
  DeviceBuffer<DescentClock> clock;
  DeviceBuffer<RayRecord> records;
  DeviceBuffer<RayPoint> ray_points;
  DeviceBuffer<GradientSums> gradient_sums;
  DeviceBuffer<RayHit> ray_hits;
  GraphCache graphs;     ///< of a few steps each
  CudaEvent stepped[2];  ///< behind the graphs that were launched last
};

/// A CUDA device at work: what the fields, solvers and trainers of a backend share. One stream,
/// which is no other's. One caller at a time.
class CudaProcessor {
 public:
  explicit CudaProcessor(int device);
  ~CudaProcessor();

  int device() const { return device_; }
  cudaStream_t stream() const { return stream_; }
  void enter() const;  ///< makes the device the calling thread's
  void wait() const { stream_.wait(); }

  CudaWorkspace& space() { return space_; }
  ScratchPool<CudaSolverMemory>& solvers() { return solvers_; }
  /// Of all aligners, which may use it beside all else.
  const std::shared_ptr<CudaFrames>& frames() const { return frames_; }

  /// A rendering of a number of views from space().poses to space().images, with the options'
  /// defaults. @throws std::invalid_argument for too many rays.
  RenderTask renderTask(const CudaField& field, const CudaCamera& camera, int views,
                        int rays_per_side);

  /// Enqueues the download of what was spent so far.
  void mark(CudaMoment* moment);
  /// What had been spent by a moment that is past.
  static CostCounters costsAt(const CudaMoment& moment);
  /// Notes the last moment that was waited for.
  void waitedFor(const CudaMoment& last) { costs_ = costsAt(last); }
  CudaWork* meter() { return meter_.data(); }

  /// As of the last moment that was waited for, and of the trainers.
  CostCounters costs() const;
  CostCounters* trainingCosts() { return &training_; }

 private:
  int device_;
  CudaStream stream_;
  CudaWorkspace space_;
  ScratchPool<CudaSolverMemory> solvers_;
  std::shared_ptr<CudaFrames> frames_ = makeCudaFrames();
  DeviceBuffer<CudaWork> meter_;
  CostCounters costs_, training_;
};

/// A camera as kernels see it.
CudaCamera plainCamera(const Camera& camera);

}  // namespace nerf_pose_refiner
