// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {
namespace {

int channelsOf(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey:
      return 1;
    case PixelFormat::kRgb:
    case PixelFormat::kBgr:
      return 3;
    case PixelFormat::kRgba:
    case PixelFormat::kBgra:
      return 4;
  }
  throw std::invalid_argument("CameraPixels: unknown format");
}

// A window of an image, in its memory.
Image8View partOf(const Image8View& bytes, const PixelWindow& window) {
  Image8View part = bytes;
  part.data += window.y * bytes.row_bytes + static_cast<std::size_t>(window.x) * bytes.channels;
  part.width = window.width;
  part.height = window.height;
  return part;
}

void toRgb(const Image8View& part, PixelFormat format, std::uint8_t* rgb) {
  const std::size_t row = 3 * static_cast<std::size_t>(part.width);
  if (format == PixelFormat::kRgb) {
    for (int y = 0; y < part.height; ++y)
      std::copy_n(part.data + y * part.row_bytes, row, rgb + y * row);
    return;
  }
  int conversion = cv::COLOR_BGR2RGB;
  if (format == PixelFormat::kGrey) conversion = cv::COLOR_GRAY2RGB;
  if (format == PixelFormat::kRgba) conversion = cv::COLOR_RGBA2RGB;
  if (format == PixelFormat::kBgra) conversion = cv::COLOR_BGRA2RGB;
  // OpenCV takes no const memory; it is only read.
  const cv::Mat from(part.height, part.width, CV_8UC(part.channels),
                     const_cast<std::uint8_t*>(part.data), part.row_bytes);
  cv::Mat to(part.height, part.width, CV_8UC3, rgb, row);
  cv::cvtColor(from, to, conversion);
}

}  // namespace

CameraPixels::CameraPixels(const Image8View& bytes, PixelFormat format,
                           std::shared_ptr<const void> owner,
                           std::shared_ptr<const Undistorter> undistorter)
    : bytes_(bytes),
      format_(format),
      owner_(std::move(owner)),
      undistorter_(std::move(undistorter)) {
  const std::size_t row = static_cast<std::size_t>(bytes.width) * bytes.channels;
  if (bytes.data == nullptr || bytes.width < 1 || bytes.height < 1 || bytes.row_bytes < row ||
      bytes.channels != channelsOf(format)) {
    throw std::invalid_argument("CameraPixels: " + std::to_string(bytes.width) + " x " +
                                std::to_string(bytes.height) + " x " +
                                std::to_string(bytes.channels) + " bytes do not fit the format");
  }
  if (undistorter_ != nullptr && (undistorter_->camera().width != bytes.width ||
                                  undistorter_->camera().height != bytes.height)) {
    throw std::invalid_argument("CameraPixels: the undistorter is for images of another size");
  }
}

void CameraPixels::requireInside(const PixelWindow& window) const {
  if (window.x < 0 || window.y < 0 || window.width < 0 || window.height < 0 ||
      window.x > bytes_.width - window.width || window.y > bytes_.height - window.height) {
    throw std::invalid_argument("CameraPixels: the window reaches outside of the image");
  }
}

Image8 CameraPixels::read(const PixelWindow& window) const {
  requireInside(window);
  Image8 rgb(window.width, window.height, 3);
  read(window, rgb.values.data());
  return rgb;
}

void CameraPixels::read(const PixelWindow& window, std::uint8_t* rgb) const {
  requireInside(window);
  if (window.empty()) return;
  if (undistorter_ == nullptr) {
    toRgb(partOf(bytes_, window), format_, rgb);
    return;
  }
  // Channels are interpolated one by one, so the order of the two steps does not matter.
  const Image8 part = undistorter_->undistort(bytes_, window);
  toRgb(viewOf(part), format_, rgb);
}

}  // namespace nerf_pose_refiner
