// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "scene_dataset.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "analytic_scene.h"
#include "image/colour.h"
#include "image/io.h"

namespace nerf_pose_refiner {
namespace {

/// Camera to object with OpenGL axes (x right, y up, z back), as transforms.json has it.
nlohmann::json toTransform(const Pose& T_O_C) {
  nlohmann::json rows = nlohmann::json::array();
  for (int i = 0; i < 3; ++i) {
    rows.push_back({T_O_C.R(i, 0), -T_O_C.R(i, 1), -T_O_C.R(i, 2), T_O_C.t[i]});
  }
  rows.push_back({0, 0, 0, 1});
  return rows;
}

}  // namespace

Camera squareCamera(int size_px) {
  const double middle = 0.5 * (size_px - 1);
  return {size_px, size_px, 2.0 * size_px, 2.0 * size_px, middle, middle};
}

void writeSceneDataset(const LoadedField& scene, const std::string& folder, int views,
                       int size_px) {
  std::filesystem::create_directories(folder);
  const Camera camera = squareCamera(size_px);
  nlohmann::json json;
  json["w"] = json["h"] = size_px;
  json["fl_x"] = json["fl_y"] = camera.fx;
  json["cx"] = json["cy"] = camera.cx + 0.5;  // the file counts from the image's corner
  for (int i = 0; i < views; ++i) {
    // A spiral over the sphere: equal areas, the golden angle from view to view.
    const double elevation = std::asin(1.9 * (i + 0.5) / views - 0.95);
    const Pose T_O_C = cameraAround(scene, 2.399963 * i, elevation);
    const Observation view = observeScene(scene, camera, T_O_C);
    const std::string name = "view_" + std::to_string(i) + ".png";
    writePng(straightBytes({view.image, view.alpha}), folder + "/" + name);
    json["frames"].push_back({{"file_path", name}, {"transform_matrix", toTransform(T_O_C)}});
  }
  std::ofstream(folder + "/transforms.json") << json.dump(1);
}

}  // namespace nerf_pose_refiner
