// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/dataset_writer.h"

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "files/atomic_file.h"
#include "files/sync.h"
#include "image/io.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kMaxNames = 1000;  // that are tried until one is free

std::string imageName(int view) {
  char name[32];
  std::snprintf(name, sizeof name, "view_%04d.png", view);
  return name;
}

/// Camera-to-world with OpenGL axes (x right, y up, z back): what loadDataset turns back.
Json matrixJson(const Pose& T_O_C) {
  const Eigen::Vector3d opengl_from_optical(1, -1, -1);
  const Eigen::Matrix3d R = T_O_C.R * opengl_from_optical.asDiagonal();
  Json rows = Json::array();
  for (int r = 0; r < 3; ++r) rows.push_back({R(r, 0), R(r, 1), R(r, 2), T_O_C.t[r]});
  rows.push_back({0, 0, 0, 1});
  return rows;
}

Json cornerJson(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

/// Intrinsics as a file or a frame has them: the principal point counted from the image's corner.
Json cameraJson(const Camera& camera) {
  return {{"w", camera.width}, {"h", camera.height},    {"fl_x", camera.fx},
          {"fl_y", camera.fy}, {"cx", camera.cx + 0.5}, {"cy", camera.cy + 0.5}};
}

void addDistortion(const Distortion& distortion, Json* document) {
  const bool fisheye = distortion.model == Distortion::Model::kFisheye;
  (*document)["camera_model"] = fisheye ? "OPENCV_FISHEYE" : "OPENCV";
  const std::vector<const char*> names =
      fisheye ? std::vector<const char*>{"k1", "k2", "k3", "k4"}
              : std::vector<const char*>{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  const std::vector<double>& coefficients = distortion.coefficients;
  for (std::size_t i = 0; i < coefficients.size(); ++i) (*document)[names.at(i)] = coefficients[i];
}

}  // namespace

DatasetWriter::DatasetWriter(const std::string& folder, const DatasetHeader& header)
    : header_(header) {
  header.camera.validate();
  if (header.has_box && !(header.box_min.array() < header.box_max.array()).all()) {
    throw std::invalid_argument("the box of the dataset is empty");
  }
  const fs::path wanted = fs::absolute(folder).lexically_normal();
  folder_ = wanted.string();
  if (fs::exists(fs::symlink_status(wanted))) {
    throw std::runtime_error("'" + folder_ + "' is there already");
  }
  const fs::path hidden = wanted.parent_path() / ("." + wanted.filename().string() + ".unfinished");
  lock_.emplace(hidden.string());
  hidden_ = hidden.string();
  for (const fs::directory_entry& left : fs::directory_iterator(hidden)) fs::remove_all(left);
}

DatasetWriter::~DatasetWriter() {
  std::error_code ignored;
  if (!hidden_.empty()) fs::remove_all(hidden_, ignored);
}

void DatasetWriter::add(const Image8& image, const Pose& T_O_C) {
  add(image, T_O_C, header_.camera);
}

void DatasetWriter::add(const Image8& image, const Pose& T_O_C, const Camera& camera) {
  if (hidden_.empty()) throw std::runtime_error("'" + folder_ + "' is finished");
  camera.validate();
  if (!(camera == header_.camera) && !header_.distortion.isZero()) {
    throw std::invalid_argument(
        "a camera of its own and a lens with distortion do not go together");
  }
  if (image.width != camera.width || image.height != camera.height ||
      (image.channels != 3 && image.channels != 4)) {
    throw std::invalid_argument("the image does not have the camera's size");
  }
  if (!T_O_C.isFinite() || !T_O_C.isRigid()) {
    throw std::invalid_argument("the camera's pose is not a rigid transform");
  }
  const std::string path = hidden_ + "/" + imageName(views());
  try {
    writePng(image, path);
  } catch (const std::exception&) {
    std::error_code ignored;
    fs::remove(path, ignored);
    throw;
  }
  views_.push_back({T_O_C, camera});
}

std::string DatasetWriter::json() const {
  Json document = cameraJson(header_.camera);
  addDistortion(header_.distortion, &document);
  if (header_.metres_per_unit > 0) document["metres_per_unit"] = header_.metres_per_unit;
  if (header_.has_box)
    document["aabb"] = {cornerJson(header_.box_min), cornerJson(header_.box_max)};
  for (int view = 0; view < views(); ++view) {
    const auto& [T_O_C, camera] = views_[view];
    Json frame = camera == header_.camera ? Json::object() : cameraJson(camera);
    frame["file_path"] = imageName(view);
    frame["transform_matrix"] = matrixJson(T_O_C);
    document["frames"].push_back(std::move(frame));
  }
  return document.dump(1) + "\n";
}

void DatasetWriter::writeJson() const {
  const std::string text = json();
  AtomicFile file(hidden_ + "/transforms.json");
  file.write(text.data(), text.size());
  file.commit();
}

/// Renames the hidden folder. (A name that is taken is an error, unless an empty folder bears it.)
std::string DatasetWriter::publish() const {
  std::error_code error;
  for (int i = 1; i <= kMaxNames; ++i) {
    const std::string name = i == 1 ? folder_ : folder_ + "_" + std::to_string(i);
    fs::rename(hidden_, name, error);
    if (!error) return name;
    if (!fs::exists(fs::symlink_status(name))) break;
  }
  throw std::runtime_error("cannot make '" + folder_ + "': " + error.message());
}

std::string DatasetWriter::finish() {
  if (hidden_.empty()) throw std::runtime_error("'" + folder_ + "' is finished");
  if (views_.empty()) throw std::runtime_error("'" + folder_ + "': there are no views");
  for (int view = 0; view < views(); ++view) syncFile(hidden_ + "/" + imageName(view));
  writeJson();
  const std::string name = publish();
  syncFolder(fs::path(name).parent_path().string());
  hidden_.clear();
  lock_.reset();
  return name;
}

}  // namespace nerf_pose_refiner
