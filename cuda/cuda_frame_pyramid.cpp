// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_frame_pyramid.h"

#include <cstring>

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

void CudaFramePyramid::make(const Observation& observation, const FramePart& part,
                            cudaStream_t stream) {
  const PixelWindow& window = part.window;
  const bool all_seen = observation.weight.empty();
  const std::size_t n = static_cast<std::size_t>(window.width) * window.height;
  const std::size_t pixel_bytes = (observation.pixels ? 3 : 3 * sizeof(float));
  const std::size_t image_bytes = alignUp(pixel_bytes * n);
  const std::size_t bytes = image_bytes + (all_seen ? 0 : n * sizeof(float));
  if (bytes > image_.capacity()) image_.reserve(withSpare(bytes));
  staged_.reserve(image_.capacity());
  const std::size_t pyramid = pyramidPixels(window.width, window.height, part.coarsest + 1);
  if (pyramid > plain_.capacity()) plain_.reserve(withSpare(pyramid));
  smooth_.reserve(plain_.capacity());
  width_ = window.width;
  height_ = window.height;

  uploaded_.wait();  // what was staged before
  awaitIn(stream);   // another stream may still be making what was there
  if (observation.pixels != nullptr) {
    observation.pixels->read(window, staged_.data());
  } else {
    copyWindow(observation.image, window, staged_.data());
  }
  if (!all_seen) copyWindow(observation.weight, window, staged_.data() + image_bytes);
  NPR_CUDA_CHECK(
      cudaMemcpyAsync(image_.data(), staged_.data(), bytes, cudaMemcpyHostToDevice, stream));
  uploaded_.record(stream);
  ImagePyramidTask task = {};
  task.width = window.width;
  task.height = window.height;
  task.finest = part.finest;
  task.coarsest = part.coarsest;
  if (observation.pixels != nullptr) {
    task.bytes = image_.data();
  } else {
    task.image = reinterpret_cast<const float*>(image_.data());
  }
  if (!all_seen) task.weight = reinterpret_cast<const float*>(image_.data() + image_bytes);
  task.plain = plain_.data();
  task.smooth = smooth_.data();
  makeImagePyramid(task, stream);
  made_.record(stream);
}

CudaLevelPixels CudaFramePyramid::level(int level) const {
  return {smooth_.data() + pyramidPixels(width_, height_, level), width_ >> level,
          height_ >> level};
}

}  // namespace nerf_pose_refiner
