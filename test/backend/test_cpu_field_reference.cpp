// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "support/cpu_rays.h"
#include "support/random_field.h"
#include "support/reference_field.h"

// The CPU's field against the reference in double precision: every instruction set, numbers of
// features, and widths of layers that are no multiple of anything.

namespace nerf_pose_refiner {
namespace {

struct Shape {
  int features, levels, width, hidden_layers, geometry_features, sh_degree;

  FieldConfig config() const {
    FieldConfig config;
    config.features = features;
    config.levels = levels;
    config.log2_table_size = 10;
    config.base_resolution = 3;
    config.finest_resolution = levels == 1 ? 3 : 40;
    config.density_width = width;
    config.density_hidden_layers = hidden_layers;
    config.colour_width = width + 4;
    config.colour_hidden_layers = hidden_layers;
    config.geometry_features = geometry_features;
    config.sh_degree = sh_degree;
    config.step = 0.07f;
    return config;
  }
};

// What a ray sees, and the share of it that is too faint to be coloured by the backend.
struct Expected {
  Eigen::Vector3d rgb = Eigen::Vector3d::Zero(), point = Eigen::Vector3d::Zero();
  double alpha = 0, faint = 0;
};

Expected expectedOf(const ReferenceField& reference, const Field& field, const Ray& ray) {
  ReferenceField::Ray r;
  r.origin = Eigen::Map<const Eigen::Vector3f>(ray.origin).cast<double>();
  r.direction = Eigen::Map<const Eigen::Vector3f>(ray.direction).cast<double>();
  r.view = r.direction;
  Expected sum;
  double transmittance = 1;
  for (const FrozenSample& sample : reference.samples(r)) {
    const RayColour here = reference.render(r, {sample}, nullptr);
    const double weight = transmittance * here.alpha;
    sum.rgb += transmittance * here.rgb;
    sum.point += weight * (r.origin + sample.t * field.cubeSide() * r.direction);
    sum.alpha += weight;
    if (weight < 1.1e-4) sum.faint += weight;
    transmittance *= 1 - here.alpha;
  }
  return sum;
}

void expectMatchesReference(const Shape& shape, const char* instruction_set) {
  const Field field = randomField(shape.config(), 3);
  const ReferenceField reference(field);
  const Rays rays = randomRays(field, 60);
  const Results results = render(*load(field, instruction_set), rays, everything());
  int hits = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Expected expected = expectedOf(reference, field, rays[i]);
    hits += expected.alpha > 0.1;
    // Single precision: positions are good to 1e-7 and features change by up to 100 a unit.
    const double tolerance = 1e-5 + expected.faint;
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(results[i].rgb[c], expected.rgb[c], tolerance) << i;
      EXPECT_NEAR(results[i].point[c], expected.point[c], 4 * tolerance) << i;  // 4 units away
    }
    EXPECT_NEAR(results[i].alpha, expected.alpha, tolerance) << i;
  }
  EXPECT_GT(hits, 30);
}

class AgainstReference : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    try {
      selectCpuKernels(GetParam());
    } catch (const std::runtime_error& error) {
      GTEST_SKIP() << error.what();
    }
  }
};

INSTANTIATE_TEST_SUITE_P(InstructionSets, AgainstReference, ::testing::Values("baseline", "avx2"),
                         [](const auto& p) { return std::string(p.param); });

TEST_P(AgainstReference, OneFeature) { expectMatchesReference({1, 5, 13, 1, 6, 2}, GetParam()); }
TEST_P(AgainstReference, TwoFeatures) { expectMatchesReference({2, 4, 16, 2, 15, 4}, GetParam()); }
TEST_P(AgainstReference, FourFeatures) { expectMatchesReference({4, 3, 9, 3, 1, 3}, GetParam()); }
TEST_P(AgainstReference, EightFeatures) { expectMatchesReference({8, 2, 18, 1, 7, 1}, GetParam()); }
TEST_P(AgainstReference, OneLevelAndNoGeometryFeatures) {
  expectMatchesReference({4, 1, 6, 2, 0, 4}, GetParam());
}

}  // namespace
}  // namespace nerf_pose_refiner
