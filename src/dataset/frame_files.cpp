// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/frame_files.h"

#include <filesystem>
#include <map>
#include <stdexcept>

#include "dataset/dataset_folder.h"
#include "image/io.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

class FrameFileFinder {
 public:
  FrameFileFinder(const std::string& folder, const DatasetOptions& options)
      : folder_(folder, options.confined), limits_(options.limits) {}

  /// Of the next frame.
  FrameFiles find(const FrameEntry& frame) {
    FrameFiles files;
    files.image = findImage(frame.image);
    const auto added = frame_of_.emplace(fs::canonical(files.image).string(), frame_of_.size());
    if (!added.second) {
      throw std::runtime_error("frame " + std::to_string(added.first->second) +
                               " has the same image '" + files.image + "'");
    }
    const std::uint64_t pixels = pixelsOf(files.image);
    if (!frame.mask.empty()) {
      files.mask = folder_.path(frame.mask);
      pixelsOf(files.mask);
    }
    addWithin(limits_.pixels, pixels, "pixels", files.image, &pixels_);
    return files;
  }

 private:
  /// Adds to what all images have so far.
  static void addWithin(std::uint64_t limit, std::uint64_t added, const char* unit,
                        const std::string& path, std::uint64_t* sum) {
    if (added > limit - *sum) {
      throw std::runtime_error("with '" + path + "' the images have more than " +
                               std::to_string(limit) + " " + unit +
                               " together, which is the limit: use fewer or smaller ones");
    }
    *sum += added;
  }

  /// NeRF Synthetic leaves the ending away.
  std::string findImage(const std::string& path) const {
    for (const char* ending : {"", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
      const std::string file = folder_.path(path + ending);
      if (fs::is_regular_file(file)) return file;
    }
    throw std::runtime_error("there is no file '" + folder_.path(path) +
                             "', with or without .png, .jpg or .jpeg");
  }

  std::uint64_t pixelsOf(const std::string& path) {
    const ImageSize size = imageSizeOf(path);
    addWithin(limits_.image_bytes, fs::file_size(path), "bytes", path, &bytes_);
    if (size.pixels() <= limits_.image_pixels) return size.pixels();
    throw std::runtime_error("'" + path + "' has " + std::to_string(size.width) + " x " +
                             std::to_string(size.height) + " pixels, at most " +
                             std::to_string(limits_.image_pixels) + " are read: scale it down");
  }

  DatasetFolder folder_;
  DatasetLimits limits_;
  std::uint64_t pixels_ = 0;                     // of all images so far
  std::uint64_t bytes_ = 0;                      // of their files, and of the masks'
  std::map<std::string, std::size_t> frame_of_;  // by the image's path, without links
};

}  // namespace

std::vector<FrameFiles> findFrameFiles(const FrameList& list, const DatasetOptions& options,
                                       const CancellationToken& cancellation) {
  FrameFileFinder finder(list.folder, options);
  std::vector<FrameFiles> files;
  for (const FrameEntry& frame : list.frames) {
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
