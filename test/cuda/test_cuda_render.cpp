// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "backend/cost_counters.h"
#include "backend/gpu_memory.h"
#include "backend/loaded_field.h"
#include "cuda_test.h"
#include "image/colour.h"
#include "test_object.h"

// Renderings of the CUDA backend against the CPU backend's, which works in single precision: halves
// in the networks and the table's own rounding leave a few thousandths.

namespace nerf_pose_refiner {
namespace {

constexpr double kColourRms = 2e-3, kColourMax = 2e-2;

struct Shape {
  const char* name;
  FieldConfig config;
};

FieldConfig paperConfig() {
  FieldConfig config = FieldConfig::named("paper");
  config.log2_table_size = 15;
  return config;
}

FieldConfig oddConfig() {
  FieldConfig config = smallConfig();
  config.levels = 5;
  config.features = 8;
  config.density_width = 24;
  config.colour_width = 40;
  config.density_hidden_layers = 2;
  config.colour_hidden_layers = 3;
  config.geometry_features = 6;
  config.sh_degree = 2;
  config.step = 0.02f;
  return config;
}

FieldConfig coneConfig() {
  FieldConfig config = smallConfig();
  config.step = 0.01f;
  config.cone_angle = 1.0f / 64;
  return config;
}

Camera renderCamera() { return {53, 44, 60, 62, 25.5, 22.25}; }

void expectSame(const Image& a, const Image& b, double rms_bound, double max_bound) {
  ASSERT_EQ(a.values.size(), b.values.size());
  double squared = 0, most = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double error = a.values[i] - b.values[i];
    ASSERT_TRUE(std::isfinite(error)) << i;
    squared += error * error;
    most = std::max(most, std::abs(error));
  }
  const double rms = std::sqrt(squared / static_cast<double>(a.values.size()));
  std::printf("  rms %.2e, most %.2e\n", rms, most);
  EXPECT_LE(rms, rms_bound);
  EXPECT_LE(most, max_bound);
}

class CudaRender : public CudaTest {
 protected:
  void compare(const Field& field, const Camera& camera, const Pose& T_O_C,
               const RenderOptions& options) {
    const auto shared = std::make_shared<Field>(field);
    const auto on_cpu = cpu->load(shared), on_cuda = cuda->load(shared);
    const CostCounters before_cpu = cpu->costs(), before_cuda = cuda->costs();
    const Rendering expected = on_cpu->render({camera, T_O_C}, options, {});
    const Rendering actual = on_cuda->render({camera, T_O_C}, options, {});
    double total = 0;
    for (float a : expected.alpha.values) total += a;
    EXPECT_GT(total, 0.02 * static_cast<double>(expected.alpha.values.size()));
    expectSame(expected.colour, actual.colour, kColourRms, kColourMax);
    expectSame(expected.alpha, actual.alpha, kColourRms, kColourMax);
    const double size = 5 * field.cubeSide();
    expectSame(expected.point, actual.point, kColourRms * size, kColourMax * size);
    const CostCounters spent_cpu = cpu->costs() - before_cpu,
                       spent_cuda = cuda->costs() - before_cuda;
    const auto same = [](std::uint64_t a, std::uint64_t b, double fraction) {
      EXPECT_NEAR(static_cast<double>(a), static_cast<double>(b),
                  fraction * static_cast<double>(a));
    };
    same(spent_cpu.samples, spent_cuda.samples, 0.02);
    same(spent_cpu.colour_samples, spent_cuda.colour_samples, 0.02);
    EXPECT_NEAR(spent_cpu.gathers, spent_cuda.gathers, 0.02 * spent_cpu.gathers);
    EXPECT_NEAR(spent_cpu.flops, spent_cuda.flops, 0.02 * spent_cpu.flops);
  }
};

TEST(GpuMemory, IsKnownWhereTheBackendWorks) {
  const std::optional<GpuMemory> memory = gpuMemory(0);
  EXPECT_EQ(memory.has_value(), whyNoCuda(0).empty());
  EXPECT_FALSE(gpuMemory(-1));
  if (!memory) return;
  EXPECT_GT(memory->used_bytes, 0u);
  EXPECT_LE(memory->used_bytes, memory->total_bytes);
}

TEST_F(CudaRender, everyShapeLooksAsOnTheCpu) {
  for (const Shape& shape :
       {Shape{"small", smallConfig()}, Shape{"cpu", FieldConfig()}, Shape{"paper", paperConfig()},
        Shape{"odd", oddConfig()}, Shape{"cone", coneConfig()}}) {
    SCOPED_TRACE(shape.name);
    std::printf("%s\n", shape.name);
    const Field field = randomField(shape.config, 3);
    compare(field, renderCamera(), cameraBefore(field, 4), {});
  }
}

TEST_F(CudaRender, emptySpaceIsSkippedAsOnTheCpu) {
  for (FieldConfig config : {FieldConfig(), coneConfig()}) {
    Field field = randomField(config, 8);
    carveBalls(&field);
    compare(field, renderCamera(), cameraBefore(field, 4), {});
    RenderOptions options;
    options.near = 3.8f;
    options.step_scale = 2;
    options.min_transmittance = 0.05f;
    compare(field, renderCamera(), cameraBefore(field, 4), options);
    options.use_occupancy = false;
    compare(field, renderCamera(), cameraBefore(field, 4), options);
  }
}

// A tenth of these samples is lighter than that: the counts of colours tell.
TEST_F(CudaRender, lightSamplesAreLeftOutAsOnTheCpu) {
  const Field field = randomField(FieldConfig(), 8);
  RenderOptions options;
  options.min_weight = 5e-4f;
  compare(field, renderCamera(), cameraBefore(field, 4), options);
}

TEST_F(CudaRender, aCameraInsideOfTheBoxAndOneThatLooksAway) {
  const Field field = learnedObject();
  const auto shared = std::make_shared<Field>(field);
  const Pose inside = cameraBefore(field, 0.05);
  compare(field, renderCamera(), inside, {});
  Pose away = cameraBefore(field, 4 * field.cubeSide());
  away.R.col(0) *= -1;
  away.R.col(2) *= -1;
  const Rendering nothing = cuda->load(shared)->render({renderCamera(), away}, {}, {});
  for (float a : nothing.alpha.values) ASSERT_EQ(a, 0);
}

TEST_F(CudaRender, theSameBitsEveryTime) {
  const auto field = cuda->load(std::make_shared<Field>(learnedObject()));
  const Pose pose = cameraBefore(field->field(), 2.5 * field->field().metadata.diameter);
  const Camera camera = renderCamera().scaled(5);
  const Rendering once = field->render({camera, pose}, {}, {});
  for (int i = 0; i < 3; ++i) {
    const Rendering again = field->render({camera, pose}, {}, {});
    EXPECT_EQ(once.colour.values, again.colour.values);
    EXPECT_EQ(once.alpha.values, again.alpha.values);
    EXPECT_EQ(once.point.values, again.point.values);
  }
}

TEST_F(CudaRender, severalPlacesAtOnceAreAsOneByOne) {
  const auto field = cuda->load(std::make_shared<Field>(learnedObject()));
  EXPECT_TRUE(field->rendersTogether());
  std::vector<Pose> poses;
  for (const double diameters : {1.5, 2.5, 4.0}) {
    poses.push_back(cameraBefore(field->field(), diameters * field->field().metadata.diameter));
  }
  const std::vector<Rendering> all = field->renderAll(renderCamera(), poses, {}, {});
  ASSERT_EQ(all.size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Rendering one = field->render({renderCamera(), poses[i]}, {}, {});
    EXPECT_EQ(all[i].colour.values, one.colour.values);
    EXPECT_EQ(all[i].alpha.values, one.alpha.values);
    EXPECT_EQ(all[i].point.values, one.point.values);
  }
  EXPECT_TRUE(field->renderAll(renderCamera(), {}, {}, {}).empty());
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(field->renderAll(renderCamera(), poses, {}, cancellation), Cancelled);
}

TEST_F(CudaRender, refusesWhatItCannotDo) {
  Field field = randomField(smallConfig(), 1);
  const auto loaded = cuda->load(std::make_shared<Field>(field));
  Pose broken;
  broken.t.x() = std::nan("");
  EXPECT_THROW(loaded->render({renderCamera(), broken}, {}, {}), std::invalid_argument);
  FieldConfig wide = smallConfig();
  wide.density_width = 128;
  EXPECT_THROW(cuda->load(std::make_shared<Field>(randomField(wide, 1))), std::invalid_argument);
  field.grid.pop_back();
  EXPECT_THROW(cuda->load(std::make_shared<Field>(field)), std::invalid_argument);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(loaded->render({renderCamera(), {}}, {}, cancellation), Cancelled);
}

TEST(MakeBackend, choosesAndRefuses) {
  BackendChoice choice;
  choice.backend = "gpu";
  EXPECT_THROW(makeBackend(choice), std::invalid_argument);
  choice.backend = "cpu";
  EXPECT_EQ(makeBackend(choice)->info().name, "cpu");
  choice.backend = "auto";
  EXPECT_EQ(makeBackend(choice)->info().name, whyNoCuda().empty() ? "cuda" : "cpu");
  choice.backend = "cuda";
  choice.device = 99;
  EXPECT_THROW(makeBackend(choice), std::runtime_error);
}

}  // namespace
}  // namespace nerf_pose_refiner
