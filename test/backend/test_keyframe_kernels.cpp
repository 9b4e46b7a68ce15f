// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/keyframe_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "backend/cpu/level_grid.h"
#include "backend/cpu/outline_groups.h"
#include "math/keyframe_search.h"
#include "math/random.h"

// The kernels of local colours and of outlines of every instruction set against plain loops, point
// by point. (Those of points are tested by what is aligned with them.)

namespace nerf_pose_refiner {
namespace {

class KeyframeKernelsTest : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    try {
      kernels_ = &selectKeyframeKernels(GetParam());
    } catch (const std::runtime_error& error) {
      GTEST_SKIP() << error.what();
    }
  }

  float uniform(double low, double high) {
    return static_cast<float>(low + (high - low) * randomUniform(1, 1, drawn_++));
  }

  const KeyframeKernels* kernels_ = nullptr;

 private:
  std::uint64_t drawn_ = 0;
};

// --- local colours

class LocalColoursTest : public KeyframeKernelsTest {
 protected:
  /// @param shown share of the cells.
  KeyframeLevel levelOf(int width, int height, int window, double shown) {
    KeyframeLevel level;
    level.width = width;
    level.height = height;
    level.window = window;
    const int count = width * height;
    for (int cell = 0; cell < count; ++cell) {
      if (uniform(0, 1) < shown) level.shown.cell.push_back(cell);
    }
    // From the last to the first: points are sorted by tiles, not by rows.
    for (int cell = count - 1; cell >= 0; --cell) {
      if (uniform(0, 1) < 0.2f) level.chosen.cell.push_back(cell);
    }
    while (level.shown.size() % kPointGroup != 0) level.shown.cell.push_back(count);
    while (level.chosen.size() % kPointGroup != 0)
      level.chosen.cell.push_back(level.chosen.cell.back());
    return level;
  }

  void fill(const KeyframeLevel& level, LevelGrid* grid) {
    for (const std::int32_t cell : level.shown.cell) {
      float* const numbers = grid->cell(cell);
      const float weight = uniform(0.2, 1);
      for (int c = 0; c < 3; ++c) {
        const float colour = uniform(0, 1);
        numbers[c] = weight * colour;
        numbers[3 + c] = weight * colour * colour;
      }
      numbers[kLocalWeight] = weight;
    }
  }

  static LocalColours<double> expectedAt(const KeyframeLevel& level, const LevelGrid& grid,
                                         int at) {
    double sums[kLocalWeight + 1] = {};
    for (const std::int32_t cell : level.shown.cell) {
      if (cell == level.width * level.height) continue;  // it fills up a group
      if (std::abs(cell % level.width - at % level.width) > level.window) continue;
      if (std::abs(cell / level.width - at / level.width) > level.window) continue;
      for (int k = 0; k <= kLocalWeight; ++k) sums[k] += grid.cell(cell)[k];
    }
    return weightedLocalColours(sums);
  }

  void expectRight(const KeyframeLevel& level, LevelGrid* grid) {
    LocalColourColumns local;
    grid->takeLocalColours(*kernels_, &local);
    for (int i = 0; i < level.chosen.size(); ++i) {
      const LocalColours<double> expected = expectedAt(level, *grid, level.chosen.cell[i]);
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(local.mean[c][i], expected.mean[c], 1e-3) << "point " << i;
        if (expected.mean[c] == 0) continue;  // nothing is seen: rounding is all there is
        ASSERT_NEAR(local.inverse_deviation[c][i] / expected.inverse_deviation[c], 1, 0.01);
      }
    }
  }
};

INSTANTIATE_TEST_SUITE_P(InstructionSets, LocalColoursTest, ::testing::Values("baseline", "avx2"),
                         [](const auto& p) { return std::string(p.param); });

TEST_P(LocalColoursTest, AreThoseOfTheCellsAround) {
  for (const double shown : {1.0, 0.6, 0.03}) {
    const KeyframeLevel level = levelOf(37, 23, 4, shown);
    LevelGrid grid;
    grid.begin(level);
    fill(level, &grid);
    expectRight(level, &grid);
  }
}

TEST_P(LocalColoursTest, ABoxMayBeLargerThanTheGrid) {
  const KeyframeLevel level = levelOf(11, 6, 20, 0.8);
  LevelGrid grid;
  grid.begin(level);
  fill(level, &grid);
  expectRight(level, &grid);
}

TEST_P(LocalColoursTest, NothingIsLeftOfTheLevelBefore) {
  LevelGrid grid;
  const KeyframeLevel before = levelOf(40, 30, 3, 1);
  grid.begin(before);
  fill(before, &grid);
  const KeyframeLevel level = levelOf(31, 17, 3, 0.5);
  grid.begin(level);
  for (const std::int32_t chosen : level.chosen.cell) ASSERT_EQ(*grid.cell(chosen), 0);
  LocalColourColumns local;
  grid.takeLocalColours(*kernels_, &local);
  for (const std::vector<float>& mean : local.mean) {
    for (const float value : mean) ASSERT_EQ(value, 0);  // black where nothing is seen
  }
  fill(level, &grid);
  expectRight(level, &grid);
}

// --- outlines

class OutlineSumsTest : public KeyframeKernelsTest {
 protected:
  void SetUp() override {
    KeyframeKernelsTest::SetUp();
    // Waves, so that sides differ; covered in a corner.
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (int c = 0; c < 3; ++c)
          pixels_.push_back(0.5f + 0.4f * std::sin(0.3f * static_cast<float>(x + c * y)));
        pixels_.push_back(x + y < 50 ? 0.5f : 1.0f);
      }
    }
    view_.image = {pixels_.data(), kWidth, kHeight, kWidth, {100, 100, 60, 45}};
    view_.pose = {{{{0.8f, -0.6f, 0}, {0.6f, 0.8f, 0}, {0, 0, 1}}}, {0.02f, 0.01f, 0.6f}};
    for (int i = 0; i < kPoints; ++i) level_.outline.push_back(drawnPoint(i));
    level_.outline_tiles = {0, 5, 5, 24, kPoints};
    groups_.take(level_);
  }

  /// Around the object; some beyond the image, behind the camera, or seen end-on.
  OutlinePoint drawnPoint(int i) {
    const float angle = uniform(0, 6.3), radius = uniform(0.1, 0.35);
    const Eigen::Vector3f outside(std::cos(angle), std::sin(angle), 0);
    OutlinePoint point;
    point.point = radius * outside + Eigen::Vector3f(0, 0, uniform(-0.1, 0.1));
    point.normal = 0.006f * outside;
    if (i % 11 == 5) point.point.z() = -1;
    if (i % 22 == 8) point.point = {0, 0, -view_.pose.t.z};  // in the camera
    if (i % 11 == 7) point.normal = Eigen::Vector3f(0, 0, 0.001f);
    for (int k = 0; k < kOutlineOpacities; ++k) {
      point.look.opacity[k] = uniform(0, 1);
      for (float& shade : point.look.shade[k]) shade = uniform(0.5, 1.5);
    }
    return point;
  }

  bool sample(float u, float v, float colour[3]) const {
    if (!(u >= 0 && v >= 0 && u < kWidth - 1 && v < kHeight - 1)) return false;
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    float value[4];
    for (int c = 0; c < 4; ++c) {
      const auto at = [&](int right, int down) {
        return pixels_[4 * ((y + down) * kWidth + x + right) + c];
      };
      const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
      value[c] = (1 - fv) * ((1 - fu) * at(0, 0) + fu * at(1, 0)) +
                 fv * ((1 - fu) * at(0, 1) + fu * at(1, 1));
    }
    std::copy_n(value, 3, colour);
    return value[3] >= kOutlineSeen;
  }

  /// body(point, its place, what the image shows there) for those of a tile that are seen.
  template <typename Body>
  int forSeen(int tile, const Body& body) const {
    int count = 0;
    for (int i = level_.outline_tiles[tile]; i < level_.outline_tiles[tile + 1]; ++i) {
      const OutlinePoint& point = level_.outline[i];
      const OutlineInImage<float> place =
          placeOutline(view_.image.K, view_.pose, plain(point.point), plain(point.normal));
      bool is_seen = place.isInSight() != 0;
      OutlineProfile<float> profile;
      for (int k = 0; k < kOutlinePlaces && is_seen; ++k) {
        const auto s = static_cast<float>(k - kOutlineReach);
        is_seen = sample(place.middle.u + s * place.step.u, place.middle.v + s * place.step.v,
                         profile.colour[k]);
      }
      if (!is_seen) continue;
      body(point, place, outlineOpacities(profile));
      ++count;
    }
    return count;
  }

  static Vec3<float> plain(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

  int tiles() const { return static_cast<int>(level_.outline_tiles.size()) - 1; }

  static constexpr int kWidth = 120, kHeight = 90, kPoints = 60;
  static constexpr OutlineRules<float> kRules = {0.7f, 3};
  std::vector<float> pixels_;
  KernelView view_ = {};
  KeyframeLevel level_;
  OutlineGroups groups_;
};

INSTANTIATE_TEST_SUITE_P(InstructionSets, OutlineSumsTest, ::testing::Values("baseline", "avx2"),
                         [](const auto& p) { return std::string(p.param); });

void expectNear(float found, float expected) {
  EXPECT_NEAR(found, expected, 1e-3 * std::abs(expected) + 1e-4);
}

TEST_P(OutlineSumsTest, AreThoseOfThePointsThatAreSeen) {
  ASSERT_EQ(groups_.tiles(), tiles());
  int seen_in_all = 0;
  for (int tile = 0; tile < tiles(); ++tile) {
    PointSums<float> expected = {}, found = {};
    const int count =
        forSeen(tile, [&](const OutlinePoint& point, const OutlineInImage<float>& place,
                          const OutlineOpacities<float>& opacities) {
          float along[6];
          flowAlongNormal(view_.image.K, view_.pose, plain(point.point), place, along);
          addOutlinePoint(point.look, opacities, along, kRules, &expected);
        });
    EXPECT_EQ(kernels_->sumOutline(view_, groups_.tile(tile), kRules, &found), count);
    expectNear(found.weight, expected.weight);
    expectNear(found.cost, expected.cost);
    expectNear(found.robust_weight, expected.robust_weight);
    expectNear(found.squared_residual, expected.squared_residual);
    for (int k = 0; k < 21; ++k) {
      const float scale = std::abs(expected.information[20]) + std::abs(expected.information[0]);
      EXPECT_NEAR(found.information[k], expected.information[k], 1e-4f * scale);
    }
    for (int k = 0; k < 6; ++k) {
      const float scale = std::abs(expected.gradient[0]) + std::abs(expected.gradient[5]);
      EXPECT_NEAR(found.gradient[k], expected.gradient[k], 1e-3f * scale + 1e-4f);
    }
    seen_in_all += count;
  }
  EXPECT_GT(seen_in_all, kPoints / 4);
  EXPECT_LT(seen_in_all, 3 * kPoints / 4);
}

TEST_P(OutlineSumsTest, EvidenceIsThatOfThePointsThatAreSeen) {
  for (int tile = 0; tile < tiles(); ++tile) {
    EvidenceSums<float> expected = {}, found = {};
    forSeen(tile, [&](const OutlinePoint& point, const OutlineInImage<float>&,
                      const OutlineOpacities<float>& opacities) {
      addOutlineEvidence(point.look, opacities, kRules, &expected);
    });
    kernels_->sumOutlineEvidence(view_, groups_.tile(tile), kRules, &found);
    expectNear(found.explained, expected.explained);
    expectNear(found.chance, expected.chance);
    expectNear(found.weight, expected.weight);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
