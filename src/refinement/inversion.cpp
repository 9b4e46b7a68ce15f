// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/pose_solver.h"
#include "math/random.h"
#include "refinement/plan.h"
#include "refinement/schedule.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSearchLevel = 0;  // the whole image
constexpr int kJudgeLevel = 1;   // and above: the object's region, to judge the winners
constexpr double kJudgedObjectPx = 128;
constexpr std::size_t kMaxSamples = 1 << 28;  // per step: backends count four times as many

// Seeds of the parts of a run are derived from that of the settings; rounds add to the last one.
enum SeedOf : std::uint64_t { kPixelSeed, kSamplingSeed, kResamplingSeed };

std::uint64_t seedOf(const RefinerSettings& settings, std::uint64_t part) {
  return randomBits(settings.seed, part, 0);
}

SamplingPlan samplingPlan(const RefinementRun& run, double unit) {
  const InversionSettings& s = run.settings.inversion;
  const FieldMetadata& object = run.field.field().metadata;
  SamplingPlan plan;
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
  plan.seed = seedOf(run.settings, kSamplingSeed);
  return plan;
}

ResamplingPlan resamplingPlan(const RefinerSettings& settings, double unit, int round) {
  const InversionSettings& s = settings.inversion;
  ResamplingPlan plan;
  plan.keep = s.survivors(round);
  plan.offspring = s.hypotheses;
  plan.rotation_jitter_rad = s.jitter_rotation_rad;
  plan.translation_jitter = s.jitter_translation * unit;
  plan.seed = seedOf(settings, kResamplingSeed + round);
  return plan;
}

/// The mean of the hypotheses that are near the best and about as good, whose noise averages out.
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

/// Searches in one image, each from its own prior, with one solver for all their hypotheses.
class Inversion {
 public:
  /// @param runs one or more; their `field`, `observation`, `settings` are the same.
  /// @param judged one level for each run, @see judge.
  Inversion(std::vector<RefinementRun*> runs, const std::vector<ImageLevel>& judged)
      : runs_(std::move(runs)),
        first_(*runs_.front()),
        settings_(first_.settings.inversion),
        object_(first_.field.field().metadata),
        unit_(settings_.unitFor(object_.diameter)) {
    std::vector<ImageLevel> levels = {{first_.observation.camera, 0}};
    levels.insert(levels.end(), judged.begin(), judged.end());
    const int searches = static_cast<int>(runs_.size());
    solver_ = first_.field.makeSolver(first_.observation, levels, settings_.hypotheses * searches);
    for (RefinementRun* run : runs_) run->together = searches;
  }

  void run() {
    std::vector<Pose> priors;
    for (const RefinementRun* run : runs_) priors.push_back(run->prior.T_O_C);
    solver_->sample(priors, samplingPlan(first_, unit_));
    optimise("explore", {0, settings_.first_steps});
    for (int round = 1; round <= settings_.rounds; ++round) {
      if (settings_.hypotheses > 1) {
        solver_->resample(resamplingPlan(first_.settings, unit_, round));
      }
      optimise(
          "round " + std::to_string(round),
          {settings_.first_steps + (round - 1) * settings_.round_steps, settings_.round_steps});
    }
    evaluate();
    std::vector<SolverSnapshot> snapshots = readWithNow();
    std::vector<HypothesisTable> tables = bySearch(snapshots.back().hypotheses);
    if (settings_.hypotheses > 1) improve(&tables);
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      if (isLive(tables[i])) judge(static_cast<int>(i), &tables[i].front());
    }
    const SolverSnapshot end = readWithNow().back();
    snapshots.back().seconds = end.seconds;
    snapshots.back().costs = end.costs;
    stages_.push_back("choose");
    report(snapshots, tables);
  }

 private:
  OptimisationPlan optimisationPlan() const {
    OptimisationPlan plan = settings_.descent;
    plan.object_centre = object_.centre;
    plan.length_unit *= unit_;
    plan.samples_per_step = static_cast<int>(
        std::min<std::size_t>(kMaxSamples, runs_.size() * std::size_t(plan.samples_per_step)));
    plan.schedule.run_updates =
        (settings_.first_steps + settings_.rounds * settings_.round_steps) / plan.steps_per_update;
    plan.seed = seedOf(first_.settings, kPixelSeed);
    return plan;
  }

  /// In slices, the last of which covers the steps over which losses are averaged. The result is
  /// the same as that of all steps in one call.
  void optimise(const std::string& stage, const StepRange& steps) {
    const OptimisationPlan plan = optimisationPlan();
    for (int left = steps.count; left > 0;) {
      const int slice = left % plan.score_steps > 0 ? left % plan.score_steps : plan.score_steps;
      solver_->optimise(kSearchLevel, plan, {steps.first + steps.count - left, slice},
                        first_.cancellation);
      left -= slice;
      solver_->snapshot();
      stages_.push_back(stage);
    }
  }

  void evaluate() {
    solver_->evaluate(kSearchLevel, optimisationPlan(), settings_.score_pixels,
                      first_.cancellation);
  }

  /// All snapshots since the last wait, the last one of the present state.
  std::vector<SolverSnapshot> readWithNow() {
    solver_->snapshot();
    return solver_->read();
  }

  /// The hypotheses of every search, best first.
  std::vector<HypothesisTable> bySearch(const HypothesisTable& all) const {
    std::vector<HypothesisTable> tables(runs_.size());
    for (const Hypothesis& h : all) tables.at(h.search).push_back(h);
    return tables;
  }

  /// Moves each winner to the mean of the best hypotheses if its loss is lower there.
  void improve(std::vector<HypothesisTable>* tables) {
    std::vector<Pose> means;
    for (std::size_t i = 0; i < tables->size(); ++i) {
      const HypothesisTable& table = (*tables)[i];
      means.push_back(isLive(table) ? meanOfBest(table, settings_, unit_) : runs_[i]->prior.T_O_C);
    }
    startAt(means);
    evaluate();
    for (const Hypothesis& evaluated : solver_->readHypotheses()) {
      HypothesisTable& table = tables->at(evaluated.search);
      if (!isLive(table) || evaluated.state != HypothesisState::kLive) continue;
      if (!(evaluated.loss < table.front().loss)) continue;
      table.front().T_O_C = evaluated.T_O_C;
      table.front().loss = evaluated.loss;
    }
  }

  /// Computes the score and the normal equations of a search's winner.
  void judge(int search, Hypothesis* winner) {
    startAt({winner->T_O_C});
    solver_->score(kJudgeLevel + search,
                   judgingStage(first_.settings, first_.observation.background),
                   first_.cancellation);
    const Hypothesis judged = solver_->readHypotheses().front();
    winner->visible_fraction = judged.visible_fraction;
    winner->score = judged.score;
    winner->information = judged.information;
    winner->gradient_scatter = judged.gradient_scatter;
    winner->residual_variance = judged.residual_variance;
  }

  /// Makes one hypothesis of each pose.
  void startAt(const std::vector<Pose>& poses) {
    SamplingPlan alone;
    alone.count = 1;
    solver_->sample(poses, alone);
  }

  /// Writes traces and results. @param chosen the final hypotheses of every search.
  void report(const std::vector<SolverSnapshot>& snapshots,
              const std::vector<HypothesisTable>& chosen) {
    std::vector<std::vector<SolverSnapshot>> own(runs_.size(), snapshots);  // for each search
    for (std::size_t k = 0; k < snapshots.size(); ++k) {
      const bool last = k + 1 == snapshots.size();
      const auto tables = last ? chosen : bySearch(snapshots[k].hypotheses);
      for (std::size_t i = 0; i < runs_.size(); ++i) own[i][k].hypotheses = tables[i];
    }
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      runs_[i]->trace(stages_, own[i]);
      runs_[i]->finish(chosen[i]);
    }
  }

  const std::vector<RefinementRun*> runs_;
  const RefinementRun& first_;
  const InversionSettings& settings_;
  const FieldMetadata& object_;
  const double unit_;  ///< [model units]
  std::unique_ptr<PoseSolver> solver_;
  std::vector<std::string> stages_;  ///< stages after which snapshots were taken
};

}  // namespace

void runInversions(std::vector<RefinementRun>* runs) {
  std::vector<RefinementRun*> visible;
  std::vector<ImageLevel> judged;
  for (RefinementRun& run : *runs) {
    const Camera& camera = run.observation.camera;
    const std::optional<ObjectRegion> region =
        objectRegion(camera, run.prior, run.field.field().metadata);
    if (!region) {
      run.result->outcome = Outcome::kNoOverlap;
      run.together = 0;
      continue;
    }
    visible.push_back(&run);
    judged.push_back({levelCamera(camera, *region, kJudgedObjectPx), 1});
  }
  if (!visible.empty()) Inversion(std::move(visible), judged).run();
}

}  // namespace nerf_pose_refiner
