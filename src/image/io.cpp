// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/io.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "files/input_file.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 29;  // 8 a pixel of the largest

[[noreturn]] void fail(const std::string& what, const std::string& path,
                       const std::string& reason) {
  throw std::runtime_error(what + " '" + path + "': " + reason);
}

/// The bytes of an image that is not larger than that.
std::vector<std::uint8_t> readBytes(const std::string& path, std::uint64_t max_pixels) {
  const InputFile file(path);
  const ImageSize size = readImageSize(file);
  if (size.pixels() > max_pixels) {
    throw std::runtime_error("it has " + std::to_string(size.width) + " x " +
                             std::to_string(size.height) + " pixels, at most " +
                             std::to_string(max_pixels) + " are read");
  }
  if (file.size() > kMaxFileBytes) throw std::runtime_error("the file is too large");
  std::vector<std::uint8_t> bytes(file.size());
  file.read(0, bytes.data(), bytes.size());
  return bytes;
}

/// Whether a JPEG (ITU-T T.81) was cut off: its segments, or the coded data behind them, end before
/// the marker "end of image". The decoder would fill the rest with grey and say nothing.
bool isCutOffJpeg(const std::vector<std::uint8_t>& bytes) {
  constexpr std::uint8_t kMarker = 0xff, kStartOfImage = 0xd8, kEndOfImage = 0xd9;
  if (bytes.size() < 3 || bytes[0] != kMarker || bytes[1] != kStartOfImage) return false;
  std::size_t i = 2;
  while (i + 1 < bytes.size()) {
    const std::uint8_t code = bytes[i + 1];
    if (bytes[i] != kMarker || code == 0 || code == kMarker) {
      ++i;  // coded data, a stuffed byte in it, or padding
    } else if (code == kEndOfImage) {
      return false;
    } else if (code == 0x01 || (code >= 0xd0 && code <= 0xd7)) {
      i += 2;  // markers without a segment
    } else {
      if (i + 3 >= bytes.size()) return true;
      i += 2 + (bytes[i + 2] << 8 | bytes[i + 3]);  // a thumbnail inside has an end of its own
    }
  }
  return true;
}

/// Decodes; bits and channels as in the file, or as the flags say.
cv::Mat decodeAsStored(const std::string& path, int flags, std::uint64_t max_pixels) {
  cv::Mat image;
  try {
    const std::vector<std::uint8_t> bytes = readBytes(path, max_pixels);
    if (isCutOffJpeg(bytes)) throw std::runtime_error("a JPEG whose end is missing");
    image = cv::imdecode(bytes, flags);
  } catch (const std::exception& error) {
    fail("cannot read image", path, error.what());
  }
  if (image.empty()) fail("cannot read image", path, "not an image, or a damaged one");
  return image;
}

/// Decodes to 8 bits per channel; channels as in the file.
cv::Mat decode(const std::string& path, int flags, std::uint64_t max_pixels) {
  cv::Mat image = decodeAsStored(path, flags, max_pixels);
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 257);
  if (image.depth() != CV_8U) fail("cannot read image", path, "neither 8 nor 16 bits a channel");
  return image;
}

template <typename T>
ImageOf<T> copyOf(const cv::Mat& mat) {
  ImageOf<T> image(mat.cols, mat.rows, mat.channels());
  const std::size_t row_bytes = sizeof(T) * static_cast<std::size_t>(mat.cols) * mat.channels();
  for (int y = 0; y < mat.rows; ++y) std::memcpy(image.pixel(0, y), mat.ptr(y), row_bytes);
  return image;
}

void encodePng(const cv::Mat& image, const std::string& path) {
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", image, bytes)) fail("cannot write image", path, "encoding failed");

  errno = 0;
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) fail("cannot write image", path, std::strerror(errno));
}

}  // namespace

ImageSize imageSizeOf(const std::string& path) {
  try {
    return readImageSize(InputFile(path));
  } catch (const std::exception& error) {
    fail("cannot read image", path, error.what());
  }
}

Image8 readImage(const std::string& path, std::uint64_t max_pixels) {
  cv::Mat image = decode(path, cv::IMREAD_UNCHANGED, max_pixels);
  switch (image.channels()) {
    case 1:
      cv::cvtColor(image, image, cv::COLOR_GRAY2RGB);
      break;
    case 3:
      cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
      break;
    case 4:
      cv::cvtColor(image, image, cv::COLOR_BGRA2RGBA);
      break;
    default:
      fail("cannot read image", path, std::to_string(image.channels()) + " channels");
  }
  return copyOf<std::uint8_t>(image);
}

Image8 readMask(const std::string& path, std::uint64_t max_pixels) {
  Image8 mask = copyOf<std::uint8_t>(
      decode(path, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION, max_pixels));
  if (*std::max_element(mask.values.begin(), mask.values.end()) == 1) {
    for (std::uint8_t& value : mask.values) value = value == 1 ? 255 : 0;
  }
  return mask;
}

ImageOf<std::uint16_t> readDepthPng(const std::string& path, std::uint64_t max_pixels) {
  const cv::Mat image = decodeAsStored(path, cv::IMREAD_UNCHANGED, max_pixels);
  if (image.type() != CV_16UC1) {
    fail("cannot read depth", path, "it is not a PNG of 16-bit grey");
  }
  return copyOf<std::uint16_t>(image);
}

void writePng(const Image8& image, const std::string& path) {
  const int channels = image.channels;
  if (image.empty() || (channels != 1 && channels != 3 && channels != 4)) {
    throw std::invalid_argument("cannot write '" + path + "': an image of " +
                                std::to_string(image.width) + " x " + std::to_string(image.height) +
                                " pixels and " + std::to_string(channels) + " channels");
  }
  // OpenCV only reads from it.
  const cv::Mat mat(image.height, image.width, CV_8UC(channels),
                    const_cast<std::uint8_t*>(image.values.data()));
  cv::Mat bgr;
  if (channels == 1) {
    bgr = mat;
  } else {
    cv::cvtColor(mat, bgr, channels == 3 ? cv::COLOR_RGB2BGR : cv::COLOR_RGBA2BGRA);
  }
  encodePng(bgr, path);
}

void writeDepthPng(const Image& depth_m, const std::string& path) {
  if (depth_m.empty() || depth_m.channels != 1) {
    throw std::invalid_argument("cannot write '" + path + "': depth has one channel and pixels");
  }
  cv::Mat_<std::uint16_t> millimetres(depth_m.height, depth_m.width);
  std::transform(depth_m.values.begin(), depth_m.values.end(), millimetres.begin(),
                 [](float z_m) { return cv::saturate_cast<std::uint16_t>(1000 * z_m); });
  encodePng(millimetres, path);
}

}  // namespace nerf_pose_refiner
