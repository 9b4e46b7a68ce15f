// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/training_occupancy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "backend/cpu/ray_batch.h"
#include "concurrency/parallel.h"
#include "field/occupied_volume.h"
#include "math/random.h"
#include "math/training.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kChunk = 1024;  // points that are evaluated together

/// Densities at n points: `position(i, p)` gives point i in N.
template <typename Position>
std::vector<float> densitiesAt(const FieldView& field, int sh_degree, int n, int threads,
                               const Position& position) {
  std::vector<float> densities(n);
  const int chunks = (n + kChunk - 1) / kChunk;
  const int workers = std::max(1, std::min(threads, chunks));
  parallelFor(threads, workers, [&](int worker) {
    SamplePool pool(*field.networks, sh_degree, kChunk);
    for (int chunk = worker; chunk < chunks; chunk += workers) {
      const int first = chunk * kChunk, count = std::min(kChunk, n - first);
      for (int i = 0; i < roundUpToColumnGroup(count); ++i) {
        float p[3] = {0.5f, 0.5f, 0.5f};
        if (i < count) position(first + i, p);
        for (int a = 0; a < 3; ++a) pool.position(a)[i] = p[a];
      }
      pool.evaluateDensity(field, 0, roundUpToColumnGroup(count));
      std::copy(pool.density(), pool.density() + count, densities.begin() + first);
    }
  });
  return densities;
}

CostCounters densityCost(const CpuNetworks& networks, int n) {
  CostCounters cost;
  cost.samples = static_cast<std::uint64_t>(n);
  cost.gathers = networks.gathersPerSample() * n;
  cost.flops = networks.densityFlops() * n;
  return cost;
}

std::array<int, 3> cellOf(std::uint32_t cell, int n) {
  return {static_cast<int>(cell) % n, static_cast<int>(cell) / n % n,
          static_cast<int>(cell) / (n * n)};
}

void setBit(OccupancyGrid* grid, std::uint32_t cell) {
  grid->bits[cell >> 3] |= static_cast<std::uint8_t>(1u << (cell & 7));
}

}  // namespace

TrainingOccupancy::TrainingOccupancy(const FieldConfig& config, const OccupancyGrid& region,
                                     const float box_min[3], const float box_max[3],
                                     std::uint64_t seed)
    : config_(config), seed_(seed) {
  const int n = config.occupancy_resolution;
  if (region.resolution != 0 && region.resolution != n) {
    throw std::invalid_argument("training: the region has " + std::to_string(region.resolution) +
                                " cells along the cube, the field's occupancy grid " +
                                std::to_string(n));
  }
  OccupancyGrid grid{n, std::vector<std::uint8_t>(static_cast<std::size_t>(n) * n * n / 8, 0)};
  for (std::uint32_t cell = 0; cell < static_cast<std::uint32_t>(n) * n * n; ++cell) {
    const std::array<int, 3> c = cellOf(cell, n);
    bool in_box = true;
    for (int a = 0; a < 3; ++a) {
      in_box = in_box && static_cast<float>(c[a] + 1) > box_min[a] * static_cast<float>(n) &&
               static_cast<float>(c[a]) < box_max[a] * static_cast<float>(n);
    }
    if (!in_box) continue;
    if (region.resolution != 0 && !region.occupied(c[0], c[1], c[2])) continue;
    region_.push_back(cell);
    setBit(&grid, cell);
  }
  density_.assign(region_.size(), 0.0f);
  mask_.reset(new OccupancyMask(std::move(grid)));
}

bool TrainingOccupancy::occupied(const float p_N[3]) const {
  const int n = config_.occupancy_resolution;
  int c[3];
  for (int a = 0; a < 3; ++a) {
    c[a] = std::min(n - 1, std::max(0, static_cast<int>(p_N[a] * static_cast<float>(n))));
  }
  return mask_->fine().occupied(c[0], c[1], c[2]);
}

void TrainingOccupancy::update(const FieldView& field, int step, int threads, CostCounters* work) {
  const int n = config_.occupancy_resolution;
  const std::size_t offset = randomIndex(seed_, static_cast<std::uint64_t>(step), 0,
                                         kOccupancyFraction);  // of this update's cells
  const int count =
      static_cast<int>((region_.size() + kOccupancyFraction - 1 - offset) / kOccupancyFraction);
  const std::vector<float> seen =
      densitiesAt(field, config_.sh_degree, count, threads, [&](int i, float p[3]) {
        drawCellPoint(seed_, step,
                      region_[offset + static_cast<std::size_t>(i) * kOccupancyFraction], n, p);
      });
  *work += densityCost(*field.networks, count);
  for (float& density : density_) density *= std::pow(kOccupancyFading, 1.0f / kOccupancyFraction);
  for (int i = 0; i < count; ++i) {
    float& density = density_[offset + static_cast<std::size_t>(i) * kOccupancyFraction];
    density = std::max(density, seen[i]);
  }
  OccupancyGrid grid{n, std::vector<std::uint8_t>(static_cast<std::size_t>(n) * n * n / 8, 0)};
  for (std::size_t i = 0; i < region_.size(); ++i) {
    if (density_[i] * config_.step > kOccupancyThickness) setBit(&grid, region_[i]);
  }
  mask_.reset(new OccupancyMask(std::move(grid)));
}

OccupancyGrid TrainingOccupancy::dense(const FieldView& field, int threads,
                                       const CancellationToken& cancellation,
                                       std::vector<float>* cell_opacity, CostCounters* work) const {
  const int n = config_.occupancy_resolution;
  const float cell_size = 1.0f / static_cast<float>(n);
  constexpr int kPoints = kFrozenPointsPerAxis * kFrozenPointsPerAxis * kFrozenPointsPerAxis;
  cell_opacity->assign(static_cast<std::size_t>(n) * n * n, 0.0f);
  OccupancyGrid grid{n, std::vector<std::uint8_t>(static_cast<std::size_t>(n) * n * n / 8, 0)};
  constexpr int kCellsPerRound = 1 << 13;  // cancellation is checked in between
  for (std::size_t first = 0; first < region_.size(); first += kCellsPerRound) {
    cancellation.check();
    const int cells =
        static_cast<int>(std::min<std::size_t>(kCellsPerRound, region_.size() - first));
    const std::vector<float> density =
        densitiesAt(field, config_.sh_degree, cells * kPoints, threads, [&](int i, float p[3]) {
          frozenCellPoint(region_[first + i / kPoints], n, i % kPoints, p);
        });
    *work += densityCost(*field.networks, cells * kPoints);
    for (int i = 0; i < cells; ++i) {
      float highest = 0, mean = 0;
      for (int k = 0; k < kPoints; ++k) {
        const float value = density[static_cast<std::size_t>(i) * kPoints + k];
        highest = std::max(highest, value);
        mean += value / kPoints;
      }
      const std::uint32_t cell = region_[first + i];
      (*cell_opacity)[cell] = 1.0f - std::exp(-mean * cell_size);
      if (highest * config_.step > kFrozenThickness) setBit(&grid, cell);
    }
  }
  return dilated(grid);
}

}  // namespace nerf_pose_refiner
