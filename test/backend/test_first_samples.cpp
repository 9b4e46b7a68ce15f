// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "backend/common/ray_march.h"
#include "backend/cpu/cpu_kernels.h"
#include "math/random.h"

// The kernel that finds where rays meet occupied cells, against the marcher that walks each of
// them.

namespace nerf_pose_refiner {
namespace {

constexpr int kCells = 16;

float uniform(std::uint64_t stream, std::uint64_t i, float low, float high) {
  return low + (high - low) * randomUniform(7, stream, i);
}

// About one of 60 cells is occupied.
OccupancyMask sparseMask(std::uint64_t seed) {
  OccupancyGrid grid{kCells, std::vector<std::uint8_t>(kCells * kCells * kCells / 8, 0)};
  for (std::uint64_t i = 0; i < kCells * kCells * kCells; ++i) {
    if (randomIndex(seed, 1, i, 60) == 0) grid.bits[i >> 3] |= 1u << (i & 7);
  }
  return OccupancyMask(grid);
}

struct DrawnRays {
  std::vector<float> origin[3], direction[3], jitter;
};

DrawnRays randomRays(int n, std::uint64_t seed) {
  DrawnRays rays;
  for (int r = 0; r < n; ++r) {
    float d[3], length = 0;
    for (int a = 0; a < 3; ++a) {
      const std::uint64_t i = static_cast<std::uint64_t>(3 * r + a);
      // Every fourth ray starts inside of the box; every fifth leaves an axis out.
      const float margin = r % 4 == 0 ? 0.0f : 1.5f;
      rays.origin[a].push_back(uniform(2 * seed, i, -margin, 1 + margin));
      d[a] =
          r % 5 == 0 && a == r / 5 % 3 ? 0.0f : uniform(2 * seed + 1, i, 0, 1) - rays.origin[a][r];
      length += d[a] * d[a];
    }
    for (int a = 0; a < 3; ++a) rays.direction[a].push_back(d[a] / std::sqrt(length));
    rays.jitter.push_back(uniform(999 + seed, static_cast<std::uint64_t>(r), 0, 1));
  }
  return rays;
}

// The kernel may use other roundings than the marcher: a sample this near to a face of its cell can
// be taken for one of the neighbour.
bool nearAFace(const float origin[3], const float direction[3], float t) {
  for (int a = 0; a < 3; ++a) {
    const float x = (origin[a] + t * direction[a]) * kCells;
    if (std::fabs(x - std::round(x)) < 1e-3f) return true;
  }
  return false;
}

void expectSameFirstSamples(const CpuKernels& kernels, std::uint64_t seed) {
  const OccupancyMask mask = sparseMask(seed);
  const MarchSpace space{{0, 0.1f, 0}, {1, 0.9f, 1}, seed % 2 ? 0.0f : 0.4f, 0.013f, 0, &mask};
  constexpr int kRays = 32 * kColumnGroup;
  const DrawnRays rays = randomRays(kRays, seed);
  KernelSpace kernel_space{mask.distances(),
                           mask.fine().bits.data(),
                           mask.coarseResolution(),
                           kCells,
                           {space.box_min[0], space.box_min[1], space.box_min[2]},
                           {space.box_max[0], space.box_max[1], space.box_max[2]},
                           space.near,
                           space.step};
  const KernelRays kernel_rays = {
      {rays.origin[0].data(), rays.origin[1].data(), rays.origin[2].data()},
      {rays.direction[0].data(), rays.direction[1].data(), rays.direction[2].data()},
      rays.jitter.data(),
      kRays};
  std::vector<std::int32_t> first(kRays, -7);
  kernels.firstSamples(kernel_space, kernel_rays, first.data());

  int hits = 0, skipped = 0;
  for (int r = 0; r < kRays; ++r) {
    const float origin[3] = {rays.origin[0][r], rays.origin[1][r], rays.origin[2][r]};
    const float direction[3] = {rays.direction[0][r], rays.direction[1][r], rays.direction[2][r]};
    RayMarcher walking(origin, direction, space, rays.jitter[r]), leaping = walking;
    RaySample expected{-1, 0}, found{-1, 0};
    const bool meets = walking.next(&expected);
    hits += meets;
    skipped += first[r] > 0;
    if (first[r] >= 0) leaping.skipTo(first[r]);
    const bool finds = first[r] >= 0 && leaping.next(&found);
    if (meets == finds && found.t == expected.t) continue;
    EXPECT_TRUE(meets && nearAFace(origin, direction, expected.t))
        << "ray " << r << ": " << found.t << " for " << expected.t;
  }
  EXPECT_GT(hits, kRays / 10);
  EXPECT_LT(hits, kRays * 9 / 10);
  EXPECT_GT(skipped, hits / 2);
}

TEST(FirstSamples, BaselineFindsWhatTheMarcherFinds) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    expectSameFirstSamples(selectCpuKernels("baseline"), seed);
  }
}

TEST(FirstSamples, BestKernelsFindWhatTheMarcherFinds) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    expectSameFirstSamples(selectCpuKernels("auto"), seed);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
