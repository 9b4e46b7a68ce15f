// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/transforms_json.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "dataset/json_values.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kRigidTolerance = 1e-3;

/// Looks a key up in the frame, then in the file.
class Lookup {
 public:
  Lookup(const Json& file, const Json& frame, const std::string& where)
      : file_(file), frame_(frame), where_(where) {}

  const Json* find(const char* key) const {
    for (const Json* object : {&frame_, &file_}) {
      const auto entry = object->find(key);
      if (entry != object->end()) return &*entry;
    }
    return nullptr;
  }

  std::optional<double> number(const char* key) const {
    const Json* value = find(key);
    if (value == nullptr) return std::nullopt;
    return finiteNumber(*value, key, where_);
  }

  std::optional<double> positive(const char* key) const {
    const std::optional<double> value = number(key);
    if (value && *value <= 0) failAt(where_, std::string(key) + " is not positive");
    return value;
  }

  std::optional<double> fieldOfView(const char* key) const {
    const std::optional<double> value = positive(key);
    if (value && *value >= kPi) failAt(where_, std::string(key) + " is not below pi");
    return value;
  }

  Distortion distortion() const {
    const bool fisheye = isFisheye();
    Distortion result;
    if (fisheye) result.model = Distortion::Model::kFisheye;
    const std::vector<const char*> keys =
        fisheye ? std::vector<const char*>{"k1", "k2", "k3", "k4"}
                : std::vector<const char*>{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
    const Json* list = find("distortion_params");  // nerfstudio's other form: k1 k2 k3 k4 p1 p2
    for (const char* key : keys) {
      const std::optional<double> value = number(key);
      result.coefficients.push_back(value || list == nullptr ? value.value_or(0)
                                                             : fromList(*list, key));
    }
    if (result.isZero()) result.coefficients.clear();
    return result;
  }

 private:
  /// Lenses that are not known must not pass for pinholes.
  bool isFisheye() const {
    const Json* model = find("camera_model");
    if (model != nullptr && *model == "OPENCV_FISHEYE") return true;
    if (model != nullptr) {
      bool known = false;
      for (const char* name :
           {"PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"}) {
        known = known || *model == name;
      }
      if (!known) failAt(where_, "the camera model " + shortText(*model) + " is not supported");
    }
    const Json* fisheye = find("is_fisheye");  // instant-ngp's key
    return fisheye != nullptr && *fisheye == true;
  }

  double fromList(const Json& list, const std::string& key) const {
    const std::vector<std::string> names = {"k1", "k2", "k3", "k4", "p1", "p2"};
    if (!list.is_array() || list.size() != names.size()) {
      failAt(where_, "distortion_params is not a list of 6 numbers");
    }
    const auto name = std::find(names.begin(), names.end(), key);
    if (name == names.end()) return 0;
    return finiteNumber(list[static_cast<std::size_t>(name - names.begin())], "distortion_params",
                        where_);
  }

  const Json& file_;
  const Json& frame_;
  const std::string& where_;
};

/// A rigid transform of 3 or 4 rows, nearly so in the file.
Pose readRigid(const Json& matrix, const std::string& name, const std::string& where) {
  const bool shaped = matrix.is_array() && (matrix.size() == 3 || matrix.size() == 4);
  if (!shaped) failAt(where, name + " does not have 4 rows");
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  for (std::size_t r = 0; r < matrix.size(); ++r) {
    const Json& row = matrix[r];
    if (!row.is_array() || row.size() != 4) {
      failAt(where, "row " + std::to_string(r) + " of " + name + " does not have 4 numbers");
    }
    for (std::size_t c = 0; c < 4; ++c) {
      T(r, c) = finiteNumber(
          row[c], name + "[" + std::to_string(r) + "][" + std::to_string(c) + "]", where);
    }
  }
  if (!T.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), kRigidTolerance)) {
    failAt(where, name + " is not rigid");
  }
  return {rotationOf(T.topLeftCorner<3, 3>(), name, where), T.topRightCorner<3, 1>()};
}

/// T_O_C of a camera-to-world matrix with OpenGL axes (x right, y up, z back).
Pose readPose(const Json& frame, const std::string& where) {
  const auto matrix = frame.find("transform_matrix");
  if (matrix == frame.end()) failAt(where, "transform_matrix is missing");
  return withOpticalAxes(readRigid(*matrix, "transform_matrix", where));
}

std::string readPath(const Json& object, const char* key, const std::string& where) {
  const auto entry = object.find(key);
  if (entry == object.end()) failAt(where, std::string(key) + " is missing");
  if (!entry->is_string() || entry->get_ref<const std::string&>().empty()) {
    failAt(where, std::string(key) + " is not a path");
  }
  return *entry;
}

FrameEntry readFrame(const Json& file, const Json& json, const std::string& path,
                     std::size_t index) {
  FrameEntry frame;
  frame.where = "'" + path + "', frame " + std::to_string(index);
  if (!json.is_object()) failAt(frame.where, "not an object");
  frame.image = readPath(json, "file_path", frame.where);
  frame.where += " ('" + frame.image + "')";
  if (json.contains("mask_path")) frame.mask = readPath(json, "mask_path", frame.where);
  frame.T_O_C = readPose(json, frame.where);

  const Lookup lookup(file, json, frame.where);
  frame.width = lookup.positive("w");
  frame.height = lookup.positive("h");
  frame.fl_x = lookup.positive("fl_x");
  frame.fl_y = lookup.positive("fl_y");
  frame.cx = lookup.number("cx");
  frame.cy = lookup.number("cy");
  frame.camera_angle_x = lookup.fieldOfView("camera_angle_x");
  frame.camera_angle_y = lookup.fieldOfView("camera_angle_y");
  frame.distortion = lookup.distortion();
  if (!frame.fl_x && !frame.camera_angle_x) {
    failAt(frame.where, "neither fl_x nor camera_angle_x is given");
  }
  if (!frame.fl_x && frame.distortion.model == Distortion::Model::kFisheye) {
    failAt(frame.where, "a fisheye lens needs fl_x: its angle of view does not give it");
  }
  return frame;
}

Eigen::Vector3d readCorner(const Json& box, std::size_t i, const std::string& where) {
  if (!box[i].is_array() || box[i].size() != 3) failAt(where, "a corner does not have 3 numbers");
  Eigen::Vector3d corner;
  for (std::size_t c = 0; c < 3; ++c) corner[c] = finiteNumber(box[i][c], "a coordinate", where);
  return corner;
}

void readBox(const Json& json, const std::string& path, FrameList* list) {
  for (const char* key : {"object_aabb", "aabb"}) {
    const auto box = json.find(key);
    if (box == json.end()) continue;
    const std::string where = "'" + path + "', " + key;
    if (!box->is_array() || box->size() != 2) failAt(where, "not [[min], [max]]");
    list->box_min = readCorner(*box, 0, where);
    list->box_max = readCorner(*box, 1, where);
    if (!(list->box_min.array() < list->box_max.array()).all()) failAt(where, "the box is empty");
    list->has_box = true;
    return;
  }
}

std::set<std::string> namesIn(const Json& json, const char* key, const std::string& where) {
  std::set<std::string> names;
  const auto entry = json.find(key);
  if (entry == json.end()) return names;
  if (!entry->is_array()) failAt(where, std::string(key) + " is not a list");
  for (const Json& name : *entry) {
    if (!name.is_string()) failAt(where, std::string(key) + " does not hold names");
    names.insert(fs::path(name.get_ref<const std::string&>()).lexically_normal().string());
  }
  return names;
}

/// Leaves out what nerfstudio's lists keep for validation and tests.
void keepTrainingFrames(const Json& json, const std::string& where, FrameList* list) {
  std::set<std::string> training = namesIn(json, "train_filenames", where);
  const bool has_training = json.contains("train_filenames");
  std::set<std::string> other = namesIn(json, "val_filenames", where);
  other.merge(namesIn(json, "test_filenames", where));
  std::vector<FrameEntry> kept;
  for (FrameEntry& frame : list->frames) {
    const std::string name = fs::path(frame.image).lexically_normal().string();
    if (has_training ? training.erase(name) == 1 : other.count(name) == 0) {
      kept.push_back(std::move(frame));
    }
  }
  if (!training.empty()) {
    failAt(where, "train_filenames lists '" + *training.begin() + "', which no frame has");
  }
  if (kept.empty()) failAt(where, "its lists leave no frame for training");
  if (kept.size() < list->frames.size()) {
    list->notes.push_back(std::to_string(kept.size()) + " of " +
                          std::to_string(list->frames.size()) +
                          " frames are used: the others are for validation or tests, as '" +
                          list->folder + "' lists them.");
  }
  list->frames = std::move(kept);
}

/// What nerfstudio did to the poses before it wrote them: x_file = scale T_F_S x_source.
struct AppliedTransform {
  Pose T_F_S;
  double scale = 1;
};

AppliedTransform readAppliedTransform(const Json& json, const std::string& where) {
  AppliedTransform applied;
  if (json.contains("applied_scale")) {
    applied.scale = requiredPositive(json, "applied_scale", where);
  }
  if (json.contains("applied_transform")) {
    applied.T_F_S = readRigid(json.at("applied_transform"), "applied_transform", where);
  }
  return applied;
}

/// Takes frames, box and scale back to where they came from.
void undo(const AppliedTransform& applied, FrameList* list) {
  const Pose T_S_F = applied.T_F_S.inverse();
  const auto toSource = [&](const Eigen::Vector3d& x_F) {
    return Eigen::Vector3d(T_S_F * (x_F / applied.scale));
  };
  for (FrameEntry& frame : list->frames) {
    frame.T_O_C = {T_S_F.R * frame.T_O_C.R, toSource(frame.T_O_C.t)};
  }
  list->metres_per_unit *= applied.scale;
  if (!list->has_box) return;
  const Eigen::Vector3d min = list->box_min, max = list->box_max;
  list->box_min = list->box_max = toSource(min);
  for (int corner = 1; corner < 8; ++corner) {
    const Eigen::Vector3d x_F(corner & 1 ? max.x() : min.x(), corner & 2 ? max.y() : min.y(),
                              corner & 4 ? max.z() : min.z());
    list->box_min = list->box_min.cwiseMin(toSource(x_F));
    list->box_max = list->box_max.cwiseMax(toSource(x_F));
  }
}

}  // namespace

FrameList readTransformsJson(const DatasetFolder& folder, const std::string& name,
                             const DatasetLimits& limits) {
  const std::string path = folder.path(name);
  const std::string where = "'" + path + "'";
  const Json json =
      parseDatasetJson(folder.read(name, limits.json_bytes), "cannot read '" + path + "'");
  if (!json.is_object()) failAt(where, "not a transforms file: no object at the top");
  const auto frames = json.find("frames");
  if (frames == json.end() || !frames->is_array()) failAt(where, "'frames' is not a list");
  if (frames->empty()) failAt(where, "'frames' is empty");
  if (frames->size() > limits.frames) {
    failAt(where, std::to_string(frames->size()) + " frames, at most " +
                      std::to_string(limits.frames) + " are read");
  }

  FrameList list;
  list.folder = folder.path();
  for (std::size_t i = 0; i < frames->size(); ++i) {
    list.frames.push_back(readFrame(json, (*frames)[i], path, i));
  }
  keepTrainingFrames(json, where, &list);
  readBox(json, path, &list);
  if (json.contains("metres_per_unit")) {
    list.metres_per_unit = requiredPositive(json, "metres_per_unit", where);
  }
  const AppliedTransform applied = readAppliedTransform(json, where);
  if (json.contains("applied_scale") || json.contains("applied_transform")) undo(applied, &list);
  return list;
}

}  // namespace nerf_pose_refiner
