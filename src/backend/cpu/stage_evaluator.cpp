// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/stage_evaluator.h"

#include <algorithm>

#include "backend/common/alignment_rules.h"
#include "backend/common/blur_rules.h"
#include "backend/common/evaluation_order.h"
#include "backend/cpu/local_contrast.h"
#include "backend/cpu/rendered_image.h"
#include "backend/loaded_field.h"
#include "concurrency/parallel.h"
#include "image/filter.h"
#include "math/local_contrast.h"

// Sums are taken over chunks of rows whose size is fixed, chunk after chunk, so that they are the
// same for any number of threads.

namespace nerf_pose_refiner {
namespace {

constexpr int kRowsPerChunk = kTileSide;

}  // namespace

StageEvaluator::StageEvaluator(const RayRenderer& scene, const CpuObservation& observation,
                               const StageRequest& request)
    : scene_(scene), request_(request) {
  const AlignStage& stage = request.align;
  target_.level = &observation.level(request.level);
  target_.observed = &target_.level->blurred;
  target_.centre = scene.field().metadata.centre;
  target_.rules = comparisonRules(observation.background, observation.background_colour, stage);
  target_.fit_gain_bias = stage.fit_gain_bias;
  needs_regions_ = target_.rules.kind == Comparison::kRegions;
  image_kernel_ = gaussianKernel(renderingBlur(target_.level->blur_px, stage.rays_per_side));
  if (stage.compare_contrast) {
    const Camera& camera = target_.level->camera;
    contrast_window_ = gaussianKernel(contrastWindow(camera.width, camera.height));
    observed_contrast_ = target_.level->blurred;
    takeContrast(contrast_window_, &observed_contrast_);
  }
}

/// The steps of an evaluation of some poses, on all threads.
class StageEvaluator::Steps {
 public:
  Steps(StageEvaluator* stage, const std::vector<Evaluation*>& evaluations)
      : stage_(*stage),
        target_(stage->target_),
        evaluations_(evaluations),
        count_(static_cast<int>(evaluations.size())) {}

  void render() {
    std::vector<ImageRequest> requests;
    const AlignStage& align = stage_.request_.align;
    for (Evaluation* e : evaluations_) {
      requests.push_back({target_.level->camera, e->T_O_C, align.rays_per_side, &e->image});
    }
    RenderOptions options;
    options.step_scale = align.step_scale;
    options.min_transmittance = align.min_transmittance;
    renderImages(stage_.scene_, requests, options, stage_.request_.cancellation);
    const std::vector<float>& weight = target_.level->weight.values;
    for (Evaluation* e : evaluations_) {
      for (std::size_t i = 0; i < weight.size(); ++i) {
        e->image.values[kImageChannels * i + kWeight] = weight[i];
      }
    }
  }

  void compareColours() { target_.observed = &target_.level->blurred; }

  void modelRegions() {
    std::vector<const Image*> images;
    std::vector<GainBias<float>> gain_biases;
    for (Evaluation* e : evaluations_) {
      images.push_back(&e->image);
      gain_biases.push_back(e->gain_bias);
    }
    stage_.regions_ =
        nerf_pose_refiner::modelRegions(*target_.level, images, gain_biases, stage_.image_kernel_);
    target_.regions = &stage_.regions_;
    target_.observed = &stage_.regions_.observed;
  }

  void seeBehind() {
    parallelFor(threads(), count_, [&](int i) {
      Evaluation& e = *evaluations_[i];
      e.behind = seenBehind(target_.level->image, e.image);
      blurImage(stage_.image_kernel_, &e.behind, &e.scratch);
    });
  }

  void blur() {
    parallelFor(threads(), count_, [&](int i) {
      Evaluation& e = *evaluations_[i];
      blurImage(stage_.image_kernel_, &e.image, &e.scratch);
    });
  }

  void fitGainBias() {
    if (!target_.fit_gain_bias) return;
    for (int pass = 0; pass < 2; ++pass) {
      const auto moments = sumChunks<GainBiasMoments>([&](const Evaluation& e, RowRange rows) {
        return sumGainBias(target_, e.image, e.gain_bias, rows);
      });
      for (int i = 0; i < count_; ++i) evaluations_[i]->gain_bias = solveGainBias(moments[i]);
    }
  }

  // From here on the images hold contrasts, which do not depend on gain and bias.
  void takeContrasts() {
    parallelFor(threads(), count_, [&](int i) {
      Evaluation& e = *evaluations_[i];
      takeContrastBefore(e.behind, e.gain_bias, stage_.contrast_window_, &e.image);
    });
    target_.observed = &stage_.observed_contrast_;
  }

  void sum() {
    const bool contrasts = target_.rules.kind == Comparison::kContrasts;
    const auto sums = sumChunks<AlignmentSums>([&](const Evaluation& e, RowRange rows) {
      const GainBias<float> gain_bias = contrasts ? GainBias<float>() : e.gain_bias;
      return sumAlignment(target_, e.image, e.T_O_C, gain_bias, rows);
    });
    for (int i = 0; i < count_; ++i) evaluations_[i]->sums = sums[i];
  }

 private:
  int threads() const { return stage_.scene_.processor().threads; }

  template <typename Sums, typename SumRows>
  std::vector<Sums> sumChunks(const SumRows& sum_rows) const {
    const int height = target_.level->camera.height;
    const int chunks = (height + kRowsPerChunk - 1) / kRowsPerChunk;
    std::vector<Sums> parts(static_cast<std::size_t>(count_) * chunks);
    parallelFor(threads(), count_ * chunks, [&](int i) {
      const int first = i % chunks * kRowsPerChunk;
      parts[i] = sum_rows(*evaluations_[i / chunks],
                          RowRange{first, std::min(height, first + kRowsPerChunk)});
    });
    std::vector<Sums> sums(count_);
    for (int i = 0; i < count_ * chunks; ++i) sums[i / chunks].add(parts[i]);
    return sums;
  }

  StageEvaluator& stage_;
  AlignmentTarget& target_;
  const std::vector<Evaluation*>& evaluations_;
  const int count_;
};

void StageEvaluator::evaluate(const std::vector<Evaluation*>& evaluations) {
  Steps steps(this, evaluations);
  evaluateInOrder(target_.rules.kind, &needs_regions_, &steps);
}

}  // namespace nerf_pose_refiner
