// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "optimise.h"

#include "cast_rays.cuh"
#include "launch.cuh"
#include "math/pixel_draw.h"
#include "math/pixel_loss.h"
#include "ray_hits.cuh"

// Rays of the paper's mode, for all hypotheses at once. First all of them are cast, which gives the
// loss; what they have seen is kept, sample by sample. Then the samples' gradients are added, in
// any order: to be bound to the order along the rays is what makes kernels wait. No gradient of a
// parameter is computed.

namespace nerf_pose_refiner {
namespace {

constexpr int kCastThreads = 128;
constexpr int kGradientThreads = 384;
constexpr int kFindThreads = 256;

/// The pixel that a ray goes through: the same for every hypothesis.
__device__ int pixelOf(const OptimisationTask& task, unsigned id) {
  const unsigned pixels = task.camera.width * task.camera.height;
  const auto stream = static_cast<std::uint64_t>(static_cast<std::int64_t>(task.clock->step));
  return static_cast<int>(drawPixel(task.seed, stream, id % task.clock->rays, pixels, task.weight));
}

/// A ray in N.
struct RayLine {
  float origin[3], direction[3];
};

__device__ RayLine lineOf(const CudaFieldView& field, const OptimisationTask& task, unsigned id) {
  const int pixel = pixelOf(task, id);
  const CameraPose<double>& pose = task.batch.items[task.live[id / task.clock->rays]].pose;
  const float x = static_cast<float>((pixel % task.camera.width - task.camera.cx) / task.camera.fx);
  const float y = static_cast<float>((pixel / task.camera.width - task.camera.cy) / task.camera.fy);
  const float scale = rsqrtf(x * x + y * y + 1);
  const double position[3] = {pose.o.x, pose.o.y, pose.o.z};
  RayLine line;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    line.direction[a] =
        scale * (static_cast<float>(pose.R.m[a][0]) * x + static_cast<float>(pose.R.m[a][1]) * y +
                 static_cast<float>(pose.R.m[a][2]));
    line.origin[a] = (static_cast<float>(position[a]) - field.origin[a]) / field.side;
  }
  return line;
}

__device__ RayLattice rayOf(const CudaFieldView& field, const OptimisationTask& task,
                            const MarchSpace& space, unsigned id) {
  const RayLine line = lineOf(field, task, id);
  return RayLattice(line.origin, line.direction, space, 0);
}

/// What a ray saw, compared with its pixel.
__device__ void recordRay(const OptimisationTask& task, unsigned id,
                          const PremultipliedColour& ray) {
  const int pixel = pixelOf(task, id);
  const float4 seen = task.image[pixel];
  const float observed[3] = {seen.x, seen.y, seen.z};
  const PixelLossTerm term =
      task.background_known
          ? lossBeforeKnown(task.loss, ray, task.background, observed, task.weight[pixel])
          : lossBeforeUnknown(task.loss, ray, observed, task.weight[pixel]);
  RayRecord r;
  r.value = term.alpha * ray.alpha;
  for (int c = 0; c < 3; ++c) {
    r.rgb[c] = term.rgb[c];
    r.value += term.rgb[c] * ray.rgb[c];
  }
  r.alpha = term.alpha;
  r.loss = term.loss;
  r.weight = term.weight;
  task.records[id] = r;
}

/// Threads take rays: lists those that meet the occupied volume; the others are complete.
__global__ void __launch_bounds__(kFindThreads)
    findRaysKernel(const __grid_constant__ CudaFieldView field,
                   const __grid_constant__ OptimisationTask task,
                   const __grid_constant__ MarchSpace space) {
  const unsigned all = static_cast<unsigned>(task.clock->live) * task.clock->rays;
  const unsigned first = blockIdx.x * blockDim.x + threadIdx.x - threadIdx.x % 32;
  for (unsigned base = first; base < all; base += gridDim.x * blockDim.x) {  // whole warps
    const unsigned id = base + threadIdx.x % 32;
    RayInterval interval = {0, 0, 0};
    const bool found =
        id < all && findOccupiedVolume(rayOf(field, task, space, id), space.occupancy, &interval);
    appendHit({task.hits, &task.clock->found}, found, {id, static_cast<unsigned>(interval.k)});
    if (id < all && !found) recordRay(task, id, {{0, 0, 0}, 0});
  }
  // The rays themselves are counted here.
  if (blockIdx.x == 0 && threadIdx.x == 0) {
    atomicAdd(&task.work->rays, static_cast<unsigned long long>(all));
  }
}

/// Listed rays on their way forward; @see findSamples.
struct CastSource {
  const CudaFieldView& field;
  const OptimisationTask& task;
  const MarchSpace& space;
  HitQueue queue;
  float4 front = {0, 0, 0, 0};  // sums over the ray's samples so far, the same for the group

  __device__ CastSource(const CudaFieldView& the_field, const OptimisationTask& the_task,
                        const MarchSpace& the_space)
      : field(the_field), task(the_task), space(the_space) {}

  __device__ bool active() const { return queue.active; }
  __device__ bool exhausted() const { return queue.exhausted; }
  __device__ void start(RayGroup* ray) {
    ray->start(rayOf(field, task, space, queue.hit.id), static_cast<int>(queue.hit.first));
    front = make_float4(0, 0, 0, 0);
  }

  /// Notes the samples that were seen. The order of the list may differ from run to run.
  __device__ void keep(const RayGroup& ray, const SampleWeight& sample, bool heavy, float density,
                       const float3& rgb) {
    if (task.points == nullptr) return;  // the same for all
    // What lanes without a sample have for a colour may not even be a number.
    const float w = heavy ? sample.weight : 0.0f;
    float sums[4] = {heavy ? w * rgb.x : 0.0f, heavy ? w * rgb.y : 0.0f, heavy ? w * rgb.z : 0.0f,
                     w};
    float* const before[4] = {&front.x, &front.y, &front.z, &front.w};
#pragma unroll
    for (int k = 0; k < 4; ++k) {
#pragma unroll
      for (int away = 1; away < kRaySamples; away *= 2) {
        const float other = __shfl_up_sync(kWholeWarp, sums[k], away, kRaySamples);
        if (laneSlot() >= away) sums[k] += other;
      }
      sums[k] += *before[k];
      *before[k] = __shfl_sync(kWholeWarp, sums[k], kRaySamples - 1, kRaySamples);
    }
    const unsigned seers = __ballot_sync(kWholeWarp, sample.seen);
    if (seers == 0) return;
    const int lane = threadIdx.x % 32;
    unsigned place = 0;
    if (lane == 0) place = atomicAdd(&task.clock->kept, static_cast<unsigned>(__popc(seers)));
    place = __shfl_sync(kWholeWarp, place, 0) + __popc(seers & ((1u << lane) - 1));
    if (!sample.seen || place >= task.max_points) return;
    task.points[place] = {queue.hit.id,
                          ray.t,
                          ray.length,
                          density,
                          w,
                          sample.transmittance_behind,
                          {rgb.x, rgb.y, rgb.z},
                          {sums[0], sums[1], sums[2], sums[3]}};
  }

  __device__ bool turnOver(const RayGroup& ray) {
    const bool done = queue.active && ray.ended && ray.count == 0;
    if (__any_sync(kWholeWarp, done)) {
      const PremultipliedColour colour = {
          {groupSum(ray.rgb[0]), groupSum(ray.rgb[1]), groupSum(ray.rgb[2])}, groupSum(ray.alpha)};
      if (done) {
        if (laneSlot() == 0) recordRay(task, queue.hit.id, colour);
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
               const __grid_constant__ OptimisationTask task,
               const __grid_constant__ MarchSpace space) {
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

/// Derivatives of the loss by the logits of a sample's colour and density.
__device__ float4 logitGradient(const RayRecord& record, const RayPoint& point) {
  const float value = record.rgb[0] * point.rgb[0] + record.rgb[1] * point.rgb[1] +
                      record.rgb[2] * point.rgb[2] + record.alpha;
  const float front = record.rgb[0] * point.front[0] + record.rgb[1] * point.front[1] +
                      record.rgb[2] * point.front[2] + record.alpha * point.front[3];
  // What is behind cannot weigh more than the light that reaches it: rounding must not, either, for
  // it is multiplied by the density.
  const float most = point.transmittance_behind * (fabsf(record.rgb[0]) + fabsf(record.rgb[1]) +
                                                   fabsf(record.rgb[2]) + fabsf(record.alpha));
  const float behind = fminf(fmaxf(record.value - front, -most), most);
  // Samples that are too light to count only hide what is behind them.
  const float through = point.weight > 0 ? point.transmittance_behind * value : 0.0f;
  float by_rgb[3];
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    by_rgb[c] = record.rgb[c] * point.weight * point.rgb[c] * (1 - point.rgb[c]);
  }
  return make_float4(by_rgb[0], by_rgb[1], by_rgb[2],
                     point.length * (through - behind) * point.density);
}

/// Sum over a warp; the result in lane 0.
__device__ long long warpSum(long long x) {
#pragma unroll
  for (int away = 16; away > 0; away /= 2) x += __shfl_down_sync(kWholeWarp, x, away);
  return x;
}

/// Derivatives of the loss by a sample; 0 for a lane that has none.
struct SampleGradient {
  float position[3];   ///< in N
  float direction[3];  ///< by the viewing direction alone
};

/// Adds samples' gradients to the sums of their hypotheses, but for those that are not finite. All
/// lanes of a warp take part: nearly always its samples are of one hypothesis, and are summed
/// before they meet those of other warps at the same few numbers.
__device__ void addGradients(const RayLine& line, float t, const SampleGradient& gradient,
                             int hypothesis, GradientSums* sums) {
  const float* d = line.direction;
  float lever[3];
#pragma unroll
  for (int a = 0; a < 3; ++a) lever[a] = t * gradient.position[a] + gradient.direction[a];
  const float terms[6] = {gradient.position[0],
                          gradient.position[1],
                          gradient.position[2],
                          d[1] * lever[2] - d[2] * lever[1],
                          d[2] * lever[0] - d[0] * lever[2],
                          d[0] * lever[1] - d[1] * lever[0]};
  float size = 0;
#pragma unroll
  for (int k = 0; k < 6; ++k) size += fabsf(terms[k]);
  const bool finite = isfinite(size);
  const bool mixed = !__all_sync(kWholeWarp, hypothesis == __shfl_sync(kWholeWarp, hypothesis, 0));
  static_assert(sizeof(GradientSums) == 6 * sizeof(long long), "");
  auto* to = reinterpret_cast<unsigned long long*>(sums + hypothesis);
#pragma unroll
  for (int k = 0; k < 6; ++k) {
    long long whole = finite ? llrint(terms[k] / kGradientUnit) : 0;
    if (!mixed) whole = warpSum(whole);
    if (whole != 0 && (mixed || threadIdx.x % 32 == 0)) {
      atomicAdd(to + k, static_cast<unsigned long long>(whole));
    }
  }
}

constexpr float kMinGradient = 1e-20f;  // what is less does not count, and has no inverse

/// Warps take 32 samples at a time. Every sample's gradient goes back scaled to one and is scaled
/// again behind: halves hold it, however small it is.
template <int W>
__global__ void __launch_bounds__(kGradientThreads, 1)
    gradientKernel(const __grid_constant__ CudaFieldView field,
                   const __grid_constant__ OptimisationTask task) {
  const WarpMemory memory = enterBlock(field, 1, true);
  WarpNetworks<W> networks(field.shape, memory);
  const unsigned kept = task.clock->kept;
  // A step whose samples do not fit is left out: which of them were kept is chance.
  const unsigned count = kept <= task.max_points ? kept : 0;
  unsigned first = (blockIdx.x * blockDim.x + threadIdx.x) / 32 * 32;
  for (; first < count; first += gridDim.x * blockDim.x) {
    const bool valid = first + memory.lane < count;
    const RayPoint point = task.points[valid ? first + memory.lane : first];
    const float4 g = logitGradient(task.records[point.id], point);
    const float scale = fmaxf(fmaxf(fabsf(g.x), fabsf(g.y)), fmaxf(fabsf(g.z), fabsf(g.w)));
    const bool gradients = valid && scale > kMinGradient && isfinite(scale);
    if (!__any_sync(kWholeWarp, gradients)) continue;
    const RayLine line = lineOf(field, task, point.id);
    float p[3];
#pragma unroll
    for (int a = 0; a < 3; ++a) p[a] = __fmaf_rn(point.t, line.direction[a], line.origin[a]);
    encode<true>(field, p, memory.row(), memory.slopeRow(), memory.slopePlane());
    writeHarmonics(line.direction, field.sh_degree, memory.harmonics + memory.lane * kHarmonics);
    networks.template density<true>();
    networks.template colour<true>(1);
    const float inverse = gradients ? 1 / scale : 0.0f;
    float by_harmonics[kHarmonics] = {};
    networks.backward(gradients
                          ? make_float4(inverse * g.x, inverse * g.y, inverse * g.z, inverse * g.w)
                          : make_float4(0, 0, 0, 0),
                      task.direction_gradient ? by_harmonics : nullptr);
    SampleGradient gradient = {};
    if (gradients) {
      positionGradient(field, memory.row(), memory.slopeRow(), memory.slopePlane(),
                       gradient.position);
      if (task.direction_gradient) {
        sphericalHarmonicsGradient(line.direction, field.sh_degree, by_harmonics,
                                   gradient.direction);
      }
#pragma unroll
      for (int a = 0; a < 3; ++a) {
        gradient.position[a] *= scale;
        gradient.direction[a] *= scale;
      }
    }
    addGradients(line, point.t, gradient, static_cast<int>(point.id / task.clock->rays), task.sums);
  }
}

void castAll(const CudaFieldView& field, const OptimisationTask& task, cudaStream_t stream) {
  launchPersistent(findRaysKernel, kFindThreads, 0, stream, field, task, marchSpace(field, 1));
  const int bytes = SharedLayout(field.shape, kRaySamples, false).bytes(kCastThreads / 32);
  const auto kernel = field.shape.width == 32 ? castKernel<32> : castKernel<64>;
  launchPersistent(kernel, kCastThreads, bytes, stream, field, task, marchSpace(field, 1));
}

}  // namespace

void optimiseOnce(const CudaFieldView& field, const OptimisationTask& task, int hypotheses,
                  cudaStream_t stream) {
  beginStep(task, stream);
  castAll(field, task, stream);
  const SharedLayout layout(field.shape, 1, true);
  const auto kernel = field.shape.width == 32 ? gradientKernel<32> : gradientKernel<64>;
  const int threads = threadsThatFit(kGradientThreads, layout.weight_bytes, layout.warp_bytes);
  launchPersistent(kernel, threads, layout.bytes(threads / 32), stream, field, task);
  updatePoses(task, field.side, hypotheses, stream);
}

void evaluateLosses(const CudaFieldView& field, const OptimisationTask& task, int pixels,
                    int hypotheses, cudaStream_t stream) {
  startOptimisation(task, 0, stream);
  beginMeasuring(task, pixels, stream);
  castAll(field, task, stream);
  sumLosses(task, hypotheses, stream);
}

}  // namespace nerf_pose_refiner
