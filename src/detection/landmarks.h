// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "backend/loaded_field.h"
#include "detection/image_features.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// A place on the object that looks special, and from where it does.
struct Landmark {
  Eigen::Vector3f point;  ///< in O [model units]
  /// Axes of the feature in O: x along its orientation, z along the ray that saw it.
  Eigen::Matrix3f R_O_F;
  float size = 0;          ///< of the feature at its depth [model units]
  std::int32_t views = 1;  ///< that saw it
};

/// Landmarks of an object: places and descriptors in the same order.
struct Landmarks {
  FeatureKind kind = bestFeatureKind();
  std::vector<Landmark> places;
  Descriptors descriptors;

  int size() const { return static_cast<int>(places.size()); }
};

struct LandmarkSettings {
  FeatureSettings features;
  int views = 80;              ///< from all around: some 22 degrees apart
  int object_px = 320;         ///< that the object's diameter spans in them
  double distance = 3;         ///< of the camera from the object's centre [diameters]
  int photos = 100;            ///< that are used of those at hand, at most
  int photo_px = 400;          ///< that the object's diameter spans in them, at most
  double least_support = 0.7;  ///< of the area that a descriptor describes: on the object
  double same_place = 0.01;    ///< landmarks nearer than this may be the same [diameters]
  double same_look = 0.45;     ///< with descriptors nearer than this
  int max_landmarks = 20000;   ///< those that most views saw are kept

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

class LandmarkMerger;

/// Adds features of renderings from all around. @throws Cancelled.
void addRenderings(const LoadedField& field, const LandmarkSettings& settings,
                   const CancellationToken& cancellation, LandmarkMerger* merger);

/// Features of renderings from all around, with their points on the object. @throws Cancelled.
Landmarks makeLandmarks(const LoadedField& field, const LandmarkSettings& settings,
                        const CancellationToken& cancellation);

/// The features of a rendering that are landmarks: their descriptors see little beside the object,
/// and their points lie on a surface without a step in its depth.
Landmarks landmarksOf(const Rendering& rendering, const View& view,
                      const LandmarkSettings& settings);

/// Collects landmarks of views. What an earlier view saw in nearly the same place, of nearly the
/// same look and from nearly the same side is the same landmark.
class LandmarkMerger {
 public:
  /// @param diameter of the object [model units].
  LandmarkMerger(const LandmarkSettings& settings, double diameter);
  void add(const Landmarks& seen);
  /// Those that most views saw.
  Landmarks best() const;

 private:
  using Cell = std::array<int, 3>;
  Cell cellOf(const Eigen::Vector3f& point) const;
  int find(const Landmark& place, const Eigen::RowVectorXf& descriptor) const;

  LandmarkSettings settings_;
  float reach_;  // within which places are the same [model units], and the side of a cell
  std::vector<Landmark> places_;
  std::vector<Eigen::RowVectorXf> sums_;    // of the descriptors of each
  std::map<Cell, std::vector<int>> cells_;  // places in each
};

/// The axes of a feature in its camera: x along its orientation, z along its ray.
Eigen::Matrix3d featureAxes(const Camera& camera, const FeaturePlace& feature);

/// The camera's pose if a feature of its image is a landmark, seen as it was seen: rough.
Pose poseFromMatch(const Camera& camera, const FeaturePlace& feature, const Landmark& landmark);

}  // namespace nerf_pose_refiner
