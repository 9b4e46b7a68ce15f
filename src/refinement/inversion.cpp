// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "math/random.h"
#include "refinement/plan.h"
#include "refinement/schedule.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSearchLevel = 0;  // the observed image as it is
constexpr int kJudgeLevel = 1;   // on: images of the object, to say how well winners agree
constexpr double kJudgedObjectPx = 128;

// Seeds of the parts of a run, all from the one of the settings; rounds add to the last.
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

/// Searches of one image, a prior each, in one batch: steps are of all their hypotheses.
class Inversion {
 public:
  /// @param runs one or more; their `field`, `observation`, `settings` are the same.
  /// @param judged a level for each of them, @see judge.
  Inversion(std::vector<RefinementRun*> runs, const std::vector<ImageLevel>& judged)
      : runs_(std::move(runs)),
        first_(*runs_.front()),
        backend_(*first_.backend),
        settings_(first_.settings.inversion),
        object_(first_.field.field().metadata),
        unit_(settings_.unitFor(object_.diameter)) {
    std::vector<ImageLevel> levels = {{first_.observation.camera, 0}};
    levels.insert(levels.end(), judged.begin(), judged.end());
    observation_ = backend_.observe(first_.observation, levels);
    for (RefinementRun* run : runs_) run->together = static_cast<int>(runs_.size());
  }

  void run() {
    const auto batch = backend_.batch(settings_.hypotheses * static_cast<int>(runs_.size()));
    std::vector<Pose> priors;
    for (const RefinementRun* run : runs_) priors.push_back(run->prior.T_O_C);
    backend_.sample(batch.get(), priors, samplingPlan(first_, unit_));
    optimise(batch.get(), "explore", 0, settings_.first_steps);
    for (int round = 1; round <= settings_.rounds; ++round) {
      if (settings_.hypotheses > 1) {
        backend_.resample(batch.get(), resamplingPlan(first_.settings, unit_, round));
      }
      optimise(batch.get(), "round " + std::to_string(round),
               settings_.first_steps + (round - 1) * settings_.round_steps, settings_.round_steps);
    }
    evaluate(batch.get());
    std::vector<HypothesisTable> tables = read(*batch);
    if (settings_.hypotheses > 1) improve(&tables);
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      if (hasWinner(tables[i])) judge(static_cast<int>(i), &tables[i].front());
    }
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      runs_[i]->trace("choose", tables[i]);
      runs_[i]->finish(tables[i]);
    }
  }

 private:
  static bool hasWinner(const HypothesisTable& table) {
    return !table.empty() && table.front().state == HypothesisState::kLive;
  }

  OptimisationPlan optimisationPlan() const {
    OptimisationPlan plan = settings_.descent;
    plan.object_centre = object_.centre;
    plan.length_unit *= unit_;
    plan.samples_per_step *= static_cast<int>(runs_.size());
    plan.schedule.run_updates =
        (settings_.first_steps + settings_.rounds * settings_.round_steps) / plan.steps_per_update;
    plan.seed = seedOf(first_.settings, kPixelSeed);
    return plan;
  }

  /// In slices, the last of them as long as losses are gathered over: they end where all steps at
  /// once would.
  void optimise(HypothesisBatch* batch, const std::string& stage, int first_step, int steps) {
    const OptimisationPlan plan = optimisationPlan();
    for (int left = steps; left > 0;) {
      const int slice = left % plan.score_steps > 0 ? left % plan.score_steps : plan.score_steps;
      backend_.optimise(batch, first_.field, *observation_, kSearchLevel, plan,
                        first_step + steps - left, slice, first_.stop);
      left -= slice;
      const std::vector<HypothesisTable> tables = read(*batch);
      for (std::size_t i = 0; i < runs_.size(); ++i) runs_[i]->trace(stage, tables[i]);
    }
  }

  void evaluate(HypothesisBatch* batch) {
    backend_.evaluate(batch, first_.field, *observation_, kSearchLevel, optimisationPlan(),
                      settings_.score_pixels, first_.stop);
  }

  /// The hypotheses of every search, best first.
  std::vector<HypothesisTable> read(const HypothesisBatch& batch) {
    std::vector<HypothesisTable> tables(runs_.size());
    for (const Hypothesis& h : backend_.read(batch)) tables.at(h.search).push_back(h);
    return tables;
  }

  /// Moves winners to the mean of the best where their loss is lower there.
  void improve(std::vector<HypothesisTable>* tables) {
    std::vector<Pose> means;
    for (std::size_t i = 0; i < tables->size(); ++i) {
      const HypothesisTable& table = (*tables)[i];
      means.push_back(hasWinner(table) ? meanOfBest(table, settings_, unit_)
                                       : runs_[i]->prior.T_O_C);
    }
    const auto batch = batchAt(means);
    evaluate(batch.get());
    for (const Hypothesis& measured : backend_.read(*batch)) {
      HypothesisTable& table = tables->at(measured.search);
      if (!hasWinner(table) || measured.state != HypothesisState::kLive) continue;
      if (!(measured.loss < table.front().loss)) continue;
      table.front().T_O_C = measured.T_O_C;
      table.front().loss = measured.loss;
    }
  }

  /// Says how well a search's winner agrees with the image, and how firmly the image holds it.
  void judge(int search, Hypothesis* winner) {
    const auto batch = batchAt({winner->T_O_C});
    backend_.score(batch.get(), first_.field, *observation_, kJudgeLevel + search,
                   judgingStage(first_.settings, first_.observation.background), first_.stop);
    const Hypothesis judged = backend_.read(*batch).front();
    winner->visible_fraction = judged.visible_fraction;
    winner->score = judged.score;
    winner->information = judged.information;
    winner->gradient_scatter = judged.gradient_scatter;
    winner->residual_variance = judged.residual_variance;
  }

  /// One hypothesis at each pose.
  std::unique_ptr<HypothesisBatch> batchAt(const std::vector<Pose>& poses) {
    SamplingPlan alone;
    alone.count = 1;
    auto batch = backend_.batch(static_cast<int>(poses.size()));
    backend_.sample(batch.get(), poses, alone);
    return batch;
  }

  const std::vector<RefinementRun*> runs_;
  const RefinementRun& first_;
  Backend& backend_;
  const InversionSettings& settings_;
  const FieldMetadata& object_;
  const double unit_;  ///< [model units]
  std::shared_ptr<const LoadedObservation> observation_;
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
