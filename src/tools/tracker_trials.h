// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "detection/object_detector.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "tracking/object_search.h"

namespace nerf_pose_refiner {

/// What a tracker does with images of one object: it detects it, or looks for it around a hint.
class TrackerTrials {
 public:
  /// @param model_path the object's file; its landmarks are beside it, or made.
  TrackerTrials(std::shared_ptr<Backend> backend, std::shared_ptr<const LoadedField> field,
                std::string model_path, const CancellationToken& cancellation);

  /// @param is_group the image shows several instances: all are looked for.
  Detections detect(const Observation& image, bool is_group);

  /// From an initial pose. A pose that a tracker would not publish is none.
  Refinement search(const Observation& image, const Prior& prior);

 private:
  std::unique_ptr<ObjectDetector> makeDetector(bool is_group) const;

  std::shared_ptr<Backend> backend_;
  std::shared_ptr<const LoadedField> field_;
  std::string model_path_;
  const CancellationToken& cancellation_;
  std::unique_ptr<ObjectDetector> of_one_, of_group_;  // null: not needed yet
  std::unique_ptr<RefinerSearch> search_;              // the same
};

}  // namespace nerf_pose_refiner
