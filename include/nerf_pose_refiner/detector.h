// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/object.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

class Backend;

/// What is known of where an object is, beside the observation's own mask and boxes. All of it may
/// be left out.
struct DetectionHint {
  /// Distance of the object's centre from the camera, up to 1.5 times too far or too near [m; model
  /// units if the object has no scale].
  std::optional<double> distance;
};

/// An instance of an object in an image.
struct Detection {
  Pose T_C_O;  ///< object in the camera's optical frame [m; model units if it has no scale]
  /// Covariance of T_C_O, as RefineResult::covariance.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double score = 0;             ///< how likely the pose is right, 0..1
  double visible_fraction = 0;  ///< fraction of the silhouette that agrees with the image, 0..1
  DepthReport depth;            ///< what became of the observation's depth
};

/// The instances of an object that were found in an image.
struct DetectionResult {
  std::vector<Detection> detections;  ///< instances that explain the image well enough, best first
  std::string message;                ///< why there is none; empty if there is one
  double seconds = 0;                 ///< duration of the search
};

/// How objects are detected.
struct DetectorOptions {
  /// File that keeps the object's landmarks, so that they are made once, and beside it the
  /// templates, of a plain object or for a GPU; empty: they are made by each detector.
  /// @see landmarksBeside
  std::string landmarks_path;
  double trust_score = 0.9;  ///< a pose that is less likely right is no detection, 0..1
  int max_instances = 10;    ///< largest number of instances in one image
  double budget_s = 0;       ///< after it what was found until then counts; 0: no limit
};

/// Where landmarks of a model file are kept: <name>.landmarks beside <name>.safetensors.
std::string landmarksBeside(const std::string& model_path);

/// Finds the instances of an object in images, without an idea of where they are.
///
/// Local features of the image are compared with landmarks, features of renderings from all around.
/// An object without texture is looked for by its contours, first where depth, if the observation
/// has some, shows something as far away as it may be. Depth then takes part in the poses. A pose
/// that looks like others by the object's symmetries is found once.
///
/// Not thread-safe; detectors of several threads may share a backend.
class Detector {
 public:
  /// Makes the landmarks if their file does not have them: up to a minute on a CPU.
  /// @throws std::invalid_argument for options out of their range, std::runtime_error where the
  /// backend has no memory for the object, Cancelled.
  Detector(std::shared_ptr<Backend> backend, const Object& object,
           const DetectorOptions& options = {}, const CancellationToken& cancellation = {});
  ~Detector();
  Detector(Detector&&) noexcept;
  Detector& operator=(Detector&&) noexcept;

  /// @throws std::invalid_argument for an image or a hint that makes no sense (sizes, NaN),
  /// Cancelled.
  DetectionResult detect(const Observation& observation, const DetectionHint& hint = {},
                         const CancellationToken& cancellation = {});

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace nerf_pose_refiner
