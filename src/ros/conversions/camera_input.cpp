// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/camera_input.h"

#include <image_geometry/pinhole_camera_model.h>
#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "concurrency/shared_values.h"
#include "image/colour.h"
#include "ros/conversions/depth_input.h"
#include "ros/conversions/pose_conversions.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {
namespace {

namespace encodings = sensor_msgs::image_encodings;

std::string sizeText(std::size_t width, std::size_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

std::shared_ptr<const Undistorter> sharedUndistorter(const CameraModel& model) {
  static SharedValues<CameraModel, Undistorter> undistorters;
  return undistorters.get(
      model, [&] { return std::make_shared<const Undistorter>(model.camera, model.distortion); });
}

/// What to do with an encoding that is not read here.
std::string adviceFor(const std::string& encoding) {
  if (encodings::isBayer(encoding)) {
    return "a Bayer pattern: the nodelet image_proc/debayer makes colours of it (image_color)";
  }
  if (encoding == encodings::YUV422 || encoding == "yuv422_yuy2") {
    return "YUV: the nodelet image_proc/debayer makes colours of it (image_color)";
  }
  const bool is_colour = encodings::isMono(encoding) || encodings::isColor(encoding);
  if (is_colour && encoding.find("16") != std::string::npos) {
    return "of 16 bits: let the camera's driver send 8, for image_proc has no node for that";
  }
  if (encoding == encodings::TYPE_16UC1 || encoding == encodings::TYPE_32FC1) {
    return "that of a depth image: listen to the colour image";
  }
  return "not one of rgb8, bgr8, rgba8, bgra8 and mono8";
}

void requireData(const char* what, const sensor_msgs::Image& image, TrackReason reason) {
  const std::size_t row_bytes =
      std::size_t{image.width} * static_cast<std::size_t>(encodings::numChannels(image.encoding));
  if (image.step < row_bytes || image.data.size() != std::size_t{image.step} * image.height) {
    throw InputError(reason,
                     std::string("the size of the ") + what + " and of its data do not match");
  }
}

PixelFormat formatOf(const std::string& encoding) {
  if (encoding == encodings::MONO8) return PixelFormat::kGrey;
  if (encoding == encodings::BGR8) return PixelFormat::kBgr;
  if (encoding == encodings::RGBA8) return PixelFormat::kRgba;
  if (encoding == encodings::BGRA8) return PixelFormat::kBgra;
  return PixelFormat::kRgb;
}

Image8View bytesOf(const sensor_msgs::Image& image) {
  return {image.data.data(), static_cast<int>(image.width), static_cast<int>(image.height),
          encodings::numChannels(image.encoding), image.step};
}

/// The pixels of a message, the same ones for all who have it.
std::shared_ptr<const CameraPixels> sharedPixels(
    const sensor_msgs::ImageConstPtr& image,
    const std::shared_ptr<const Undistorter>& undistorter) {
  // The pixels keep the message and the undistorter alive, so their addresses are not reused. (The
  // stamp tells a driver that fills one message again and again, which it must not.)
  using Key = std::tuple<const sensor_msgs::Image*, ros::Time, const Undistorter*>;
  static SharedValues<Key, CameraPixels> pixels;
  return pixels.get({image.get(), image->header.stamp, undistorter.get()}, [&] {
    return std::make_shared<const CameraPixels>(
        bytesOf(*image), formatOf(image->encoding),
        std::shared_ptr<const void>(image.get(), [image](const void*) {}), undistorter);
  });
}

/// The distortion of a raw image. If D is zero there is none, whatever the model, as for
/// image_proc.
Distortion readDistortion(const sensor_msgs::CameraInfo& info) {
  namespace models = sensor_msgs::distortion_models;
  const auto is_zero = [](double d) { return d == 0; };
  if (std::all_of(info.D.begin(), info.D.end(), is_zero)) return {};
  const bool fisheye = info.distortion_model == "equidistant";  // first releases lack the constant
  if (!fisheye && info.distortion_model != models::PLUMB_BOB &&
      info.distortion_model != models::RATIONAL_POLYNOMIAL) {
    throw InputError(TrackReason::kBadCameraInfo,
                     "the distortion model '" + info.distortion_model +
                         "' is not supported: let the nodelet image_proc/rectify take it out, "
                         "listen to its image_rect_color and set ~image_is_rectified");
  }
  const std::size_t n = info.D.size();
  const bool right_count = fisheye ? n == 4 : n == 4 || n == 5 || n == 8;
  const auto is_finite = [](double d) { return std::isfinite(d); };
  if (!right_count || !std::all_of(info.D.begin(), info.D.end(), is_finite)) {
    throw InputError(TrackReason::kBadCameraInfo,
                     std::string("D of camera_info must hold ") + (fisheye ? "4" : "4, 5 or 8") +
                         " finite numbers, and has " + std::to_string(n) + " numbers");
  }
  return {info.D, fisheye ? Distortion::Model::kFisheye : Distortion::Model::kPolynomial};
}

/// A field of view of 0.06 to 179.9 degrees: beyond that, the calibration is wrong.
void requirePlausible(const Camera& camera) {
  constexpr double kMax = 1000;  // of the focal length, in widths of the image; and of its inverse
  const double width = std::max(camera.width, camera.height);
  const auto [low, high] = std::minmax(camera.fx, camera.fy);
  if (low * kMax >= width && high <= kMax * width) return;
  throw InputError(TrackReason::kBadCameraInfo,
                   "the focal length of camera_info, " + std::to_string(camera.fx) + " x " +
                       std::to_string(camera.fy) + " px, does not suit an image of " +
                       sizeText(camera.width, camera.height) + " px");
}

/// Binning and region of interest (REP-104) are image_geometry's work.
CameraModel readGeometry(const sensor_msgs::CameraInfo& info, bool rectified) {
  image_geometry::PinholeCameraModel geometry;
  geometry.fromCameraInfo(info);
  const cv::Size size = geometry.reducedResolution();
  CameraModel model;
  if (rectified) {
    model.camera = {size.width,    size.height,   geometry.fx(),
                    geometry.fy(), geometry.cx(), geometry.cy()};
  } else {
    const cv::Matx33d& K = geometry.intrinsicMatrix();
    model.camera = {size.width, size.height, K(0, 0), K(1, 1), K(0, 2), K(1, 2)};
    model.distortion = readDistortion(info);
  }
  model.camera.validate();
  requirePlausible(model.camera);
  return model;
}

/// A box, cut to its image; nothing: it lies beside that.
std::optional<ImageBox> cutTo(const Camera& camera, const ImageBox& box) {
  const ImageBox inside = {std::max(box.x_min, -0.5), std::max(box.y_min, -0.5),
                           std::min(box.x_max, camera.width - 0.5),
                           std::min(box.y_max, camera.height - 0.5)};
  if (!(inside.x_min < inside.x_max && inside.y_min < inside.y_max)) return std::nullopt;
  return inside;
}

/// Where the pixels of a distorted image that a box touches are in the undistorted one; nothing:
/// beside it. @param box inside the image.
std::optional<ImageBox> undistorted(const ImageBox& box, const Undistorter& undistorter) {
  const auto first = [](double edge) { return static_cast<int>(std::floor(edge + 0.5)); };
  const auto last = [](double edge) { return static_cast<int>(std::ceil(edge + 0.5)); };
  const cv::Rect touched(cv::Point(first(box.x_min), first(box.y_min)),
                         cv::Point(last(box.x_max), last(box.y_max)));
  const Camera& camera = undistorter.camera();
  Image8 bytes(camera.width, camera.height, 1);
  cv::Mat(bytes.height, bytes.width, CV_8UC1, bytes.values.data())(touched) = 255;
  Image8 moved = undistorter.undistort(bytes);
  const cv::Mat values(moved.height, moved.width, CV_8UC1, moved.values.data());
  const cv::Rect seen = cv::boundingRect(values > 127);
  if (seen.empty()) return std::nullopt;
  return ImageBox{seen.x - 0.5, seen.y - 0.5, seen.br().x - 0.5, seen.br().y - 0.5};
}

}  // namespace

CameraModel cameraFromMessage(const sensor_msgs::CameraInfo& info, bool rectified) {
  if (!((rectified ? info.P[0] : info.K[0]) > 0)) {
    throw InputError(TrackReason::kUncalibrated, std::string("the camera is not calibrated (") +
                                                     (rectified ? "P" : "K") +
                                                     "[0] of camera_info is not positive)");
  }
  if (rectified && info.P[3] != 0) {
    throw InputError(TrackReason::kBadCameraInfo,
                     "the right camera of a stereo pair is not supported: use the left one");
  }
  try {
    return readGeometry(info, rectified);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& e) {  // also of OpenCV, which image_geometry lets through
    throw InputError(TrackReason::kBadCameraInfo, std::string("camera_info: ") + e.what());
  }
}

void requireStampAndFrame(const sensor_msgs::Image& image) {
  if (image.header.stamp.isZero() || withoutSlash(image.header.frame_id).empty()) {
    throw InputError(TrackReason::kBadImage, "the image has no stamp or no frame");
  }
}

void checkImage(const sensor_msgs::Image& image, const Camera& camera) {
  requireStampAndFrame(image);
  const auto known = {encodings::RGB8, encodings::BGR8, encodings::RGBA8, encodings::BGRA8,
                      encodings::MONO8};
  if (std::find(known.begin(), known.end(), image.encoding) == known.end()) {
    throw InputError(TrackReason::kBadImage,
                     "the encoding '" + image.encoding + "' is " + adviceFor(image.encoding));
  }
  requireData("image", image, TrackReason::kBadImage);
  if (static_cast<int>(image.width) != camera.width ||
      static_cast<int>(image.height) != camera.height) {
    throw InputError(TrackReason::kBadCameraInfo,
                     "the image is " + sizeText(image.width, image.height) +
                         " but camera_info is for " + sizeText(camera.width, camera.height));
  }
}

Image8 rgbPixels(const sensor_msgs::Image& image) {
  const CameraPixels pixels(bytesOf(image), formatOf(image.encoding), nullptr);
  return pixels.read({0, 0, pixels.width(), pixels.height()});
}

Image8 maskPixels(const char* what, const sensor_msgs::Image& mask, const Camera& camera) {
  if (mask.encoding != encodings::MONO8 && mask.encoding != encodings::TYPE_8UC1) {
    throw InputError(TrackReason::kBadMask, std::string("the encoding of the ") + what + " is '" +
                                                mask.encoding + "', not mono8");
  }
  requireData(what, mask, TrackReason::kBadMask);
  if (static_cast<int>(mask.width) != camera.width ||
      static_cast<int>(mask.height) != camera.height) {
    throw InputError(TrackReason::kBadMask,
                     std::string("the ") + what + " is " + sizeText(mask.width, mask.height) +
                         " but the image is " + sizeText(camera.width, camera.height));
  }
  Image8 bytes(camera.width, camera.height, 1);
  for (int y = 0; y < bytes.height; ++y) {
    const std::uint8_t* row = mask.data.data() + std::size_t{mask.step} * y;
    std::transform(row, row + bytes.width, bytes.pixel(0, y),
                   [](std::uint8_t value) { return static_cast<std::uint8_t>(value ? 255 : 0); });
  }
  return bytes;
}

sensor_msgs::CameraInfo toMessage(const Camera& camera) {
  sensor_msgs::CameraInfo info;
  info.width = camera.width;
  info.height = camera.height;
  info.distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  info.D.assign(5, 0.0);
  info.K = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  return info;
}

void CameraInput::makeUndistorter(const CameraModel& model) {
  if (undistorter_ != nullptr && model == model_) return;
  undistorter_.reset();
  try {
    auto undistorter = sharedUndistorter(model);
    requirePlausible(undistorter->camera());
    undistorter_ = std::move(undistorter);
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& e) {
    throw InputError(TrackReason::kBadCameraInfo, std::string("camera_info: ") + e.what());
  }
  model_ = model;
}

Observation CameraInput::observe(const sensor_msgs::ImageConstPtr& image,
                                 const sensor_msgs::CameraInfo& info, const ImageMasks& masks) {
  if (depth_ && isDepthImage(*image)) {
    requireStampAndFrame(*image);
    return nerf_pose_refiner::observe(depthFromMessage(image, info, Pose(), *depth_));
  }
  const CameraModel model = cameraFromMessage(info, rectified_);
  checkImage(*image, model.camera);
  makeUndistorter(model);
  const Undistorter& undistorter = *undistorter_;
  Observation observation;
  observation.pixels = last_ = sharedPixels(image, undistorter_);
  observation.camera = undistorter.camera();
  for (const ImageBox& box : masks.boxes) {
    std::optional<ImageBox> there = cutTo(model.camera, box);
    if (there && !model.distortion.isZero()) there = undistorted(*there, undistorter);
    if (there) observation.boxes.push_back(*there);
  }
  if (masks.object) {
    observation.background = Background::kMask;
    observation.alpha =
        toFloat(undistorter.undistort(maskPixels("mask", *masks.object, model.camera)));
  }
  if (masks.ignored) {
    const Image8 ignored =
        undistorter.undistort(maskPixels("ignore_mask", *masks.ignored, model.camera));
    observation.weight = Image(ignored.width, ignored.height, 1);
    // A pixel that is interpolated from one to be ignored shows some of what is there.
    std::transform(ignored.values.begin(), ignored.values.end(), observation.weight.values.begin(),
                   [](std::uint8_t value) { return value ? 0.0f : 1.0f; });
  }
  return observation;
}

}  // namespace nerf_pose_refiner
