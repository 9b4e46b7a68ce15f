// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/ray_batch.h"

#include <algorithm>

#include "math/spherical_harmonics.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSamplesPerPass = 4;   // of a ray, before its transmittance is checked again
constexpr int kPoolCapacity = 8192;  // columns: more than the longest ray has, four a sample

}  // namespace

RayBatch::RayBatch(const CpuNetworks& networks, int sh_degree)
    : sh_degree_(sh_degree),
      pool_(networks, sh_degree, kPoolCapacity),
      passing_(kPoolCapacity, 0.0f) {}

void RayBatch::Rays::resize(int n) {
  const std::size_t size = static_cast<std::size_t>(roundUpToColumnGroup(n));
  for (int a = 0; a < 3; ++a) {
    origin[a].resize(size);
    direction[a].resize(size);
  }
  jitter.resize(size);
}

void RayBatch::findFirstSamples(const FieldView& field, const MarchSpace& space, int n) {
  first_.assign(roundUpToColumnGroup(n), 0);
  if (space.mask == nullptr || space.mask->empty() || space.cone_angle > 0) return;
  KernelSpace kernel_space;
  kernel_space.distance = space.mask->distances();
  kernel_space.bits = space.mask->fine().bits.data();
  kernel_space.coarse = space.mask->coarseResolution();
  kernel_space.fine = space.mask->fine().resolution;
  std::copy(space.box_min, space.box_min + 3, kernel_space.box_min);
  std::copy(space.box_max, space.box_max + 3, kernel_space.box_max);
  kernel_space.near = space.near;
  kernel_space.step = space.step;
  KernelRays rays;
  for (int a = 0; a < 3; ++a) {
    rays.origin[a] = given_.origin[a].data();
    rays.direction[a] = given_.direction[a].data();
  }
  rays.offset = given_.jitter.data();
  rays.count = roundUpToColumnGroup(n);
  field.kernels->firstSamples(kernel_space, rays, first_.data());
}

void RayBatch::begin(const FieldView& field, const MarchSpace& space, int n) {
  for (int r = n; r < roundUpToColumnGroup(n); ++r) {  // the kernel works on whole groups
    for (int a = 0; a < 3; ++a) {
      given_.origin[a][r] = given_.origin[a][0];
      given_.direction[a][r] = given_.direction[a][0];
    }
    given_.jitter[r] = given_.jitter[0];
  }
  findFirstSamples(field, space, n);
  rays_.resize(n);
  active_.clear();
  columns_.clear();
  density_evaluations_ = colour_evaluations_ = 0;
  for (int r = 0; r < n; ++r) {
    if (first_[r] < 0) continue;
    RayState& ray = rays_[r];
    for (int a = 0; a < 3; ++a) {
      ray.origin[a] = given_.origin[a][r];
      ray.direction[a] = given_.direction[a][r];
    }
    ray.marcher = RayMarcher(ray.origin, ray.direction, space, given_.jitter[r]);
    ray.marcher.skipTo(first_[r]);
    ray.transmittance = 1;
    ray.has_harmonics = false;
    active_.push_back(r);
  }
}

/// Of a ray's direction; most rays meet nothing and never need them.
const float* RayBatch::harmonicsOf(int r) {
  RayState& ray = rays_[r];
  if (!ray.has_harmonics) {
    sphericalHarmonics(ray.direction, sh_degree_, ray.harmonics);
    ray.has_harmonics = true;
  }
  return ray.harmonics;
}

void RayBatch::takeSamples() {
  float* const x = pool_.position(0);
  float* const y = pool_.position(1);
  float* const z = pool_.position(2);
  for (const int r : active_) {
    RayState& ray = rays_[r];
    RaySample sample;
    for (int k = 0; k < kSamplesPerPass && ray.marcher.next(&sample); ++k) {
      const std::size_t s = columns_.size();
      x[s] = ray.origin[0] + sample.t * ray.direction[0];
      y[s] = ray.origin[1] + sample.t * ray.direction[1];
      z[s] = ray.origin[2] + sample.t * ray.direction[2];
      columns_.push_back({r, sample, 0, 0});
    }
  }
}

bool RayBatch::advance(const FieldView& field, float min_transmittance) {
  const int first = static_cast<int>(columns_.size());
  const int most = static_cast<int>(active_.size()) * kSamplesPerPass;
  if (first + roundUpToColumnGroup(most) > pool_.capacity()) return false;
  takeSamples();
  const int count = static_cast<int>(columns_.size()) - first;
  const int padded = roundUpToColumnGroup(count);
  for (int s = first + count; s < first + padded; ++s) {
    for (int a = 0; a < 3; ++a) pool_.position(a)[s] = 0.5f;
    columns_.push_back({-1, {0, 0}, 0, 0});
  }
  density_evaluations_ += static_cast<std::uint64_t>(count);
  pool_.evaluateDensity(field, first, padded);
  weighSamples(field, first, count, min_transmittance);
  return true;
}

void RayBatch::weighSamples(const FieldView& field, int first, int count, float min_transmittance) {
  const int padded = roundUpToColumnGroup(count);
  for (int s = first; s < first + padded; ++s) {
    passing_[s] = -pool_.density()[s] * columns_[s].sample.length;
  }
  field.kernels->exponential(passing_.data() + first, passing_.data() + first, padded);

  std::size_t kept = 0;
  int s = first;
  for (const int r : active_) {
    RayState& ray = rays_[r];
    const int begin = s;
    for (; s < first + count && columns_[s].ray == r; ++s) {
      Column& column = columns_[s];
      if (ray.transmittance < min_transmittance) continue;  // behind what is seen
      column.weight = ray.transmittance * (1.0f - passing_[s]);
      ray.transmittance *= passing_[s];
      column.transmittance_behind = ray.transmittance;
    }
    const bool more = s - begin == kSamplesPerPass;
    if (more && ray.transmittance >= min_transmittance) active_[kept++] = r;
  }
  active_.resize(kept);
}

void RayBatch::addColours(const FieldView& field, float min_weight, Sums* sums) {
  coloured_.clear();
  for (int s = 0; s < static_cast<int>(columns_.size()); ++s) {
    if (columns_[s].ray >= 0 && columns_[s].weight >= min_weight) coloured_.push_back(s);
  }
  const int count = static_cast<int>(coloured_.size());
  for (int i = 0; i < count; ++i) {
    pool_.setColourInput(i, harmonicsOf(columns_[coloured_[i]].ray), coloured_[i]);
  }
  pool_.evaluateColour(field, roundUpToColumnGroup(count));
  colour_evaluations_ += static_cast<std::uint64_t>(count);
  for (int i = 0; i < count; ++i) {
    const Column& column = columns_[coloured_[i]];
    Sums& sum = sums[column.ray];
    for (int c = 0; c < 3; ++c) sum.rgb[c] += column.weight * pool_.rgb(c)[i];
    sum.alpha += column.weight;
    sum.depth += column.weight * column.sample.t;
  }
  columns_.clear();
}

bool RayBatch::forward(const FieldView& field, float min_transmittance, float min_weight,
                       Sums* sums) {
  while (!finished()) {
    if (advance(field, min_transmittance)) continue;
    if (rays_.size() > 1) return false;
    break;
  }
  static const float kNoHarmonics[kMaxHarmonics] = {};
  const int count = static_cast<int>(columns_.size());
  for (int s = 0; s < count; ++s) {
    const int r = columns_[s].ray;
    pool_.setColourInput(s, r < 0 ? kNoHarmonics : harmonicsOf(r), s);
  }
  pool_.evaluateColour(field, count);
  colour_evaluations_ += static_cast<std::uint64_t>(count);
  std::fill(sums, sums + rays_.size(), Sums{});
  for (int s = 0; s < count; ++s) {
    Column& column = columns_[s];
    if (column.ray < 0) continue;
    if (column.weight < min_weight) column.weight = column.transmittance_behind = 0;
    Sums& sum = sums[column.ray];
    for (int c = 0; c < 3; ++c) sum.rgb[c] += column.weight * pool_.rgb(c)[s];
    sum.alpha += column.weight;
    sum.depth += column.weight * column.sample.t;
  }
  return true;
}

void RayBatch::backward(const FieldView& field, const RayLossGradient* gradients,
                        std::vector<std::vector<float>>* weight_gradients) {
  // Walking backwards, `behind` sums what the samples further along a ray contribute:
  // dL/d density_i = length_i (T_{i+1} v_i - sum_{j > i} w_j v_j), with v = colour . dL/dC + dL/dA.
  std::vector<float> behind(rays_.size(), 0.0f);
  const int count = static_cast<int>(columns_.size());
  for (int s = count - 1; s >= 0; --s) {
    const Column& column = columns_[s];
    if (column.ray < 0) {
      for (int c = 0; c < 3; ++c) pool_.rgbGradient(c)[s] = 0;
      pool_.densityGradient()[s] = 0;
      continue;
    }
    const RayLossGradient& gradient = gradients[column.ray];
    float value = gradient.alpha;
    for (int c = 0; c < 3; ++c) {
      value += gradient.rgb[c] * pool_.rgb(c)[s];
      pool_.rgbGradient(c)[s] = gradient.rgb[c] * column.weight;
    }
    pool_.densityGradient()[s] =
        column.sample.length * (column.transmittance_behind * value - behind[column.ray]);
    behind[column.ray] += column.weight * value;
  }
  pool_.backward(field, count, weight_gradients);
}

}  // namespace nerf_pose_refiner
