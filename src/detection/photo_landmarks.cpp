// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/photo_landmarks.h"

#include <algorithm>
#include <cmath>

#include "field/field.h"
#include "image/colour.h"
#include "image/resample.h"

namespace nerf_pose_refiner {

std::optional<Camera> objectPart(const View& view, const FieldMetadata& object, int object_px) {
  constexpr double kReach = 0.6;  // around the centre [diameters]
  constexpr int kMinSide_px = 32;
  const Eigen::Vector3d centre_C = view.T_O_C.inverse() * object.centre;
  const double reach = kReach * object.diameter;
  if (!(centre_C.z() > 1.2 * reach)) return std::nullopt;
  const Camera& camera = view.camera;
  // (The nearest part of the object is seen largest.)
  const double half_px = reach * camera.fx / (centre_C.z() - reach);
  const Eigen::Vector2d middle = camera.project(centre_C);
  const auto inside = [](double u, int size) {
    return static_cast<int>(std::clamp(std::lround(u), 0L, static_cast<long>(size)));
  };
  const int left = inside(middle.x() - half_px, camera.width);
  const int right = inside(middle.x() + half_px, camera.width);
  const int top = inside(middle.y() - half_px, camera.height);
  const int bottom = inside(middle.y() + half_px, camera.height);
  if (std::min(right - left, bottom - top) < kMinSide_px) return std::nullopt;
  const Camera part = camera.cropped(left, top, right - left, bottom - top);
  const double scale = object_px * centre_C.z() / (object.diameter * camera.fx);
  return scale < 1 ? part.scaled(scale) : part;
}

Landmarks landmarksOf(const LandmarkPhoto& photo, const LoadedField& field,
                      const LandmarkSettings& settings, const CancellationToken& cancellation) {
  const std::optional<Camera> part =
      objectPart(photo.view, field.field().metadata, settings.photo_px);
  if (!part) return {settings.features.kind, {}, {}};
  const View view = {*part, photo.view.T_O_C};
  Rendering seen = field.render(view, {}, cancellation);
  const PremultipliedImage whole = premultiply(*photo.rgba);
  const Image colour = resample(whole.colour, photo.view.camera, *part);
  const Image alpha = resample(whole.alpha, photo.view.camera, *part);
  for (std::size_t i = 0; i < seen.alpha.values.size(); ++i) {
    // The photo's colours where both show the object.
    const float by_photo = std::min(1.0f, std::max(0.0f, alpha.values[i]));
    const float by_field = seen.alpha.values[i];
    for (std::size_t c = 0; c < 3; ++c) {
      seen.colour.values[3 * i + c] = by_field * colour.values[3 * i + c];
      seen.point.values[3 * i + c] *= by_photo;
    }
    seen.alpha.values[i] = by_field * by_photo;
  }
  return landmarksOf(seen, view, settings);
}

Landmarks makeLandmarks(const LoadedField& field, const std::vector<LandmarkPhoto>& photos,
                        const LandmarkSettings& settings, const CancellationToken& cancellation) {
  settings.validate();
  LandmarkMerger merger(settings, field.field().metadata.diameter);
  const std::size_t used = std::min(photos.size(), static_cast<std::size_t>(settings.photos));
  for (std::size_t i = 0; i < used; ++i) {
    merger.add(landmarksOf(photos[i * photos.size() / used], field, settings, cancellation));
  }
  addRenderings(field, settings, cancellation, &merger);
  return merger.best();
}

}  // namespace nerf_pose_refiner
