// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/bop_scene.h"

#include <algorithm>
#include <cmath>

#include "dataset/json_values.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMaxDigits = 9;  // of a number that an int can hold
constexpr double kMetresPerMillimetre = 1e-3;
constexpr double kSkewTolerance = 1e-6;  // of the focal length
constexpr double kMaxId = 1e9;

int imageNumber(const std::string& key, const std::string& where) {
  const bool digits = !key.empty() && key.size() <= kMaxDigits &&
                      key.find_first_not_of("0123456789") == std::string::npos;
  if (!digits) failAt(where, "'" + key.substr(0, 100) + "' is not the number of an image");
  return std::stoi(key);
}

Json parseScene(const std::string& text, const std::string& where) {
  Json json = parseDatasetJson(text, where);
  if (!json.is_object()) failAt(where, "no object at the top");
  return json;
}

/// Intrinsics from the row-wise matrix K.
void readIntrinsics(const Json& camera, const std::string& where, BopView* view) {
  const std::vector<double> K = requiredNumbers(camera, "cam_K", 9, where);
  view->fx = K[0];
  view->fy = K[4];
  view->cx = K[2];
  view->cy = K[5];
  const bool pinhole = K[0] > 0 && K[4] > 0 && std::abs(K[1]) <= kSkewTolerance * K[0] &&
                       K[3] == 0 && K[6] == 0 && K[7] == 0 && K[8] == 1;
  if (!pinhole) failAt(where, "cam_K is not the matrix of a pinhole camera without skew");
}

void readObject(const Json& object, const std::string& where, BopView* view) {
  const double id = requiredPositive(object, "obj_id", where);
  if (id != std::floor(id) || id > kMaxId) failAt(where, "obj_id is not a whole number");
  view->object = static_cast<int>(id);
  const std::vector<double> R = requiredNumbers(object, "cam_R_m2c", 9, where);
  const std::vector<double> t = requiredNumbers(object, "cam_t_m2c", 3, where);
  const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix3d>(R.data()).transpose();
  view->T_C_O = {rotationOf(rotation, "cam_R_m2c", where),
                 kMetresPerMillimetre * Eigen::Vector3d(t[0], t[1], t[2])};
}

/// visib_fract of an object, if it is stated.
double visibleFraction(const Json& gt_info, const std::string& image, std::size_t instance,
                       const std::string& where) {
  const auto list = gt_info.find(image);
  if (list == gt_info.end() || !list->is_array() || instance >= list->size()) return 1;
  const Json& info = (*list)[instance];
  if (!info.is_object() || !info.contains("visib_fract")) return 1;
  return requiredNumber(info, "visib_fract", where);
}

}  // namespace

std::vector<BopView> readBopScene(const BopSceneFiles& files) {
  const std::string where = "'" + files.name + "'";
  const Json cameras = parseScene(files.camera, where + ", scene_camera.json");
  const Json gt = parseScene(files.gt, where + ", scene_gt.json");
  const Json gt_info = files.gt_info.empty()
                           ? Json::object()
                           : parseScene(files.gt_info, where + ", scene_gt_info.json");
  std::vector<BopView> views;
  for (const auto& [key, objects] : gt.items()) {
    BopView view;
    view.image = imageNumber(key, where + ", scene_gt.json");
    const std::string image = where + ", image " + key;
    if (!objects.is_array()) failAt(image, "scene_gt.json has no list of objects");
    const auto camera = cameras.find(key);
    if (camera == cameras.end()) failAt(image, "scene_camera.json has no such image");
    readIntrinsics(*camera, image, &view);
    for (std::size_t i = 0; i < objects.size(); ++i) {
      view.instance = static_cast<int>(i);
      readObject(objects[i], image + ", object " + std::to_string(i), &view);
      view.visible = visibleFraction(gt_info, key, i, image);
      views.push_back(view);
    }
  }
  std::stable_sort(views.begin(), views.end(),
                   [](const BopView& a, const BopView& b) { return a.image < b.image; });
  return views;
}

}  // namespace nerf_pose_refiner
