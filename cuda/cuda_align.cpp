// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "backend/common/alignment_rules.h"
#include "backend/common/blur_rules.h"
#include "backend/common/evaluation_order.h"
#include "backend/common/solver_rules.h"
#include "cuda_solver.h"
#include "image/filter.h"
#include "math/local_contrast.h"

// Direct alignment: evaluations of a stage are enqueued until all searches are done.

namespace nerf_pose_refiner {
namespace {

constexpr int kEvaluationsAhead = 2;  // of the device: so soon a cancellation is noticed

}  // namespace

/// One stage, ready to be enqueued: its tasks, and the steps of an evaluation (@see
/// evaluateInOrder).
class CudaSolver::Stage {
 public:
  /// Starts a search from every live hypothesis.
  Stage(const CudaSolver& solver, int level, const AlignStage& stage);

  void rankByRegions() { target_.rules.rank_by_regions = true; }

  /// Enqueues an evaluation of all searches and their next step. @param only_score takes the sums
  /// as they are, and ends the searches.
  void evaluate(bool only_score) {
    only_score_ = only_score;
    evaluateInOrder(target_.rules.kind, &needs_regions_, this);
  }

  /// Enqueues the download of who is still searching. @param active [views].
  void copyActive(int* active) const {
    NPR_CUDA_CHECK(cudaMemcpyAsync(active, searches_.active,
                                   static_cast<std::size_t>(searches_.view_count) * sizeof(int),
                                   cudaMemcpyDeviceToHost, stream_));
  }

  /// Writes what the searches found to their hypotheses.
  void finish() const {
    const bool by_contrast = target_.rules.kind == Comparison::kContrasts;
    finishSearches(searches_, hypotheses_, by_contrast, stream_);
  }

  // The steps.
  void render() { renderImages(field_.view(), render_, stream_); }
  void compareColours() { target_.observed = level_.blurred.data(); }
  void modelRegions() {
    nerf_pose_refiner::modelRegions(region_, stream_);
    target_.observed = region_.observed;
    target_.background_density = region_.background_density;
  }
  void seeBehind() { nerf_pose_refiner::seeBehind(contrast_, stream_); }
  void blur() { blurImages(blur_, stream_); }
  void fitGainBias() {
    if (!target_.fit_gain_bias) return;
    for (int pass = 0; pass < 2; ++pass) {
      fitGainBiases(target_, searches_, stream_);
    }
  }
  void takeContrasts() {
    nerf_pose_refiner::takeContrasts(contrast_, stream_);
    target_.observed = space_.observed.data();
  }
  void sum() { advanceSearches(target_, searches_, rules_, only_score_, stream_); }

 private:
  void prepareSearches(int views);
  void prepareBlur(int rays_per_side);
  void prepareContrasts();
  void prepareRegions();

  const CudaField& field_;
  const CudaLevel& level_;
  const CudaHypotheses hypotheses_;
  CudaWorkspace& space_;
  const cudaStream_t stream_;
  RenderTask render_ = {};
  BlurTask blur_ = {};
  CudaAlignmentTarget target_ = {};
  CudaSearches searches_ = {};
  AlignmentRules rules_;
  ContrastTask contrast_ = {};  ///< where contrasts are compared
  RegionTask region_ = {};      ///< where colours are, before an unknown background
  bool needs_regions_ = false;  ///< they are learned with the first evaluation
  bool only_score_ = false;
};

CudaSolver::Stage::Stage(const CudaSolver& solver, int level, const AlignStage& stage)
    : field_(solver.field_),
      level_(solver.level(level)),
      hypotheses_(solver.hypotheses_),
      space_(solver.processor_.space()),
      stream_(solver.processor_.stream()) {
  render_ = solver.processor_.renderTask(field_, level_.camera, solver.bound_, stage.rays_per_side);
  prepareSearches(solver.bound_);
  render_.active = searches_.active;
  render_.step_scale = stage.step_scale;
  render_.min_transmittance = stage.min_transmittance;
  prepareBlur(stage.rays_per_side);
  target_.camera = level_.camera;
  target_.observed = level_.blurred.data();
  target_.weight = level_.weight.data();
  target_.rules = comparisonRules(solver.background_, solver.background_colour_, stage);
  target_.fit_gain_bias = stage.fit_gain_bias;
  rules_ = alignmentRules(field_.field().metadata, level_.camera.fx, stage,
                          {solver.prior_T_O_C_, solver.sampling_});
  if (target_.rules.kind == Comparison::kContrasts) prepareContrasts();
  if (target_.rules.kind == Comparison::kRegions) prepareRegions();
  startSearches(searches_, hypotheses_, rules_, stream_);
}

void CudaSolver::Stage::prepareSearches(int views) {
  const auto n = static_cast<std::size_t>(views);
  space_.searches.reserve(n);
  space_.active.reserve(n);
  space_.partial_sums.reserve(n * static_cast<std::size_t>(alignmentChunks(level_.camera)) *
                              kAlignmentSums);
  searches_.searches = space_.searches.data();
  searches_.poses = space_.poses.data();
  searches_.active = space_.active.data();
  searches_.images = space_.images.data();
  searches_.partial_sums = space_.partial_sums.data();
  searches_.view_count = views;
}

void CudaSolver::Stage::prepareBlur(int rays_per_side) {
  const std::vector<float> kernel = gaussianKernel(renderingBlur(level_.blur_px, rays_per_side));
  space_.kernel.upload(kernel, stream_);
  space_.scratch.reserve(space_.images.capacity());
  blur_.width = level_.camera.width;
  blur_.height = level_.camera.height;
  blur_.view_count = searches_.view_count;
  blur_.active = searches_.active;
  blur_.weight = level_.weight.data();
  blur_.half_kernel = space_.kernel.data();
  blur_.radius = static_cast<int>(kernel.size()) - 1;
  blur_.images = space_.images.data();
  blur_.scratch = space_.scratch.data();
  blur_.blurred = space_.images.data();
}

void CudaSolver::Stage::prepareContrasts() {
  const int width = level_.camera.width, height = level_.camera.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  const std::vector<float> window = gaussianKernel(contrastWindow(width, height));
  space_.window.upload(window, stream_);
  space_.behind.reserve(2 * pixels * static_cast<std::size_t>(searches_.view_count));
  space_.statistics.reserve(space_.behind.capacity());
  space_.observed.reserve(2 * pixels);
  space_.inside_weight.reserve(pixels);
  contrast_.width = width;
  contrast_.height = height;
  contrast_.searches = searches_;
  contrast_.image = level_.image.data();
  contrast_.blur = blur_;
  contrast_.window = space_.window.data();
  contrast_.window_radius = static_cast<int>(window.size()) - 1;
  contrast_.images = space_.images.data();
  contrast_.behind = space_.behind.data();
  contrast_.statistics = space_.statistics.data();
  contrast_.seen = space_.inside_weight.data();
  takeObservedContrasts(contrast_, level_.blurred.data(), space_.observed.data(), stream_);
}

void CudaSolver::Stage::prepareRegions() {
  const int width = level_.camera.width, height = level_.camera.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  const std::vector<float> kernel = gaussianKernel(kColourSigma * kColourBins);
  space_.window.upload(kernel, stream_);
  space_.counts.reserve(1);
  space_.opacity.reserve(pixels);
  space_.inside_weight.reserve(pixels);
  space_.background_density.reserve(pixels);
  space_.observed.reserve(2 * pixels);
  space_.behind.reserve(2 * pixels);
  region_.width = width;
  region_.height = height;
  region_.searches = searches_;
  region_.images = space_.images.data();
  region_.image = level_.image.data();
  region_.blurred = level_.blurred.data();
  region_.weight = level_.weight.data();
  region_.blur = blur_;
  region_.colour_kernel = space_.window.data();
  region_.colour_radius = static_cast<int>(kernel.size()) - 1;
  region_.counts = space_.counts.data();
  region_.opacity = space_.opacity.data();
  region_.inside_weight = space_.inside_weight.data();
  region_.colours = space_.behind.data();
  region_.observed = space_.observed.data();
  region_.background_density = space_.background_density.data();
  needs_regions_ = true;
}

// The device is kept at most kEvaluationsAhead evaluations behind: a cancellation is noticed, and
// nothing is enqueued once all searches are done.
void CudaSolver::align(int level, const AlignStage& stage, const CancellationToken& cancellation) {
  processor_.enter();
  requireLevel(level, level_count_);
  if (bound_ == 0) return;
  Stage ready(*this, level, stage);
  CudaWorkspace& space = processor_.space();
  const auto views = static_cast<std::size_t>(bound_);
  space.pinned_active.reserve(kEvaluationsAhead * views);
  for (int evaluation = 0; evaluation <= stage.max_iterations; ++evaluation) {
    const int slot = evaluation % kEvaluationsAhead;
    int* active = space.pinned_active.data() + static_cast<std::size_t>(slot) * views;
    space.evaluated[slot].wait();
    cancellation.check();
    if (evaluation >= kEvaluationsAhead &&
        std::all_of(active, active + views, [](int a) { return a == 0; })) {
      break;
    }
    ready.evaluate(false);
    ready.copyActive(active);
    space.evaluated[slot].record(processor_.stream());
  }
  ready.finish();
}

void CudaSolver::score(int level, const AlignStage& stage, const CancellationToken& cancellation) {
  processor_.enter();
  cancellation.check();
  requireLevel(level, level_count_);
  if (bound_ == 0) return;
  Stage ready(*this, level, stage);
  ready.rankByRegions();
  ready.evaluate(true);
  ready.finish();
}

}  // namespace nerf_pose_refiner
