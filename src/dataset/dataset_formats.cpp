// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/dataset_formats.h"

#include <filesystem>
#include <optional>
#include <stdexcept>

#include "dataset/bop_folder.h"
#include "dataset/colmap_folder.h"
#include "dataset/dataset_folder.h"
#include "dataset/polycam.h"
#include "dataset/record3d.h"
#include "dataset/transforms_json.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

/// The first of the forms that is in the folder. A transforms.json comes first, for it is what
/// somebody made of the others that may lie beside it.
std::optional<FrameList> readKnownForm(const DatasetFolder& folder, const DatasetOptions& options) {
  for (const char* name : {"transforms.json", "transforms_train.json"}) {
    if (folder.hasFile(name)) return readTransformsJson(folder, name, options.limits);
  }
  if (isBopFolder(folder)) return readBopFolder(folder, options);
  if (isPolycamFolder(folder)) return readPolycamFolder(folder, options.limits);
  if (isRecord3dFolder(folder)) return readRecord3dFolder(folder, options.limits);
  if (isColmapFolder(folder)) return readColmapFolder(folder, options.limits);
  return std::nullopt;
}

}  // namespace

FrameList readFrameList(const std::string& path, const DatasetOptions& options) {
  if (!fs::is_directory(path)) {
    const fs::path file(path);
    const DatasetFolder folder(file.parent_path().string(), options.confined);
    return readTransformsJson(folder, file.filename().string(), options.limits);
  }
  const std::optional<FrameList> list =
      readKnownForm(DatasetFolder(path, options.confined), options);
  if (!list) {
    throw std::runtime_error(
        "'" + path +
        "' holds no posed photos in a form that is known: a transforms.json or "
        "transforms_train.json (nerfstudio, instant-ngp, NeRF Synthetic), a COLMAP model "
        "(sparse/0), a BOP scene (scene_camera.json), keyframes of Polycam, or an export of "
        "Record3D");
  }
  return *list;
}

}  // namespace nerf_pose_refiner
