// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "cuda_engine.h"
#include "engine/alignment_rules.h"
#include "nerf_pose_refiner/image/filter.h"

// Direct alignment: every evaluation of a stage is enqueued, searches that are done cost nothing.

namespace nerf_pose_refiner {

/// One stage, ready to be enqueued.
struct CudaEngine::Stage {
  const CudaField* field;
  RenderTask render;
  BlurTask blur;
  CudaAlignmentTarget target;
  CudaSearches searches;
  AlignmentRules rules;
};

namespace {

CudaAlignmentTarget targetOf(const CudaObservation& observation, const CudaLevel& level,
                             const AlignStage& stage) {
  CudaAlignmentTarget target = {};
  target.camera = level.camera;
  target.observed = level.blurred.data();
  target.weight = level.weight.data();
  for (int c = 0; c < 3; ++c) target.background[c] = observation.background_colour[c];
  target.robust_scale = static_cast<float>(stage.robust_scale);
  const bool colour_only = observation.background == Background::kKnownColour;
  target.opacity_weight = colour_only ? 0.0f : static_cast<float>(stage.alpha_weight);
  target.fit_light = stage.fit_gain_bias;
  return target;
}

}  // namespace

CudaEngine::Stage CudaEngine::prepareStage(const CudaBatch& batch, const CudaField& field,
                                           const CudaObservation& observation, int level_index,
                                           const AlignStage& stage) {
  if (observation.background == Background::kUnknown) {
    throw std::runtime_error(
        "the CUDA engine cannot align before an unknown background yet: give a mask, or use the "
        "CPU engine");
  }
  const CudaLevel& level = observation.level(level_index);
  const auto n = static_cast<std::size_t>(batch.bound);
  searches_.reserve(n);
  active_.reserve(n);
  partial_sums_.reserve(n * static_cast<std::size_t>(alignmentChunks(level.camera)) *
                        kAlignmentSums);
  // A lattice of n x n rays has a variance of (1 - 1 / n^2) / 12 of a pixel along each axis.
  const double rays = stage.rays_per_side;
  const std::vector<float> kernel = gaussianKernel(
      std::sqrt(std::max(0.0, level.blur_px * level.blur_px - (1 - 1 / (rays * rays)) / 12)));
  kernel_.upload(kernel, stream_);

  Stage made = {};
  made.field = &field;
  made.render = renderTask(field, level.camera, batch.bound, stage.rays_per_side);
  made.render.active = active_.data();
  made.render.step_scale = stage.step_scale;
  made.render.min_transmittance = stage.min_transmittance;
  scratch_.reserve(pictures_.capacity());
  made.blur = {level.camera.width,
               level.camera.height,
               batch.bound,
               active_.data(),
               level.weight.data(),
               kernel_.data(),
               static_cast<int>(kernel.size()) - 1,
               pictures_.data(),
               scratch_.data(),
               pictures_.data()};
  made.target = targetOf(observation, level, stage);
  made.searches = {searches_.data(), poses_.data(), active_.data(), partial_sums_.data(),
                   batch.bound};
  made.rules = alignmentRules(field.field().metadata, level.camera.fx, stage, batch.scatter,
                              batch.prior_T_O_C);
  startSearches(made.searches, batch.view(), made.rules, stream_);
  return made;
}

void CudaEngine::evaluateTrials(const Stage& stage, bool only_score) {
  renderPictures(stage.field->view(), stage.render, stream_);
  blurPictures(stage.blur, stream_);
  if (stage.target.fit_light) {
    for (int pass = 0; pass < 2; ++pass) {
      fitLights(stage.target, stage.searches, pictures_.data(), stream_);
    }
  }
  advanceSearches(stage.target, stage.searches, pictures_.data(), stage.rules, only_score, stream_);
}

void CudaEngine::align(HypothesisBatch* batch, const LoadedField& field,
                       const LoadedObservation& observation, int level, const AlignStage& stage,
                       const StopToken& stop) {
  enter();
  CudaBatch& hypotheses = own(batch);
  if (hypotheses.bound == 0) return;
  const Stage ready = prepareStage(hypotheses, own(field), own(observation), level, stage);
  for (int evaluation = 0; evaluation <= stage.max_iterations; ++evaluation) {
    stop.check();
    evaluateTrials(ready, false);
  }
  finishSearches(ready.searches, hypotheses.view(), stream_);
}

void CudaEngine::score(HypothesisBatch* batch, const LoadedField& field,
                       const LoadedObservation& observation, int level, const AlignStage& stage,
                       const StopToken& stop) {
  enter();
  stop.check();
  CudaBatch& hypotheses = own(batch);
  if (hypotheses.bound == 0) return;
  const Stage ready = prepareStage(hypotheses, own(field), own(observation), level, stage);
  evaluateTrials(ready, true);
  finishSearches(ready.searches, hypotheses.view(), stream_);
}

}  // namespace nerf_pose_refiner
