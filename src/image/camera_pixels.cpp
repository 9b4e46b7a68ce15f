// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
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

Image8 copied(const Image8View& bytes, const PixelWindow& window) {
  Image8 part(window.width, window.height, bytes.channels);
  const auto row = static_cast<std::ptrdiff_t>(window.width) * bytes.channels;
  for (int y = 0; y < window.height; ++y) {
    std::copy_n(bytes.data + (window.y + y) * bytes.row_bytes +
                    static_cast<std::size_t>(window.x) * bytes.channels,
                row, part.pixel(0, y));
  }
  return part;
}

Image8 toRgb(Image8 part, PixelFormat format) {
  if (format == PixelFormat::kRgb) return part;
  int conversion = cv::COLOR_BGR2RGB;
  if (format == PixelFormat::kGrey) conversion = cv::COLOR_GRAY2RGB;
  if (format == PixelFormat::kRgba) conversion = cv::COLOR_RGBA2RGB;
  if (format == PixelFormat::kBgra) conversion = cv::COLOR_BGRA2RGB;
  Image8 rgb(part.width, part.height, 3);
  const cv::Mat from(part.height, part.width, CV_8UC(part.channels), part.values.data());
  cv::Mat to(rgb.height, rgb.width, CV_8UC3, rgb.values.data());
  cv::cvtColor(from, to, conversion);
  return rgb;
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

Image8 CameraPixels::read(const PixelWindow& window) const {
  if (window.x < 0 || window.y < 0 || window.width < 0 || window.height < 0 ||
      window.x > bytes_.width - window.width || window.y > bytes_.height - window.height) {
    throw std::invalid_argument("CameraPixels: the window reaches outside of the image");
  }
  if (window.empty()) return Image8(window.width, window.height, 3);
  // Channels are interpolated one by one, so the order of the two steps does not matter.
  return toRgb(
      undistorter_ == nullptr ? copied(bytes_, window) : undistorter_->undistort(bytes_, window),
      format_);
}

}  // namespace nerf_pose_refiner
