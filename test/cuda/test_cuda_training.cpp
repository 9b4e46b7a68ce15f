// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <stdexcept>

#include "backend/backend.h"
#include "backend/common/training_setup.h"
#include "backend/cost_counters.h"
#include "backend/loaded_field.h"
#include "cuda_test.h"
#include "image/colour.h"
#include "math/half.h"
#include "registration/registrar.h"
#include "registration/view_quality.h"
#include "registration/visual_hull.h"
#include "support/analytic_dataset.h"

// Training on the GPU: its first step against the CPU backend's, which draws the same rays, and
// what comes of many steps.

namespace nerf_pose_refiner {
namespace {

FieldConfig trainingConfig() {
  FieldConfig config;
  config.levels = 6;
  config.log2_table_size = 14;
  config.base_resolution = 8;
  config.finest_resolution = 64;
  config.density_width = 16;
  config.colour_width = 16;
  config.step = 1.7320508f / 128;
  config.occupancy_resolution = 32;
  return config;
}

/// As many features, layers and neurons as the paper's.
FieldConfig wideConfig() {
  FieldConfig config = trainingConfig();
  config.levels = 16;
  config.features = 2;
  config.density_width = config.colour_width = 64;
  config.colour_hidden_layers = 2;
  return config;
}

/// Sizes that need padding everywhere.
FieldConfig oddTrainingConfig() {
  FieldConfig config = trainingConfig();
  config.levels = 5;
  config.features = 8;
  config.density_width = 24;
  config.colour_width = 40;
  config.density_hidden_layers = 2;
  config.colour_hidden_layers = 3;
  config.geometry_features = 6;
  config.sh_degree = 2;
  return config;
}

const Dataset& photos() {
  static const Dataset dataset = analyticDataset(24, 40);
  return dataset;
}

const Hull& hull() {
  static const Hull found = visualHull(photos(), trainingConfig().occupancy_resolution, 0, {});
  return found;
}

TrainingPlan trainingPlan() {
  TrainingPlan plan;
  plan.samples_per_step = 4096;
  return plan;
}

/// Share of the numbers that moved to the same side, among those that moved in either.
double agreement(const std::vector<float>& start, const std::vector<float>& a,
                 const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  std::size_t moved = 0, same = 0;
  for (std::size_t i = 0; i < start.size(); ++i) {
    const float move_a = a[i] - start[i], move_b = b[i] - start[i];
    if (move_a == 0 && move_b == 0) continue;
    ++moved;
    same += move_a * move_b > 0;
  }
  EXPECT_GT(moved, start.size() / 100);
  return static_cast<double>(same) / static_cast<double>(moved);
}

std::vector<float> floats(const std::vector<std::uint16_t>& halves) {
  std::vector<float> values;
  for (const std::uint16_t h : halves) values.push_back(halfToFloat(h));
  return values;
}

std::vector<float> featuresAtStart(std::size_t n, std::uint64_t seed) {
  std::vector<float> values;
  for (std::size_t i = 0; i < n; ++i) {
    values.push_back(halfToFloat(floatToHalf(initialFeature(seed, i))));
  }
  return values;
}

class CudaTraining : public CudaTest {
 protected:
  std::unique_ptr<FieldTrainer> trainer(Backend* backend, const FieldConfig& config,
                                        const TrainingPlan& plan) {
    return backend->makeTrainer(config, hull().box, trainingViews(photos()), plan);
  }

  Field train(int steps, const FieldConfig& config, const TrainingPlan& plan,
              std::vector<double>* losses = nullptr) {
    const auto trained = trainer(cuda.get(), config, plan);
    for (int i = 0; i < steps; ++i) {
      EXPECT_EQ(trained->stepsDone(), i);
      const double loss = trained->step(static_cast<double>(i) / steps);
      if (losses != nullptr) losses->push_back(loss);
    }
    return trained->finish({});
  }

  /// Mean PSNR over views from other sides than those of the training, rendered on the CPU.
  double unseenPsnr(const Field& field) {
    return meanPsnr(*cpu->load(std::make_shared<Field>(field)), analyticDataset(6, 40, 1.0).views,
                    {});
  }
};

// Adam's first step moves every touched number by the learning rate, to the side of its gradient.
TEST_F(CudaTraining, firstStepMovesAsOnTheCpu) {
  for (const FieldConfig& config : {trainingConfig(), wideConfig(), oddTrainingConfig()}) {
    SCOPED_TRACE(config.levels);
    TrainingPlan plan = trainingPlan();
    plan.samples_per_step = 16384;
    const auto expected = trainer(cpu.get(), config, plan);
    const auto actual = trainer(cuda.get(), config, plan);
    const double loss = expected->step(0);
    EXPECT_NEAR(actual->step(0), loss, 2e-3 * loss);
    const Field a = expected->finish({}), b = actual->finish({});
    const InitialWeights start = initialWeights(config, plan.seed);
    const double table =
        agreement(featuresAtStart(a.grid.size(), plan.seed), floats(a.grid), floats(b.grid));
    const double density = agreement(start.density, a.density_weights, b.density_weights);
    const double colour = agreement(start.colour, a.colour_weights, b.colour_weights);
    std::printf("  same side: table %.4f, density %.4f, colour %.4f\n", table, density, colour);
    EXPECT_GT(table, 0.9);
    EXPECT_GT(density, 0.9);
    EXPECT_GT(colour, 0.9);
  }
}

TEST_F(CudaTraining, lossFallsAsOnTheCpu) {
  constexpr int kSteps = 96;  // beyond the first updates of the occupancy grid
  TrainingPlan plan = trainingPlan();
  plan.region = hull().region;
  const auto expected = trainer(cpu.get(), trainingConfig(), plan);
  const auto actual = trainer(cuda.get(), trainingConfig(), plan);
  double last_expected = 0, last_actual = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double loss = expected->step(0);
    if (i >= kSteps - 16) last_expected += loss / 16;
    last_actual = actual->step(0);  // the mean over the last 16
  }
  EXPECT_NEAR(last_actual, last_expected, 0.15 * last_expected);
}

TEST_F(CudaTraining, showsUnseenViews) {
  for (const FieldConfig& config : {trainingConfig(), wideConfig(), oddTrainingConfig()}) {
    TrainingPlan plan = trainingPlan();
    plan.region = hull().region;
    std::vector<double> losses;
    const Field field = train(300, config, plan, &losses);
    EXPECT_NO_THROW(field.validate());
    EXPECT_GT(losses.front(), 10 * losses.back());
    const double psnr_db = unseenPsnr(field);
    std::printf("  %d levels: %.2f dB\n", config.levels, psnr_db);
    EXPECT_GT(psnr_db, 27);
    EXPECT_NEAR(field.metadata.diameter, 1.090, 0.08 * 1.090);  // as the CPU backend's test
    EXPECT_LT((field.metadata.centre - Eigen::Vector3d(0.016, 0.011, 0.013)).norm(), 0.022);
    EXPECT_EQ(field.metadata.training_steps, 300u);
  }
}

TEST_F(CudaTraining, worksWithoutARegion) {
  EXPECT_GT(unseenPsnr(train(150, trainingConfig(), trainingPlan())), 25);
}

TEST_F(CudaTraining, occupancyGridHidesNothing) {
  TrainingPlan plan = trainingPlan();
  plan.region = hull().region;
  const auto field = cuda->load(std::make_shared<Field>(train(300, trainingConfig(), plan)));
  RenderOptions everything;
  everything.use_occupancy = false;
  for (const PosedView& view : analyticDataset(3, 40, 1.0).views) {
    const Rendering with = field->render({view.camera, view.T_O_C}, {}, {});
    const Rendering without = field->render({view.camera, view.T_O_C}, everything, {});
    EXPECT_GT(psnr(with.colour, without.colour), 60);  // 1e-3 RMS
  }
  int occupied = 0;
  for (const std::uint8_t byte : field->field().occupancy.bits) {
    occupied += __builtin_popcount(byte);
  }
  EXPECT_LT(occupied, 32 * 32 * 32 * 6 / 10);
  EXPECT_GT(occupied, 32 * 32 * 32 * 2 / 10);
}

// Budgets that the first rays overflow, and one of which a step has many.
TEST_F(CudaTraining, keepsToItsBudget) {
  for (const int samples : {1024, 1 << 16}) {
    TrainingPlan plan = trainingPlan();
    plan.samples_per_step = samples;
    const auto trained = trainer(cuda.get(), trainingConfig(), plan);
    for (int i = 0; i < 48; ++i) trained->step(0);
    const CostCounters before = cuda->costs();
    for (int i = 0; i < 32; ++i) trained->step(0);
    const CostCounters spent = cuda->costs() - before;
    // Evaluated before compositing and again on the way back; empty points and cells come on top.
    EXPECT_GT(static_cast<double>(spent.samples), 32 * 1.4 * samples);
    EXPECT_LT(static_cast<double>(spent.samples), 32 * (8.0 * samples + 8192));
    EXPECT_GT(spent.rays, 32u * 16);
  }
}

// Numbers grow until halves cannot hold them: such steps are left out, and the field stays whole.
TEST_F(CudaTraining, stepsThatAreNotFiniteChangeNothing) {
  TrainingPlan plan = trainingPlan();
  plan.learning_rate = 100;
  EXPECT_NO_THROW(train(48, trainingConfig(), plan).validate());
}

TEST_F(CudaTraining, snapshotsDoNotDisturb) {
  const auto trained = trainer(cuda.get(), trainingConfig(), trainingPlan());
  for (int i = 0; i < 20; ++i) trained->step(0);
  const Field once = trained->snapshot({}), again = trained->snapshot({});
  EXPECT_EQ(once.grid, again.grid);
  EXPECT_EQ(once.density_weights, again.density_weights);
  EXPECT_EQ(once.colour_weights, again.colour_weights);
  EXPECT_EQ(once.occupancy.bits, again.occupancy.bits);
  trained->step(0);
  EXPECT_NE(trained->snapshot({}).grid, once.grid);
}

TEST_F(CudaTraining, refusesWhatItCannotDo) {
  FieldConfig wide = trainingConfig();
  wide.density_width = 128;
  EXPECT_THROW(trainer(cuda.get(), wide, trainingPlan()), std::invalid_argument);
  TrainingPlan plan = trainingPlan();
  plan.region = {16, std::vector<std::uint8_t>(512, 255)};
  EXPECT_THROW(trainer(cuda.get(), trainingConfig(), plan), std::invalid_argument);
  EXPECT_THROW(cuda->makeTrainer(trainingConfig(), hull().box, {}, trainingPlan()),
               std::invalid_argument);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(trainer(cuda.get(), trainingConfig(), trainingPlan())->finish(cancellation),
               Cancelled);
}

TEST_F(CudaTraining, registersAnObject) {
  RegistrationOptions settings;
  settings.steps = 300;
  settings.held_out = 2;
  settings.samples_per_step = 1 << 14;
  const Field field = learnField(cuda.get(), photos(), settings, {}, {});
  EXPECT_GT(field.metadata.psnr_db, 24);
}

}  // namespace
}  // namespace nerf_pose_refiner
