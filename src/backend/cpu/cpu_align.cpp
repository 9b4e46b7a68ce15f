// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <memory>

#include "backend/common/alignment_rules.h"
#include "backend/common/solver_rules.h"
#include "backend/cpu/cpu_solver.h"
#include "backend/cpu/stage_evaluator.h"

// Direct alignment: Gauss-Newton with Levenberg damping on the difference of rendered and observed
// images, for all hypotheses of a stage in step. The steps themselves are in
// math/alignment_search.h.

namespace nerf_pose_refiner {
namespace {

// A hypothesis on its way through a stage.
struct Track {
  CpuHypothesis* hypothesis;
  Evaluation trial;
  AlignmentSearch search;
};

AlignmentRules rulesOf(const StageEvaluator& evaluator, const AlignStage& stage,
                       const CpuHypotheses& hypotheses) {
  return alignmentRules(evaluator.object(), evaluator.target().level->camera.fx, stage,
                        {hypotheses.prior_T_O_C, hypotheses.sampling});
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
  h->information = symmetricMatrix(sums.equations.information);
  h->gradient_scatter = search.scatter.correction() * symmetricMatrix(search.scatter.gradients);
}

// Live hypotheses before the camera, ready for their first evaluation; the others are flagged.
std::vector<Track> tracksOf(const AlignmentRules& rules, CpuHypotheses* hypotheses) {
  std::vector<Track> tracks;
  for (CpuHypothesis* h : hypotheses->live()) {
    const AlignmentSearch search = startSearch(rules, plainPose(h->T_O_C));
    h->state = search.state;
    if (search.done) continue;
    tracks.emplace_back();
    tracks.back().hypothesis = h;
    tracks.back().trial.T_O_C = h->T_O_C;
    tracks.back().search = search;
  }
  return tracks;
}

// Evaluates the trials of all tracks that are not done; false if there are none.
bool evaluateTrials(StageEvaluator* evaluator, std::vector<Track>* tracks,
                    const CancellationToken& cancellation) {
  cancellation.check();
  std::vector<Evaluation*> trials;
  for (Track& track : *tracks) {
    if (!track.search.done) trials.push_back(&track.trial);
  }
  if (!trials.empty()) evaluator->evaluate(trials);
  return !trials.empty();
}

}  // namespace

void CpuSolver::align(int level, const AlignStage& stage, const CancellationToken& cancellation) {
  StageEvaluator evaluator(scene_, observation_, {level, stage, cancellation});
  const AlignmentRules rules = rulesOf(evaluator, stage, hypotheses_);
  std::vector<Track> tracks = tracksOf(rules, &hypotheses_);
  while (evaluateTrials(&evaluator, &tracks, cancellation)) {
    for (Track& track : tracks) {
      if (!track.search.done) advance(rules, &track);
    }
  }
  for (const Track& track : tracks) writeResult(track, stage.compare_contrast, track.hypothesis);
}

void CpuSolver::score(int level, const AlignStage& stage, const CancellationToken& cancellation) {
  StageEvaluator evaluator(scene_, observation_, {level, stage, cancellation});
  evaluator.rankByRegions();
  const AlignmentRules rules = rulesOf(evaluator, stage, hypotheses_);
  std::vector<Track> tracks = tracksOf(rules, &hypotheses_);
  evaluateTrials(&evaluator, &tracks, cancellation);
  for (Track& track : tracks) {
    takeTrial(&track);
    scoreSearch(rules, track.trial.sums, &track.search);
    writeResult(track, stage.compare_contrast, track.hypothesis);
  }
}

}  // namespace nerf_pose_refiner
