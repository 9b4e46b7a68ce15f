// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "concurrency/parallel.h"
#include "dataset/dataset.h"
#include "dataset/dataset_formats.h"
#include "dataset/frame_files.h"
#include "dataset/mask_check.h"
#include "dataset/points_box.h"
#include "image/io.h"
#include "image/orientation.h"
#include "math/unsure_alpha.h"
#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {
namespace {

std::string sizeText(double width, double height) {
  return std::to_string(std::lround(width)) + " x " + std::to_string(std::lround(height));
}

/// Camera of a frame, pixel centres integers.
Camera cameraOf(const FrameEntry& frame, int width, int height) {
  const bool in_pixels = frame.fl_x || frame.fl_y || frame.cx || frame.cy;
  const double stated_width = frame.width.value_or(width);
  const double stated_height = frame.height.value_or(height);
  if (in_pixels && (stated_width != width || stated_height != height)) {
    const bool turned = stated_width == height && stated_height == width;
    throw std::runtime_error("w x h is " + sizeText(stated_width, stated_height) +
                             ", the image has " + sizeText(width, height) +
                             (turned ? ": it was turned after its pose was found, turn it back"
                                     : ": scale it, or the intrinsics"));
  }
  const auto focal = [](double size, double angle) { return 0.5 * size / std::tan(0.5 * angle); };
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = frame.fl_x ? *frame.fl_x : focal(width, *frame.camera_angle_x);
  camera.fy = frame.fl_y             ? *frame.fl_y
              : frame.camera_angle_y ? focal(height, *frame.camera_angle_y)
                                     : camera.fx;
  camera.cx = frame.cx.value_or(0.5 * width) - 0.5;
  camera.cy = frame.cy.value_or(0.5 * height) - 0.5;
  return camera;
}

/// Reads a photo with the sides that its camera has. EXIF data say how to turn the photos of a
/// phone that was held upright; whether the software that found the poses did so shows in the size
/// that it gives.
Image8 readPhoto(const std::string& path, const FrameEntry& frame, std::uint64_t max_pixels) {
  Image8 image = readImage(path, max_pixels);
  const bool turned = image.width != image.height && frame.width == double(image.height) &&
                      frame.height == double(image.width);
  if (!turned) return image;
  const int orientation = readExifOrientation(InputFile(path));
  return exchangesSides(orientation) ? upright(image, orientation) : image;
}

Image8 withAlpha(const Image8& image) {
  if (image.channels == 4) return image;
  Image8 rgba(image.width, image.height, 4, 255);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    for (int c = 0; c < 3; ++c) rgba.values[4 * i + c] = image.values[3 * i + c];
  }
  return rgba;
}

/// Multiplies the alpha of an image by a mask.
void applyMask(const Image8& mask, const std::string& mask_path, Image8* rgba) {
  if (mask.width != rgba->width || mask.height != rgba->height) {
    throw std::runtime_error("the mask '" + mask_path + "' has " +
                             sizeText(mask.width, mask.height) + " pixels, the image " +
                             sizeText(rgba->width, rgba->height));
  }
  for (std::size_t i = 0; i < mask.pixels(); ++i) {
    std::uint8_t& alpha = rgba->values[4 * i + 3];
    alpha = static_cast<std::uint8_t>((alpha * mask.values[i] + 127) / 255);
  }
}

/// Only a mask whose pixels are sure or unsure means the latter: soft edges have any value.
bool tellsUnsure(const Image8& mask) {
  return std::all_of(mask.values.begin(), mask.values.end(), [](std::uint8_t value) {
    return value == 0 || value == 255 || isUnsure(value);
  });
}

void makeSure(Image8* rgba) {
  for (std::size_t i = 3; i < rgba->values.size(); i += 4) {
    std::uint8_t& alpha = rgba->values[i];
    if (isUnsure(alpha)) alpha = alpha == kPerhapsObject ? 255 : 0;
  }
}

/// Keeps the last undistorter, for most datasets come from one camera; more would be a large
/// memory where each frame has intrinsics of its own.
class UndistorterCache {
 public:
  std::shared_ptr<const Undistorter> get(const Camera& c, const Distortion& distortion) {
    std::vector<double> key = distortion.coefficients;
    key.insert(key.end(), {double(c.width), double(c.height), c.fx, c.fy, c.cx, c.cy});
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!last_ || key != last_key_) {
      last_ = std::make_shared<const Undistorter>(c, distortion);
      last_key_ = key;
    }
    return last_;
  }

 private:
  std::mutex mutex_;  // guards what follows
  std::vector<double> last_key_;
  std::shared_ptr<const Undistorter> last_;
};

struct LoadedView {
  PosedView view;
  bool has_alpha_channel = false;  // in the image or beside it
  bool has_transparency = false;   // somewhere
};

LoadedView loadView(const FrameFiles& files, const FrameEntry& frame, const DatasetLimits& limits,
                    UndistorterCache* undistorters) {
  LoadedView loaded;
  PosedView& view = loaded.view;
  view.name = files.image;
  view.T_O_C = frame.T_O_C;
  const Image8 image = readPhoto(view.name, frame, limits.image_pixels);
  view.photo_camera = cameraOf(frame, image.width, image.height);
  view.camera = view.photo_camera;
  view.distortion = frame.distortion;
  loaded.has_alpha_channel = image.channels == 4 || !frame.mask.empty();
  Image8 rgba = withAlpha(image);
  bool tells_unsure = false;
  if (!frame.mask.empty()) {
    const Image8 mask = readMask(files.mask, limits.image_pixels);
    tells_unsure = image.channels != 4 && tellsUnsure(mask);
    applyMask(mask, files.mask, &rgba);
  }
  if (!frame.distortion.isZero()) {
    const auto undistorter = undistorters->get(view.camera, frame.distortion);
    rgba = undistorter->undistort(rgba);
    view.camera = undistorter->camera();
  }
  if (!tells_unsure) makeSure(&rgba);
  for (std::size_t i = 3; i < rgba.values.size(); i += 4) {
    loaded.has_transparency = loaded.has_transparency || rgba.values[i] < 255;
  }
  view.rgba = std::make_shared<const Image8>(std::move(rgba));
  return loaded;
}

/// All views, in parallel. The first frame that fails is the one that is reported.
std::vector<LoadedView> loadViews(const std::vector<FrameFiles>& files,
                                  const std::vector<FrameEntry>& frames,
                                  const DatasetOptions& options,
                                  const CancellationToken& cancellation) {
  std::vector<LoadedView> views(frames.size());
  UndistorterCache undistorters;
  parallelFor(threadCount(options.threads), static_cast<int>(frames.size()), [&](int i) {
    cancellation.check();
    try {
      views[i] = loadView(files[i], frames[i], options.limits, &undistorters);
    } catch (const std::exception& error) {
      throw std::runtime_error(frames[i].where + ": " + error.what());
    }
  });
  return views;
}

/// @throws std::runtime_error naming the first mask.
void requireMasksFit(const FrameList& list, const std::vector<PosedView>& views) {
  try {
    requireMasksNotMirrored(views);
  } catch (const std::exception& error) {
    throw std::runtime_error(list.frames[0].where + ": " + error.what() + " ('" +
                             list.frames[0].mask + "' and the others)");
  }
}

}  // namespace

Dataset loadDataset(const std::string& path, const DatasetOptions& options,
                    const CancellationToken& cancellation) {
  const FrameList list = readFrameList(path, options);
  const std::vector<FrameFiles> files = findFrameFiles(list, options, cancellation);
  const std::vector<LoadedView> views = loadViews(files, list.frames, options, cancellation);

  Dataset dataset;
  dataset.folder = list.folder;
  dataset.has_box = list.has_box;
  dataset.box_min = list.box_min;
  dataset.box_max = list.box_max;
  dataset.metres_per_unit = list.metres_per_unit;
  dataset.points = list.points;
  dataset.notes = list.notes;
  for (std::size_t i = 0; i < views.size(); ++i) {
    // Without its mask the background would be learned as part of the object.
    if (views[i].has_alpha_channel != views[0].has_alpha_channel) {
      const std::size_t without = views[i].has_alpha_channel ? 0 : i;
      throw std::runtime_error(list.frames[without].where +
                               ": neither alpha channel nor mask, while other frames have one");
    }
    dataset.has_alpha = dataset.has_alpha || views[i].has_transparency;
    dataset.has_masks = dataset.has_masks || !list.frames[i].mask.empty();
    dataset.views.push_back(views[i].view);
  }
  if (dataset.has_masks) requireMasksFit(list, dataset.views);
  if (!dataset.has_alpha && !dataset.has_box && !dataset.points.empty()) useBoxOfPoints(&dataset);
  return dataset;
}

}  // namespace nerf_pose_refiner
