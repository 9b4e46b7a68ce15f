// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>

#include "backend/common/alignment_rules.h"
#include "backend/cpu/cpu_backend.h"
#include "backend/cpu/stage_evaluator.h"

// Direct alignment: Gauss-Newton with Levenberg damping on the difference of rendered and observed
// images, for all hypotheses of a stage in step. The steps themselves are in
// maths/alignment_search.h.

namespace nerf_pose_refiner {
namespace {

// A hypothesis on its way through a stage.
struct Track {
  CpuHypothesis* hypothesis;
  Evaluation trial;
  AlignmentSearch search;
};

AlignmentRules rulesOf(const StageEvaluator& evaluator, const AlignStage& stage,
                       const CpuBatch& batch) {
  return alignmentRules(evaluator.object(), evaluator.target().level->camera.fx, stage,
                        batch.sampling, batch.prior_T_O_C);
}

// Hands over what the evaluation found beside the sums.
void takeTrial(Track* track) {
  track->search.trial_gain_bias = track->trial.gain_bias;
  track->search.trial_scatter = track->trial.sums.scatter;
}

// Takes what the evaluation found into the search, which says what to try next.
void advance(const AlignmentRules& rules, Track* track) {
  takeTrial(track);
  advanceSearch(rules, track->trial.sums, &track->search);
  track->trial.T_O_C = poseOf(track->search.trial);
  track->trial.gain_bias = track->search.trial_gain_bias;
}

Eigen::Matrix<double, 6, 6> symmetric(const double lower[21]) {
  Eigen::Matrix<double, 6, 6> whole;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) whole(i, j) = whole(j, i) = lower[i * (i + 1) / 2 + j];
  }
  return whole;
}

void writeResult(const Track& track, bool by_contrast, CpuHypothesis* h) {
  const AlignmentSearch& search = track.search;
  const AlignmentSumsOf<double>& sums = search.sums;
  h->state = search.state;
  h->T_O_C = poseOf(search.best);
  h->loss = search.loss;
  h->iterations += search.evaluations;
  h->visible_fraction = visibleFractionOf(sums);
  h->score = scoreOf(sums, by_contrast);
  h->residual_variance =
      sums.residual_weight > 0 ? sums.squared_residual / sums.residual_weight : 0;
  h->information = symmetric(sums.equations.information);
  h->gradient_scatter = search.scatter.correction() * symmetric(search.scatter.gradients);
}

// Live hypotheses before the camera, ready for their first evaluation; the others are flagged.
std::vector<Track> tracksOf(const AlignmentRules& rules, CpuBatch* batch) {
  std::vector<Track> tracks;
  for (CpuHypothesis& h : batch->hypotheses) {
    if (h.state != HypothesisState::kLive) continue;
    const AlignmentSearch search = startSearch(rules, plainPose(h.T_O_C));
    h.state = search.state;
    if (search.done) continue;
    tracks.emplace_back();
    tracks.back().hypothesis = &h;
    tracks.back().trial.T_O_C = h.T_O_C;
    tracks.back().search = search;
  }
  return tracks;
}

// Evaluates the trials of all tracks that are not done; false if there are none.
bool evaluateTrials(StageEvaluator* evaluator, std::vector<Track>* tracks,
                    const CancellationToken& stop) {
  stop.check();
  std::vector<Evaluation*> trials;
  for (Track& track : *tracks) {
    if (!track.search.done) trials.push_back(&track.trial);
  }
  if (!trials.empty()) evaluator->evaluate(trials);
  return !trials.empty();
}

}  // namespace

void CpuBackend::align(HypothesisBatch* batch, const LoadedField& field,
                       const LoadedObservation& observation, int level, const AlignStage& stage,
                       const CancellationToken& stop) {
  CpuBatch& own = cpuBatch(batch);
  StageEvaluator evaluator(rayRenderer(field), cpuObservation(observation), level, stage, threads_,
                           stop, &work_);
  const AlignmentRules rules = rulesOf(evaluator, stage, own);
  std::vector<Track> tracks = tracksOf(rules, &own);
  while (evaluateTrials(&evaluator, &tracks, stop)) {
    for (Track& track : tracks) {
      if (!track.search.done) advance(rules, &track);
    }
  }
  for (const Track& track : tracks) writeResult(track, stage.compare_contrast, track.hypothesis);
}

void CpuBackend::score(HypothesisBatch* batch, const LoadedField& field,
                       const LoadedObservation& observation, int level, const AlignStage& stage,
                       const CancellationToken& stop) {
  CpuBatch& own = cpuBatch(batch);
  StageEvaluator evaluator(rayRenderer(field), cpuObservation(observation), level, stage, threads_,
                           stop, &work_);
  evaluator.rankByRegions();
  const AlignmentRules rules = rulesOf(evaluator, stage, own);
  std::vector<Track> tracks = tracksOf(rules, &own);
  evaluateTrials(&evaluator, &tracks, stop);
  for (Track& track : tracks) {
    takeTrial(&track);
    scoreSearch(rules, track.trial.sums, &track.search);
    writeResult(track, stage.compare_contrast, track.hypothesis);
  }
}

}  // namespace nerf_pose_refiner
