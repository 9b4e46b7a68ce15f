// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "field/object_metadata.h"
#include "nerf_pose_refiner/depth.h"
#include "nerf_pose_refiner/observation.h"
#include "recorded_sequence.h"
#include "rendered_depth.h"

namespace CLI {
class App;
}

namespace nerf_pose_refiner {

/// What a depth camera beside a recording's camera sees, and what is wrong with it.
struct RecordedDepthOptions {
  StereoSensor sensor;
  double beside_m = 0.015;  ///< from the colour camera
  double cover = 0;         ///< fraction of the object behind a card, in both images
  bool table = false;       ///< the object stands on one, where seen from above
  std::string fault = "none";
  std::string shown;  ///< mesh that stands in the object's place; empty: the object's own

  void addTo(CLI::App* app);
};

/// A recording (recordings/README.md) with a depth camera, whose images are rendered from the
/// recording's mesh.
class RecordedDepth {
 public:
  /// @param object of the recording; lives longer. @throws std::runtime_error naming the file.
  RecordedDepth(const RecordedDepthOptions& options, const std::string& folder,
                const FieldMetadata& object);

  const RecordedSequence& sequence() const { return sequence_; }
  std::shared_ptr<const DepthImage> depthOf(std::size_t i) const;
  /// The image alone.
  Observation coloursOf(std::size_t i) const;
  double diameter_m() const;
  /// The object's centre in the colour camera [m].
  Eigen::Vector3d centreInCamera(std::size_t i) const;

 private:
  const TriangleMesh& meshAt(const Pose& T_D_O) const;
  DepthSurroundings surroundings(std::size_t i, const Camera& camera, const Pose& T_C_D) const;

  const RecordedDepthOptions options_;
  RecordedSequence sequence_;
  TriangleMesh mesh_, on_table_;
  const FieldMetadata& object_;
  double unit_m_;
};

}  // namespace nerf_pose_refiner
