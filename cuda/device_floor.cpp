// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "device_floor.h"

#include <algorithm>

#include "backend/common/plain_pose.h"
#include "cuda_processor.h"
#include "evaluate.h"
#include "gather_rate.h"
#include "render.h"

namespace nerf_pose_refiner {
namespace {

/// Seconds of each of some repetitions on the device, after three to warm up.
template <typename Enqueue>
std::vector<double> timed(cudaStream_t stream, int repetitions, const Enqueue& enqueue) {
  for (int i = 0; i < 3; ++i) enqueue();
  const CudaTimer begin, end;
  std::vector<double> seconds;
  for (int i = 0; i < repetitions; ++i) {
    begin.record(stream);
    enqueue();
    end.record(stream);
    end.wait();
    seconds.push_back(end.secondsSince(begin));
  }
  return seconds;
}

double medianOf(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

}  // namespace

DeviceFloor measureDeviceFloor(std::size_t table_bytes) {
  constexpr std::size_t kCopied = std::size_t{1} << 29;
  const CudaStream stream;
  DeviceBuffer<char> from(kCopied), to(kCopied);
  from.clear(kCopied, stream);
  DeviceFloor floor;
  cudaDeviceProp properties;
  int device = 0;
  NPR_CUDA_CHECK(cudaGetDevice(&device));
  NPR_CUDA_CHECK(cudaGetDeviceProperties(&properties, device));
  floor.name = properties.name;
  floor.bytes_per_s = 2.0 * kCopied / medianOf(timed(stream, 10, [&] {
                        NPR_CUDA_CHECK(cudaMemcpyAsync(to.data(), from.data(), kCopied,
                                                       cudaMemcpyDeviceToDevice, stream));
                      }));
  std::size_t entries = 1;
  while (entries * 2 * sizeof(std::uint64_t) <= table_bytes) entries *= 2;
  DeviceBuffer<std::uint64_t> table(entries);
  DeviceBuffer<unsigned> sink(1);
  table.clear(entries, stream);
  floor.gathers_per_s =
      static_cast<double>(kGathersPerLaunch) / medianOf(timed(stream, 10, [&] {
        gatherOnce(table.data(), static_cast<unsigned>(entries - 1), sink.data(), stream);
      }));
  DeviceBuffer<float> unused(1);
  floor.flops_per_s = kOperationsPerLaunch /
                      medianOf(timed(stream, 10, [&] { multiplyOnce(unused.data(), stream); }));
  return floor;
}

std::size_t deviceMemoryUsed() {
  std::size_t free = 0, total = 0;
  NPR_CUDA_CHECK(cudaMemGetInfo(&free, &total));
  return total - free;
}

std::vector<double> timeEvaluations(const Field& field, const std::vector<float>& positions,
                                    const std::vector<float>& directions, bool with_gradient,
                                    int repetitions) {
  const CudaStream stream;
  const CudaField loaded(std::make_shared<Field>(field), stream);
  const std::size_t n = positions.size() / 3;
  DeviceBuffer<float> p, d, g;
  DeviceBuffer<float4> values(n), gradients;
  p.upload(positions, stream);
  d.upload(directions, stream);
  EvaluationTask task = {};
  task.count = static_cast<int>(n);
  task.positions = p.data();
  task.directions = d.data();
  task.values = values.data();
  if (with_gradient) {
    gradients.upload(std::vector<float4>(n, float4{0.1f, -0.2f, 0.3f, 0.001f}), stream);
    g.reserve(3 * n);
    task.gradients = gradients.data();
    task.position_gradients = g.data();
  }
  return timed(stream, repetitions, [&] { evaluateSamples(loaded.view(), task, stream); });
}

std::vector<double> timeRenderings(const Field& field, const View& seen, int repetitions) {
  const CudaStream stream;
  const CudaField loaded(std::make_shared<Field>(field), stream);
  const std::size_t pixels = static_cast<std::size_t>(seen.camera.width) * seen.camera.height;
  DeviceBuffer<CameraPose<double>> pose;
  DeviceBuffer<CudaView> view(1);
  DeviceBuffer<RayHit> hits(pixels);
  DeviceBuffer<unsigned> hit_count(2);
  DeviceBuffer<float4> image(2 * pixels);
  DeviceBuffer<CudaWork> work;
  work.clear(1, stream);
  const CameraPose<double> plain = plainPose(seen.T_O_C);
  pose.upload(&plain, 1, stream);
  RenderTask task = {};
  task.camera = plainCamera(seen.camera);
  task.poses = pose.data();
  task.view_count = 1;
  task.rays_per_side = 1;
  task.step_scale = 1;
  task.min_transmittance = RenderOptions().min_transmittance;
  task.min_weight = RenderOptions().min_weight;
  task.use_occupancy = true;
  task.views = view.data();
  task.hits.items = hits.data();
  task.hits.counts = hit_count.data();
  task.images = task.rays = image.data();
  task.costs = loaded.costs();
  task.work = work.data();
  return timed(stream, repetitions, [&] { renderImages(loaded.view(), task, stream); });
}

}  // namespace nerf_pose_refiner
