// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/detection_model.h"

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "detection/landmark_file.h"
#include "detection/template_file.h"
#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

/// Keeps what can be made again. A folder may not be ours.
template <typename Save>
void keep(const std::string& path, const Save& save) {
  if (path.empty()) return;
  try {
    save();
  } catch (const std::runtime_error&) {
  }
}

void keepLandmarks(const Landmarks& landmarks, std::uint64_t key, const std::string& path) {
  keep(path, [&] { saveLandmarks(landmarks, key, path); });
}

/// With templates, if the landmarks are few or templates are wanted anyway.
DetectionModel completed(const LoadedField& field, Landmarks landmarks,
                         const DetectionModelSettings& settings, const std::string& landmark_path,
                         const CancellationToken& cancellation) {
  const bool is_plain = landmarks.size() < settings.plain_landmarks;
  DetectionModel model = {std::move(landmarks), nullptr, is_plain};
  if (!is_plain && !settings.templates_for_all) return model;
  const std::uint64_t key = templateKey(field.field(), settings.templates);
  const std::string path = landmark_path.empty() ? std::string() : templatePathOf(landmark_path);
  std::optional<TemplateBank> bank;
  if (!path.empty()) bank = loadTemplates(path, key);
  if (!bank) {
    bank = makeTemplateBank(field, settings.templates, cancellation);
    keep(path, [&] { saveTemplates(*bank, key, path); });
  }
  model.templates = std::make_shared<const TemplateBank>(*std::move(bank));
  return model;
}

}  // namespace

void DetectionModelSettings::validate() const {
  landmarks.validate();
  templates.validate();
  require(plain_landmarks >= 0, "DetectionModelSettings::plain_landmarks", plain_landmarks);
}

std::string templatePathOf(const std::string& landmark_path) {
  return std::filesystem::path(landmark_path).replace_extension(".templates").string();
}

DetectionModel detectionModelFor(const LoadedField& field, const DetectionModelSettings& settings,
                                 const std::string& landmark_path,
                                 const CancellationToken& cancellation) {
  const std::uint64_t key = landmarkKey(field.field(), settings.landmarks);
  std::optional<Landmarks> landmarks;
  if (!landmark_path.empty()) landmarks = loadLandmarks(landmark_path, key);
  if (!landmarks) {
    // Rounded, so that the same image gives the same poses with and without a file.
    landmarks = asStored(makeLandmarks(field, settings.landmarks, cancellation));
    keepLandmarks(*landmarks, key, landmark_path);
  }
  return completed(field, *std::move(landmarks), settings, landmark_path, cancellation);
}

DetectionModel makeDetectionModel(const LoadedField& field,
                                  const std::vector<LandmarkPhoto>& photos,
                                  const DetectionModelSettings& settings,
                                  const std::string& landmark_path,
                                  const CancellationToken& cancellation) {
  Landmarks landmarks = asStored(makeLandmarks(field, photos, settings.landmarks, cancellation));
  keepLandmarks(landmarks, landmarkKey(field.field(), settings.landmarks), landmark_path);
  return completed(field, std::move(landmarks), settings, landmark_path, cancellation);
}

}  // namespace nerf_pose_refiner
