// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/mask_agreement.h"

#include <algorithm>
#include <cmath>

#include "field/field.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMask_px = 48;  // that the object spans where it is rendered for this

/// The camera of an image that is so much smaller that the object has few pixels.
Camera reducedCamera(const Camera& camera, const Pose& T_O_C, const FieldMetadata& object) {
  const double distance = (T_O_C.t - object.centre).norm();
  const double object_px = object.diameter / distance * std::max(camera.fx, camera.fy);
  return camera.scaled(std::min(1.0, kMask_px / std::max(object_px, 1.0)));
}

/// Mean of the mask over a pixel of a smaller image.
float maskAt(const Image& mask, const Camera& reduced, int x, int y) {
  const int left = x * mask.width / reduced.width, top = y * mask.height / reduced.height;
  const int right = std::max(left + 1, (x + 1) * mask.width / reduced.width);
  const int bottom = std::max(top + 1, (y + 1) * mask.height / reduced.height);
  float sum = 0;
  for (int v = top; v < bottom; ++v) {
    for (int u = left; u < right; ++u) sum += mask.at(u, v, 0);
  }
  return sum / static_cast<float>((right - left) * (bottom - top));
}

}  // namespace

double maskAgreement(const LoadedField& field, const Observation& observation, const Pose& T_O_C,
                     const CancellationToken& cancellation) {
  const Camera camera = reducedCamera(observation.camera, T_O_C, field.field().metadata);
  const Image silhouette = field.render({camera, T_O_C}, RenderOptions(), cancellation).alpha;
  double both = 0, either = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const float object = silhouette.at(x, y, 0);
      const float mask = maskAt(observation.alpha, camera, x, y);
      both += std::min(object, mask);
      either += std::max(object, mask);
    }
  }
  return either > 0 ? both / either : 0;
}

}  // namespace nerf_pose_refiner
