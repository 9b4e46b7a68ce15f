// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/colmap_folder.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "dataset/colmap_binary.h"
#include "dataset/colmap_text.h"
#include "dataset/json_values.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxTextBytes = std::uint64_t{1} << 28;  // text is read as a whole
constexpr std::size_t kMaxNamed = 5;                             // photos that a note names

/// A folder in the dataset's with a model.
struct ModelFolder {
  std::string path;
  bool binary = true;
  std::uint64_t photos = 0;  ///< with a pose
};

bool hasModel(const DatasetFolder& folder, const std::string& path, const char* extension) {
  for (const char* name : {"cameras", "images"}) {
    if (!folder.hasFile(joined(path, std::string(name) + extension))) return false;
  }
  return true;
}

/// Calls a reader of a file; names the file in errors.
template <typename Reader>
auto readNamed(const std::string& path, const Reader& read) {
  try {
    return read();
  } catch (const std::exception& error) {
    failAt("cannot read '" + path + "'", error.what());
  }
}

class ModelReader {
  template <typename Reader>
  auto readBinary(const ModelFolder& model, const char* name, const Reader& read) const {
    const std::string path = folder_.path(fileOf(model, name));
    return readNamed(path, [&] { return read(InputFile(path)); });
  }

  template <typename Reader>
  auto readText(const ModelFolder& model, const char* name, const Reader& read) const {
    const std::string file = fileOf(model, name);
    const std::string text = folder_.read(file, std::min(kMaxTextBytes, limits_.model_bytes));
    return readNamed(folder_.path(file), [&] { return read(text); });
  }

 public:
  ModelReader(const DatasetFolder& folder, const DatasetLimits& limits)
      : folder_(folder), limits_(limits) {}

  std::uint64_t countImages(const ModelFolder& model) const {
    return model.binary ? readBinary(model, "images", countColmapImagesBinary)
                        : images(model).size();
  }

  ColmapCameras cameras(const ModelFolder& model) const {
    return model.binary ? readBinary(model, "cameras", readColmapCamerasBinary)
                        : readText(model, "cameras", readColmapCamerasText);
  }

  std::vector<ColmapImage> images(const ModelFolder& model) const {
    const auto binary = [this](const InputFile& f) { return readColmapImagesBinary(f, limits_); };
    const auto text = [this](const std::string& t) { return readColmapImagesText(t, limits_); };
    return model.binary ? readBinary(model, "images", binary) : readText(model, "images", text);
  }

  /// None if there is no such file.
  std::vector<ScenePoint> points(const ModelFolder& model) const {
    if (!folder_.hasFile(fileOf(model, "points3D"))) return {};
    const auto binary = [this](const InputFile& f) { return readColmapPointsBinary(f, limits_); };
    const auto text = [this](const std::string& t) { return readColmapPointsText(t, limits_); };
    return model.binary ? readBinary(model, "points3D", binary) : readText(model, "points3D", text);
  }

  std::string fileOf(const ModelFolder& model, const std::string& name) const {
    return joined(model.path, name + (model.binary ? ".bin" : ".txt"));
  }

 private:
  const DatasetFolder& folder_;
  const DatasetLimits& limits_;
};

/// The models at a path and in the folders in it. (Of both kinds COLMAP prefers the binary, too.)
std::vector<ModelFolder> modelsAt(const DatasetFolder& folder, const std::string& path) {
  std::vector<std::string> candidates = {path};
  for (const std::string& name : folder.folders(path)) candidates.push_back(joined(path, name));
  std::vector<ModelFolder> models;
  for (const std::string& candidate : candidates) {
    if (hasModel(folder, candidate, ".bin")) {
      models.push_back({candidate, true});
    } else if (hasModel(folder, candidate, ".txt")) {
      models.push_back({candidate, false});
    }
  }
  return models;
}

/// All models, those of one reconstruction together, in the order in which they are tried.
std::vector<std::vector<ModelFolder>> findModels(const DatasetFolder& folder) {
  std::vector<std::string> places = {"sparse", "colmap/sparse", "dense/sparse"};
  for (const std::string& name : folder.folders("dense")) {
    places.push_back(joined(joined("dense", name), "sparse"));
  }
  std::vector<std::vector<ModelFolder>> found;
  for (const char* extension : {".bin", ".txt"}) {
    if (found.empty() && hasModel(folder, ".", extension)) {
      found.push_back({{".", extension == std::string(".bin")}});
    }
  }
  for (const std::string& place : places) {
    std::vector<ModelFolder> models = modelsAt(folder, place);
    if (!models.empty()) found.push_back(std::move(models));
  }
  if (found.empty()) {
    std::vector<ModelFolder> numbered = modelsAt(folder, ".");  // the folder sparse itself
    if (!numbered.empty()) found.push_back(std::move(numbered));
  }
  return found;
}

/// The largest of several models, and a note that says so.
ModelFolder largest(const ModelReader& reader, std::vector<ModelFolder> models, FrameList* list) {
  for (ModelFolder& model : models) model.photos = reader.countImages(model);
  const auto best = std::max_element(
      models.begin(), models.end(),
      [](const ModelFolder& a, const ModelFolder& b) { return a.photos < b.photos; });
  if (models.size() > 1) {
    std::string others;
    for (const ModelFolder& model : models) {
      if (model.path == best->path) continue;
      others +=
          (others.empty() ? "'" : ", '") + model.path + "' (" + std::to_string(model.photos) + ")";
    }
    list->notes.push_back("COLMAP made " + std::to_string(models.size()) +
                          " models of these photos, which do not hang together. The largest, '" +
                          best->path + "' with " + std::to_string(best->photos) +
                          " photos, is used; left out: " + others + ".");
  }
  return *best;
}

/// Where the photos of a model may be, nearest first, from the dataset's folder.
std::vector<std::string> photoFolders(const DatasetFolder& folder, const std::string& model) {
  std::vector<std::string> bases;
  for (fs::path base = fs::path(model).lexically_normal();; base = base.parent_path()) {
    if (base.empty()) base = ".";
    bases.push_back(base.string());
    if (base == ".") break;
  }
  if (!folder.confined()) bases.insert(bases.end(), {"..", "../.."});
  std::vector<std::string> result;
  for (const std::string& base : bases) {
    for (const char* name : {"images", "."}) {
      const std::string candidate = joined(base, name);
      if (folder.hasFolder(candidate)) result.push_back(candidate);
    }
  }
  return result;
}

/// The folder in which the first photo is.
std::optional<std::string> findPhotos(const DatasetFolder& folder, const std::string& model,
                                      const std::string& name) {
  for (const std::string& candidate : photoFolders(folder, model)) {
    if (folder.hasFile(joined(candidate, name))) return candidate;
  }
  return std::nullopt;
}

/// The mask of a photo, or nothing.
std::string findMask(const DatasetFolder& folder, const std::string& photos,
                     const std::string& name) {
  const fs::path photo = fs::path(name).lexically_normal();
  if (photo.is_absolute() || photo.string().compare(0, 2, "..") == 0) return "";  // elsewhere
  const std::string stem = fs::path(name).replace_extension().string();
  for (const std::string& place : {joined(photos, "../masks"), joined(photos, "masks")}) {
    if (place.compare(0, 2, "..") == 0 && folder.confined()) continue;
    for (const std::string& file : {name + ".png", stem + ".png", name}) {
      if (folder.hasFile(joined(place, file))) return joined(place, file);
    }
  }
  return "";
}

FrameEntry frameOf(const ColmapImage& image, const ColmapCamera& camera) {
  FrameEntry frame;
  frame.T_O_C = image.T_C_O.inverse();
  frame.width = camera.width;
  frame.height = camera.height;
  frame.fl_x = camera.fx;
  frame.fl_y = camera.fy;
  frame.cx = camera.cx;
  frame.cy = camera.cy;
  frame.distortion = camera.distortion;
  return frame;
}

/// Says which photos of the folder have no pose.
void notePhotosWithoutPose(const DatasetFolder& folder, const std::string& photos,
                           const std::vector<ColmapImage>& images, FrameList* list) {
  std::vector<std::string> names;
  for (const ColmapImage& image : images) names.push_back(image.name);
  std::sort(names.begin(), names.end());
  std::string missing;
  std::size_t count = 0;
  for (const std::string& name : folder.files(photos)) {
    const std::string extension = fs::path(name).extension().string();
    const auto known = {".jpg", ".JPG", ".jpeg", ".JPEG", ".png", ".PNG"};
    if (std::find(known.begin(), known.end(), extension) == known.end()) continue;
    if (std::binary_search(names.begin(), names.end(), name)) continue;
    if (++count <= kMaxNamed) missing += (missing.empty() ? "" : ", ") + name;
  }
  if (count == 0) return;
  if (count > kMaxNamed) missing += ", ...";
  list->notes.push_back(std::to_string(count) + " of " + std::to_string(count + images.size()) +
                        " photos have no pose and are left out: " + missing + ".");
}

/// Fills the list from a model. @return false if its photos are not there.
bool readModel(const DatasetFolder& folder, const ModelReader& reader, const ModelFolder& model,
               FrameList* list) {
  const std::vector<ColmapImage> images = reader.images(model);
  const std::string where = "'" + folder.path(reader.fileOf(model, "images")) + "'";
  if (images.empty()) failAt(where, "no photo has a pose");
  const std::optional<std::string> photos = findPhotos(folder, model.path, images[0].name);
  if (!photos) return false;
  const ColmapCameras cameras = reader.cameras(model);
  for (const ColmapImage& image : images) {
    const std::string photo = where + ", '" + image.name.substr(0, 200) + "'";
    const auto camera = cameras.find(image.camera);
    if (camera == cameras.end()) {
      failAt(photo, "there is no camera " + std::to_string(image.camera));
    }
    FrameEntry frame = frameOf(image, camera->second);
    frame.where = photo;
    frame.image = joined(*photos, image.name);
    frame.mask = findMask(folder, *photos, image.name);
    list->frames.push_back(frame);
  }
  list->points = reader.points(model);
  notePhotosWithoutPose(folder, *photos, images, list);
  return true;
}

}  // namespace

bool isColmapFolder(const DatasetFolder& folder) { return !findModels(folder).empty(); }

FrameList readColmapFolder(const DatasetFolder& folder, const DatasetLimits& limits) {
  const ModelReader reader(folder, limits);
  std::string tried;
  for (const std::vector<ModelFolder>& models : findModels(folder)) {
    FrameList list;
    list.folder = folder.path();
    const ModelFolder model = largest(reader, models, &list);
    if (readModel(folder, reader, model, &list)) return list;
    tried += (tried.empty() ? "'" : ", '") + model.path + "'";
  }
  failAt("'" + folder.path() + "'",
         "the photos of the COLMAP model " + tried +
             " are not there: put them, called as they were, into a folder images beside it");
}

}  // namespace nerf_pose_refiner
