// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "backend/common/blur_rules.h"
#include "backend/common/observed_colours.h"
#include "backend/common/solver_rules.h"
#include "concurrency/parallel.h"
#include "cuda_solver.h"
#include "image/filter.h"
#include "views.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMaxThreads = 4;  // that copy an image

/// Pixels of the observation that levels take something of.
struct Crop {
  int x, y, width, height;
};

/// First and last pixel of an image that a level covers along one axis.
void coverAxis(const ImageAxis& image, const ImageAxis& level, int* first, int* last) {
  const double scale = image.focal / level.focal, margin = std::max(scale, 1.0) + 1;
  const double low = (0 - level.centre) * scale + image.centre - margin;
  const double high = (level.size - 1 - level.centre) * scale + image.centre + margin;
  *first = std::min(*first, static_cast<int>(std::clamp(std::floor(low), 0.0, image.size - 1.0)));
  *last = std::max(*last, static_cast<int>(std::clamp(std::ceil(high), 0.0, image.size - 1.0)));
}

Crop cropFor(const Camera& camera, const std::vector<ImageLevel>& levels) {
  int left = camera.width - 1, right = 0, top = camera.height - 1, bottom = 0;
  for (const ImageLevel& level : levels) {
    coverAxis(axisX(camera), axisX(level.camera), &left, &right);
    coverAxis(axisY(camera), axisY(level.camera), &top, &bottom);
  }
  return {left, top, std::max(1, right - left + 1), std::max(1, bottom - top + 1)};
}

/// Through page-locked memory, which copies go out of beside kernels.
void uploadCrop(const Image& image, const Crop& crop, StagedImage* to, cudaStream_t stream) {
  const std::size_t row = static_cast<std::size_t>(crop.width) * image.channels;
  to->staged.reserve(row * crop.height);
  const int bands = std::min(crop.height, std::min(kMaxThreads, threadCount(0)));
  parallelFor(bands, bands, [&](int band) {
    for (int y = crop.height * band / bands; y < crop.height * (band + 1) / bands; ++y) {
      const float* from = image.pixel(crop.x, crop.y + y);
      std::copy(from, from + row, to->staged.data() + row * y);
    }
  });
  to->image.upload(to->staged.data(), row * crop.height, stream);
}

/// Enqueues the way of what the levels cover to the device.
CudaObservedImage uploadObservation(CudaProcessor* processor, const Observation& observation,
                                    const std::vector<ImageLevel>& levels) {
  CudaWorkspace& space = processor->space();
  const cudaStream_t stream = processor->stream();
  const Crop crop = cropFor(observation.camera, levels);
  CudaObservedImage uploaded = {};
  space.uploaded.wait();  // what was staged for the last one may still be on its way
  if (observation.pixels == nullptr) {
    uploadCrop(observation.image, crop, &space.image, stream);
  } else {
    const Image part = observedColours(observation, {crop.x, crop.y, crop.width, crop.height});
    uploadCrop(part, {0, 0, crop.width, crop.height}, &space.image, stream);
  }
  uploaded.image = space.image.image.data();
  if (!observation.alpha.empty()) {
    uploadCrop(observation.alpha, crop, &space.alpha, stream);
    uploaded.alpha = space.alpha.image.data();
  }
  if (!observation.weight.empty()) {
    uploadCrop(observation.weight, crop, &space.weight, stream);
    uploaded.weight = space.weight.image.data();
  }
  space.uploaded.record(stream);
  uploaded.camera =
      plainCamera(observation.camera.cropped(crop.x, crop.y, crop.width, crop.height));
  uploaded.is_mask = observation.background == Background::kMask;
  return uploaded;
}

/// Enqueues the making of a level. @param scale of it, in the observation's pixels.
void observeLevel(CudaProcessor* processor, const CudaObservedImage& image, const ImageLevel& plan,
                  double scale, CudaLevel* level) {
  CudaWorkspace& space = processor->space();
  const cudaStream_t stream = processor->stream();
  level->camera = plainCamera(plan.camera);
  level->blur_px = plan.blur_px;
  const std::size_t pixels = static_cast<std::size_t>(plan.camera.width) * plan.camera.height;
  level->image.reserve(pixels);
  level->weight.reserve(pixels);
  level->blurred.reserve(2 * pixels);
  resampleObservation(image, level->camera, level->image.data(), level->weight.data(), stream);

  const std::vector<float> kernel = gaussianKernel(remainingBlur(plan.blur_px, scale));
  space.kernel.upload(kernel, stream);
  space.scratch.reserve(2 * pixels);
  packImage(level->image.data(), static_cast<int>(pixels), level->blurred.data(), stream);
  BlurTask blur = {};
  blur.width = plan.camera.width;
  blur.height = plan.camera.height;
  blur.view_count = 1;
  blur.weight = level->weight.data();
  blur.half_kernel = space.kernel.data();
  blur.radius = static_cast<int>(kernel.size()) - 1;
  blur.images = level->blurred.data();
  blur.scratch = space.scratch.data();
  blur.blurred = level->blurred.data();
  blurImages(blur, stream);
}

}  // namespace

void CudaSolver::observe(const Observation& observation, const std::vector<ImageLevel>& levels) {
  background_ = observation.background;
  background_colour_ = backgroundColour(observation);
  level_count_ = levels.size();
  if (memory_.levels.size() < levels.size()) memory_.levels.resize(levels.size());
  const CudaObservedImage image = uploadObservation(&processor_, observation, levels);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    observeLevel(&processor_, image, levels[i], levels[i].camera.fx / observation.camera.fx,
                 &memory_.levels[i]);
  }
}

}  // namespace nerf_pose_refiner
