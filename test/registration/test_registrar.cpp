// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/registrar.h"
#include "registration/view_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "backend/make_backend.h"
#include "registration/registration_hash.h"
#include "support/analytic_dataset.h"
#include "support/expect_error.h"
#include "support/grey_dataset.h"
#include "support/scripted_backend.h"

namespace nerf_pose_refiner {
namespace {

RegistrationOptions fewSteps(int steps) {
  RegistrationOptions settings;
  settings.steps = steps;
  settings.accept_poor_data = true;  // these tests need no good ones
  return settings;
}

Field registerWith(Backend* backend, const Dataset& dataset, const RegistrationOptions& settings,
                   const std::function<void(const RegistrationProgress&)>& progress = {},
                   const CancellationToken& cancellation = {}) {
  return learnField(backend, dataset, settings, progress, cancellation);
}

std::set<int> heldOut(int views, int held_out) {
  ScriptedBackend backend;
  RegistrationOptions settings = fewSteps(1);
  settings.held_out = held_out;
  const Dataset dataset = greyDataset(views);
  const Field field = registerWith(&backend, dataset, settings);
  std::set<int> missing;
  for (int i = 0; i < views; ++i) missing.insert(i);
  for (const TrainingView& view : backend.views) {
    missing.erase(static_cast<int>(std::lround(view.T_O_C.t.x())));
  }
  EXPECT_EQ(backend.views.size() + missing.size(), dataset.views.size());
  EXPECT_EQ(field.metadata.score.views, static_cast<int>(missing.size()));
  return missing;
}

TEST(RegisterObject, HeldOutViewsAreSpreadOverThePathAndNotTrainedOn) {
  EXPECT_EQ(heldOut(40, 4), (std::set<int>{5, 15, 25, 35}));
  EXPECT_EQ(heldOut(24, 4), (std::set<int>{6, 18}));  // at most a tenth
  EXPECT_EQ(heldOut(45, 2), (std::set<int>{11, 33}));
  EXPECT_EQ(heldOut(9, 4), std::set<int>{});
  EXPECT_EQ(heldOut(40, 0), std::set<int>{});
}

TEST(RegisterObject, GivesTheTrainerWhatItNeeds) {
  ScriptedBackend backend;
  RegistrationOptions settings = fewSteps(4);
  settings.seed = 7;
  settings.learning_rate = 0.5;
  registerWith(&backend, greyDataset(10), settings);
  EXPECT_EQ(backend.box.min, Eigen::Vector3d(-1, -2, -3));
  EXPECT_EQ(backend.box.max, Eigen::Vector3d(60, 2, 3));
  EXPECT_EQ(backend.plan.region.resolution, 0);
  EXPECT_EQ(backend.plan.seed, 7u);
  EXPECT_EQ(backend.plan.learning_rate, 0.5);
  EXPECT_EQ(backend.progress, (std::vector<double>{0, 0.25, 0.5, 0.75}));

  ScriptedBackend with_alpha;
  registerWith(&with_alpha, analyticDataset(12, 24), fewSteps(1));
  EXPECT_EQ(with_alpha.plan.region.resolution, FieldConfig::named("cpu").occupancy_resolution);
  EXPECT_TRUE(with_alpha.plan.random_background);
}

// The corners of a view see 0.3 units up and down for each unit of depth; the box begins at z = -3
// and ends at y = 2.
TEST(RegisterObject, ASceneThatFillsAllViewsIsOpaque) {
  const auto is_opaque = [](double z_of_a_view) {
    Dataset dataset = greyDataset(10);
    dataset.views[6].T_O_C.t.z() = z_of_a_view;
    ScriptedBackend backend;
    registerWith(&backend, dataset, fewSteps(1));
    return backend.plan.random_background;
  };
  EXPECT_TRUE(is_opaque(0));      // from inside
  EXPECT_TRUE(is_opaque(-9.6));   // 1.98 units above the axis where the box begins
  EXPECT_FALSE(is_opaque(-9.7));  // 2.01
}

TEST(RegisterObject, MeasuresHeldOutViewsByHand) {
  ScriptedBackend backend;
  backend.error = [](int, const Pose& T_O_C) { return T_O_C.t.x() < 10 ? 0.1 : -0.01; };
  RegistrationOptions settings = fewSteps(3);
  settings.held_out = 2;  // views 5 and 15
  const Field field = registerWith(&backend, greyDataset(20), settings);
  EXPECT_NEAR(field.metadata.psnr_db, 30, 1e-3);  // 20 and 40 dB
  EXPECT_EQ(field.metadata.score.views, 2);
  EXPECT_NEAR(field.metadata.score.mean_loss, 0.055, 1e-6);
  EXPECT_NEAR(field.metadata.score.stddev_loss, 0.045, 1e-6);
  EXPECT_EQ(field.metadata.training_steps, 3u);
  EXPECT_EQ(field.metadata.data_hash, registrationHash(greyDataset(20), settings));
}

// Photos without alpha show what is behind the box as well. Seen from z = -10 the box covers the
// four pixels in the middle of 4 x 4: at its nearer face the rays are at 0.9 and 2.7 units.
TEST(RegisterObject, PhotosWithoutAlphaAreJudgedWhereTheBoxIs) {
  Dataset dataset = greyDataset(20);
  dataset.box_min = {-1, -1, -1};
  dataset.box_max = {1, 1, 1};
  for (PosedView& view : dataset.views) {
    Image8 photo(4, 4, 4, 255);  // bright, but for the middle
    for (const int i : {5, 6, 9, 10}) {
      for (int c = 0; c < 3; ++c) photo.values[4 * i + c] = 128;
    }
    view.rgba = std::make_shared<Image8>(photo);
    view.T_O_C.t = {0, 0, -10};
  }
  ScriptedBackend backend;
  RegistrationOptions settings = fewSteps(2);
  settings.target_psnr_db = 19.9;
  const Field field = registerWith(&backend, dataset, settings);
  EXPECT_NEAR(field.metadata.psnr_db, 20, 1e-3);
  EXPECT_NEAR(field.metadata.score.mean_loss, 0.1, 1e-6);
  EXPECT_EQ(field.metadata.training_steps, 1u);  // it is seen that the quality is reached
}

TEST(RegisterObject, HeldOutViewsThatShowNothingDoNotCount) {
  Dataset dataset = greyDataset(20);
  RegistrationOptions settings = fewSteps(1);
  settings.held_out = 2;                  // views 5 and 15
  dataset.views[5].T_O_C.t = {0, 0, 10};  // looks away from the box
  ScriptedBackend backend;
  backend.error = [](int, const Pose& T_O_C) { return T_O_C.t.z() > 0 ? 0.0 : 0.1; };
  const Field field = registerWith(&backend, dataset, settings);
  EXPECT_EQ(field.metadata.score.views, 1);
  EXPECT_NEAR(field.metadata.psnr_db, 20, 1e-3);
}

TEST(RegisterObject, ThePsnrOfEqualImagesIsFinite) {
  ScriptedBackend backend;
  backend.error = [](int, const Pose&) { return 0.0; };
  const Field field = registerWith(&backend, greyDataset(20), fewSteps(1));
  EXPECT_EQ(field.metadata.psnr_db, 100);
}

TEST(RegisterObject, RefusesABoxThatIsNone) {
  const double nan = std::nan("");
  for (const bool has_alpha : {false, true}) {
    for (const Eigen::Vector3d& max :
         {Eigen::Vector3d(1, -2, 3), Eigen::Vector3d(1, -5, 3), Eigen::Vector3d(1, 2, nan)}) {
      Dataset dataset = greyDataset(10);
      dataset.has_alpha = has_alpha;
      dataset.box_max = max;
      ScriptedBackend backend;
      expectError<std::invalid_argument>([&] { registerWith(&backend, dataset, fewSteps(1)); },
                                         "the box from -1 -2 -3 to ", "is empty");
      EXPECT_TRUE(backend.views.empty());
    }
  }
}

TEST(RegisterObject, TheSettingsScaleGoesBeforeTheDatasets) {
  ScriptedBackend backend;
  Dataset dataset = greyDataset(10);
  RegistrationOptions settings = fewSteps(1);
  EXPECT_EQ(registerWith(&backend, dataset, settings).metadata.metres_per_unit, 0);
  dataset.metres_per_unit = 0.5;
  EXPECT_EQ(registerWith(&backend, dataset, settings).metadata.metres_per_unit, 0.5);
  settings.metres_per_unit = 0.25;
  EXPECT_EQ(registerWith(&backend, dataset, settings).metadata.metres_per_unit, 0.25);
}

TEST(RegisterObject, ReportsItsStagesInOrder) {
  ScriptedBackend backend;
  backend.step_ms = 30;
  std::vector<RegistrationProgress> reports;
  registerWith(&backend, greyDataset(10), fewSteps(40),
               [&](const RegistrationProgress& report) { reports.push_back(report); });
  // At once, twice a second, and at every new stage.
  ASSERT_GE(reports.size(), 6u);
  EXPECT_LE(reports.size(), 4u + reports.back().seconds / 0.5);
  EXPECT_EQ(reports.front().step, 1);
  EXPECT_EQ(reports[reports.size() - 3].stage, "occupancy");
  EXPECT_EQ(reports[reports.size() - 2].stage, "quality");
  EXPECT_EQ(reports.back().stage, "pose quality");
  EXPECT_EQ(reports.back().step, 40);
  EXPECT_EQ(reports.back().seconds_left, 0);
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (i + 3 < reports.size()) {
      EXPECT_EQ(reports[i].stage, "training") << i;
    }
    EXPECT_EQ(reports[i].steps, 40);
    EXPECT_EQ(reports[i].loss, 0.25);
    if (i == 0) continue;
    EXPECT_GE(reports[i].step, reports[i - 1].step);
    EXPECT_GE(reports[i].seconds, reports[i - 1].seconds);
  }
  const RegistrationProgress& early = reports[1];
  EXPECT_NEAR(early.seconds_left, early.seconds * (40.0 - early.step) / early.step, 1e-9);
}

TEST(RegisterObject, EndsByTime) {
  ScriptedBackend backend;
  backend.step_ms = 5;
  RegistrationOptions settings = fewSteps(1000000);
  settings.max_seconds = 0.2;
  settings.keep_colours = true;  // no rough training before
  const Field field = registerWith(&backend, greyDataset(10), settings);
  EXPECT_LE(field.metadata.training_steps, 40u);
  EXPECT_GE(field.metadata.training_steps, 2u);
  double last = 0;  // the learning rate falls by the time
  for (const double progress : backend.progress) {
    EXPECT_GE(progress, last);
    EXPECT_LT(progress, 1);
    last = progress;
  }
}

TEST(RegisterObject, EndsByQuality) {
  ScriptedBackend backend;
  backend.error = [](int steps, const Pose&) { return steps < 35 ? 0.1 : 0.01; };
  RegistrationOptions settings = fewSteps(100);
  settings.held_out = 1;
  settings.target_psnr_db = 39;
  double reported = 0;
  const Field field = registerWith(&backend, greyDataset(20), settings,
                                   [&](const RegistrationProgress& r) { reported = r.psnr_db; });
  // Looked at after every tenth of the training: after 40 steps, or one more by rounding.
  EXPECT_NEAR(static_cast<double>(field.metadata.training_steps), 40.5, 0.5);
  EXPECT_NEAR(reported, 40, 1e-3);

  backend.progress.clear();
  settings.target_psnr_db = 41;  // is never reached
  EXPECT_EQ(registerWith(&backend, greyDataset(20), settings).metadata.training_steps, 100u);
}

TEST(RegisterObject, StopsWithinAStep) {
  for (const std::string stage : {"training", "occupancy", "quality"}) {
    ScriptedBackend backend;
    const CancellationToken cancellation;
    const auto stop_there = [&](const RegistrationProgress& report) {
      if (report.stage == stage) cancellation.requestCancel();
    };
    EXPECT_THROW(registerWith(&backend, greyDataset(20), fewSteps(50), stop_there, cancellation),
                 Cancelled);
    EXPECT_EQ(backend.progress.size(), stage == "training" ? 1u : 50u) << stage;
  }
}

TEST(RegisterObject, RefusesWhatHasNoMatter) {
  ScriptedBackend backend;
  backend.diameter = 0;
  expectError<std::runtime_error>([&] { registerWith(&backend, greyDataset(10), fewSteps(1)); },
                                  "grey: training found nothing opaque");
}

TEST(RegisterObject, RefusesAPoorModelUnlessItIsAccepted) {
  ScriptedBackend backend;
  backend.error = [](int, const Pose&) { return 0.5; };
  RegistrationOptions settings = fewSteps(1);
  settings.held_out = 2;
  Dataset dataset = greyDataset(20);
  dataset.has_box = true;  // near to the cameras, which see it from different directions
  dataset.box_min = {4, -1, 2};
  dataset.box_max = {16, 1, 4};
  for (std::size_t i = 0; i < 20; ++i) {  // photos that differ
    auto photo = std::make_shared<Image8>(*dataset.views[i].rgba);
    photo->values[0] = static_cast<std::uint8_t>(photo->values[0] + i);
    dataset.views[i].rgba = photo;
  }
  EXPECT_NO_THROW(registerWith(&backend, dataset, settings));
  settings.accept_poor_data = false;
  expectError<std::runtime_error>([&] { registerWith(&backend, dataset, settings); }, "PSNR 6.",
                                  "accept_poor_data");
}

// --- the CPU backend

TEST(RegisterObject, OnTheCpu) {
  const auto backend = makeCpuBackend(2);
  RegistrationOptions settings = fewSteps(160);  // clear enough to be rendered fast
  settings.accept_poor_data = false;             // good photos are not refused
  settings.samples_per_step = 4096;
  const Field field = registerWith(backend.get(), analyticDataset(24, 40), settings);
  EXPECT_NO_THROW(field.validate());
  EXPECT_EQ(field.config.profile, "cpu");
  EXPECT_GT(field.metadata.psnr_db, 20);
  EXPECT_EQ(field.metadata.score.views, 2);
  EXPECT_GT(field.metadata.score.mean_loss, 0);
  EXPECT_NEAR(field.metadata.diameter, 1.09, 0.1);
}

// Nothing more is evaluated once cancellation is requested. (How far apart the backend's own looks
// at the token are is a matter of its tests.)
TEST(RegisterObject, StopsAtOnceOnTheCpu) {
  for (const std::string stage : {"training", "occupancy", "quality"}) {
    const auto backend = makeCpuBackend(2);
    RegistrationOptions settings = fewSteps(80);  // enough for something opaque
    settings.keep_colours = true;
    settings.samples_per_step = 4096;
    const CancellationToken cancellation;
    std::uint64_t samples = 0;
    const auto stop_there = [&](const RegistrationProgress& report) {
      if (report.stage != stage) return;
      cancellation.requestCancel();
      samples = backend->costs().samples;
    };
    EXPECT_THROW(
        registerWith(backend.get(), analyticDataset(24, 40), settings, stop_there, cancellation),
        Cancelled);
    EXPECT_GT(samples, 0u) << stage;
    EXPECT_EQ(backend->costs().samples, samples) << stage;
  }
}

// --- settings

void expectRefused(const std::function<void(RegistrationOptions*)>& change, const char* name) {
  RegistrationOptions settings;
  change(&settings);
  expectError<std::invalid_argument>([&] { settings.validate(); }, std::string(name) + " = ");
}

TEST(RegistrationOptions, NamesWhatIsOutOfRange) {
  using S = RegistrationOptions;
  const double nan = std::nan("");
  EXPECT_NO_THROW(S().validate());
  expectRefused([](S* s) { s->steps = 0; }, "steps");
  expectRefused([](S* s) { s->threads = -1; }, "threads");
  expectRefused([](S* s) { s->max_seconds = -1; }, "max_seconds");
  expectRefused([=](S* s) { s->max_seconds = nan; }, "max_seconds");
  expectRefused([](S* s) { s->target_psnr_db = -1; }, "target_psnr_db");
  expectRefused([](S* s) { s->held_out = -1; }, "held_out");
  expectRefused([](S* s) { s->metres_per_unit = -1; }, "metres_per_unit");
  expectRefused([](S* s) { s->metres_per_unit = 1 / 0.0; }, "metres_per_unit");
  expectRefused([](S* s) { s->samples_per_step = 1000; }, "samples_per_step");
  expectRefused([](S* s) { s->samples_per_step = (1 << 24) + 1; }, "samples_per_step");
  expectRefused([](S* s) { s->learning_rate = 0; }, "learning_rate");
  expectRefused([=](S* s) { s->learning_rate = nan; }, "learning_rate");
  expectRefused([](S* s) { s->learning_rate = 1 / 0.0; }, "learning_rate");
  expectRefused([](S* s) { s->final_learning_rate_factor = 0; }, "final_learning_rate_factor");
  expectRefused([](S* s) { s->final_learning_rate_factor = 2; }, "final_learning_rate_factor");
  S unknown;
  unknown.profile = "tpu";
  expectError<std::invalid_argument>([&] { unknown.validate(); }, "'tpu'", "cpu, gpu, paper");
}

TEST(MeanPsnr, NeedsViews) {
  const RecordingField field(std::make_shared<Field>());
  expectError<std::invalid_argument>([&] { meanPsnr(field, {}, CancellationToken()); }, "PSNR");
}

}  // namespace
}  // namespace nerf_pose_refiner
