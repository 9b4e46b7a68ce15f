// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "backend/common/alignment_rules.h"
#include "cuda_backend.h"
#include "image/filter.h"
#include "math/local_contrast.h"

// Direct alignment: evaluations of a stage are enqueued until all searches are done.

namespace nerf_pose_refiner {

/// One stage, ready to be enqueued.
struct CudaBackend::Stage {
  const CudaField* field;
  RenderTask render;
  BlurTask blur;
  CudaAlignmentTarget target;
  CudaSearches searches;
  AlignmentRules rules;
  ContrastTask contrast;  ///< where contrasts are compared
  RegionTask region;      ///< where colours are, before an unknown background
  bool needs_regions;     ///< they are learned with the first evaluation
  const float4* blurred;  ///< observation, as it is
};

namespace {

constexpr int kEvaluationsAhead = 2;  // of the device: so soon a stop is heard

}  // namespace

CudaBackend::Stage CudaBackend::prepareStage(const CudaBatch& batch, const CudaField& field,
                                             const CudaObservation& observation, int level_index,
                                             const AlignStage& stage) {
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
  scratch_.reserve(images_.capacity());
  made.blur = {level.camera.width,
               level.camera.height,
               batch.bound,
               active_.data(),
               level.weight.data(),
               kernel_.data(),
               static_cast<int>(kernel.size()) - 1,
               images_.data(),
               scratch_.data(),
               images_.data()};
  made.target = {level.camera,
                 level.blurred.data(),
                 level.weight.data(),
                 nullptr,
                 comparisonRules(observation.background, observation.background_colour, stage),
                 stage.fit_gain_bias};
  made.blurred = level.blurred.data();
  made.searches = {searches_.data(), poses_.data(), active_.data(), partial_sums_.data(),
                   batch.bound};
  made.rules = alignmentRules(field.field().metadata, level.camera.fx, stage, batch.sampling,
                              batch.prior_T_O_C);
  if (made.target.rules.kind == Comparison::kContrasts) prepareContrasts(level, &made);
  if (made.target.rules.kind == Comparison::kRegions) prepareRegions(level, &made);
  startSearches(made.searches, batch.view(), made.rules, stream_);
  return made;
}

void CudaBackend::prepareContrasts(const CudaLevel& level, Stage* stage) {
  const int width = level.camera.width, height = level.camera.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  const std::vector<float> window = gaussianKernel(contrastWindow(width, height));
  window_.upload(window, stream_);
  behind_.reserve(2 * pixels * static_cast<std::size_t>(stage->searches.view_count));
  statistics_.reserve(behind_.capacity());
  observed_.reserve(2 * pixels);
  inside_weight_.reserve(pixels);
  stage->contrast = {width,
                     height,
                     stage->searches,
                     level.image.data(),
                     stage->blur,
                     window_.data(),
                     static_cast<int>(window.size()) - 1,
                     images_.data(),
                     behind_.data(),
                     statistics_.data(),
                     inside_weight_.data()};
  takeObservedContrasts(stage->contrast, level.blurred.data(), observed_.data(), stream_);
}

void CudaBackend::prepareRegions(const CudaLevel& level, Stage* stage) {
  const int width = level.camera.width, height = level.camera.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  const std::vector<float> kernel = gaussianKernel(kColourSigma * kColourBins);
  window_.upload(kernel, stream_);
  counts_.reserve(1);
  opacity_.reserve(pixels);
  inside_weight_.reserve(pixels);
  background_density_.reserve(pixels);
  observed_.reserve(2 * pixels);
  behind_.reserve(2 * pixels);
  stage->region = {width,
                   height,
                   stage->searches,
                   images_.data(),
                   level.image.data(),
                   level.blurred.data(),
                   level.weight.data(),
                   stage->blur,
                   window_.data(),
                   static_cast<int>(kernel.size()) - 1,
                   counts_.data(),
                   opacity_.data(),
                   inside_weight_.data(),
                   behind_.data(),
                   observed_.data(),
                   background_density_.data()};
  stage->needs_regions = true;
}

void CudaBackend::fitGainBias(const Stage& stage) {
  if (!stage.target.fit_gain_bias) return;
  for (int pass = 0; pass < 2; ++pass) {
    fitGainBiases(stage.target, stage.searches, images_.data(), stream_);
  }
}

void CudaBackend::evaluateTrials(Stage* stage, bool only_score) {
  const bool contrasts = stage->target.rules.kind == Comparison::kContrasts;
  renderImages(stage->field->view(), stage->render, stream_);
  if (contrasts) stage->target.observed = stage->blurred;
  if (stage->needs_regions) {
    fitGainBias(*stage);
    modelRegions(stage->region, stream_);
    stage->target.observed = stage->region.observed;
    stage->target.background_density = stage->region.background_density;
    stage->needs_regions = false;
  }
  if (contrasts) seeBehind(stage->contrast, stream_);
  blurImages(stage->blur, stream_);
  fitGainBias(*stage);
  if (contrasts) {
    takeContrasts(stage->contrast, stream_);
    stage->target.observed = observed_.data();
  }
  advanceSearches(stage->target, stage->searches, images_.data(), stage->rules, only_score,
                  stream_);
}

// The device is kept at most kEvaluationsAhead evaluations behind: a stop is heard, and nothing is
// enqueued once all searches are done.
void CudaBackend::align(HypothesisBatch* batch, const LoadedField& field,
                        const LoadedObservation& observation, int level, const AlignStage& stage,
                        const CancellationToken& stop) {
  enter();
  CudaBatch& hypotheses = own(batch);
  if (hypotheses.bound == 0) return;
  Stage ready = prepareStage(hypotheses, own(field), own(observation), level, stage);
  const auto views = static_cast<std::size_t>(ready.searches.view_count);
  pinned_active_.reserve(kEvaluationsAhead * views);
  for (int evaluation = 0; evaluation <= stage.max_iterations; ++evaluation) {
    stop.check();
    const int slot = evaluation % kEvaluationsAhead;
    int* active = pinned_active_.data() + static_cast<std::size_t>(slot) * views;
    if (evaluation >= kEvaluationsAhead) {
      evaluated_[slot].wait();
      if (std::all_of(active, active + views, [](int a) { return a == 0; })) break;
    }
    evaluateTrials(&ready, false);
    NPR_CUDA_CHECK(cudaMemcpyAsync(active, ready.searches.active, views * sizeof(int),
                                   cudaMemcpyDeviceToHost, stream_));
    evaluated_[slot].record(stream_);
  }
  finishSearches(ready.searches, hypotheses.view(), stage.compare_contrast, stream_);
}

void CudaBackend::score(HypothesisBatch* batch, const LoadedField& field,
                        const LoadedObservation& observation, int level, const AlignStage& stage,
                        const CancellationToken& stop) {
  enter();
  stop.check();
  CudaBatch& hypotheses = own(batch);
  if (hypotheses.bound == 0) return;
  Stage ready = prepareStage(hypotheses, own(field), own(observation), level, stage);
  ready.target.rules.rank_by_regions = true;
  evaluateTrials(&ready, true);
  finishSearches(ready.searches, hypotheses.view(), stage.compare_contrast, stream_);
}

}  // namespace nerf_pose_refiner
