// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/ray_march.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "math/random.h"

// Samples along rays. The cube N is [0, 1]^3.

namespace nerf_pose_refiner {
namespace {

using Point = std::array<float, 3>;

struct March {
  Point origin = {-1, 0.5f, 0.5f};
  Point direction = {1, 0, 0};
  Point box_min = {0, 0, 0}, box_max = {1, 1, 1};
  float near = 0, step = 0.3f, cone_angle = 0, jitter = 0;

  MarchSpace space(const OccupancyMask* mask) const {
    return {{box_min[0], box_min[1], box_min[2]},
            {box_max[0], box_max[1], box_max[2]},
            near,
            step,
            cone_angle,
            mask};
  }

  std::vector<RaySample> samples(const OccupancyMask* mask = nullptr) const {
    RayMarcher marcher(origin.data(), direction.data(), space(mask), jitter);
    std::vector<RaySample> samples;
    for (RaySample sample; marcher.next(&sample);) samples.push_back(sample);
    return samples;
  }
};

// Expects intervals that follow each other: edges[i] to edges[i + 1].
void expectIntervals(const March& march, const std::vector<double>& edges) {
  const std::vector<RaySample> samples = march.samples();
  ASSERT_EQ(samples.size() + 1, edges.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_NEAR(samples[i].t, 0.5 * (edges[i] + edges[i + 1]), 1e-6) << i;
    EXPECT_NEAR(samples[i].length, edges[i + 1] - edges[i], 1e-6) << i;
  }
}

void expectNothing(const March& march) { EXPECT_TRUE(march.samples().empty()); }

TEST(RayMarcher, LatticeStartsAtTheEntryAndIsCutOffAtTheExit) {
  expectIntervals({}, {1, 1.3, 1.6, 1.9, 2});
}

TEST(RayMarcher, DiagonalRay) {
  const float d = std::sqrt(1.0f / 3);
  March march;
  march.origin = {2, -1, 2};
  march.direction = {-d, d, -d};
  march.step = 1;
  expectIntervals(march, {1.7320508, 2.7320508, 3.4641016});
}

TEST(RayMarcher, BoxThatIsNoCube) {
  March march;
  march.box_min = {0, 0.25f, 0.4f};
  march.box_max = {1, 0.75f, 0.6f};
  march.origin = {0.5f, 0.5f, 2};
  march.direction = {0, 0, -1};
  march.step = 0.125f;
  expectIntervals(march, {1.4, 1.525, 1.6});
  march.direction = {0, 0.6f, -0.8f};   // leaves the box's side: y = 0.75 before z = 0.4
  march.origin = {0.5f, -0.35f, 1.9f};  // z = 0.6 at t = 1.625, y = 0.75 at t = 1.8333
  expectIntervals(march, {1.625, 1.75, 1.8333333});
}

TEST(RayMarcher, NearPlane) {
  March march;
  march.near = 1.5f;
  expectIntervals(march, {1.5, 1.8, 2});
  march.near = 0.5f;
  expectIntervals(march, {1, 1.3, 1.6, 1.9, 2});
  march.near = 2.5f;
  expectNothing(march);
}

TEST(RayMarcher, CameraInsideTheBox) {
  March march;
  march.origin = {0.25f, 0.5f, 0.5f};
  expectIntervals(march, {0, 0.3, 0.6, 0.75});
  march.direction = {-1, 0, 0};
  expectIntervals(march, {0, 0.25});
  march.near = 0.125f;
  expectIntervals(march, {0.125, 0.25});
}

TEST(RayMarcher, RaysThatMiss) {
  March march;
  march.direction = {-1, 0, 0};  // the box is behind
  expectNothing(march);
  march.direction = {0, 1, 0};  // passes in front of it
  expectNothing(march);
  march.direction = {0.6f, 0.8f, 0};  // y = 1 at t = 0.625, x = 0 at t = 1.67
  expectNothing(march);
  march.origin = {-1, 1.001f, 0.5f};  // beside it
  march.direction = {1, 0, 0};
  expectNothing(march);
}

TEST(RayMarcher, ZeroComponentsOfBothSigns) {
  for (const float y : {0.0f, -0.0f}) {
    for (const float z : {0.0f, -0.0f}) {
      March march;
      march.direction = {1, y, z};
      expectIntervals(march, {1, 1.3, 1.6, 1.9, 2});
      march.origin = {-1, 0, 1};  // on an edge, which belongs to the box
      expectIntervals(march, {1, 1.3, 1.6, 1.9, 2});
      march.origin = {-1, -1e-6f, 0.5f};
      expectNothing(march);
    }
  }
}

TEST(RayMarcher, IntervalsGrowWithDistance) {
  March march;
  march.origin = {0, 0.5f, 0.5f};
  march.step = 0.125f;
  march.cone_angle = 0.5f;  // by half of the distance behind 0.25
  expectIntervals(march, {0, 0.125, 0.25, 0.375, 0.5625, 0.84375, 1});
  march.near = 0.0625f;  // the last short interval starts at 0.1875
  expectIntervals(march, {0.0625, 0.1875, 0.3125, 0.46875, 0.703125, 1});
  march.near = 0;
  march.origin = {-1, 0.5f, 0.5f};
  expectIntervals(march, {1, 1.5, 2});
}

TEST(RayMarcher, JitterStartsTheLatticeBeforeTheBox) {
  March march;
  march.jitter = 0.5f;
  expectIntervals(march, {1, 1.15, 1.45, 1.75, 2});
  march.near = 1.5f;
  expectIntervals(march, {1.5, 1.65, 1.95, 2});
  march.near = 0;
  march.step = 0.125f;
  march.cone_angle = 0.5f;
  expectIntervals(march, {1, 1.2, 1.8, 2});  // 0.8, and half as much again and again
}

TEST(RayMarcher, JitterTakesNoSamplesOfABoxThatIsMissedOrBehind) {
  March march;
  march.jitter = 0.9f;
  march.origin = {1.01f, 0.5f, 0.5f};
  expectNothing(march);
  march.direction = {0.8f, 0.6f, 0};  // at x = 0 it is 0.05 above the box
  march.origin = {-0.8f, 0.45f, 0.5f};
  expectNothing(march);
}

float marchUniform(std::uint64_t stream, std::uint64_t counter, float low, float high) {
  return low + (high - low) * randomUniform(3, stream, counter);
}

// A ray from in or around the cube through a point of it, at times along an axis or nearly so.
March randomMarch(std::uint64_t seed) {
  March march;
  const bool inside = randomIndex(1, seed, 0, 4) == 0;
  Eigen::Vector3f through, origin;
  for (int a = 0; a < 3; ++a) {
    march.box_min[a] = marchUniform(seed, a, 0, 0.3f);
    march.box_max[a] = marchUniform(seed, 3 + a, 0.7f, 1);
    through[a] = marchUniform(seed, 6 + a, 0.1f, 0.9f);
    origin[a] = inside ? marchUniform(seed, 9 + a, 0, 1) : marchUniform(seed, 9 + a, -2, 3);
  }
  Eigen::Vector3f d = through - origin;
  for (int a = 0; a < 3; ++a) {
    const std::uint32_t kind = randomIndex(2, seed, a, 12);
    if (kind == 0) d[a] = a == 1 ? -0.0f : 0.0f;
    if (kind == 1) d[a] *= 1e-6f;
  }
  if (d.norm() < 1e-3f) d = Eigen::Vector3f::UnitX();
  d.normalize();
  march.origin = {origin.x(), origin.y(), origin.z()};
  march.direction = {d.x(), d.y(), d.z()};
  march.step = marchUniform(seed, 12, 0.002f, 0.05f);
  march.near = randomIndex(1, seed, 1, 3) == 0 ? marchUniform(seed, 13, 0, 1) : 0.0f;
  if (seed % 2 == 1) march.cone_angle = marchUniform(seed, 14, 0.002f, 0.1f);
  if (seed % 4 >= 2) march.jitter = randomUniform(3, seed, 15);
  return march;
}

struct Span {
  double begin, end;
};

// Of a ray in its box, in double precision; empty if end <= begin.
Span boxSpan(const March& march) {
  Span span = {march.near, 1e9};
  for (int a = 0; a < 3; ++a) {
    const double d = march.direction[a];
    const double low = march.box_min[a] - static_cast<double>(march.origin[a]);
    const double high = march.box_max[a] - static_cast<double>(march.origin[a]);
    if (d == 0) {
      if (low > 0 || high < 0) span.end = -1;
      continue;
    }
    span.begin = std::max(span.begin, std::min(low / d, high / d));
    span.end = std::min(span.end, std::max(low / d, high / d));
  }
  return span;
}

TEST(RayMarcher, IntervalsCoverTheBoxWithoutGap) {
  int hits = 0;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const March march = randomMarch(seed);
    const Span span = boxSpan(march);
    const std::vector<RaySample> samples = march.samples();
    if (span.end - span.begin < 1e-5) {
      EXPECT_LE(samples.size(), 1u) << seed;
      continue;
    }
    ++hits;
    ASSERT_FALSE(samples.empty()) << seed;
    double end = span.begin;
    for (const RaySample& sample : samples) {
      EXPECT_NEAR(sample.t - 0.5 * sample.length, end, 2e-5) << seed;
      const double most = std::max<double>(march.step, march.cone_angle * end);
      EXPECT_LE(sample.length, most + 1e-5) << seed;
      end = sample.t + 0.5 * sample.length;
    }
    EXPECT_NEAR(end, span.end, 2e-5) << seed;
  }
  EXPECT_GT(hits, 1000);
}

// Blobs in empty space, so that there are strides of all lengths.
OccupancyGrid randomGrid(int n, int blobs, std::uint64_t seed) {
  OccupancyGrid grid{n, std::vector<std::uint8_t>(static_cast<std::size_t>(n) * n * n / 8, 0)};
  for (int b = 0; b < blobs; ++b) {
    int first[3], size[3];
    for (int a = 0; a < 3; ++a) {
      first[a] = static_cast<int>(randomIndex(seed, 1, b * 6 + a, n));
      size[a] = 1 + static_cast<int>(randomIndex(seed, 1, b * 6 + 3 + a, 4));
    }
    for (int z = first[2]; z < std::min(n, first[2] + size[2]); ++z) {
      for (int y = first[1]; y < std::min(n, first[1] + size[1]); ++y) {
        for (int x = first[0]; x < std::min(n, first[0] + size[0]); ++x) {
          const int cell = (z * n + y) * n + x;
          grid.bits[cell >> 3] |= static_cast<std::uint8_t>(1 << (cell & 7));
        }
      }
    }
  }
  return grid;
}

enum class Cell { kEmpty, kOccupied, kOnAFace };

// The cell of a sample; on a face where rounding decides.
Cell cellOf(const March& march, const RaySample& sample, const OccupancyGrid& grid) {
  int cell[3];
  bool on_a_face = false;
  for (int a = 0; a < 3; ++a) {
    const double p = march.origin[a] + static_cast<double>(sample.t) * march.direction[a];
    const double scaled = p * grid.resolution;
    const double nearest = std::round(scaled);
    const bool inner = nearest > 0 && nearest < grid.resolution;
    on_a_face = on_a_face || (inner && std::abs(scaled - nearest) < 1e-4);
    cell[a] = std::max(0, std::min(grid.resolution - 1, static_cast<int>(std::floor(scaled))));
  }
  if (on_a_face) return Cell::kOnAFace;
  return grid.occupied(cell[0], cell[1], cell[2]) ? Cell::kOccupied : Cell::kEmpty;
}

TEST(RayMarcher, SkipsExactlyTheSamplesInEmptyCells) {
  const int kResolutions[4] = {8, 16, 40, 64};
  int taken = 0, skipped = 0, on_faces = 0;
  for (std::uint64_t g = 0; g < 64; ++g) {
    const int blobs = 1 << (g % 8);
    const OccupancyMask mask(randomGrid(kResolutions[g % 4], blobs, g));
    for (std::uint64_t r = 0; r < 200; ++r) {
      const March march = randomMarch(200 * g + r);
      const std::vector<RaySample> kept = march.samples(&mask);
      std::size_t next = 0;
      for (const RaySample& sample : march.samples()) {
        const bool is_kept = next < kept.size() && kept[next].t == sample.t;
        if (is_kept) {
          EXPECT_EQ(kept[next++].length, sample.length);
        }
        const Cell cell = cellOf(march, sample, mask.fine());
        if (cell != Cell::kOnAFace) {
          ASSERT_EQ(is_kept, cell == Cell::kOccupied) << "grid " << g << ", ray " << r;
        }
        on_faces += cell == Cell::kOnAFace;
        ++(is_kept ? taken : skipped);
      }
      EXPECT_EQ(next, kept.size()) << "samples that are not on the lattice";
    }
  }
  EXPECT_GT(taken, 10000);
  EXPECT_GT(skipped, 10000);
  EXPECT_LT(on_faces, (taken + skipped) / 100);
}

TEST(RayMarcher, RaysInTheFacesOfCellsEnd) {
  const OccupancyMask mask(randomGrid(16, 8, 1));
  March march;
  march.step = 0.001f;
  for (const float y : {0.0f, 0.25f, 0.5f, 1.0f}) {
    march.origin = {-1, y, 0.5f};
    for (const float d : {1.0f, -1.0f}) {
      march.direction = {d, 0, -0.0f};
      march.origin[0] = -d;
      EXPECT_LE(march.samples(&mask).size(), march.samples().size());
    }
  }
}

TEST(OccupancyMask, DistancesAreChebyshevs) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const int n = seed % 2 == 0 ? 32 : 64, coarse = n / 4;
    const OccupancyGrid grid = randomGrid(n, 1 + static_cast<int>(seed), seed);
    std::vector<Eigen::Vector3i> occupied_volume;
    for (int z = 0; z < n; ++z) {
      for (int y = 0; y < n; ++y) {
        for (int x = 0; x < n; ++x) {
          if (grid.occupied(x, y, z)) occupied_volume.emplace_back(x / 4, y / 4, z / 4);
        }
      }
    }
    const OccupancyMask mask(grid);
    ASSERT_EQ(mask.coarseResolution(), coarse);
    for (int z = 0; z < coarse; ++z) {
      for (int y = 0; y < coarse; ++y) {
        for (int x = 0; x < coarse; ++x) {
          int nearest = coarse;
          for (const Eigen::Vector3i& m : occupied_volume) {
            const int away = (m - Eigen::Vector3i(x, y, z)).cwiseAbs().maxCoeff();
            nearest = std::min(nearest, away);
          }
          ASSERT_EQ(mask.distance(x, y, z), nearest) << seed << ": " << x << " " << y << " " << z;
        }
      }
    }
  }
}

TEST(OccupancyMask, AnEmptyGridLeavesNothingAndNoGridLeavesAll) {
  const OccupancyMask empty(randomGrid(32, 0, 0)), none((OccupancyGrid()));
  EXPECT_FALSE(empty.empty());
  EXPECT_TRUE(none.empty());
  March march;
  EXPECT_TRUE(march.samples(&empty).empty());
  EXPECT_EQ(march.samples(&none).size(), 4u);
}

}  // namespace
}  // namespace nerf_pose_refiner
