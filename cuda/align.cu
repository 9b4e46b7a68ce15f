// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "align.h"
#include "cuda_error.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;
constexpr int kPixelsPerChunk = kTileSide * kTileSide;  // one block's: a tile of the scatter
constexpr int kGainBiasSums = 15;                       // numbers of GainBiasMomentsOf
constexpr int kSumParts = 8;                            // threads that share a sum over chunks
constexpr int kAdvanceThreads = 288;
constexpr unsigned kWholeWarp = 0xffffffffu;

static_assert(sizeof(AlignmentSumsOf<float>) == kAlignmentSums * sizeof(float), "");
static_assert(sizeof(AlignmentSumsOf<double>) == kAlignmentSums * sizeof(double), "");
static_assert(sizeof(GainBiasMomentsOf<float>) == kGainBiasSums * sizeof(float), "");
static_assert(kAdvanceThreads >= kSumParts * kAlignmentSums, "");
static_assert(kThreads >= kSumParts * kGainBiasSums, "");
static_assert(sizeof(GainBiasMomentsOf<double>) == kGainBiasSums * sizeof(double), "");

/// Sum over a block, in a fixed order, of N numbers of every thread; the result in to[0..N).
template <int N>
__device__ void sumBlock(const float* values, double* to) {
  __shared__ float warp_sums[kThreads / 32][N];
  const int lane = threadIdx.x % 32, warp = threadIdx.x / 32;
#pragma unroll
  for (int i = 0; i < N; ++i) {
    float sum = values[i];
#pragma unroll
    for (int away = 16; away > 0; away /= 2) sum += __shfl_down_sync(kWholeWarp, sum, away);
    if (lane == 0) warp_sums[warp][i] = sum;
  }
  __syncthreads();
  for (int i = threadIdx.x; i < N; i += kThreads) {
    double sum = 0;
    for (int w = 0; w < kThreads / 32; ++w) sum += warp_sums[w][i];
    to[i] = sum;
  }
}

/// Sums of N terms over the chunks of a view, by a block of kSumParts * N threads or more and in a
/// fixed order; the result in shared memory. term(k, i) by the thread whose number modulo N is i.
template <int N, typename Term>
__device__ void sumOverChunks(int chunks, const Term& term, double* sums) {
  __shared__ double parts[kSumParts][N];
  const int i = static_cast<int>(threadIdx.x) % N, part = static_cast<int>(threadIdx.x) / N;
  if (part < kSumParts) {
    double sum = 0;
#pragma unroll 4
    for (int k = part; k < chunks; k += kSumParts) sum += term(k, i);
    parts[part][i] = sum;
  }
  __syncthreads();
  if (part == 0) {
    double sum = 0;
    for (int k = 0; k < kSumParts; ++k) sum += parts[k][i];
    sums[i] = sum;
  }
  __syncthreads();
}

/// Sums of the first N numbers of the chunks.
template <int N>
__device__ void sumChunks(const double* partial_sums, int view, int chunks, double* sums) {
  const double* first = partial_sums + static_cast<std::size_t>(view) * chunks * kAlignmentSums;
  const auto term = [&](int k, int i) {
    return first[static_cast<std::size_t>(k) * kAlignmentSums + i];
  };
  sumOverChunks<N>(chunks, term, sums);
}

__device__ AlignmentView viewOf(const CudaCamera& camera, const Vec3<double>& centre,
                                const CameraPose<double>& pose) {
  AlignmentView view;
  view.K = {static_cast<float>(camera.fx), static_cast<float>(camera.fy),
            static_cast<float>(camera.cx), static_cast<float>(camera.cy)};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) view.pose.R.m[i][j] = static_cast<float>(pose.R.m[i][j]);
  }
  view.pose.o = {static_cast<float>(pose.o.x), static_cast<float>(pose.o.y),
                 static_cast<float>(pose.o.z)};
  view.centre = {static_cast<float>(centre.x), static_cast<float>(centre.y),
                 static_cast<float>(centre.z)};
  view.centre_depth = static_cast<float>(inCamera(pose, centre).z);
  return view;
}

__device__ ImageSample<float> sampleAt(const float4* image, int width, int height, int x, int y) {
  const auto at = [&](int u, int v) { return image[2 * (v * width + u)]; };
  const float4 left = at(max(x - 1, 0), y), right = at(min(x + 1, width - 1), y);
  const float4 above = at(x, max(y - 1, 0)), below = at(x, min(y + 1, height - 1));
  const float4 here = at(x, y);
  return {{here.x, here.y, here.z, here.w},
          {0.5f * (right.x - left.x), 0.5f * (right.y - left.y), 0.5f * (right.z - left.z),
           0.5f * (right.w - left.w)},
          {0.5f * (below.x - above.x), 0.5f * (below.y - above.y), 0.5f * (below.z - above.z),
           0.5f * (below.w - above.w)}};
}

__device__ RegionPixel regionAt(const CudaAlignmentTarget& target, int pixel) {
  if (target.rules.kind != Comparison::kRegions) return {};
  const float4 region = target.observed[2 * pixel + 1];
  return {region.x, region.y, target.background_density[pixel]};
}

/// A block per chunk (x) and search (y).
__global__ void sumAlignmentKernel(CudaAlignmentTarget target, CudaSearches searches,
                                   const float4* images, Vec3<double> centre) {
  const int v = static_cast<int>(blockIdx.y);
  if (!searches.active[v]) return;
  __shared__ AlignmentView view;
  if (threadIdx.x == 0) view = viewOf(target.camera, centre, searches.searches[v].trial);
  __syncthreads();
  // Contrasts do not depend on gain and bias.
  const GainBias<float> gain_bias = target.rules.kind == Comparison::kContrasts
                                        ? GainBias<float>()
                                        : searches.searches[v].trial_gain_bias;
  const int width = target.camera.width, height = target.camera.height, pixels = width * height;
  const float4* image = images + 2 * static_cast<std::size_t>(v) * pixels;
  AlignmentSumsOf<float> sums;
  const int tiles = (width + kTileSide - 1) / kTileSide;  // in a row
  const int left = static_cast<int>(blockIdx.x) % tiles * kTileSide;
  const int top = static_cast<int>(blockIdx.x) / tiles * kTileSide;
  for (int k = threadIdx.x; k < kPixelsPerChunk; k += kThreads) {
    const int x = left + k % kTileSide, y = top + k / kTileSide;
    if (x >= width || y >= height) continue;
    const int i = y * width + x;
    const float pixel_weight = target.weight[i];
    if (pixel_weight == 0) continue;
    const ImageSample<float> rendered = sampleAt(image, width, height, x, y);
    const ImageSample<float> observed = sampleAt(target.observed, width, height, x, y);
    const float4 point = image[2 * i + 1];
    ComparedPixel pixel;
    pixel.region = regionAt(target, i);
    pixel.residual = comparePixel(target.rules, rendered, observed, gain_bias, pixel.region);
    pixel.opacity = rendered.value[3];
    pixel.flow = surfaceFlow(view, {point.x, point.y, point.z}, pixel.opacity, x, y);
    pixel.weight = pixel_weight;
    addComparedPixel(target.rules, pixel, &sums, &sums.equations);
  }
  const std::size_t part = static_cast<std::size_t>(v) * gridDim.x + blockIdx.x;
  sumBlock<kAlignmentSums>(reinterpret_cast<const float*>(&sums),
                           searches.partial_sums + part * kAlignmentSums);
}

/// Sums over the tiles of a view, by a block of kAdvanceThreads.
__device__ void sumScatter(const double* partial_sums, int view, int tiles, TileScatter* scatter) {
  constexpr int kProducts = 21, kSums = kProducts + 2;
  const auto* tile = reinterpret_cast<const AlignmentSumsOf<double>*>(
      partial_sums + static_cast<std::size_t>(view) * tiles * kAlignmentSums);
  const int own = static_cast<int>(threadIdx.x) % kSums;
  int row = 0;
  while ((row + 1) * (row + 2) / 2 <= own) ++row;
  const int column = own - row * (row + 1) / 2;
  const auto term = [&](int k, int i) {
    const NormalEquations6<double>& equations = tile[k].equations;
    if (i < kProducts) return equations.gradient[row] * equations.gradient[column];
    const double* information = equations.information;
    const double trace = information[0] + information[2] + information[5];
    return i == kProducts ? trace : trace * trace;
  };
  __shared__ double sums[kSums];
  sumOverChunks<kSums>(tiles, term, sums);
  if (threadIdx.x < kProducts) scatter->gradients[threadIdx.x] = sums[threadIdx.x];
  if (threadIdx.x == 0) {
    scatter->information = sums[kProducts];
    scatter->squared_information = sums[kProducts + 1];
  }
  __syncthreads();
}

/// Copies a search, by all threads of a block.
__device__ void copySearch(const AlignmentSearch* from, AlignmentSearch* to) {
  static_assert(sizeof(AlignmentSearch) % sizeof(int) == 0, "");
  constexpr int kWords = sizeof(AlignmentSearch) / sizeof(int);
  for (int i = threadIdx.x; i < kWords; i += blockDim.x) {
    reinterpret_cast<int*>(to)[i] = reinterpret_cast<const int*>(from)[i];
  }
  __syncthreads();
}

/// A block per search. The one thread that takes the step works in shared memory: it would wait for
/// every number of the device's.
__global__ void __launch_bounds__(kAdvanceThreads)
    advanceKernel(CudaSearches searches, AlignmentRules rules, int chunks, bool only_score) {
  const int v = static_cast<int>(blockIdx.x);
  if (!searches.active[v]) return;
  __shared__ double numbers[kAlignmentSums];
  __shared__ alignas(AlignmentSearch) unsigned char memory[sizeof(AlignmentSearch)];
  auto* search = reinterpret_cast<AlignmentSearch*>(memory);
  copySearch(&searches.searches[v], search);
  sumChunks<kAlignmentSums>(searches.partial_sums, v, chunks, numbers);
  sumScatter(searches.partial_sums, v, chunks, &search->trial_scatter);
  if (threadIdx.x == 0) {
    const auto& sums = *reinterpret_cast<const AlignmentSumsOf<double>*>(numbers);
    if (only_score) {
      scoreSearch(rules, sums, search);
    } else {
      advanceSearch(rules, sums, search);
    }
    searches.poses[v] = search->trial;
    searches.active[v] = !search->done;
  }
  __syncthreads();
  copySearch(search, &searches.searches[v]);
}

/// A block per chunk (x) and search (y).
__global__ void sumGainBiasKernel(CudaAlignmentTarget target, CudaSearches searches,
                                  const float4* images) {
  const int v = static_cast<int>(blockIdx.y);
  if (!searches.active[v]) return;
  const GainBias<float> gain_bias = searches.searches[v].trial_gain_bias;
  const int pixels = target.camera.width * target.camera.height;
  const float4* image = images + 2 * static_cast<std::size_t>(v) * pixels;
  GainBiasMomentsOf<float> sums;
  for (int k = 0; k < kPixelsPerChunk; k += kThreads) {
    const int i = static_cast<int>(blockIdx.x) * kPixelsPerChunk + k + threadIdx.x;
    if (i >= pixels) break;
    const float4 rendered = image[2 * i], observed = target.observed[2 * i];
    sums.addPixel(&rendered.x, &observed.x, target.weight[i], gain_bias, target.rules.robust_scale);
  }
  const std::size_t part = static_cast<std::size_t>(v) * gridDim.x + blockIdx.x;
  sumBlock<kGainBiasSums>(reinterpret_cast<const float*>(&sums),
                          searches.partial_sums + part * kAlignmentSums);
}

/// A block per search.
__global__ void solveGainBiasKernel(CudaSearches searches, int chunks) {
  const int v = static_cast<int>(blockIdx.x);
  if (!searches.active[v]) return;
  __shared__ double numbers[kGainBiasSums];
  sumChunks<kGainBiasSums>(searches.partial_sums, v, chunks, numbers);
  if (threadIdx.x != 0) return;
  searches.searches[v].trial_gain_bias =
      solveGainBias(*reinterpret_cast<const GainBiasMomentsOf<double>*>(numbers));
}

/// A thread per search.
__global__ void startKernel(CudaSearches searches, CudaHypotheses batch, AlignmentRules rules) {
  const int v = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (v >= searches.view_count) return;
  searches.active[v] = 0;
  // Whole, with what is between its numbers: blocks copy it word by word.
  memset(&searches.searches[v], 0, sizeof(AlignmentSearch));
  searches.searches[v].done = true;
  if (v >= *batch.count) return;
  CudaHypothesis& h = batch.items[v];
  if (h.state != HypothesisState::kLive) return;
  const AlignmentSearch search = startSearch(rules, h.pose);
  h.state = search.state;
  searches.searches[v] = search;
  searches.poses[v] = search.trial;
  searches.active[v] = !search.done;
}

/// A thread per search.
__global__ void finishKernel(CudaSearches searches, CudaHypotheses batch, bool by_contrast) {
  const int v = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (v >= searches.view_count || v >= *batch.count) return;
  const AlignmentSearch& search = searches.searches[v];
  if (!search.judged) return;
  CudaHypothesis& h = batch.items[v];
  const AlignmentSumsOf<double>& sums = search.sums;
  h.pose = search.best;
  h.state = search.state;
  h.loss = search.loss;
  h.iterations += search.evaluations;
  h.visible_fraction = visibleFractionOf(sums);
  h.score = scoreOf(sums, by_contrast);
  h.residual_variance = sums.residual_weight > 0 ? sums.squared_residual / sums.residual_weight : 0;
  for (int i = 0; i < 21; ++i) {
    h.information[i] = sums.equations.information[i];
    h.gradient_scatter[i] = search.scatter.correction() * search.scatter.gradients[i];
  }
}

int blocksFor(int threads) { return (threads + kThreads - 1) / kThreads; }

}  // namespace

int alignmentChunks(const CudaCamera& camera) {
  const auto tiles = [](int pixels) { return (pixels + kTileSide - 1) / kTileSide; };
  return tiles(camera.width) * tiles(camera.height);
}

void startSearches(const CudaSearches& searches, const CudaHypotheses& batch,
                   const AlignmentRules& rules, cudaStream_t stream) {
  startKernel<<<blocksFor(searches.view_count), kThreads, 0, stream>>>(searches, batch, rules);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void fitGainBiases(const CudaAlignmentTarget& target, const CudaSearches& searches,
                   const float4* images, cudaStream_t stream) {
  const int chunks = alignmentChunks(target.camera);
  const dim3 grid(chunks, searches.view_count);
  sumGainBiasKernel<<<grid, kThreads, 0, stream>>>(target, searches, images);
  NPR_CUDA_CHECK(cudaGetLastError());
  solveGainBiasKernel<<<searches.view_count, kThreads, 0, stream>>>(searches, chunks);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void advanceSearches(const CudaAlignmentTarget& target, const CudaSearches& searches,
                     const float4* images, const AlignmentRules& rules, bool only_score,
                     cudaStream_t stream) {
  const int chunks = alignmentChunks(target.camera);
  const dim3 grid(chunks, searches.view_count);
  sumAlignmentKernel<<<grid, kThreads, 0, stream>>>(target, searches, images, rules.centre);
  NPR_CUDA_CHECK(cudaGetLastError());
  advanceKernel<<<searches.view_count, kAdvanceThreads, 0, stream>>>(searches, rules, chunks,
                                                                     only_score);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void finishSearches(const CudaSearches& searches, const CudaHypotheses& batch, bool by_contrast,
                    cudaStream_t stream) {
  finishKernel<<<blocksFor(searches.view_count), kThreads, 0, stream>>>(searches, batch,
                                                                        by_contrast);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
