// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "image/colour.h"
#include "registration/visual_hull.h"
#include "support/analytic_dataset.h"
#include "support/expect_error.h"

// A small field is trained from 24 small images of the analytic scene.

namespace nerf_pose_refiner {
namespace {

constexpr int kViews = 24;
constexpr int kSize = 40;  // [px]
constexpr int kSteps = 300;

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

const Dataset& dataset() {
  static const Dataset photos = analyticDataset(kViews, kSize);
  return photos;
}

const Hull& hull() {
  static const Hull hull =
      visualHull(dataset(), trainingConfig().occupancy_resolution, 0, CancellationToken());
  return hull;
}

TrainingPlan trainingPlan() {
  TrainingPlan plan;
  plan.samples_per_step = 4096;
  plan.region = hull().region;
  return plan;
}

struct Trained {
  Field field;
  std::vector<double> losses;
};

Trained train(Backend* backend, int steps, const TrainingPlan& plan) {
  const auto trainer =
      backend->makeTrainer(trainingConfig(), hull().box, trainingViews(dataset()), plan);
  Trained trained;
  for (int i = 0; i < steps; ++i) {
    EXPECT_EQ(trainer->stepsDone(), i);
    trained.losses.push_back(trainer->step(static_cast<double>(i) / steps));
  }
  trained.field = trainer->finish(CancellationToken());
  return trained;
}

const Trained& trained() {
  static const Trained once = train(makeCpuBackend(1).get(), kSteps, trainingPlan());
  return once;
}

// Views from other sides than those of the training.
const std::vector<PosedView>& unseenViews() {
  static const std::vector<PosedView> views = analyticDataset(6, kSize, 1.0).views;
  return views;
}

std::vector<Rendering> renderUnseen(const Field& field, bool use_occupancy) {
  const auto backend = makeCpuBackend(1);
  const auto loaded = backend->load(std::make_shared<Field>(field));
  RenderOptions options;
  options.use_occupancy = use_occupancy;
  std::vector<Rendering> renderings;
  for (const PosedView& view : unseenViews()) {
    renderings.push_back(loaded->render({view.camera, view.T_O_C}, options, CancellationToken()));
  }
  return renderings;
}

double rms(const Image& a, const Image& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    squares += std::pow(a.values[i] - b.values[i], 2);
  }
  return std::sqrt(squares / static_cast<double>(a.values.size()));
}

// Mean PSNR over the unseen views, on black [dB].
double unseenPsnr(const Field& field) {
  double sum = 0;
  const std::vector<Rendering> renderings = renderUnseen(field, true);
  for (std::size_t i = 0; i < renderings.size(); ++i) {
    sum += psnr(renderings[i].colour, premultiply(*unseenViews()[i].rgba).colour);
  }
  return sum / static_cast<double>(renderings.size());
}

double mean(const std::vector<double>& values, int first, int count) {
  double sum = 0;
  for (int i = first; i < first + count; ++i) sum += values[i] / count;
  return sum;
}

TEST(Training, LossFalls) {
  const std::vector<double>& losses = trained().losses;
  EXPECT_GT(mean(losses, 0, 10), 10 * mean(losses, kSteps - 10, 10));
  for (const double loss : losses) ASSERT_TRUE(std::isfinite(loss));
}

TEST(Training, ShowsUnseenViews) { EXPECT_GT(unseenPsnr(trained().field), 29); }

TEST(Training, LearnsTheOutline) {
  const std::vector<Rendering> renderings = renderUnseen(trained().field, true);
  for (std::size_t i = 0; i < renderings.size(); ++i) {
    EXPECT_LT(rms(renderings[i].alpha, premultiply(*unseenViews()[i].rgba).alpha), 0.1) << i;
  }
}

TEST(Training, OccupancyGridHidesNothing) {
  const std::vector<Rendering> with = renderUnseen(trained().field, true);
  const std::vector<Rendering> without = renderUnseen(trained().field, false);
  for (std::size_t i = 0; i < with.size(); ++i) {
    EXPECT_LE(rms(with[i].colour, without[i].colour), 1e-3) << i;
    EXPECT_LE(rms(with[i].alpha, without[i].alpha), 1e-3) << i;
  }
}

TEST(Training, OccupancyGridLeavesMostSpaceOut) {
  const OccupancyGrid& grid = trained().field.occupancy;
  ASSERT_EQ(grid.resolution, 32);
  int occupied = 0;
  for (const std::uint8_t byte : grid.bits) occupied += __builtin_popcount(byte);
  // The object fills a fifth of the cube, with the cells around it two fifths.
  EXPECT_LT(occupied, 32 * 32 * 32 * 6 / 10);
  EXPECT_GT(occupied, 32 * 32 * 32 * 2 / 10);
}

// Rays never look outside of the region; without a push such space would keep its first density.
TEST(Training, ClearsTheSpaceOutsideTheRegion) {
  const Box box = {Eigen::Vector3d::Constant(-1), Eigen::Vector3d::Constant(1)};
  TrainingPlan plan = trainingPlan();
  plan.region = {32, std::vector<std::uint8_t>(32 * 32 * 32 / 8, 0)};
  const auto in_region = [](int x, int y, int z) {
    return std::max({std::abs(x - 15.5), std::abs(y - 15.5), std::abs(z - 15.5)}) < 9;
  };
  const auto forEachCell = [](const auto& body) {
    for (int z = 0; z < 32; ++z) {
      for (int y = 0; y < 32; ++y) {
        for (int x = 0; x < 32; ++x) body(x, y, z);
      }
    }
  };
  forEachCell([&](int x, int y, int z) {
    if (in_region(x, y, z)) plan.region.bits[(z * 32 + y) * 4 + x / 8] |= 1 << (x % 8);
  });
  const auto backend = makeCpuBackend(1);
  const auto trainer = backend->makeTrainer(trainingConfig(), box, trainingViews(dataset()), plan);
  for (int i = 0; i < kSteps / 2; ++i) trainer->step(0);
  const OccupancyGrid grid = trainer->finish(CancellationToken()).occupancy;
  int outside = 0, left = 0;
  forEachCell([&](int x, int y, int z) {
    if (in_region(x, y, z)) return;
    ++outside;
    left += grid.occupied(x, y, z);
  });
  EXPECT_LT(left, outside / 10);
}

TEST(Training, MeasuresTheObject) {
  const FieldMetadata& metadata = trained().field.metadata;
  // From the box's corner (-0.36, -0.22, -0.28) through the ball's centre to its far side.
  EXPECT_NEAR(metadata.diameter, 1.090, 0.05 * 1.090);
  // Centre of the volume, integrated numerically.
  EXPECT_LT((metadata.centre - Eigen::Vector3d(0.016, 0.011, 0.013)).norm(), 0.02 * 1.090);
  EXPECT_EQ(metadata.training_steps, static_cast<std::uint64_t>(kSteps));
  EXPECT_EQ(metadata.seed, 1u);
  EXPECT_NO_THROW(trained().field.validate());
}

TEST(Training, WorksWithoutVectorInstructions) {
  const auto backend = makeCpuBackend(1, "baseline");
  EXPECT_GT(unseenPsnr(train(backend.get(), kSteps / 2, trainingPlan()).field), 25);
}

TEST(Training, WorksWithoutARegion) {
  TrainingPlan plan = trainingPlan();
  plan.region = OccupancyGrid();
  EXPECT_GT(unseenPsnr(train(makeCpuBackend(1).get(), kSteps / 2, plan).field), 25);
}

void expectSameBits(const Trained& a, const Trained& b) {
  EXPECT_EQ(a.losses, b.losses);
  EXPECT_EQ(a.field.grid, b.field.grid);
  EXPECT_EQ(a.field.density_weights, b.field.density_weights);
  EXPECT_EQ(a.field.colour_weights, b.field.colour_weights);
  EXPECT_EQ(a.field.occupancy.bits, b.field.occupancy.bits);
  EXPECT_EQ(a.field.metadata.diameter, b.field.metadata.diameter);
  EXPECT_EQ(a.field.metadata.centre, b.field.metadata.centre);
}

TEST(Training, SameSeedSameBitsOnAnyNumberOfThreads) {
  TrainingPlan plan = trainingPlan();
  plan.samples_per_step = 2048;
  constexpr int kFewSteps = 90;  // the occupancy grid is updated after 64 and 80
  const Trained one = train(makeCpuBackend(1).get(), kFewSteps, plan);
  expectSameBits(one, train(makeCpuBackend(2).get(), kFewSteps, plan));
  plan.seed = 2;
  const Trained other = train(makeCpuBackend(1).get(), 2, plan);
  EXPECT_NE(one.losses[0], other.losses[0]);
  EXPECT_NE(one.field.grid, other.field.grid);
}

TEST(Training, SnapshotsDoNotDisturb) {
  const auto backend = makeCpuBackend(1);
  const auto views = trainingViews(dataset());
  const auto a = backend->makeTrainer(trainingConfig(), hull().box, views, trainingPlan());
  const auto b = backend->makeTrainer(trainingConfig(), hull().box, views, trainingPlan());
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(a->step(0), b->step(0));
    EXPECT_EQ(b->snapshot(CancellationToken()).metadata.training_steps,
              static_cast<std::uint64_t>(i + 1));
  }
  EXPECT_EQ(a->finish(CancellationToken()).grid, b->finish(CancellationToken()).grid);
}

// White images, opaque everywhere, which nothing shows as yet.
TEST(Training, LossIsTheMeanOverTheRays) {
  std::vector<TrainingView> views = trainingViews(dataset());
  for (TrainingView& view : views) view.rgba = std::make_shared<Image8>(kSize, kSize, 4, 255);
  TrainingPlan plan;
  plan.random_background = false;
  for (const int samples : {1024, 3000, 4096}) {
    plan.samples_per_step = samples;
    const double loss =
        makeCpuBackend(1)->makeTrainer(trainingConfig(), hull().box, views, plan)->step(0);
    EXPECT_LE(loss, 1 - 0.05) << samples;  // Huber's loss of 1 with a threshold of 0.1
    EXPECT_GT(loss, 0.6) << samples;
  }
}

Box boxAt(const Eigen::Vector3d& centre) {
  return {centre - Eigen::Vector3d::Constant(0.1), centre + Eigen::Vector3d::Constant(0.1)};
}

TEST(Training, RefusesViewsThatDoNotShowTheBox) {
  const auto backend = makeCpuBackend(1);
  TrainingPlan plan;
  expectError<std::invalid_argument>(
      [&] {
        backend->makeTrainer(trainingConfig(), boxAt({0, 0, 50}), {}, plan);
      },
      "no view");
  std::vector<TrainingView> views = {trainingViews(dataset())[0]};
  const Eigen::Vector3d beside = views[0].T_O_C * Eigen::Vector3d(5, 0, 2);
  expectError<std::invalid_argument>(
      [&] { backend->makeTrainer(trainingConfig(), boxAt(beside), views, plan); },
      "no view shows the object's box");
}

TEST(Training, LeavesOutViewsThatDoNotShowTheBox) {
  const auto backend = makeCpuBackend(1);
  std::vector<TrainingView> views = trainingViews(dataset());
  const auto expected = backend->makeTrainer(trainingConfig(), hull().box, views, trainingPlan());
  TrainingView away = views[3];
  away.T_O_C.t = away.T_O_C * Eigen::Vector3d(20, 0, 0);  // looks past the object
  views.insert(views.begin(), away);
  const auto trainer = backend->makeTrainer(trainingConfig(), hull().box, views, trainingPlan());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(trainer->step(0), expected->step(0));
}

TEST(Training, RefusesARegionOfAnotherResolution) {
  TrainingPlan plan = trainingPlan();
  plan.region = {16, std::vector<std::uint8_t>(512, 255)};
  expectError<std::invalid_argument>(
      [&] {
        makeCpuBackend(1)->makeTrainer(trainingConfig(), hull().box, trainingViews(dataset()),
                                       plan);
      },
      "region has 16 cells", "occupancy grid 32");
}

TEST(Training, FinishCanBeStopped) {
  const auto backend = makeCpuBackend(1);
  const auto trainer =
      backend->makeTrainer(trainingConfig(), hull().box, trainingViews(dataset()), trainingPlan());
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(trainer->finish(cancellation), Cancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
