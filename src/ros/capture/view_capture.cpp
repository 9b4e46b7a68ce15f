// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/capture/view_capture.h"

#include <tf2/exceptions.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "dataset/path_below.h"
#include "image/sharpness.h"
#include "ros/conversions/pose_conversions.h"
#include "runtime/object_store.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::size_t kMaxWaiting = 30;  // images: a second's, whose TF is late

void readPoint(ParamReader* reader, const std::string& name, Eigen::Vector3d* point, bool* given) {
  const std::optional<std::vector<double>> numbers = reader->numbers(name);
  if (!numbers || numbers->empty()) return;
  if (numbers->size() != 3) throw std::invalid_argument("~" + name + " must hold x, y and z");
  *point = Eigen::Vector3d((*numbers)[0], (*numbers)[1], (*numbers)[2]);
  *given = true;
}

void require(bool holds, const std::string& text) {
  if (!holds) throw std::invalid_argument(text);
}

/// The image with the mask as its alpha.
Image8 withAlpha(const Image8& rgb, const Image8& mask) {
  Image8 rgba(rgb.width, rgb.height, 4);
  for (std::size_t i = 0; i < rgb.pixels(); ++i) {
    for (int c = 0; c < 3; ++c) rgba.values[4 * i + c] = rgb.values[3 * i + c];
    rgba.values[4 * i + 3] = mask.values[i];
  }
  return rgba;
}

bool sameCamera(const CameraModel& a, const CameraModel& b) {
  return a.camera == b.camera && a.distortion == b.distortion;
}

}  // namespace

CaptureParameters CaptureParameters::read(ParamReader* reader) {
  CaptureParameters p;
  reader->get("name", p.name);
  reader->get("dataset_root", p.dataset_root);
  reader->get("object_reference_frame", p.object_reference_frame);
  reader->get("use_masks", p.use_masks);
  bool has_min = false, has_max = false, has_centre = false;
  readPoint(reader, "box_min", &p.box_min, &has_min);
  readPoint(reader, "box_max", &p.box_max, &has_max);
  require(has_min == has_max, "~box_min and ~box_max: give both, or neither");
  p.has_box = has_min;
  Eigen::Vector3d centre;
  readPoint(reader, "object_centre", &centre, &has_centre);
  if (has_centre) p.object_centre = centre;
  reader->get("image_is_rectified", p.image_is_rectified);
  reader->get("image_transport", p.image_transport);
  reader->get("min_views", p.min_views);
  reader->get("max_views", p.max_views);
  reader->get("min_coverage", p.min_coverage);
  reader->get("tf_timeout_s", p.tf_timeout_s);
  reader->get("min_angle_deg", p.selection.min_angle_deg);
  reader->get("min_distance_m", p.selection.min_distance);
  reader->get("min_sharpness", p.selection.min_sharpness);
  reader->get("recent_images", p.selection.recent_images);
  reader->get("register_service", p.register_service);
  p.validate();
  return p;
}

void CaptureParameters::validate() const {
  requireObjectName(name);
  pathBelow(dataset_root, name);
  require(!object_reference_frame.empty(), "~object_reference_frame is not set");
  require(use_masks || has_box,
          "what of the images is the object? Set ~use_masks, or ~box_min and ~box_max");
  require(!has_box || (box_min.array() < box_max.array()).all(),
          "~box_max must be greater than ~box_min on every axis");
  require(min_views >= 1, "~min_views must be 1 or more");
  require(max_views == 0 || max_views >= min_views, "~max_views must be 0 or at least ~min_views");
  require(min_coverage >= 0 && min_coverage <= 1, "~min_coverage must be 0..1");
  require(tf_timeout_s >= 0, "~tf_timeout_s must be 0 or more");
  selection.validate();
}

Eigen::Vector3d CaptureParameters::centre() const {
  if (object_centre) return *object_centre;
  return has_box ? Eigen::Vector3d(0.5 * (box_min + box_max)) : Eigen::Vector3d::Zero();
}

ViewCapture::ViewCapture(const CaptureParameters& parameters, const tf2::BufferCore& transforms)
    : parameters_(parameters), transforms_(transforms) {
  parameters_.validate();
  counts_.dataset = parameters_.name;
}

void ViewCapture::start(const sensor_msgs::CameraInfo& info) {
  if (capturing()) throw std::runtime_error("a capture is under way: ~finish or ~abort it");
  camera_ = cameraFromMessage(info, parameters_.image_is_rectified);
  const std::string camera_frame = withoutSlash(info.header.frame_id);
  try {
    transforms_.lookupTransform(parameters_.object_reference_frame, camera_frame, ros::Time(0));
  } catch (const tf2::TransformException& e) {
    throw std::runtime_error("TF does not lead from ~object_reference_frame to the camera: " +
                             std::string(e.what()));
  }
  DatasetHeader header;
  header.camera = camera_.camera;
  header.distortion = camera_.distortion;
  header.has_box = parameters_.has_box;
  header.box_min = parameters_.box_min;
  header.box_max = parameters_.box_max;
  writer_ = std::make_unique<DatasetWriter>(pathBelow(parameters_.dataset_root, parameters_.name),
                                            header);
  selection_.emplace(parameters_.selection, parameters_.centre());
  counts_ = CaptureStatus();
  counts_.dataset = parameters_.name;
}

void ViewCapture::add(const CapturedImage& image) {
  if (!capturing()) return;
  ++counts_.images;
  waiting_.push_back(image);
  if (waiting_.size() <= kMaxWaiting) return;
  waiting_.pop_front();
  ++counts_.no_transform;
  counts_.message = "TF is late: images are left out";
}

ViewCapture::Lookup ViewCapture::lookUp(const CapturedImage& image, const ros::Time& now,
                                        Pose* T_O_C) {
  const std_msgs::Header& header = image.image->header;
  try {
    *T_O_C = fromMessage(transforms_
                             .lookupTransform(parameters_.object_reference_frame,
                                              withoutSlash(header.frame_id), header.stamp)
                             .transform);
    return Lookup::kFound;
  } catch (const std::exception& e) {  // tf2's, or of a stamp too far off for its differences
    // Numbers: a difference of times throws where a stamp is far off.
    const double age_s = now.toSec() - header.stamp.toSec();
    if (age_s >= 0 && age_s < parameters_.tf_timeout_s) return Lookup::kWait;
    counts_.message = e.what();
    return Lookup::kNever;
  }
}

bool ViewCapture::process(const ros::Time& now) {
  while (capturing() && !waiting_.empty()) {
    Pose T_O_C;
    const Lookup lookup = lookUp(waiting_.front(), now, &T_O_C);
    if (lookup == Lookup::kWait) break;
    const CapturedImage image = waiting_.front();
    waiting_.pop_front();
    if (lookup == Lookup::kNever) {
      ++counts_.no_transform;
      continue;
    }
    try {
      judge(image, T_O_C);
    } catch (const std::exception& e) {  // of a message, or a full disk: the others are kept
      ++counts_.refused;
      counts_.message = e.what();
    }
  }
  return capturing() && parameters_.max_views > 0 && selection_->kept() >= parameters_.max_views &&
         incompleteness().empty();
}

void ViewCapture::judge(const CapturedImage& image, const Pose& T_O_C) {
  const CameraModel camera = cameraFromMessage(*image.info, parameters_.image_is_rectified);
  if (!sameCamera(camera, camera_)) throw std::invalid_argument("camera_info has changed");
  checkImage(*image.image, camera_.camera);
  const Image8 rgb = rgbPixels(*image.image);
  switch (selection_->judge(T_O_C, sharpness(rgb))) {
    case ViewDecision::kBlurred:
      ++counts_.blurred;
      return;
    case ViewDecision::kTooNear:
      ++counts_.too_near;
      return;
    case ViewDecision::kKeep:
      break;
  }
  const bool full = parameters_.max_views > 0 && selection_->kept() >= parameters_.max_views;
  if (full && !selection_->coverage().adds(selection_->directionOf(T_O_C))) {
    ++counts_.too_near;  // only directions without a view are wanted now
    return;
  }
  if (!parameters_.use_masks) {
    writer_->add(rgb, T_O_C);
  } else {
    if (!image.mask) throw std::invalid_argument("an image has no mask");
    const Image8 mask = maskPixels("mask", *image.mask, camera_.camera);
    const auto shown = std::count(mask.values.begin(), mask.values.end(), 255);
    if (shown == 0) throw std::invalid_argument("a mask is empty");
    writer_->add(withAlpha(rgb, mask), T_O_C);
  }
  selection_->keep(T_O_C);
}

std::string ViewCapture::incompleteness() const {
  if (selection_->kept() < parameters_.min_views) {
    return std::to_string(selection_->kept()) + " views, " + std::to_string(parameters_.min_views) +
           " are needed (~min_views)";
  }
  const Coverage& coverage = selection_->coverage();
  if (coverage.fraction() >= parameters_.min_coverage) return "";
  std::string text = "too one-sided (~min_coverage): no view from";
  for (const std::string& name : coverage.missing()) text += " " + name;
  return text + " of " + parameters_.object_reference_frame;
}

void ViewCapture::finish() {
  if (!capturing()) throw std::runtime_error("nothing is captured: call ~start");
  const std::string problem = incompleteness();
  if (!problem.empty()) throw std::runtime_error(problem);
  const std::string folder = writer_->finish();
  counts_ = status();
  counts_.dataset = std::filesystem::path(folder).filename().string();
  if (counts_.dataset != parameters_.name) {
    counts_.message = "written as '" + counts_.dataset + "': '" + parameters_.name + "' appeared";
  }
  writer_.reset();
  waiting_.clear();
}

void ViewCapture::abort() {
  if (writer_) counts_ = status();
  writer_.reset();
  waiting_.clear();
}

CaptureStatus ViewCapture::status() const {
  CaptureStatus status = counts_;
  if (capturing()) {
    status.views = static_cast<std::uint32_t>(selection_->kept());
    status.coverage = static_cast<float>(selection_->coverage().fraction());
    status.missing = selection_->coverage().missing();
  }
  return status;
}

}  // namespace nerf_pose_refiner
