// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/polycam.h"

#include <filesystem>

#include "dataset/json_values.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

/// "corrected_" where the export has photos with poses from its own optimisation, else "".
std::string prefixIn(const DatasetFolder& folder) {
  const bool corrected = folder.hasFolder("keyframes/corrected_cameras") &&
                         folder.hasFolder("keyframes/corrected_images");
  return corrected ? "keyframes/corrected_" : "keyframes/";
}

}  // namespace

bool isPolycamFolder(const DatasetFolder& folder) {
  const std::string prefix = prefixIn(folder);
  return folder.hasFolder(prefix + "cameras") && folder.hasFolder(prefix + "images");
}

FrameEntry readPolycamCamera(const std::string& text, const std::string& where) {
  const nlohmann::json json = parseDatasetJson(text, where);
  Pose T_W_G;  // of a world with y up, and a camera with OpenGL's axes
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) {
      const std::string key = "t_" + std::to_string(r) + std::to_string(c);
      (c < 3 ? T_W_G.R(r, c) : T_W_G.t[r]) = requiredNumber(json, key.c_str(), where);
    }
  }
  T_W_G.R = rotationOf(T_W_G.R, "t_00 to t_22", where);
  FrameEntry frame;
  frame.where = where;
  frame.T_O_C = withOpticalAxes(zUp() * T_W_G);
  frame.width = requiredPositive(json, "width", where);
  frame.height = requiredPositive(json, "height", where);
  frame.fl_x = requiredPositive(json, "fx", where);
  frame.fl_y = requiredPositive(json, "fy", where);
  frame.cx = requiredNumber(json, "cx", where);
  frame.cy = requiredNumber(json, "cy", where);
  return frame;
}

FrameList readPolycamFolder(const DatasetFolder& folder, const DatasetLimits& limits) {
  const std::string prefix = prefixIn(folder);
  FrameList list;
  list.folder = folder.path();
  list.metres_per_unit = 1;
  for (const std::string& name : folder.files(prefix + "cameras")) {
    const fs::path file(name);
    if (file.extension() != ".json") continue;
    if (list.frames.size() == limits.frames) {
      failAt("'" + folder.path() + "'",
             "more than " + std::to_string(limits.frames) + " photos, which is the limit");
    }
    const std::string camera = prefix + "cameras/" + name;
    const std::string where = "'" + folder.path(camera) + "'";
    list.frames.push_back(readPolycamCamera(folder.read(camera, limits.json_bytes), where));
    list.frames.back().image = prefix + "images/" + file.stem().string();  // a JPEG or a PNG
  }
  if (list.frames.empty()) failAt("'" + folder.path(prefix + "cameras") + "'", "no camera");
  return list;
}

}  // namespace nerf_pose_refiner
