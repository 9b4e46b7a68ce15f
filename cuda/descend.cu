// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "descend.h"

#include "cast_rays.cuh"
#include "launch.cuh"
#include "nerf_pose_refiner/maths/pixel_loss.h"
#include "nerf_pose_refiner/maths/random.h"
#include "ray_hits.cuh"

// Rays of the paper's mode, for all hypotheses at once. First all of them are cast, which gives the
// loss; then those that saw something are walked along again and pull. No gradient of a parameter
// is computed.

namespace nerf_pose_refiner {
namespace {

constexpr int kCastThreads = 128;
constexpr int kPullThreads = 384;
constexpr int kFindThreads = 256;

/// The pixel that a ray goes through: the same for every hypothesis.
__device__ int pixelOf(const DescentTask& task, unsigned id) {
  const unsigned pixels = task.camera.width * task.camera.height;
  const auto stream = static_cast<std::uint64_t>(static_cast<std::int64_t>(task.clock->step));
  return static_cast<int>(randomIndex(task.seed, stream, id % task.clock->rays, pixels));
}

__device__ RayLattice rayOf(const CudaFieldView& field, const DescentTask& task,
                            const MarchSpace& space, unsigned id) {
  const int pixel = pixelOf(task, id);
  const CameraPose<double>& pose = task.batch.items[task.live[id / task.clock->rays]].pose;
  const float x = static_cast<float>((pixel % task.camera.width - task.camera.cx) / task.camera.fx);
  const float y = static_cast<float>((pixel / task.camera.width - task.camera.cy) / task.camera.fy);
  const float scale = rsqrtf(x * x + y * y + 1);
  const double position[3] = {pose.o.x, pose.o.y, pose.o.z};
  float origin[3], direction[3];
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    direction[a] =
        scale * (static_cast<float>(pose.R.m[a][0]) * x + static_cast<float>(pose.R.m[a][1]) * y +
                 static_cast<float>(pose.R.m[a][2]));
    origin[a] = (static_cast<float>(position[a]) - field.origin[a]) / field.side;
  }
  return RayLattice(origin, direction, space, 0);
}

/// What a ray saw, compared with its pixel.
__device__ void recordRay(const DescentTask& task, unsigned id, const float rgb[3], float alpha) {
  const int pixel = pixelOf(task, id);
  const float4 seen = task.image[pixel];
  const float observed[3] = {seen.x, seen.y, seen.z};
  const PixelLossTerm term =
      task.background_known
          ? lossBeforeKnown(task.loss, rgb, alpha, task.background, observed, task.weight[pixel])
          : lossBeforeUnknown(task.loss, rgb, alpha, observed, task.weight[pixel]);
  RayRecord r;
  r.value = term.alpha * alpha;
  for (int c = 0; c < 3; ++c) {
    r.rgb[c] = term.rgb[c];
    r.value += term.rgb[c] * rgb[c];
  }
  r.alpha = term.alpha;
  r.loss = term.loss;
  r.weight = term.weight;
  task.records[id] = r;
}

/// Threads take rays: lists those that meet matter; the others have seen all that they will.
__global__ void __launch_bounds__(kFindThreads)
    findRaysKernel(const __grid_constant__ CudaFieldView field,
                   const __grid_constant__ DescentTask task,
                   const __grid_constant__ MarchSpace space) {
  const unsigned all = static_cast<unsigned>(task.clock->live) * task.clock->rays;
  const unsigned first = blockIdx.x * blockDim.x + threadIdx.x - threadIdx.x % 32;
  for (unsigned base = first; base < all; base += gridDim.x * blockDim.x) {  // whole warps
    const unsigned id = base + threadIdx.x % 32;
    RayInterval interval = {0, 0, 0};
    const bool found =
        id < all && findMatter(rayOf(field, task, space, id), space.occupancy, &interval);
    appendHit({task.hits, &task.clock->found}, found, {id, static_cast<unsigned>(interval.k)});
    if (id < all && !found) {
      const float nothing[3] = {0, 0, 0};
      recordRay(task, id, nothing, 0);
      task.forces[id] = RayForce();
    }
  }
  // The rays themselves are counted here.
  if (blockIdx.x == 0 && threadIdx.x == 0) {
    atomicAdd(&task.work->rays, static_cast<unsigned long long>(all));
  }
}

/// Listed rays on their way forward; @see findSamples.
struct CastSource {
  const CudaFieldView& field;
  const DescentTask& task;
  const MarchSpace& space;
  HitQueue queue;

  __device__ CastSource(const CudaFieldView& the_field, const DescentTask& the_task,
                        const MarchSpace& the_space)
      : field(the_field), task(the_task), space(the_space) {}

  __device__ bool active() const { return queue.active; }
  __device__ bool exhausted() const { return queue.exhausted; }
  __device__ void start(RayGroup* ray) {
    ray->start(rayOf(field, task, space, queue.hit.id), static_cast<int>(queue.hit.first));
  }

  __device__ bool turnOver(const RayGroup& ray) {
    const bool done = queue.active && ray.ended && ray.count == 0;
    if (__any_sync(kWholeWarp, done)) {
      const float rgb[3] = {groupSum(ray.rgb[0]), groupSum(ray.rgb[1]), groupSum(ray.rgb[2])};
      const float alpha = groupSum(ray.alpha);
      if (done) {
        if (laneSlot() == 0) recordRay(task, queue.hit.id, rgb, alpha);
        queue.active = false;
      }
    }
    return queue.take({task.hits, &task.clock->found}, &task.clock->cast);
  }
};

/// A persistent grid: warps take rays until there are none.
template <int W>
__global__ void __launch_bounds__(kCastThreads, 4)
    castKernel(const __grid_constant__ CudaFieldView field,
               const __grid_constant__ DescentTask task, const __grid_constant__ MarchSpace space) {
  CastSource source(field, task, space);
  const LaneWork work = castRays<W>(field, space, task.min_transmittance, task.min_weight, &source);
  unsigned samples = work.samples;
  for (int away = 1; away < 32; away *= 2) {
    samples += __shfl_xor_sync(kWholeWarp, samples, away);
  }
  if (threadIdx.x % 32 == 0 && samples > 0) {
    atomicAdd(&task.clock->samples, static_cast<unsigned long long>(samples));
  }
  addWork(task.costs, work.samples, work.colours, task.work);
}

/// Listed rays that pull; @see findSamples.
struct PullSource {
  const CudaFieldView& field;
  const DescentTask& task;
  const MarchSpace& space;
  HitQueue queue;
  RayRecord record;
  float in_front = 0;  // what the samples so far contributed to record.value
  RayForce sum = {};   // over this lane's samples, in units of N

  __device__ PullSource(const CudaFieldView& the_field, const DescentTask& the_task,
                        const MarchSpace& the_space)
      : field(the_field), task(the_task), space(the_space) {}

  __device__ bool active() const { return queue.active; }
  __device__ bool exhausted() const { return queue.exhausted; }

  __device__ void start(RayGroup* ray) {
    ray->start(rayOf(field, task, space, queue.hit.id), static_cast<int>(queue.hit.first));
    in_front = 0;
    sum = RayForce();
  }

  __device__ bool turnOver(const RayGroup& ray) {
    const bool done = queue.active && ray.ended && ray.count == 0;
    if (__any_sync(kWholeWarp, done)) {
      RayForce total;
#pragma unroll
      for (int a = 0; a < 3; ++a) {
        total.force[a] = groupSum(sum.force[a]) / field.side;
        total.torque[a] = groupSum(sum.torque[a]);
      }
      if (done) {
        if (laneSlot() == 0) task.forces[queue.hit.id] = total;
        queue.active = false;
      }
    }
    if (!queue.take({task.hits, &task.clock->found}, &task.clock->pulled)) return false;
    record = task.records[queue.hit.id];
    const bool pulls =
        record.rgb[0] != 0 || record.rgb[1] != 0 || record.rgb[2] != 0 || record.alpha != 0;
    if (!pulls) {
      if (laneSlot() == 0) task.forces[queue.hit.id] = RayForce();
      queue.active = false;
    }
    return pulls;
  }

  /// Derivatives of the loss by the logits of the lane's colour and density. All lanes take part.
  __device__ float4 logitGradient(const SampleWeight& sample, float density, float length,
                                  const float3& rgb) {
    const float value =
        record.rgb[0] * rgb.x + record.rgb[1] * rgb.y + record.rgb[2] * rgb.z + record.alpha;
    // Samples that the cast left out only hide what is behind them.
    const bool heavy = sample.seen && sample.weight >= task.min_weight;
    float so_far = heavy ? sample.weight * value : 0.0f;
#pragma unroll
    for (int away = 1; away < kRaySamples; away *= 2) {
      const float other = __shfl_up_sync(kWholeWarp, so_far, away, kRaySamples);
      if (laneSlot() >= away) so_far += other;
    }
    // What is behind cannot weigh more than the light that reaches it: rounding must not, either,
    // for it is multiplied by the density.
    const float most = sample.transmittance_behind * (fabsf(record.rgb[0]) + fabsf(record.rgb[1]) +
                                                      fabsf(record.rgb[2]) + fabsf(record.alpha));
    const float behind = fminf(fmaxf(record.value - in_front - so_far, -most), most);
    in_front += __shfl_sync(kWholeWarp, so_far, kRaySamples - 1, kRaySamples);
    if (!sample.seen) return make_float4(0, 0, 0, 0);
    const float w = heavy ? sample.weight : 0.0f;
    const float through = heavy ? sample.transmittance_behind * value : 0.0f;
    return make_float4(
        record.rgb[0] * w * rgb.x * (1 - rgb.x), record.rgb[1] * w * rgb.y * (1 - rgb.y),
        record.rgb[2] * w * rgb.z * (1 - rgb.z), length * (through - behind) * density);
  }

  /// Adds a sample's pull. @param gradient by its position, in N.
  __device__ void add(const RayGroup& ray, const float gradient[3], const float lever_extra[3]) {
    const float* d = ray.lattice.direction;
    float lever[3];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      sum.force[a] += gradient[a];
      lever[a] = ray.t * gradient[a] + lever_extra[a];
    }
    sum.torque[0] += d[1] * lever[2] - d[2] * lever[1];
    sum.torque[1] += d[2] * lever[0] - d[0] * lever[2];
    sum.torque[2] += d[0] * lever[1] - d[1] * lever[0];
  }
};

constexpr float kLeastGradient = 1e-20f;  // what is less pulls at nothing, and has no inverse

/// A persistent grid, as castKernel. Every sample's gradient goes back scaled to one and is scaled
/// again behind: halves hold it, however small it is.
template <int W>
__global__ void __launch_bounds__(kPullThreads, 1)
    pullKernel(const __grid_constant__ CudaFieldView field,
               const __grid_constant__ DescentTask task, const __grid_constant__ MarchSpace space) {
  const WarpMemory memory = enterBlock(field, kRaySamples, true);
  WarpNetworks<W> networks(field.shape, memory);
  __half* const harmonics = memory.harmonics + memory.lane / kRaySamples * kHarmonics;
  PullSource source(field, task, space);
  RayGroup ray;
  bool needs_harmonics = true;
  while (true) {
    bool fresh = false;
    if (!findSamples(space.occupancy, &source, &ray, &fresh)) break;
    needs_harmonics = needs_harmonics || fresh;
    const bool ready = source.active() && hasFullGroup(ray);
    if (!__any_sync(kWholeWarp, ready)) continue;
    const bool valid = ready && laneSlot() < ray.count;
    if (valid) {
      float p[3];
      samplePosition(ray, p);
      encode<true>(field, p, memory.row(), memory.slopeRow(), memory.slopePlane());
      if (needs_harmonics && laneSlot() == 0) {
        writeHarmonics(ray.lattice.direction, field.sh_degree, harmonics);
      }
    }
    needs_harmonics = needs_harmonics && !ready;
    const float density = expf(fminf(networks.template density<true>(), 30.0f));
    const float length = ray.length;
    const SampleWeight sample = weighSamples(density, task.min_transmittance, ready, &ray);
    const float3 rgb = networks.template colour<true>(kRaySamples);
    const float4 g = source.logitGradient(sample, density, length, rgb);
    const float scale = fmaxf(fmaxf(fabsf(g.x), fabsf(g.y)), fmaxf(fabsf(g.z), fabsf(g.w)));
    const bool pulls = scale > kLeastGradient && isfinite(scale);
    if (!__any_sync(kWholeWarp, pulls)) continue;
    const float inverse = pulls ? 1 / scale : 0.0f;
    float by_harmonics[kHarmonics] = {};
    networks.backward(pulls
                          ? make_float4(inverse * g.x, inverse * g.y, inverse * g.z, inverse * g.w)
                          : make_float4(0, 0, 0, 0),
                      task.direction_gradient ? by_harmonics : nullptr);
    if (!pulls) continue;
    float gradient[3], lever[3] = {0, 0, 0};
    positionGradient(field, memory.row(), memory.slopeRow(), memory.slopePlane(), gradient);
    const float* d = ray.lattice.direction;
    if (task.direction_gradient) {
      sphericalHarmonicsGradient(d[0], d[1], d[2], field.sh_degree, by_harmonics, lever);
    }
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      gradient[a] *= scale;
      lever[a] *= scale;
    }
    source.add(ray, gradient, lever);
  }
}

void castAll(const CudaFieldView& field, const DescentTask& task, cudaStream_t stream) {
  launchPersistent(findRaysKernel, kFindThreads, 0, stream, field, task, marchSpace(field, 1));
  const int bytes = SharedLayout(field.shape, kRaySamples, false).bytes(kCastThreads / 32);
  const auto kernel = field.shape.width == 32 ? castKernel<32> : castKernel<64>;
  launchPersistent(kernel, kCastThreads, bytes, stream, field, task, marchSpace(field, 1));
}

}  // namespace

void descendOnce(const CudaFieldView& field, const DescentTask& task, int hypotheses,
                 cudaStream_t stream) {
  beginStep(task, stream);
  castAll(field, task, stream);
  const SharedLayout layout(field.shape, kRaySamples, true);
  const auto kernel = field.shape.width == 32 ? pullKernel<32> : pullKernel<64>;
  const int threads = threadsThatFit(kPullThreads, layout.weight_bytes, layout.warp_bytes);
  launchPersistent(kernel, threads, layout.bytes(threads / 32), stream, field, task,
                   marchSpace(field, 1));
  updatePoses(task, hypotheses, stream);
}

void measureLosses(const CudaFieldView& field, const DescentTask& task, int pixels, int hypotheses,
                   cudaStream_t stream) {
  startDescent(task, 0, stream);
  beginMeasuring(task, pixels, stream);
  castAll(field, task, stream);
  sumLosses(task, hypotheses, stream);
}

}  // namespace nerf_pose_refiner
