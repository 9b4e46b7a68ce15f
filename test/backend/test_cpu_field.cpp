// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include "backend/cost_counters.h"
#include "backend/loaded_field.h"
#include "support/cpu_rays.h"
#include "support/expect_error.h"
#include "support/random_field.h"
#include "support/small_field.h"

// Rays through a hash-grid field on the CPU.

namespace nerf_pose_refiner {
namespace {

// Fog of one density and one colour in a box. Every entry of the grid is 1, so the encoding is 1
// everywhere; so is the one hidden neuron of each network.
Field uniformFog(double density, double red) {
  Field field;
  FieldConfig& config = field.config;
  config.levels = 1;
  config.features = 1;
  config.base_resolution = config.finest_resolution = 2;
  config.density_width = config.colour_width = 1;
  config.geometry_features = 0;
  config.sh_degree = 1;
  config.step = 0.125f;
  config.occupancy_resolution = 8;
  field.box.min = {-1, -1, -1};
  field.box.max = {1, 1, 1};
  field.grid.assign(32, 0x3c00);  // 27 vertices, rounded up to a multiple of 8
  field.density_weights = {1, static_cast<float>(std::log(density))};
  field.colour_weights = {3.5449077f, static_cast<float>(std::log(red / (1 - red))), 0, 0};
  return field;
}

const Ray kAlongX = {{-3, 0.1f, 0.1f}, {1, 0, 0}};  // through [-1, 1]^3 from t = 2 to 4

void expectResult(const RayResult& result, double red, double alpha) {
  EXPECT_NEAR(result.rgb[0], red * alpha, 2e-6);
  EXPECT_NEAR(result.rgb[1], 0.5 * alpha, 2e-6);
  EXPECT_NEAR(result.rgb[2], 0.5 * alpha, 2e-6);
  EXPECT_NEAR(result.alpha, alpha, 2e-6);
}

TEST(CpuField, GridOfZerosIsFogOfDensityOne) {
  Field field = randomField(smallConfig(), 5);
  std::fill(field.grid.begin(), field.grid.end(), std::uint16_t{0});
  std::fill(field.colour_weights.begin(), field.colour_weights.end(), 0.0f);
  // The cube's side is 2.3; along z the box is 1.7 deep.
  const Ray ray = {{0.2f, 0.4f, -2}, {0, 0, 1}};
  expectResult(render(*load(field), {ray}, everything())[0], 0.5, 1 - std::exp(-1.7 / 2.3));
}

TEST(CpuField, UniformFogByHand) {
  const auto scene = load(uniformFog(3, 0.8));
  expectResult(render(*scene, {kAlongX}, everything())[0], 0.8, 1 - std::exp(-3.0));
  const Ray from_inside = {{0.5f, 0, 0}, {0, 0.6f, 0.8f}};  // 1 / 0.8 to the face, of a side of 2
  expectResult(render(*scene, {from_inside}, everything())[0], 0.8, 1 - std::exp(-3 * 0.625));
  const Ray miss = {{-3, 1.1f, 0}, {1, 0, 0}}, away = {{-3, 0, 0}, {-1, 0, 0}};
  for (const RayResult& result : render(*scene, {miss, away})) expectResult(result, 0, 0);
}

TEST(CpuField, NearPlaneIsInModelUnits) {
  RenderOptions options = everything();
  options.near = 3.5f;  // half a unit of two is left, a quarter of the cube
  const RayResult result = render(*load(uniformFog(3, 0.8)), {kAlongX}, options)[0];
  expectResult(result, 0.8, 1 - std::exp(-0.75));
  EXPECT_GT(result.point[0], 0.5 * result.alpha);
}

TEST(CpuField, ExpectedPointByHand) {
  Field field = uniformFog(2, 0.8);
  field.config.step = 0.5f;  // of the cube: intervals [2, 3] and [3, 4] of the ray
  const RayResult result = render(*load(field), {kAlongX}, everything())[0];
  const double near = 1 - std::exp(-1.0), far = std::exp(-1.0) * near;
  EXPECT_NEAR(result.point[0], near * -0.5 + far * 0.5, 1e-6);
  EXPECT_NEAR(result.point[1], 0.1 * (near + far), 1e-6);
  EXPECT_NEAR(result.point[2], 0.1 * (near + far), 1e-6);
}

TEST(CpuField, WorkByHand) {
  const auto scene = load(uniformFog(3, 0.8));
  CostCounters work;
  const Ray miss = {{-3, 1.1f, 0}, {1, 0, 0}};
  render(*scene, {kAlongX, miss}, everything(), &work);
  EXPECT_EQ(work.rays, 2u);
  EXPECT_EQ(work.samples, 8u);  // steps of an eighth of the cube
  EXPECT_EQ(work.colour_samples, 8u);
  EXPECT_EQ(work.gathers, 8 * 8);
  // Interpolation: 8 products and sums; density 1 x 1 + 1 x 1 weights; colour 1 x 1 + 1 x 3.
  EXPECT_EQ(work.flops, 8 * (16 + 2 * 2) + 8 * (2 * 4));
  render(*scene, {kAlongX}, everything(), &work);  // is added to
  EXPECT_EQ(work.samples, 16u);
}

TEST(CpuField, OpaqueRaysEndAfterAFewSamples) {
  Field field = uniformFog(1000, 0.8);
  field.config.step = 1.0f / 64;
  CostCounters work;
  const RayResult result = render(*load(field), {kAlongX}, RenderOptions(), &work)[0];
  expectResult(result, 0.8, 1);
  EXPECT_EQ(work.samples, 4u);  // what a ray takes at once
  EXPECT_EQ(work.colour_samples, 1u);
}

TEST(CpuField, EarlyEndHidesNoMoreThanIsLeft) {
  const Field field = randomField(smallConfig(), 3);
  const auto scene = load(field);
  const Rays rays = randomRays(field, 300);
  const Results whole = render(*scene, rays, everything());
  RenderOptions options = everything();
  options.min_transmittance = 0.4f;
  const Results cut = render(*scene, rays, options);
  int ended = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_LE(cut[i].alpha, whole[i].alpha);
    EXPECT_LT(whole[i].alpha - cut[i].alpha, 0.4);
    for (int c = 0; c < 3; ++c) {
      EXPECT_LE(std::abs(whole[i].rgb[c] - cut[i].rgb[c]), whole[i].alpha - cut[i].alpha + 1e-6);
    }
    if (cut[i].alpha == whole[i].alpha) continue;
    ++ended;
    EXPECT_GT(cut[i].alpha, 0.6 - 1e-3);
  }
  EXPECT_GT(ended, 30);
}

// --- options

TEST(CpuField, OccupancySkipsEmptyCells) {
  Field field = uniformFog(3, 0.8);  // cells and intervals are eighths of the cube
  field.occupancy = {8, std::vector<std::uint8_t>(64, 0x0e)};  // x = 1, 2, 3
  const auto scene = load(field);
  RenderOptions options = everything();
  CostCounters work;
  options.use_occupancy = true;
  expectResult(render(*scene, {kAlongX}, options, &work)[0], 0.8, 1 - std::exp(-3 * 3 / 8.0));
  EXPECT_EQ(work.samples, 3u);
  options.use_occupancy = false;
  expectResult(render(*scene, {kAlongX}, options)[0], 0.8, 1 - std::exp(-3.0));
}

bool sameBits(const RayResult& a, const RayResult& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

TEST(CpuField, StepScaleMultipliesTheIntervals) {
  Field field = randomField(smallConfig(), 3);
  field.config.cone_angle = 0.1f;
  Field coarse = field;
  coarse.config.step *= 2;
  coarse.config.cone_angle *= 2;
  const Rays rays = randomRays(field, 50);
  RenderOptions options = everything();
  CostCounters fine_work, coarse_work;
  render(*load(field), rays, options, &fine_work);
  options.step_scale = 2;
  const Results scaled = render(*load(field), rays, options, &coarse_work);
  const Results expected = render(*load(coarse), rays, everything());
  for (std::size_t i = 0; i < rays.size(); ++i) EXPECT_TRUE(sameBits(scaled[i], expected[i])) << i;
  EXPECT_NEAR(coarse_work.samples / static_cast<double>(fine_work.samples), 0.5, 0.1);
}

TEST(CpuField, AScaledSceneGivesTheSameImage) {
  Field field = randomField(smallConfig(), 3);
  field.config.cone_angle = 0.1f;
  RenderOptions options;
  options.near = 0.5f;
  const Results expected = render(*load(field), randomRays(field, 200), options);
  constexpr double kScale = 0.05;
  const Rays rays = randomRays(field, 200, kScale);
  field.box.min *= kScale;
  field.box.max *= kScale;
  options.near *= kScale;
  const Results results = render(*load(field), rays, options);
  for (std::size_t i = 0; i < results.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(results[i].rgb[c], expected[i].rgb[c], 1e-4) << i;
      EXPECT_NEAR(results[i].point[c], kScale * expected[i].point[c], 4 * kScale * 1e-4) << i;
    }
    EXPECT_NEAR(results[i].alpha, expected[i].alpha, 1e-4) << i;
  }
}

// --- order

TEST(CpuField, ResultsDoNotDependOnGroupsOrThreads) {
  const Field field = randomField(smallConfig(), 3);
  const auto scene = load(field);
  const Rays rays = randomRays(field, 1000);
  const Results together = render(*scene, rays);
  Results alone(rays.size()), threaded(rays.size());
  for (std::size_t i = rays.size(); i-- > 0;) {
    scene->renderRays({&rays[i], 1}, RenderOptions(), &alone[i]);
  }
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int first = 50 * t; first < 1000; first += 200) {
        scene->renderRays({&rays[first], 50}, RenderOptions(), &threaded[first]);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    ASSERT_TRUE(sameBits(alone[i], together[i])) << i;
    ASSERT_TRUE(sameBits(threaded[i], together[i])) << i;
  }
}

std::vector<RayGradient> gradientsOf(const RayRenderer& scene, const Rays& rays,
                                     std::vector<int>* asked) {
  std::vector<RayGradient> gradients(rays.size());
  const auto gradient = [&](int i, const RayResult& result) -> RayLossGradient {
    ++asked->at(i);
    return {{result.rgb[0], 1, -1}, 0.5f};
  };
  scene.rayGradients(spanOf(rays), everything(), true, gradient, gradients.data());
  return gradients;
}

TEST(CpuField, GradientsOfRaysWithManySamplesAreTakenInSmallerGroups) {
  Field field = randomField(smallConfig(), 3);
  field.config.step = 0.002f;  // several hundred samples a ray: 32 rays do not fit
  const auto scene = load(field);
  const Rays rays = randomRays(field, 70);
  std::vector<int> asked(70, 0), asked_once(1, 0);
  const std::vector<RayGradient> together = gradientsOf(*scene, rays, &asked);
  EXPECT_EQ(asked, std::vector<int>(70, 1));
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const RayGradient alone = gradientsOf(*scene, {rays[i]}, &asked_once)[0];
    EXPECT_EQ(std::memcmp(&alone, &together[i], sizeof alone), 0) << i;
  }
}

// The paper's mode optimises what is scored: the same samples count for both.
TEST(CpuField, GradientSeesWhatIsRendered) {
  Field field = randomField(smallConfig(), 3);
  field.config.step = 0.002f;  // most samples are faint
  const auto scene = load(field);
  const Rays rays = randomRays(field, 100);
  RenderOptions strict;
  strict.min_weight = 3e-3f;
  for (const RenderOptions& options : {everything(), RenderOptions(), strict}) {
    const Results rendered = render(*scene, rays, options);
    std::vector<RayGradient> gradients(rays.size());
    const auto compare = [&](int i, const RayResult& seen) -> RayLossGradient {
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen.rgb[c], rendered[i].rgb[c], 1e-5);
      EXPECT_NEAR(seen.alpha, rendered[i].alpha, 1e-5);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen.point[c], rendered[i].point[c], 4e-5);
      return {{0, 0, 0}, 0};
    };
    scene->rayGradients(spanOf(rays), options, false, compare, gradients.data());
    for (const RayGradient& p : gradients) {
      for (int a = 0; a < 3; ++a) EXPECT_EQ(std::abs(p.force[a]) + std::abs(p.torque[a]), 0);
    }
  }
}

TEST(CpuField, FaintSamplesDoNotCount) {
  Field field = randomField(smallConfig(), 3);
  const auto scene = load(field);
  const Rays rays = randomRays(field, 200);
  const Results whole = render(*scene, rays, everything());
  RenderOptions options = everything();
  options.min_weight = 0.05f;
  const Results heavy = render(*scene, rays, options);
  int fewer = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_LE(heavy[i].alpha, whole[i].alpha + 1e-6f);
    const bool none_left = heavy[i].alpha == 0;
    EXPECT_TRUE(none_left || heavy[i].alpha >= options.min_weight);
    fewer += heavy[i].alpha < whole[i].alpha - 1e-3f;
  }
  EXPECT_GT(fewer, 20);
}

// --- errors

TEST(CpuField, RefusesAFieldThatIsNotWhole) {
  Field field = smallField();
  field.grid.pop_back();
  expectError<std::invalid_argument>([&] { load(field); }, "Field::grid holds");
  field = smallField();
  field.box.max.x() = field.box.min.x();
  expectError<std::invalid_argument>([&] { load(field); }, "Field::box");
}

}  // namespace
}  // namespace nerf_pose_refiner
