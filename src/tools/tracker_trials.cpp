// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tools/tracker_trials.h"

#include <utility>

#include "detection/detection_model.h"
#include "detection/landmark_file.h"
#include "nerf_pose_refiner/tracker.h"
#include "tracking/calibrate_detector.h"

namespace nerf_pose_refiner {

TrackerTrials::TrackerTrials(std::shared_ptr<Backend> backend,
                             std::shared_ptr<const LoadedField> field, std::string model_path,
                             const CancellationToken& cancellation)
    : backend_(std::move(backend)),
      field_(std::move(field)),
      model_path_(std::move(model_path)),
      cancellation_(cancellation) {}

std::unique_ptr<ObjectDetector> TrackerTrials::makeDetector(bool is_group) const {
  DetectionSettings settings;
  if (!is_group) settings.max_instances = 1;
  settings.model = settings.model.adaptedTo(backend_->info());
  auto detector = std::make_unique<ObjectDetector>(
      backend_.get(), field_,
      detectionModelFor(*field_, settings.model, landmarkPathOf(model_path_), cancellation_),
      settings);
  calibrate(detector.get(), backend_.get(), *field_, cancellation_);
  return detector;
}

Detections TrackerTrials::detect(const Observation& image, bool is_group) {
  std::unique_ptr<ObjectDetector>& detector = is_group ? of_group_ : of_one_;
  if (!detector) detector = makeDetector(is_group);
  return detector->detect(image, {}, cancellation_);
}

Refinement TrackerTrials::search(const Observation& image, const Prior& prior) {
  const double published = TrackerOptions().trust_score;
  if (!search_) {
    DetectionSetup detection;
    detection.landmarks_path = [this](const auto&) { return landmarkPathOf(model_path_); };
    const RefinerSettings settings = RefinerSettings::named("keyframes");
    search_ = std::make_unique<RefinerSearch>(
        [this] {
          return SearchProcessor{backend_, {}};
        },
        settings, settings, detection);
    search_->use({field_, &field_->field()});
    search_->detect(image, published, cancellation_);  // makes landmarks: they join the search
  }
  Refinement found = search_->search({image, prior}, cancellation_);
  if (found.score < published) found.outcome = Outcome::kDiverged;
  return found;
}

}  // namespace nerf_pose_refiner
