// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/bop_folder.h"

#include <cstdio>
#include <filesystem>
#include <set>
#include <utility>

#include "dataset/bop_scene.h"
#include "dataset/json_values.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr double kMinVisible = 0.9;

bool isScene(const DatasetFolder& folder, const std::string& path) {
  return folder.hasFile(joined(path, "scene_camera.json")) &&
         folder.hasFile(joined(path, "scene_gt.json"));
}

std::vector<std::string> findScenes(const DatasetFolder& folder) {
  if (isScene(folder, ".")) return {"."};
  std::vector<std::string> scenes;
  for (const std::string& name : folder.folders(".")) {
    if (isScene(folder, name)) scenes.push_back(name);
  }
  return scenes;
}

/// The first of two folders of a scene that is there; empty if none is.
std::string firstFolder(const DatasetFolder& folder, const std::string& scene, const char* first,
                        const char* second) {
  for (const char* name : {first, second}) {
    if (folder.hasFolder(joined(scene, name))) return joined(scene, name);
  }
  return "";
}

/// A scene, and where its images are.
struct Scene {
  std::string path;
  std::string images;
  std::string masks;  ///< empty: none
  std::vector<BopView> views;
};

Scene readScene(const DatasetFolder& folder, const std::string& path, const DatasetLimits& limits) {
  BopSceneFiles files;
  files.name = folder.path(path);
  files.camera = folder.read(joined(path, "scene_camera.json"), limits.json_bytes);
  files.gt = folder.read(joined(path, "scene_gt.json"), limits.json_bytes);
  const std::string info = joined(path, "scene_gt_info.json");
  if (folder.hasFile(info)) files.gt_info = folder.read(info, limits.json_bytes);
  Scene scene = {path, firstFolder(folder, path, "rgb", "gray"),
                 firstFolder(folder, path, "mask_visib", "mask"), readBopScene(files)};
  if (scene.images.empty()) failAt("'" + files.name + "'", "there is no folder rgb or gray");
  return scene;
}

/// The object that is meant.
int chosenObject(const std::vector<Scene>& scenes, int wanted, const std::string& where) {
  std::set<int> objects;
  for (const Scene& scene : scenes) {
    for (const BopView& view : scene.views) objects.insert(view.object);
  }
  if (objects.empty()) failAt(where, "no image has an object's pose");
  if (wanted == 0 && objects.size() == 1) return *objects.begin();
  if (objects.count(wanted) == 1) return wanted;
  std::string list;
  for (const int object : objects) list += (list.empty() ? "" : ", ") + std::to_string(object);
  failAt(where, (wanted == 0 ? "it shows several objects, and none is chosen"
                             : "it does not show the object " + std::to_string(wanted)) +
                    ": choose an object id of " + list);
}

FrameEntry frameOf(const DatasetFolder& folder, const Scene& scene, const BopView& view) {
  char image[16], mask[32];
  std::snprintf(image, sizeof image, "%06d", view.image);
  std::snprintf(mask, sizeof mask, "%06d_%06d.png", view.image, view.instance);
  FrameEntry frame;
  frame.where = "'" + folder.path(scene.path) + "', image " + std::to_string(view.image);
  frame.image = joined(scene.images, image);  // whatever its extension
  if (!scene.masks.empty()) frame.mask = joined(scene.masks, mask);
  frame.T_O_C = view.T_C_O.inverse();
  frame.fl_x = view.fx;
  frame.fl_y = view.fy;
  frame.cx = view.cx + 0.5;
  frame.cy = view.cy + 0.5;
  return frame;
}

/// Adds the views of an object, of each image the one that is least hidden.
void addViews(const DatasetFolder& folder, const Scene& scene, int object, FrameList* list) {
  std::size_t hidden = 0;
  for (std::size_t i = 0; i < scene.views.size();) {
    const BopView* best = nullptr;
    const int image = scene.views[i].image;
    for (; i < scene.views.size() && scene.views[i].image == image; ++i) {
      const BopView& view = scene.views[i];
      if (view.object == object && (!best || view.visible > best->visible)) best = &view;
    }
    if (!best) continue;
    if (best->visible < kMinVisible) {
      ++hidden;
      continue;
    }
    list->frames.push_back(frameOf(folder, scene, *best));
  }
  if (hidden == 0) return;
  list->notes.push_back(std::to_string(hidden) + " images of '" + folder.path(scene.path) +
                        "' are left out: something hides a tenth of the object or more.");
}

}  // namespace

bool isBopFolder(const DatasetFolder& folder) { return !findScenes(folder).empty(); }

FrameList readBopFolder(const DatasetFolder& folder, const DatasetOptions& options) {
  std::vector<Scene> scenes;
  for (const std::string& path : findScenes(folder)) {
    scenes.push_back(readScene(folder, path, options.limits));
  }
  const std::string where = "'" + folder.path() + "'";
  const int object = chosenObject(scenes, options.object_id, where);
  FrameList list;
  list.folder = folder.path();
  list.metres_per_unit = 1;
  for (const Scene& scene : scenes) {
    addViews(folder, scene, object, &list);
    if (list.frames.size() > options.limits.frames) {
      failAt(where,
             "more than " + std::to_string(options.limits.frames) + " images, which is the limit");
    }
  }
  if (list.frames.empty()) failAt(where, "the object is hidden in all images");
  return list;
}

}  // namespace nerf_pose_refiner
