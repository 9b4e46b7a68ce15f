// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/stage_evaluator.h"

#include <algorithm>
#include <cmath>

#include "backend/common/alignment_rules.h"
#include "backend/common/local_contrast.h"
#include "backend/cpu/rendered_image.h"
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
                               int level, const AlignStage& stage, int threads,
                               const CancellationToken& stop, CostCounters* work)
    : scene_(scene), stage_(stage), threads_(threads), stop_(stop), work_(work) {
  target_.level = &observedLevel(observation, level);
  target_.observed = &target_.level->blurred;
  target_.centre = scene.field().metadata.centre;
  target_.rules = comparisonRules(observation.background, observation.background_colour, stage);
  target_.fit_gain_bias = stage.fit_gain_bias;
  needs_regions_ = target_.rules.kind == Comparison::kRegions;
  // A lattice of n x n rays has a variance of (1 - 1 / n^2) / 12 of a pixel along each axis.
  const double n = stage.rays_per_side;
  const double blur = target_.level->blur_px;
  image_kernel_ = gaussianKernel(std::sqrt(std::max(0.0, blur * blur - (1 - 1 / (n * n)) / 12)));
  if (stage.compare_contrast) {
    const Camera& camera = target_.level->camera;
    contrast_window_ = gaussianKernel(contrastWindow(camera.width, camera.height));
    observed_contrast_ = target_.level->blurred;
    takeContrast(contrast_window_, &observed_contrast_);
  }
}

void StageEvaluator::render(const std::vector<Evaluation*>& evaluations) {
  std::vector<ImageRequest> requests;
  for (Evaluation* e : evaluations) {
    requests.push_back({target_.level->camera, e->T_O_C, stage_.rays_per_side, &e->image});
  }
  RenderOptions options;
  options.step_scale = stage_.step_scale;
  options.min_transmittance = stage_.min_transmittance;
  renderImages(scene_, requests, options, threads_, stop_, work_);
  const std::vector<float>& weight = target_.level->weight.values;
  for (Evaluation* e : evaluations) {
    for (std::size_t i = 0; i < weight.size(); ++i) {
      e->image.values[kImageChannels * i + kWeight] = weight[i];
    }
  }
}

void StageEvaluator::buildRegions(const std::vector<Evaluation*>& evaluations) {
  std::vector<const Image*> images;
  std::vector<GainBias<float>> gain_biases;
  for (Evaluation* e : evaluations) {
    images.push_back(&e->image);
    gain_biases.push_back(e->gain_bias);
  }
  regions_ = modelRegions(*target_.level, images, gain_biases, image_kernel_);
  target_.regions = &regions_;
  target_.observed = &regions_.observed;
  needs_regions_ = false;
}

template <typename Sums, typename SumRows>
std::vector<Sums> StageEvaluator::sumChunks(int count, const SumRows& sum_rows) const {
  const int height = target_.level->camera.height;
  const int chunks = (height + kRowsPerChunk - 1) / kRowsPerChunk;
  std::vector<Sums> parts(static_cast<std::size_t>(count) * chunks);
  parallelFor(threads_, count * chunks, [&](int i) {
    const int first = i % chunks * kRowsPerChunk;
    parts[i] = sum_rows(i / chunks, first, std::min(height, first + kRowsPerChunk));
  });
  std::vector<Sums> sums(count);
  for (int i = 0; i < count * chunks; ++i) sums[i / chunks].add(parts[i]);
  return sums;
}

void StageEvaluator::fitGainBiases(const std::vector<Evaluation*>& evaluations) {
  const int count = static_cast<int>(evaluations.size());
  for (int pass = 0; pass < 2; ++pass) {
    const auto moments = sumChunks<GainBiasMoments>(count, [&](int i, int first, int last) {
      return sumGainBias(target_, evaluations[i]->image, evaluations[i]->gain_bias, first, last);
    });
    for (int i = 0; i < count; ++i) evaluations[i]->gain_bias = solveGainBias(moments[i]);
  }
}

void StageEvaluator::blurAll(const std::vector<Evaluation*>& evaluations) {
  parallelFor(threads_, static_cast<int>(evaluations.size()), [&](int i) {
    Evaluation& e = *evaluations[i];
    if (comparesContrasts()) {
      e.behind = seenBehind(target_.level->image, e.image);
      blurImage(image_kernel_, &e.behind, &e.scratch);
    }
    blurImage(image_kernel_, &e.image, &e.scratch);
  });
}

// From here on the images hold contrasts, which know no light.
void StageEvaluator::takeContrasts(const std::vector<Evaluation*>& evaluations) {
  parallelFor(threads_, static_cast<int>(evaluations.size()), [&](int i) {
    takeContrastBefore(evaluations[i]->behind, evaluations[i]->gain_bias, contrast_window_,
                       &evaluations[i]->image);
  });
  target_.observed = &observed_contrast_;
}

void StageEvaluator::evaluate(const std::vector<Evaluation*>& evaluations) {
  const int count = static_cast<int>(evaluations.size());
  render(evaluations);
  if (comparesContrasts()) target_.observed = &target_.level->blurred;
  if (needs_regions_) {
    if (target_.fit_gain_bias) fitGainBiases(evaluations);
    buildRegions(evaluations);
  }
  blurAll(evaluations);
  if (target_.fit_gain_bias) fitGainBiases(evaluations);
  if (comparesContrasts()) takeContrasts(evaluations);
  const auto sums = sumChunks<AlignmentSums>(count, [&](int i, int first, int last) {
    const Evaluation& e = *evaluations[i];
    const GainBias<float> gain_bias = comparesContrasts() ? GainBias<float>() : e.gain_bias;
    return sumAlignment(target_, e.image, e.T_O_C, gain_bias, first, last);
  });
  for (int i = 0; i < count; ++i) evaluations[i]->sums = sums[i];
}

}  // namespace nerf_pose_refiner
