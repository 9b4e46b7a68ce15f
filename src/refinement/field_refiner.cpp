// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/field_refiner.h"

#include <chrono>
#include <cmath>
#include <stdexcept>

#include "refinement/plan.h"
#include "refinement/pose_probability.h"
#include "refinement/schedule.h"

namespace nerf_pose_refiner {
namespace {

double secondsBetween(std::chrono::steady_clock::time_point from,
                      std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

constexpr double kMaxSamplesPerStep = 1 << 28;  // of a batch

int countLive(const HypothesisTable& table) {
  int live = 0;
  for (const Hypothesis& h : table) live += h.state == HypothesisState::kLive ? 1 : 0;
  return live;
}

}  // namespace

void RefinementRun::trace(const std::vector<std::string>& names,
                          const std::vector<SolverSnapshot>& snapshots) {
  SolverSnapshot before;
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    const SolverSnapshot& now = snapshots[i];
    TraceEntry entry;
    entry.stage = names.at(i);
    entry.seconds = (now.seconds - before.seconds) / together;
    entry.work = (now.costs - before.costs) / together;
    entry.live = countLive(now.hypotheses);
    if (entry.live > 0) {
      entry.best_loss = now.hypotheses.front().loss;
      entry.best_T_O_C = now.hypotheses.front().T_O_C;
    }
    result->trace.push_back(entry);
    before = now;
  }
}

void RefinementRun::finish(const HypothesisTable& table) {
  result->hypotheses = table;
  if (countLive(table) == 0) {
    result->outcome = Outcome::kDiverged;
    return;
  }
  const FieldMetadata& object = field.field().metadata;
  result->hypotheses = nearestEquivalents(table, prior, object);
  const Hypothesis& best = result->hypotheses.front();
  result->outcome = Outcome::kRefined;
  result->T_O_C = {nearestRotation(best.T_O_C.R), best.T_O_C.t};
  result->visible_fraction = best.visible_fraction;
  const bool by_contrast = judgingStage(settings, observation.background).compare_contrast;
  result->score = fieldScoreProbability(by_contrast ? calibratedScore(best.score, object.pose)
                                                    : scoreOfFraction(best.score));
  result->covariance = poseCovariance(result->hypotheses, prior, object);
}

FieldRefiner::FieldRefiner(std::shared_ptr<Backend> backend, const RefinerSettings& settings)
    : backend_(std::move(backend)), settings_(settings) {
  if (!backend_) throw std::invalid_argument("Refiner: the backend is null");
  settings_.validate();
}

Refinement FieldRefiner::refine(const LoadedField& field, const Observation& observation,
                                const Prior& prior, const CancellationToken& cancellation) {
  return refineAll(field, observation, {prior}, cancellation).front();
}

std::vector<Refinement> FieldRefiner::refineAll(const LoadedField& field,
                                                const Observation& observation,
                                                const std::vector<Prior>& priors,
                                                const CancellationToken& cancellation) {
  if (!(field.field().metadata.diameter > 0)) {
    throw std::invalid_argument("Refiner: the diameter of the object '" +
                                field.field().metadata.name + "' is not known");
  }
  if (observation.isDepthAlone()) {
    throw std::invalid_argument("Refiner: this method compares colours, and there are none");
  }
  const bool together = settings_.method == Method::kInversion;
  const double samples = static_cast<double>(settings_.inversion.descent.samples_per_step);
  if (together && samples * static_cast<double>(priors.size()) > kMaxSamplesPerStep) {
    throw std::invalid_argument("Refiner: " + std::to_string(priors.size()) +
                                " priors at once are too many");
  }
  for (const Prior& prior : priors) {
    prior.validate();
    if (together && !prior.isAsWideAs(priors.front())) {
      throw std::invalid_argument("Refiner: priors of one batch must be equally wide");
    }
  }
  std::vector<Refinement> results(priors.size());
  std::vector<RefinementRun> runs;
  for (std::size_t i = 0; i < priors.size(); ++i) {
    results[i].T_O_C = priors[i].T_O_C;
    runs.push_back({field, observation, priors[i], settings_, cancellation, &results[i]});
    if (together && i + 1 < priors.size()) continue;
    carryOut(&runs);
    runs.clear();
  }
  return results;
}

void FieldRefiner::carryOut(std::vector<RefinementRun>* runs) {
  const auto start = std::chrono::steady_clock::now();
  const CostCounters work_before = backend_->costs();
  try {
    if (settings_.method == Method::kInversion) {
      runInversions(runs);
    } else {
      for (RefinementRun& run : *runs) runAlignment(&run);
    }
  } catch (const Cancelled&) {
    for (RefinementRun& run : *runs) run.result->outcome = Outcome::kCancelled;
  }
  const CostCounters work = backend_->costs() - work_before;
  const double seconds = secondsBetween(start, std::chrono::steady_clock::now());
  for (RefinementRun& run : *runs) {
    if (run.together == 0) continue;
    run.result->work = work / run.together;
    run.result->seconds = seconds / run.together;
  }
}

}  // namespace nerf_pose_refiner
