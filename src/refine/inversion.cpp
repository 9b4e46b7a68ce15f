// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "nerf_pose_refiner/maths/random.h"
#include "nerf_pose_refiner/refine/plan.h"
#include "schedule.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSearchLevel = 0;  // the observed image as it is
constexpr int kJudgeLevel = 1;   // a picture of the object, to say how well the winner agrees
constexpr double kJudgedObjectPx = 128;

// Seeds of the parts of a run, all from the one of the settings; rounds add to the last.
enum SeedOf : std::uint64_t { kPixelSeed, kScatterSeed, kSelectSeed };

std::uint64_t seedOf(const RefinerSettings& settings, std::uint64_t part) {
  return randomBits(settings.seed, part, 0);
}

DescentPlan descentPlan(const RefinementRun& run, double unit) {
  DescentPlan plan = run.settings.inversion.descent;
  plan.object_centre = run.field.field().metadata.centre;
  plan.length_unit *= unit;
  plan.seed = seedOf(run.settings, kPixelSeed);
  return plan;
}

ScatterPlan scatterPlan(const RefinementRun& run, double unit) {
  const InversionSettings& s = run.settings.inversion;
  const FieldMetadata& object = run.field.field().metadata;
  ScatterPlan plan;
  plan.count = s.hypotheses;
  plan.rotation_rad.setConstant(run.prior.rotation_rad);
  plan.rotate_about_object = run.prior.rotate_about_object;
  plan.object_centre = object.centre;
  if (s.spread_rotation_rad > 0) {
    plan.rotation_rad.setConstant(s.spread_rotation_rad);
    plan.rotate_about_object = false;
  }
  plan.translation.setConstant(s.spread_translation > 0 ? s.spread_translation * unit
                                                        : run.prior.translation * object.diameter);
  plan.seed = seedOf(run.settings, kScatterSeed);
  return plan;
}

SelectPlan selectPlan(const RefinerSettings& settings, double unit, int round) {
  const InversionSettings& s = settings.inversion;
  SelectPlan plan;
  plan.keep = s.survivors(round);
  plan.offspring = s.hypotheses;
  plan.rotation_jitter_rad = s.jitter_rotation_rad;
  plan.translation_jitter = s.jitter_translation * unit;
  plan.seed = seedOf(settings, kSelectSeed + round);
  return plan;
}

// Says how well the winner agrees with the image, and how firmly the image holds it.
void judge(const RefinementRun& run, const LoadedObservation& observation, Hypothesis* winner) {
  Engine& engine = *run.engine;
  ScatterPlan alone;
  alone.count = 1;
  const auto batch = engine.batch(1);
  engine.scatter(batch.get(), winner->T_O_C, alone);
  engine.score(batch.get(), run.field, observation, kJudgeLevel,
               judgingStage(run.settings, run.observation.background), run.stop);
  const Hypothesis judged = engine.read(*batch).front();
  winner->visible_fraction = judged.visible_fraction;
  winner->score = judged.score;
  winner->information = judged.information;
  winner->gradient_scatter = judged.gradient_scatter;
  winner->residual_variance = judged.residual_variance;
}

/// The mean of the hypotheses that are near the best and about as good: each has a noise of its
/// own.
Pose meanOfBest(const HypothesisTable& table, const InversionSettings& s, double unit) {
  constexpr double kAboutAsGood = 1.1;  // of the best one's loss
  const Hypothesis& best = table.front();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), offset = Eigen::Vector3d::Zero();
  int count = 0;
  for (const Hypothesis& h : table) {
    const Eigen::Vector3d turned = logSO3(Eigen::Matrix3d(h.T_O_C.R * best.T_O_C.R.transpose()));
    const Eigen::Vector3d moved = h.T_O_C.t - best.T_O_C.t;
    const bool near =
        turned.norm() <= s.jitter_rotation_rad && moved.norm() <= s.jitter_translation * unit;
    if (h.state != HypothesisState::kLive || h.loss > kAboutAsGood * best.loss || !near) continue;
    turn += turned;
    offset += moved;
    ++count;
  }
  return {expSO3(Eigen::Vector3d(turn / count)) * best.T_O_C.R, best.T_O_C.t + offset / count};
}

/// Moves the winner to that mean if its loss is lower there.
void improve(const RefinementRun& run, const LoadedObservation& observation, double unit,
             Hypothesis* winner, const Pose& mean) {
  Engine& engine = *run.engine;
  ScatterPlan alone;
  alone.count = 1;
  const auto batch = engine.batch(1);
  engine.scatter(batch.get(), mean, alone);
  engine.measure(batch.get(), run.field, observation, kSearchLevel, descentPlan(run, unit),
                 run.settings.inversion.score_pixels, run.stop);
  const Hypothesis measured = engine.read(*batch).front();
  if (measured.state != HypothesisState::kLive || !(measured.loss < winner->loss)) return;
  winner->T_O_C = measured.T_O_C;
  winner->loss = measured.loss;
}

}  // namespace

void runInversion(RefinementRun* run) {
  const InversionSettings& s = run->settings.inversion;
  const FieldMetadata& object = run->field.field().metadata;
  const Camera& camera = run->observation.camera;
  const std::optional<ObjectRegion> region = objectRegion(camera, run->prior, object);
  if (!region) {
    run->result->outcome = Outcome::kNoOverlap;
    return;
  }
  const double unit = s.unitFor(object.diameter);

  Engine& engine = *run->engine;
  const auto observation = engine.observe(
      run->observation, {{camera, 0}, {levelCamera(camera, *region, kJudgedObjectPx), 1}});
  const auto batch = engine.batch(s.hypotheses);
  engine.scatter(batch.get(), run->prior.T_O_C, scatterPlan(*run, unit));
  // In slices, the last of them as long as losses are gathered over: they end where all steps at
  // once would.
  const auto descend = [&](const std::string& stage, int first_step, int steps) {
    const DescentPlan plan = descentPlan(*run, unit);
    for (int left = steps; left > 0;) {
      const int slice = left % plan.score_steps > 0 ? left % plan.score_steps : plan.score_steps;
      engine.descend(batch.get(), run->field, *observation, kSearchLevel, plan,
                     first_step + steps - left, slice, run->stop);
      left -= slice;
      run->trace(stage, engine.read(*batch));
    }
  };
  descend("explore", 0, s.first_steps);
  for (int round = 1; round <= s.rounds; ++round) {
    if (s.hypotheses > 1) engine.select(batch.get(), selectPlan(run->settings, unit, round));
    descend("round " + std::to_string(round), s.first_steps + (round - 1) * s.round_steps,
            s.round_steps);
  }
  engine.measure(batch.get(), run->field, *observation, kSearchLevel, descentPlan(*run, unit),
                 s.score_pixels, run->stop);
  HypothesisTable table = engine.read(*batch);
  if (!table.empty() && table.front().state == HypothesisState::kLive) {
    if (s.hypotheses > 1) {
      improve(*run, *observation, unit, &table.front(), meanOfBest(table, s, unit));
    }
    judge(*run, *observation, &table.front());
  }
  run->trace("choose", table);
  run->finish(table);
}

}  // namespace nerf_pose_refiner
