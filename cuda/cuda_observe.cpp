// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "concurrency/parallel.h"
#include "cuda_backend.h"
#include "image/filter.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMaxThreads = 4;  // that copy an image

/// Pixels of the observation that levels take something of.
struct Crop {
  int x, y, width, height;
};

/// First and last of `size` pixels that a level covers along one axis.
void coverAxis(int size, double focal, double centre, int level_size, double level_focal,
               double level_centre, int* first, int* last) {
  const double scale = focal / level_focal, margin = std::max(scale, 1.0) + 1;
  const double low = (0 - level_centre) * scale + centre - margin;
  const double high = (level_size - 1 - level_centre) * scale + centre + margin;
  *first = std::min(*first, static_cast<int>(std::clamp(std::floor(low), 0.0, size - 1.0)));
  *last = std::max(*last, static_cast<int>(std::clamp(std::ceil(high), 0.0, size - 1.0)));
}

Crop cropFor(const Camera& camera, const std::vector<ImageLevel>& levels) {
  int left = camera.width - 1, right = 0, top = camera.height - 1, bottom = 0;
  for (const ImageLevel& level : levels) {
    const Camera& c = level.camera;
    coverAxis(camera.width, camera.fx, camera.cx, c.width, c.fx, c.cx, &left, &right);
    coverAxis(camera.height, camera.fy, camera.cy, c.height, c.fy, c.cy, &top, &bottom);
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

/// Blur that is still missing: area averaging over n x n pixels has a variance of (n^2 - 1) / 12 of
/// the observation's pixels along each axis.
double remainingBlur(double blur_px, double scale) {
  return std::sqrt(std::max(0.0, blur_px * blur_px - std::max(0.0, 1 - scale * scale) / 12));
}

}  // namespace

void CudaBackend::uploadObservation(const Observation& observation,
                                    const std::vector<ImageLevel>& levels,
                                    CudaObservedImage* uploaded) {
  const Crop crop = cropFor(observation.camera, levels);
  uploaded_.wait();  // what was staged for the last one may still be on its way
  uploadCrop(observation.image, crop, &image_, stream_);
  uploaded->image = image_.image.data();
  if (!observation.alpha.empty()) {
    uploadCrop(observation.alpha, crop, &alpha_, stream_);
    uploaded->alpha = alpha_.image.data();
  }
  if (!observation.weight.empty()) {
    uploadCrop(observation.weight, crop, &weight_, stream_);
    uploaded->weight = weight_.image.data();
  }
  uploaded_.record(stream_);
  uploaded->camera =
      plainCamera(observation.camera.cropped(crop.x, crop.y, crop.width, crop.height));
  uploaded->is_mask = observation.background == Background::kMask;
}

void CudaBackend::observeLevel(const CudaObservedImage& image, const ImageLevel& plan, double scale,
                               CudaLevel* level) {
  level->camera = plainCamera(plan.camera);
  level->blur_px = plan.blur_px;
  const std::size_t pixels = static_cast<std::size_t>(plan.camera.width) * plan.camera.height;
  level->image.reserve(pixels);
  level->weight.reserve(pixels);
  level->blurred.reserve(2 * pixels);
  resampleObservation(image, level->camera, level->image.data(), level->weight.data(), stream_);

  const std::vector<float> kernel = gaussianKernel(remainingBlur(plan.blur_px, scale));
  kernel_.upload(kernel, stream_);
  scratch_.reserve(2 * pixels);
  packImage(level->image.data(), static_cast<int>(pixels), level->blurred.data(), stream_);
  BlurTask blur = {};
  blur.width = plan.camera.width;
  blur.height = plan.camera.height;
  blur.view_count = 1;
  blur.weight = level->weight.data();
  blur.half_kernel = kernel_.data();
  blur.radius = static_cast<int>(kernel.size()) - 1;
  blur.images = level->blurred.data();
  blur.scratch = scratch_.data();
  blur.blurred = level->blurred.data();
  blurImages(blur, stream_);
}

std::shared_ptr<const LoadedObservation> CudaBackend::observe(
    const Observation& observation, const std::vector<ImageLevel>& levels) {
  enter();
  observation.validate();
  for (const ImageLevel& level : levels) level.camera.validate();
  auto observed = std::make_shared<CudaObservation>(levels_, device_);
  observed->background = observation.background;
  if (observation.background == Background::kKnownColour) {
    observed->background_colour = observation.background_colour;
  }
  CudaLevels* memory = observed->levels();
  if (memory->levels.size() < levels.size()) memory->levels.resize(levels.size());
  memory->count = levels.size();
  CudaObservedImage image = {};
  uploadObservation(observation, levels, &image);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    observeLevel(image, levels[i], levels[i].camera.fx / observation.camera.fx, &memory->levels[i]);
  }
  return observed;
}

}  // namespace nerf_pose_refiner
