// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "backend/cpu/cpu_backend.h"
#include "backend/make_backend.h"
#include "math/angle.h"
#include "refinement/field_refiner.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/expect_error.h"
#include "support/fog_scene.h"
#include "support/recording_backend.h"
#include "support/small_inversion.h"

// The schedule of the paper's mode, and whole refinements in a scene of fog.

namespace nerf_pose_refiner {
namespace {

Camera smallCamera() { return {64, 64, 80, 80, 31.5, 31.5}; }

/// An object of 5 model units.
std::shared_ptr<const Field> someField() {
  auto field = std::make_shared<Field>();
  field->metadata.diameter = 5;
  return field;
}

/// What a preset asks of a solver.
/// @param table what it finds.
std::shared_ptr<const Recording> recorded(const RefinerSettings& settings, const Prior& prior,
                                          const HypothesisTable& table = HypothesisTable(1)) {
  const auto recording = std::make_shared<Recording>();
  recording->table = table;
  const RecordingField field(someField(), recording);
  Observation observation;
  observation.camera = smallCamera();
  observation.image = Image(64, 64, 3);
  Prior there = prior;
  there.T_O_C = cameraAround(field, 0, 0);
  EXPECT_EQ(FieldRefiner(makeCpuBackend(1), settings).refine(field, observation, there).outcome,
            Outcome::kRefined);
  return recording;
}

/// Steps go in slices, behind each of which there is a line in the trace.
void expectSlices(const std::vector<int>& sizes, int first_step, std::vector<std::string>* calls) {
  for (const int size : sizes) {
    calls->push_back("optimise " + std::to_string(first_step) + "+" + std::to_string(size));
    first_step += size;
  }
}

// Lin et al., section IV-D: 64 hypotheses, 2560 = 512 + 4 x 512 steps.
TEST(Inversion, scheduleOfThePaper) {
  const auto asked = recorded(RefinerSettings::named("paper"), Prior());
  std::vector<std::string> expected = {"sample 64"};
  for (int round = 0; round <= 4; ++round) {
    if (round > 0) expected.push_back(round == 1 ? "resample 8 for 64" : "resample 4 for 64");
    expectSlices({128, 128, 128, 128}, 512 * round, &expected);
  }
  // The choice; whether the mean of the best is better; how firmly the image holds the winner.
  expected.insert(expected.end(),
                  {"evaluate 16384", "sample 1", "evaluate 16384", "sample 1", "score"});
  EXPECT_EQ(asked->calls, expected);
}

TEST(Inversion, singleIsNotResampled) {
  const auto asked = recorded(RefinerSettings::named("paper_single"), Prior());
  std::vector<std::string> expected = {"sample 1"};
  expectSlices(std::vector<int>(20, 128), 0, &expected);
  expected.insert(expected.end(), {"evaluate 16384", "sample 1", "score"});
  EXPECT_EQ(asked->calls, expected);
}

Hypothesis hypothesisAt(double x, double loss) {
  Hypothesis hypothesis;
  hypothesis.T_O_C.t.x() = x;
  hypothesis.T_O_C.R = expSO3(Eigen::Vector3d(0, 0, 0.1 * x));
  hypothesis.loss = loss;
  return hypothesis;
}

// Near (0.2 model units, of which the paper's are 2) and about as good: those at 0, 0.04 and 0.08.
TEST(Inversion, theMeanOfTheBestIsTried) {
  const HypothesisTable table = {hypothesisAt(0, 1), hypothesisAt(0.04, 1.05),
                                 hypothesisAt(0.08, 1.09), hypothesisAt(0.01, 1.2),
                                 hypothesisAt(0.3, 1.01)};
  RefinerSettings settings = RefinerSettings::named("paper");
  const auto asked = recorded(settings, Prior(), table);
  ASSERT_EQ(asked->priors.size(), 3u);  // the search, the mean, the winner
  EXPECT_NEAR(asked->priors[1].t.x(), 0.04, 1e-12);
  EXPECT_NEAR(logSO3(asked->priors[1].R).z(), 0.004, 1e-12);
  EXPECT_EQ(asked->priors[2].t.x(), 0);  // its loss is that of the best: no gain, the best stays

  settings.inversion.jitter_rotation_rad = settings.inversion.jitter_translation = 0;
  EXPECT_EQ(recorded(settings, Prior(), table)->priors[1].t.x(), 0);  // the best alone is near
}

// The last slice is as long as losses are gathered over.
TEST(Inversion, iNerfHasOneHypothesisAndATwist) {
  const auto asked = recorded(RefinerSettings::named("inerf"), Prior());
  std::vector<std::string> expected = {"sample 1"};
  expectSlices({116, 128, 128, 128}, 0, &expected);
  expected.insert(expected.end(), {"evaluate 16384", "sample 1", "score"});
  EXPECT_EQ(asked->calls, expected);
  EXPECT_EQ(asked->optimised[0].update, PoseUpdate::kTwist);
}

// The object of 5 model units stands for 2.5 of the paper's: one of those is 2 model units.
TEST(Inversion, lengthsAreInUnitsOfTheObject) {
  const auto asked = recorded(RefinerSettings::named("paper"), Prior());
  EXPECT_NEAR(asked->sampled.translation.x(), 0.6, 1e-12);
  EXPECT_NEAR(asked->sampled.rotation_rad.x(), 15 * kDegree, 1e-12);
  EXPECT_FALSE(asked->sampled.rotate_about_object);
  EXPECT_NEAR(asked->resampled[0].translation_jitter, 0.2, 1e-12);
  EXPECT_NEAR(asked->resampled[0].rotation_jitter_rad, 3 * kDegree, 1e-12);
  EXPECT_NEAR(asked->optimised[0].length_unit, 6.06, 1e-12);

  RefinerSettings settings = RefinerSettings::named("paper");
  settings.inversion.unit = 1;  // as in the NeRF Synthetic scenes themselves
  EXPECT_NEAR(recorded(settings, Prior())->optimised[0].length_unit, 3.03, 1e-12);
}

TEST(Inversion, aSpreadOfZeroIsThePriors) {
  RefinerSettings settings = RefinerSettings::named("paper");
  settings.inversion.spread_rotation_rad = 0;
  settings.inversion.spread_translation = 0;
  Prior prior;
  prior.rotation_rad = 0.1;
  prior.translation = 0.02;
  const auto asked = recorded(settings, prior);
  EXPECT_EQ(asked->sampled.rotation_rad.y(), 0.1);
  EXPECT_NEAR(asked->sampled.translation.y(), 0.1, 1e-12);
  EXPECT_TRUE(asked->sampled.rotate_about_object);
}

TEST(Inversion, everyRandomDrawHasItsOwnSeed) {
  const auto asked = recorded(RefinerSettings::named("paper"), Prior());
  std::set<std::uint64_t> seeds = {asked->sampled.seed, asked->optimised[0].seed};
  for (const ResamplingPlan& plan : asked->resampled) seeds.insert(plan.seed);
  EXPECT_EQ(seeds.size(), 6u);
  EXPECT_EQ(asked->optimised[0].seed, asked->optimised.back().seed);  // steps tell them apart
}

TEST(Inversion, survivorsHalveButForTheLastFew) {
  InversionSettings settings;
  settings.hypotheses = 256;
  EXPECT_EQ(settings.survivors(1), 32);
  EXPECT_EQ(settings.survivors(2), 16);
  EXPECT_EQ(settings.survivors(3), 8);
  EXPECT_EQ(settings.survivors(5), 4);
  settings.hypotheses = 3;
  EXPECT_EQ(settings.survivors(1), 3);
}

TEST(Inversion, refusesSettingsOutOfRange) {
  const auto expectRefused = [](const char* name, auto change) {
    RefinerSettings settings = RefinerSettings::named("paper");
    change(&settings.inversion);
    expectError<std::invalid_argument>([&] { settings.validate(); }, name);
  };
  expectRefused("hypotheses", [](InversionSettings* s) { s->hypotheses = 0; });
  expectRefused("unit", [](InversionSettings* s) { s->unit = -1; });
  expectRefused("keep_share", [](InversionSettings* s) { s->keep_fraction = 1.5; });
  expectRefused("score_pixels", [](InversionSettings* s) { s->score_pixels = 0; });
  expectRefused("jitter_translation", [](InversionSettings* s) { s->jitter_translation = NAN; });
  expectRefused("descent.beta2", [](InversionSettings* s) { s->descent.beta2 = 1; });
  expectRefused("descent.samples_per_step",
                [](InversionSettings* s) { s->descent.samples_per_step = (1 << 27) + 1; });
  expectRefused("descent.decay", [](InversionSettings* s) { s->descent.schedule.decay = 0; });
  expectRefused("descent.anneal_share",
                [](InversionSettings* s) { s->descent.schedule.anneal_fraction = 1.1; });
  expectRefused("descent.steps_per_update",
                [](InversionSettings* s) { s->descent.steps_per_update = 0; });
}

struct Trial {
  explicit Trial(double scale = 1, int threads = 2)
      : processor(cpuProcessor(threads)),
        backend(std::make_shared<CpuBackend>(processor)),
        scene(scale, processor),
        truth(cameraAround(scene, 0.4, 0.3, 1.3)) {
    observation = observeScene(scene, smallCamera(), truth);
    prior.T_O_C.R = expSO3(Eigen::Vector3d(0.1, -0.12, 0.08)) * truth.R;
    prior.T_O_C.t = truth.t + scale * Eigen::Vector3d(0.08, 0.06, -0.05);
  }

  Refinement run(const RefinerSettings& settings, const CancellationToken& cancellation = {}) {
    return FieldRefiner(backend, settings).refine(scene, observation, prior, cancellation);
  }
  /// Distance of the object from where it stands in the camera's frame, in diameters.
  double displacement(const Pose& pose) const {
    return (pose.inverse().t - truth.inverse().t).norm() / scene.field().metadata.diameter;
  }

  std::shared_ptr<CpuProcessor> processor;
  std::shared_ptr<Backend> backend;
  FogScene scene;
  Pose truth;
  Observation observation;
  Prior prior;
};

TEST(Inversion, findsThePose) {
  Trial trial;
  const Refinement result = trial.run(smallInversion());
  ASSERT_EQ(result.outcome, Outcome::kRefined);
  EXPECT_GT(trial.displacement(trial.prior.T_O_C), 0.1);
  EXPECT_LT(trial.displacement(result.T_O_C), 0.02);
  EXPECT_LT(rotationDistance(result.T_O_C.R, trial.truth.R), 4 * kDegree);
  EXPECT_GT(result.score, 0.8);
  EXPECT_EQ(result.hypotheses.size(), 12u);
  ASSERT_EQ(result.trace.size(), 10u);  // slices, and the choice
  for (const TraceEntry& entry : result.trace) EXPECT_EQ(entry.live, 12);
  EXPECT_LT(result.trace[8].best_loss, result.trace[0].best_loss);
  EXPECT_GT(result.work.samples, 100u * 2048u);
}

TEST(Inversion, sameSeedSameBitsWithAnyNumberOfThreads) {
  Trial one(1, 1), two(1, 2);
  const Refinement a = one.run(smallInversion());
  const Refinement b = two.run(smallInversion());
  EXPECT_EQ(a.T_O_C.R, b.T_O_C.R);
  EXPECT_EQ(a.T_O_C.t, b.T_O_C.t);
  EXPECT_EQ(a.hypotheses.back().loss, b.hypotheses.back().loss);
}

// Lengths are relative to the object: a scene scaled by a power of two gives the same numbers to
// the last bit, any other one the same trial but for rounding.
TEST(Inversion, aScaledSceneGivesTheSameTrial) {
  const Refinement whole = Trial(1).run(smallInversion());
  const Refinement sixteenth = Trial(1.0 / 16).run(smallInversion());
  EXPECT_EQ(whole.T_O_C.R, sixteenth.T_O_C.R);
  EXPECT_EQ(whole.T_O_C.t, 16 * sixteenth.T_O_C.t);
  const Refinement twentieth = Trial(0.05).run(smallInversion());
  EXPECT_LT((whole.T_O_C.t - 20 * twentieth.T_O_C.t).norm(), 0.02);
  EXPECT_LT(rotationDistance(whole.T_O_C.R, twentieth.T_O_C.R), 1 * kDegree);
}

// How far the last updates move the pose is how much it trembles.
TEST(Inversion, anAnnealedRunComesToRest) {
  const auto lastMove = [](double anneal_fraction) {
    RefinerSettings settings = smallInversion();
    InversionSettings& s = settings.inversion;
    s.hypotheses = 1;
    s.first_steps = 180;
    s.rounds = 0;
    s.descent.schedule.anneal_fraction = anneal_fraction;
    const std::vector<TraceEntry> trace = Trial().run(settings).trace;
    // The last entry is of the choice.
    const Pose &before = trace.at(trace.size() - 3).best_T_O_C,
               &end = trace.at(trace.size() - 2).best_T_O_C;
    return (end.t - before.t).norm() + rotationDistance(end.R, before.R);
  };
  EXPECT_LT(lastMove(0.5), 0.5 * lastMove(0));
}

TEST(Inversion, aPriorOutsideOfTheImageHasNoOverlap) {
  Trial trial;
  trial.prior.T_O_C.R = trial.truth.R * expSO3(Eigen::Vector3d(0, M_PI, 0));
  const Refinement result = trial.run(smallInversion());
  EXPECT_EQ(result.outcome, Outcome::kNoOverlap);
  EXPECT_EQ(result.work.samples, 0u);
}

// Priors of one image share steps and nothing else: equal ones end at equal poses, and near where
// each would alone (the budget's rays are those of all).
TEST(Inversion, severalPriorsAtOnce) {
  Trial trial;
  const Refinement alone = trial.run(smallInversion());
  Prior outside = trial.prior, other = trial.prior;
  outside.T_O_C.R = trial.truth.R * expSO3(Eigen::Vector3d(0, M_PI, 0));
  other.T_O_C.t += Eigen::Vector3d(0.03, -0.02, 0.01);
  FieldRefiner refiner(trial.backend, smallInversion());
  const CostCounters before = trial.backend->costs();
  const std::vector<Refinement> results =
      refiner.refineAll(trial.scene, trial.observation, {trial.prior, outside, other, trial.prior});
  const CostCounters spent = trial.backend->costs() - before;
  ASSERT_EQ(results.size(), 4u);
  EXPECT_EQ(results[1].outcome, Outcome::kNoOverlap);
  EXPECT_EQ(results[1].T_O_C.t, outside.T_O_C.t);
  for (const int i : {0, 2, 3}) {
    SCOPED_TRACE(i);
    ASSERT_EQ(results[i].outcome, Outcome::kRefined);
    EXPECT_LT(trial.displacement(results[i].T_O_C), 0.02);
    EXPECT_EQ(results[i].hypotheses.size(), 12u);
    EXPECT_EQ(results[i].trace.size(), 10u);
    EXPECT_NEAR(results[i].score, alone.score, 0.05);
  }
  EXPECT_EQ(results[0].T_O_C.t, results[3].T_O_C.t);
  EXPECT_EQ(results[0].T_O_C.R, results[3].T_O_C.R);
  EXPECT_NE(results[0].T_O_C.t, results[2].T_O_C.t);
  EXPECT_EQ(results[0].work.samples, spent.samples / 3);
  EXPECT_EQ(results[1].work.samples, 0u);
  EXPECT_EQ(results[1].seconds, 0);
  EXPECT_NEAR(static_cast<double>(spent.samples), 3.0 * alone.work.samples, 0.1 * spent.samples);
}

TEST(Inversion, tooManyPriorsAreRefused) {
  Trial trial;
  RefinerSettings settings = smallInversion();
  settings.inversion.descent.samples_per_step = 1 << 27;
  FieldRefiner refiner(trial.backend, settings);
  const std::vector<Prior> three(3, trial.prior);
  expectError<std::invalid_argument>(
      [&] { refiner.refineAll(trial.scene, trial.observation, three); }, "3 priors");
}

TEST(Inversion, priorsOfOneBatchAreEquallyWide) {
  Trial trial;
  Prior wider = trial.prior;
  wider.translation *= 2;
  FieldRefiner refiner(trial.backend, smallInversion());
  expectError<std::invalid_argument>(
      [&] {
        refiner.refineAll(trial.scene, trial.observation, {trial.prior, wider});
      },
      "equally wide");
}

TEST(Inversion, noSurvivorIsNoResult) {
  const auto recording = std::make_shared<Recording>();
  recording->table.clear();
  const RecordingField field(someField(), recording);
  Observation observation;
  observation.camera = smallCamera();
  observation.image = Image(64, 64, 3);
  Prior prior;
  prior.T_O_C = cameraAround(field, 0, 0);
  FieldRefiner refiner(makeCpuBackend(1), RefinerSettings::named("paper"));
  const Refinement result = refiner.refine(field, observation, prior);
  EXPECT_EQ(result.outcome, Outcome::kDiverged);
  EXPECT_EQ(result.T_O_C.t, prior.T_O_C.t);
}

TEST(Inversion, stopsOnRequest) {
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_EQ(Trial().run(smallInversion(), cancellation).outcome, Outcome::kCancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
