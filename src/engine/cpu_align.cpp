// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "cpu_engine.h"
#include "stage_evaluator.h"

// Direct alignment: Gauss-Newton with Levenberg damping on the difference of rendered and observed
// pictures, for all hypotheses of a stage in step.

namespace nerf_pose_refiner {
namespace {

constexpr double kFirstDamping = 1e-2;
constexpr double kLeastDamping = 1e-4;
constexpr double kMostDamping = 1e3;

// A hypothesis on its way through a stage.
struct Track {
  CpuHypothesis* hypothesis;
  Evaluation trial;
  Pose best;  // with its loss, its sums and light
  double loss = std::numeric_limits<double>::infinity();
  AlignmentSums sums;
  GainBias<float> light;
  double damping = kFirstDamping;
  int evaluations = 0;
  bool done = false;
};

// Depth of the object's centre before a camera [model units].
double depthOf(const AlignmentTarget& target, const Pose& T_O_C) {
  return (T_O_C.inverse() * target.centre).z();
}

// Whether a pose is further from the prior than the search may lead.
bool isBeyondLimit(const CpuBatch& batch, const Pose& T_O_C) {
  const ScatterPlan& plan = batch.scatter;
  const Pose& prior = batch.prior_T_O_C;
  if (plan.rotation_limit_rad > 0 && rotationDistance(T_O_C.R, prior.R) > plan.rotation_limit_rad) {
    return true;
  }
  const Eigen::Vector3d offset =
      T_O_C.inverse() * plan.object_centre - prior.inverse() * plan.object_centre;
  return plan.translation_limit > 0 && offset.norm() > plan.translation_limit;
}

bool isBehindCamera(const StageEvaluator& stage, const Pose& T_O_C) {
  return !(depthOf(stage.target(), T_O_C) > 0.05 * stage.diameter());
}

// What keeps a pose from being followed.
HypothesisState stateOf(const StageEvaluator& stage, const Evaluation& e) {
  if (!e.T_O_C.isFinite() || !std::isfinite(e.loss())) return HypothesisState::kNotFinite;
  const Camera& camera = stage.target().level->camera;
  const double diameter_px = stage.diameter() * camera.fx / depthOf(stage.target(), e.T_O_C);
  if (e.sums.opacity < 2e-3 * diameter_px * diameter_px) return HypothesisState::kOutOfImage;
  const auto factors = factorise6(e.sums.equations.information, kLeastDamping);
  if (!(factors.smallest_pivot > 0)) return HypothesisState::kIllConditioned;
  return HypothesisState::kLive;
}

void acceptTrial(Track* track) {
  track->best = track->trial.T_O_C;
  track->loss = track->trial.loss();
  track->sums = track->trial.sums;
  track->light = track->trial.light;
}

// Proposes the next pose to try; false if the step is too small to matter or cannot be computed.
bool propose(const StageEvaluator& stage, const AlignStage& plan, const CpuBatch& batch,
             Track* track) {
  double x[6];
  const double diameter = stage.diameter();
  const Eigen::Vector3d& c = stage.target().centre;
  while (track->damping <= kMostDamping) {
    if (!solve6(track->sums.equations, track->damping, 0.0, x)) return false;
    Eigen::Vector3d v(x[0], x[1], x[2]), w(x[3], x[4], x[5]);
    const double bound = std::min(
        {1.0, plan.max_translation * diameter / v.norm(), plan.max_rotation_rad / w.norm()});
    v *= bound;
    w *= bound;
    const double rim_px = (v.norm() + 0.5 * diameter * w.norm()) * stage.target().level->camera.fx /
                          depthOf(stage.target(), track->best);
    if (rim_px < plan.convergence_px) return false;
    const Eigen::Matrix3d turn = expSO3(w);
    track->trial.T_O_C = {turn * track->best.R, c + v + turn * (track->best.t - c)};
    track->trial.light = track->light;
    const Pose& trial = track->trial.T_O_C;
    if (!isBehindCamera(stage, trial) && !isBeyondLimit(batch, trial)) return true;
    track->damping *= 10;
  }
  return false;
}

// Takes the trial in if it is better, or damps more; then makes the next one.
void advance(const StageEvaluator& stage, const AlignStage& plan, const CpuBatch& batch,
             Track* track) {
  const bool first = track->evaluations == 0;
  ++track->evaluations;
  if (first) {
    track->hypothesis->state = stateOf(stage, track->trial);
    acceptTrial(track);
  } else if (track->trial.loss() < track->loss) {
    acceptTrial(track);
    track->damping = std::max(kLeastDamping, 0.2 * track->damping);
  } else {
    track->damping *= 8;
  }
  track->done = track->hypothesis->state != HypothesisState::kLive ||
                track->evaluations > plan.max_iterations || !propose(stage, plan, batch, track);
}

void writeResult(const Track& track, CpuHypothesis* h) {
  h->T_O_C = track.best;
  h->loss = track.loss;
  h->iterations += track.evaluations;
  const AlignmentSums& sums = track.sums;
  h->visible_fraction = sums.opacity > 0 ? sums.agreeing / sums.opacity : 0;
  h->score = sums.opacity > 0 ? sums.agreeing / (sums.opacity + sums.unexplained) : 0;
  h->residual_variance =
      sums.residual_weight > 0 ? sums.squared_residual / sums.residual_weight : 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      h->information(i, j) = h->information(j, i) = sums.equations.information[i * (i + 1) / 2 + j];
    }
  }
}

// Live hypotheses before the camera, ready for their first evaluation; the others are flagged.
std::vector<Track> tracksOf(const StageEvaluator& stage, CpuBatch* batch) {
  std::vector<Track> tracks;
  for (CpuHypothesis& h : batch->hypotheses) {
    if (h.state != HypothesisState::kLive) continue;
    if (!h.T_O_C.isFinite()) {
      h.state = HypothesisState::kNotFinite;
    } else if (isBehindCamera(stage, h.T_O_C)) {
      h.state = HypothesisState::kBehindCamera;
    } else {
      tracks.emplace_back();
      tracks.back().hypothesis = &h;
      tracks.back().trial.T_O_C = h.T_O_C;
    }
  }
  return tracks;
}

// Evaluates the trials of all tracks that are not done; false if there are none.
bool evaluateTrials(StageEvaluator* evaluator, std::vector<Track>* tracks, const StopToken& stop) {
  stop.check();
  std::vector<Evaluation*> trials;
  for (Track& track : *tracks) {
    if (!track.done) trials.push_back(&track.trial);
  }
  if (!trials.empty()) evaluator->evaluate(trials);
  return !trials.empty();
}

}  // namespace

void CpuEngine::align(HypothesisBatch* batch, const LoadedField& field,
                      const LoadedObservation& observation, int level, const AlignStage& stage,
                      const StopToken& stop) {
  CpuBatch& own = cpuBatch(batch);
  StageEvaluator evaluator(rayRenderer(field), cpuObservation(observation), level, stage, threads_,
                           stop, &work_);
  std::vector<Track> tracks = tracksOf(evaluator, &own);
  while (evaluateTrials(&evaluator, &tracks, stop)) {
    for (Track& track : tracks) {
      if (!track.done) advance(evaluator, stage, own, &track);
    }
  }
  for (const Track& track : tracks) writeResult(track, track.hypothesis);
}

void CpuEngine::score(HypothesisBatch* batch, const LoadedField& field,
                      const LoadedObservation& observation, int level, const AlignStage& stage,
                      const StopToken& stop) {
  StageEvaluator evaluator(rayRenderer(field), cpuObservation(observation), level, stage, threads_,
                           stop, &work_);
  evaluator.rankByRegions();
  std::vector<Track> tracks = tracksOf(evaluator, &cpuBatch(batch));
  evaluateTrials(&evaluator, &tracks, stop);
  for (Track& track : tracks) {
    track.hypothesis->state = stateOf(evaluator, track.trial);
    acceptTrial(&track);
    writeResult(track, track.hypothesis);
  }
}

}  // namespace nerf_pose_refiner
