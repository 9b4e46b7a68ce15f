// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "detection/landmarks.h"
#include "detection/photo_landmarks.h"
#include "detection/template_view.h"
#include "nerf_pose_refiner/backend.h"

namespace nerf_pose_refiner {

/// What detection knows an object by, and how that is made.
struct DetectionModelSettings {
  LandmarkSettings landmarks;
  TemplateBankSettings templates;
  int plain_landmarks = 8000;      ///< objects with fewer are plain, and get templates, too
  bool templates_for_all = false;  ///< textured ones, too, @see BackendInfo::scans_fast

  /// The same for a processor.
  DetectionModelSettings adaptedTo(const BackendInfo& processor) const {
    DetectionModelSettings settings = *this;
    settings.templates_for_all = processor.scans_fast;
    return settings;
  }

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// What detection knows an object by.
struct DetectionModel {
  Landmarks landmarks;
  std::shared_ptr<const TemplateBank> templates = nullptr;  ///< null: the landmarks do
  bool is_plain = false;                                    ///< its landmarks are few
};

/// <name>.templates of <name>.landmarks.
std::string templatePathOf(const std::string& landmark_path);

/// What detection knows an object by, from files, or made and written there; where those cannot be
/// written it is made again next time.
/// @param landmark_path templates are beside it; empty: no files. @throws Cancelled.
DetectionModel detectionModelFor(const LoadedField& field, const DetectionModelSettings& settings,
                                 const std::string& landmark_path,
                                 const CancellationToken& cancellation);

/// The same of an object that was just learned, whose photos are at hand: their features are
/// landmarks, too. Makes it in any case.
DetectionModel makeDetectionModel(const LoadedField& field,
                                  const std::vector<LandmarkPhoto>& photos,
                                  const DetectionModelSettings& settings,
                                  const std::string& landmark_path,
                                  const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
