// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/transforms_json.h"

#include <cmath>
#include <cstring>
#include <stdexcept>

#include "files/input_file.h"
#include "files/json.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

constexpr double kPi = 3.14159265358979323846;
constexpr double kRigidTolerance = 1e-3;

[[noreturn]] void fail(const std::string& where, const std::string& what) {
  throw std::runtime_error(where + ": " + what);
}

/// Python writes NaN and Infinity, which JSON does not know. They become null, so that the message
/// can name the frame and not just a line.
std::string withNullForNan(const std::string& text) {
  std::string result;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '"') in_string = !in_string;
    if (in_string) {
      if (text[i] == '\\' && i + 1 < text.size()) result += text[i++];
      result += text[i];
      continue;
    }
    std::size_t skipped = 0;
    for (const char* word : {"NaN", "-Infinity", "Infinity"}) {
      if (skipped == 0 && text.compare(i, std::strlen(word), word) == 0) {
        skipped = std::strlen(word);
      }
    }
    if (skipped == 0) {
      result += text[i];
    } else {
      result += "null";
      i += skipped - 1;
    }
  }
  return result;
}

/// A value as messages quote it.
std::string shortText(const Json& value) {
  return value.is_string() ? value.dump().substr(0, 100) : std::string(value.type_name());
}

double finiteNumber(const Json& value, const std::string& name, const std::string& where) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!std::isfinite(number)) fail(where, name + " is not a finite number");
  return number;
}

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
    if (value && *value <= 0) fail(where_, std::string(key) + " is not positive");
    return value;
  }

  std::optional<double> fieldOfView(const char* key) const {
    const std::optional<double> value = positive(key);
    if (value && *value >= kPi) fail(where_, std::string(key) + " is not below pi");
    return value;
  }

  Distortion distortion() const {
    Distortion result;
    for (const char* key : {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}) {
      result.coefficients.push_back(number(key).value_or(0));
    }
    if (result.isZero()) result.coefficients.clear();
    return result;
  }

  /// Lenses that are not pinholes with OpenCV's distortion must not pass for such.
  void checkCameraModel() const {
    const Json* model = find("camera_model");
    if (model != nullptr) {
      bool known = false;
      for (const char* name :
           {"PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"}) {
        known = known || *model == name;
      }
      if (!known) fail(where_, "the camera model " + shortText(*model) + " is not supported");
    }
    const Json* fisheye = find("is_fisheye");
    if (fisheye != nullptr && *fisheye == true) fail(where_, "fisheye cameras are not supported");
  }

 private:
  const Json& file_;
  const Json& frame_;
  const std::string& where_;
};

/// T_O_C of a camera-to-world matrix with OpenGL axes (x right, y up, z back).
Pose readPose(const Json& frame, const std::string& where) {
  const auto matrix = frame.find("transform_matrix");
  if (matrix == frame.end()) fail(where, "transform_matrix is missing");
  const bool shaped = matrix->is_array() && (matrix->size() == 3 || matrix->size() == 4);
  if (!shaped) fail(where, "transform_matrix does not have 4 rows");
  Eigen::Matrix4d c2w = Eigen::Matrix4d::Identity();
  for (std::size_t r = 0; r < matrix->size(); ++r) {
    const Json& row = (*matrix)[r];
    if (!row.is_array() || row.size() != 4) {
      fail(where, "row " + std::to_string(r) + " of transform_matrix does not have 4 numbers");
    }
    for (std::size_t c = 0; c < 4; ++c) {
      const std::string name =
          "transform_matrix[" + std::to_string(r) + "][" + std::to_string(c) + "]";
      c2w(r, c) = finiteNumber(row[c], name, where);
    }
  }
  const Pose pose(c2w.topLeftCorner<3, 3>(), c2w.topRightCorner<3, 1>());
  const bool last_row = c2w.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), kRigidTolerance);
  if (!pose.isRigid(kRigidTolerance) || !last_row) fail(where, "transform_matrix is not rigid");
  const Eigen::Vector3d optical_from_opengl(1, -1, -1);
  return {nearestRotation(pose.R) * optical_from_opengl.asDiagonal(), pose.t};
}

std::string readPath(const Json& object, const char* key, const std::string& where) {
  const auto entry = object.find(key);
  if (entry == object.end()) fail(where, std::string(key) + " is missing");
  if (!entry->is_string() || entry->get_ref<const std::string&>().empty()) {
    fail(where, std::string(key) + " is not a path");
  }
  return *entry;
}

TransformsFrame readFrame(const Json& file, const Json& json, const std::string& path,
                          std::size_t index) {
  TransformsFrame frame;
  frame.where = "'" + path + "', frame " + std::to_string(index);
  if (!json.is_object()) fail(frame.where, "not an object");
  frame.file_path = readPath(json, "file_path", frame.where);
  frame.where += " ('" + frame.file_path + "')";
  if (json.contains("mask_path")) frame.mask_path = readPath(json, "mask_path", frame.where);
  frame.T_O_C = readPose(json, frame.where);

  const Lookup lookup(file, json, frame.where);
  lookup.checkCameraModel();
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
    fail(frame.where, "neither fl_x nor camera_angle_x is given");
  }
  return frame;
}

Eigen::Vector3d readCorner(const Json& box, std::size_t i, const std::string& where) {
  if (!box[i].is_array() || box[i].size() != 3) fail(where, "a corner does not have 3 numbers");
  Eigen::Vector3d corner;
  for (std::size_t c = 0; c < 3; ++c) corner[c] = finiteNumber(box[i][c], "a coordinate", where);
  return corner;
}

void readBox(const Json& json, const std::string& path, TransformsFile* file) {
  for (const char* key : {"object_aabb", "aabb"}) {
    const auto box = json.find(key);
    if (box == json.end()) continue;
    const std::string where = "'" + path + "', " + key;
    if (!box->is_array() || box->size() != 2) fail(where, "not [[min], [max]]");
    file->box_min = readCorner(*box, 0, where);
    file->box_max = readCorner(*box, 1, where);
    if (!(file->box_min.array() < file->box_max.array()).all()) fail(where, "the box is empty");
    file->has_box = true;
    return;
  }
}

Json parse(const std::string& path, const DatasetLimits& limits) {
  try {
    return parseJson(withNullForNan(readWhole(InputFile(path), limits.json_bytes)));
  } catch (const std::exception& error) {
    fail("cannot read '" + path + "'", error.what());
  }
}

}  // namespace

TransformsFile readTransformsJson(const std::string& path, const DatasetLimits& limits) {
  const Json json = parse(path, limits);
  const std::string where = "'" + path + "'";
  if (!json.is_object()) fail(where, "not a transforms file: no object at the top");
  const auto frames = json.find("frames");
  if (frames == json.end() || !frames->is_array()) fail(where, "'frames' is not a list");
  if (frames->empty()) fail(where, "'frames' is empty");
  if (frames->size() > limits.frames) {
    fail(where, std::to_string(frames->size()) + " frames, at most " +
                    std::to_string(limits.frames) + " are read");
  }

  TransformsFile file;
  for (std::size_t i = 0; i < frames->size(); ++i) {
    file.frames.push_back(readFrame(json, (*frames)[i], path, i));
  }
  readBox(json, path, &file);
  const auto scale = json.find("metres_per_unit");
  if (scale != json.end()) {
    file.metres_per_unit = finiteNumber(*scale, "metres_per_unit", where);
    if (file.metres_per_unit <= 0) fail(where, "metres_per_unit is not positive");
  }
  return file;
}

}  // namespace nerf_pose_refiner
