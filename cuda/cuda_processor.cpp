// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_processor.h"

#include <limits>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

CudaCamera plainCamera(const Camera& camera) {
  CudaCamera plain;
  plain.fx = camera.fx;
  plain.fy = camera.fy;
  plain.cx = camera.cx;
  plain.cy = camera.cy;
  plain.width = camera.width;
  plain.height = camera.height;
  return plain;
}

CudaProcessor::CudaProcessor(int device)
    : device_(device), solvers_([] { return std::make_unique<CudaSolverMemory>(); }) {
  meter_.clear(1, stream_);
  space_.hit_count.reserve(2);
}

CudaProcessor::~CudaProcessor() {
  cudaSetDevice(device_);  // a destructor never throws
  cudaStreamSynchronize(stream_);
}

void CudaProcessor::enter() const { NPR_CUDA_CHECK(cudaSetDevice(device_)); }

RenderTask CudaProcessor::renderTask(const CudaField& field, const CudaCamera& camera, int views,
                                     int rays_per_side) {
  const auto n = static_cast<std::size_t>(views);
  const std::size_t pixels = n * static_cast<std::size_t>(camera.width) * camera.height;
  const std::size_t rays = pixels * static_cast<std::size_t>(rays_per_side * rays_per_side);
  if (rays > std::numeric_limits<unsigned>::max() / 2) {
    throw std::invalid_argument("too many rays to be rendered at once: " + std::to_string(rays));
  }
  space_.views.reserve(n);
  space_.poses.reserve(n);
  space_.images.reserve(2 * pixels);
  space_.hits.reserve(rays);
  if (rays_per_side > 1) space_.rays.reserve(2 * rays);
  RenderTask task = {};
  task.camera = camera;
  task.poses = space_.poses.data();
  task.view_count = views;
  task.rays_per_side = rays_per_side;
  task.step_scale = 1;
  task.min_weight = RenderOptions().min_weight;
  task.use_occupancy = true;
  task.views = space_.views.data();
  task.hits.items = space_.hits.data();
  task.hits.counts = space_.hit_count.data();
  task.images = space_.images.data();
  task.rays = rays_per_side > 1 ? space_.rays.data() : space_.images.data();
  task.costs = field.costs();
  task.work = meter_.data();
  return task;
}

void CudaProcessor::mark(CudaMoment* moment) {
  moment->work.reserve(1);
  NPR_CUDA_CHECK(cudaMemcpyAsync(moment->work.data(), meter_.data(), sizeof(CudaWork),
                                 cudaMemcpyDeviceToHost, stream_));
  moment->time.record(stream_);
}

CostCounters CudaProcessor::costsAt(const CudaMoment& moment) {
  const CudaWork& meter = *moment.work.data();
  CostCounters costs;
  costs.rays = meter.rays;
  costs.samples = meter.samples;
  costs.colour_samples = meter.colour_samples;
  costs.gathers = static_cast<double>(meter.gathers);
  costs.flops = static_cast<double>(meter.flops);
  return costs;
}

CostCounters CudaProcessor::costs() const {
  CostCounters all = costs_;
  return all += training_;
}

}  // namespace nerf_pose_refiner
