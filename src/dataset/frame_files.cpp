// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/frame_files.h"

#include <filesystem>
#include <map>
#include <stdexcept>

#include "dataset/path_below.h"
#include "image/io.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

class FrameFileFinder {
 public:
  FrameFileFinder(const std::string& folder, const DatasetOptions& options)
      : folder_(folder), confined_(options.confined), limits_(options.limits) {}

  /// Of the next frame.
  FrameFiles find(const TransformsFrame& frame) {
    FrameFiles files;
    files.image = findImage(frame.file_path);
    const auto added = frame_of_.emplace(fs::canonical(files.image).string(), frame_of_.size());
    if (!added.second) {
      throw std::runtime_error("frame " + std::to_string(added.first->second) +
                               " has the same image '" + files.image + "'");
    }
    const std::uint64_t pixels = pixelsOf(files.image);
    if (!frame.mask_path.empty()) {
      files.mask = find(frame.mask_path);
      pixelsOf(files.mask);
    }
    if (pixels > limits_.pixels - pixels_) {
      throw std::runtime_error("with '" + files.image + "' the images have more than " +
                               std::to_string(limits_.pixels) +
                               " pixels together, which is the limit: use fewer or smaller ones");
    }
    pixels_ += pixels;
    return files;
  }

 private:
  std::string find(const std::string& path) const {
    return confined_ ? pathBelow(folder_.empty() ? "." : folder_.string(), path)
                     : (folder_ / path).lexically_normal().string();
  }

  /// NeRF Synthetic leaves the ending away.
  std::string findImage(const std::string& path) const {
    for (const char* ending : {"", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
      const std::string file = find(path + ending);
      if (fs::is_regular_file(file)) return file;
    }
    throw std::runtime_error("there is no file '" + find(path) +
                             "', with or without .png, .jpg or .jpeg");
  }

  std::uint64_t pixelsOf(const std::string& path) const {
    const ImageSize size = imageSizeOf(path);
    if (size.pixels() <= limits_.image_pixels) return size.pixels();
    throw std::runtime_error("'" + path + "' has " + std::to_string(size.width) + " x " +
                             std::to_string(size.height) + " pixels, at most " +
                             std::to_string(limits_.image_pixels) + " are read: scale it down");
  }

  fs::path folder_;
  bool confined_;
  DatasetLimits limits_;
  std::uint64_t pixels_ = 0;                     // of all images so far
  std::map<std::string, std::size_t> frame_of_;  // by the image's path, without links
};

}  // namespace

std::vector<FrameFiles> findFrameFiles(const std::vector<TransformsFrame>& frames,
                                       const std::string& folder, const DatasetOptions& options,
                                       const CancellationToken& cancellation) {
  FrameFileFinder finder(folder, options);
  std::vector<FrameFiles> files;
  for (const TransformsFrame& frame : frames) {
    cancellation.check();
    try {
      files.push_back(finder.find(frame));
    } catch (const std::exception& error) {
      throw std::runtime_error(frame.where + ": " + error.what());
    }
  }
  return files;
}

}  // namespace nerf_pose_refiner
