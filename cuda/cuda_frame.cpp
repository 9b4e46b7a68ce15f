// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_frame.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

#include "image_pyramid.h"

namespace nerf_pose_refiner {
namespace {

// Rows of an image's window, one behind the other.
void copyWindow(const Image& image, const PixelWindow& window, std::uint8_t* to) {
  const std::size_t row = sizeof(float) * window.width * image.channels;
  for (int y = 0; y < window.height; ++y, to += row) {
    std::memcpy(to, image.pixel(window.x, window.y + y), row);
  }
}

// Where numbers may begin behind so many bytes.
std::size_t alignUp(std::size_t bytes) {
  return (bytes + sizeof(float) - 1) / sizeof(float) * sizeof(float);
}

// Windows change their size from image to image: memory must not be asked for each time.
std::size_t withSpare(std::size_t n) { return n + n / 2; }

}  // namespace

void CudaFrame::prepare(const Observation& observation, const FrameWindow& window,
                        cudaStream_t stream) {
  const FrameLevels levels(observation, window);
  if (levels.count() > kMaxFrameLevels) {
    throw std::invalid_argument("alignment to keyframes takes no more than " +
                                std::to_string(kMaxFrameLevels) + " levels of an image");
  }
  const PixelWindow& pixels = levels.window();
  const bool all_seen = observation.weight.empty();
  const std::size_t n = static_cast<std::size_t>(pixels.width) * pixels.height;
  const std::size_t pixel_bytes = (observation.pixels ? 3 : 3 * sizeof(float));
  const std::size_t image_bytes = alignUp(pixel_bytes * n);
  const std::size_t bytes = image_bytes + (all_seen ? 0 : n * sizeof(float));
  if (bytes > window_.capacity()) window_.reserve(withSpare(bytes));
  staged_.reserve(window_.capacity());
  const std::size_t pyramid =
      pyramidPixels(pixels.width, pixels.height, levels.finest() + levels.count());
  if (pyramid > plain_.capacity()) plain_.reserve(withSpare(pyramid));
  smooth_.reserve(plain_.capacity());
  levels_ = levels;

  uploaded_.wait();  // what was staged before
  if (observation.pixels != nullptr) {
    const Image8 part = observation.pixels->read(pixels);
    std::copy(part.values.begin(), part.values.end(), staged_.data());
  } else {
    copyWindow(observation.image, pixels, staged_.data());
  }
  if (!all_seen) copyWindow(observation.weight, pixels, staged_.data() + image_bytes);
  NPR_CUDA_CHECK(
      cudaMemcpyAsync(window_.data(), staged_.data(), bytes, cudaMemcpyHostToDevice, stream));
  uploaded_.record(stream);
  ImagePyramidTask task = {};
  task.width = pixels.width;
  task.height = pixels.height;
  task.finest = levels.finest();
  task.coarsest = levels.finest() + levels.count() - 1;
  if (observation.pixels != nullptr) {
    task.bytes = window_.data();
  } else {
    task.image = reinterpret_cast<const float*>(window_.data());
  }
  if (!all_seen) task.weight = reinterpret_cast<const float*>(window_.data() + image_bytes);
  task.plain = plain_.data();
  task.smooth = smooth_.data();
  makeImagePyramid(task, stream);
}

CudaFrameLevel CudaFrame::level(int i) const {
  const PixelWindow& pixels = levels_.window();
  const int level = levels_.finest() + i;
  CudaFrameLevel of_frame = {};
  of_frame.pixels = smooth_.data() + pyramidPixels(pixels.width, pixels.height, level);
  of_frame.width = pixels.width >> level;
  of_frame.height = pixels.height >> level;
  of_frame.K = levels_.intrinsics(level);
  return of_frame;
}

}  // namespace nerf_pose_refiner
