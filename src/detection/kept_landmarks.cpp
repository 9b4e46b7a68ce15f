// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <utility>

#include "detection/landmark_file.h"

namespace nerf_pose_refiner {

Landmarks landmarksFor(const LoadedField& field, const LandmarkSettings& settings,
                       const std::string& path, const CancellationToken& cancellation) {
  if (path.empty()) return makeLandmarks(field, settings, cancellation);
  const std::uint64_t key = landmarkKey(field.field(), settings);
  if (std::optional<Landmarks> kept = loadLandmarks(path, key)) return *std::move(kept);
  Landmarks landmarks = makeLandmarks(field, settings, cancellation);
  try {
    saveLandmarks(landmarks, key, path);
  } catch (const std::runtime_error&) {  // a folder that is not ours
  }
  return landmarks;
}

}  // namespace nerf_pose_refiner
