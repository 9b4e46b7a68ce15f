// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/detector.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "detection/detection_model.h"
#include "detection/landmark_file.h"
#include "detection/object_detector.h"
#include "field/field.h"
#include "field/object_frame.h"
#include "math/require.h"
#include "tracking/calibrate_detector.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {
namespace {

DetectionSettings settingsOf(const DetectorOptions& options) {
  require(options.trust_score >= 0 && options.trust_score <= 1, "trust_score", options.trust_score,
          "0..1");
  require(options.max_instances >= 1, "max_instances", options.max_instances, "1 or more");
  require(options.budget_s >= 0, "budget_s", options.budget_s, "0 or more");
  DetectionSettings settings;
  settings.least_score = options.trust_score;
  settings.max_instances = options.max_instances;
  settings.budget_s = options.budget_s;
  return settings;
}

}  // namespace

struct Detector::Parts {
  Object object;
  std::shared_ptr<Backend> backend;
  std::unique_ptr<ObjectDetector> detector;
};

std::string landmarksBeside(const std::string& model_path) { return landmarkPathOf(model_path); }

Detector::Detector(std::shared_ptr<Backend> backend, const Object& object,
                   const DetectorOptions& options, const CancellationToken& cancellation) {
  if (!backend) throw std::invalid_argument("Detector: the backend is null");
  DetectionSettings settings = settingsOf(options);
  settings.model = settings.model.adaptedTo(backend->info());
  const std::shared_ptr<const LoadedField> field = backend->load(ObjectInside::field(object));
  auto detector = std::make_unique<ObjectDetector>(
      backend.get(), field,
      detectionModelFor(*field, settings.model, options.landmarks_path, cancellation), settings);
  calibrate(detector.get(), backend.get(), *field, cancellation);
  parts_.reset(new Parts{object, std::move(backend), std::move(detector)});
}

Detector::~Detector() = default;
Detector::Detector(Detector&&) noexcept = default;
Detector& Detector::operator=(Detector&&) noexcept = default;

DetectionResult Detector::detect(const Observation& observation, const DetectionHint& hint,
                                 const CancellationToken& cancellation) {
  const FieldMetadata& metadata = ObjectInside::field(parts_->object)->metadata;
  const ObjectFrame frame = ObjectInside::frame(parts_->object);
  SearchArea area;
  if (hint.distance) area.distance = *hint.distance / frame.lengthPerUnit();
  const Detections found = parts_->detector->detect(observation, area, cancellation);
  DetectionResult result;
  result.message = found.message;
  result.seconds = found.seconds;
  for (const Refinement& one : found.found) {
    Detection detection;
    detection.T_C_O = frame.objectInCamera(one.T_O_C);
    detection.covariance = covarianceInCamera(one.covariance, one.T_O_C, metadata, frame);
    detection.score = one.score;
    detection.visible_fraction = one.visible_fraction;
    detection.depth = one.depth;
    result.detections.push_back(detection);
  }
  return result;
}

}  // namespace nerf_pose_refiner
