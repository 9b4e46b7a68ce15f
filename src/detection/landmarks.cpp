// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmarks.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "field/field.h"
#include "math/require.h"
#include "views/sphere_directions.h"

namespace nerf_pose_refiner {
namespace {

/// Sums of alpha over rectangles.
class AlphaSums {
 public:
  explicit AlphaSums(const Image& alpha)
      : width_(alpha.width), height_(alpha.height), sums_(alpha.width + 1, alpha.height + 1, 1) {
    for (int y = 0; y < height_; ++y) {
      double row = 0;
      for (int x = 0; x < width_; ++x) {
        row += alpha.at(x, y, 0);
        sums_.at(x + 1, y + 1, 0) = sums_.at(x + 1, y, 0) + row;
      }
    }
  }

  /// Mean over a square around a point; outside of the image alpha is 0.
  double meanAround(double x, double y, double half) const {
    const auto clamp = [](double v, int most) {
      return std::max(0, std::min(most, static_cast<int>(std::lround(v))));
    };
    const int left = clamp(x - half, width_), right = clamp(x + half + 1, width_);
    const int top = clamp(y - half, height_), bottom = clamp(y + half + 1, height_);
    const double sum = sums_.at(right, bottom, 0) - sums_.at(left, bottom, 0) -
                       sums_.at(right, top, 0) + sums_.at(left, top, 0);
    return sum / ((2 * half + 1) * (2 * half + 1));
  }

 private:
  int width_, height_;
  ImageOf<double> sums_;
};

// The object before its own mean colour, which makes the outline as weak as it can be.
Image beforeMeanColour(const Rendering& rendering) {
  Eigen::Array3d mean = Eigen::Array3d::Zero();
  double alpha = 1e-9;
  for (std::size_t i = 0; i < rendering.alpha.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      mean[static_cast<Eigen::Index>(c)] += rendering.colour.values[3 * i + c];
    }
    alpha += rendering.alpha.values[i];
  }
  mean /= alpha;
  Image image = rendering.colour;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] += (1 - rendering.alpha.values[i / 3]) *
                       static_cast<float>(mean[static_cast<Eigen::Index>(i % 3)]);
  }
  return image;
}

// The point that a pixel shows, if it shows one for certain.
bool pointAt(const Rendering& rendering, int x, int y, Eigen::Vector3f* point) {
  constexpr float kMinAlpha = 0.95f;
  if (x < 0 || y < 0 || x >= rendering.alpha.width || y >= rendering.alpha.height) return false;
  const float alpha = rendering.alpha.at(x, y, 0);
  if (alpha < kMinAlpha) return false;
  const float* sum = rendering.point.pixel(x, y);
  *point = Eigen::Vector3f(sum[0], sum[1], sum[2]) / alpha;
  return true;
}

double depthOf(const Eigen::Vector3f& point, const View& view) {
  return (view.T_O_C.inverse() * point.cast<double>()).z();
}

// The point under a feature, if the surface has no step there.
bool surfacePoint(const Rendering& rendering, const View& view, const FeaturePlace& feature,
                  Eigen::Vector3f* point) {
  constexpr float kSteepest = 4;  // in pixels as wide as their depth makes them
  const int x = static_cast<int>(std::lround(feature.x));
  const int y = static_cast<int>(std::lround(feature.y));
  if (!pointAt(rendering, x, y, point)) return false;
  const int r = std::max(1, static_cast<int>(std::lround(0.5 * feature.size_px)));
  const double px = depthOf(*point, view) / view.camera.fx;
  const float most = kSteepest * static_cast<float>(r * px);
  const int around[4][2] = {{r, 0}, {-r, 0}, {0, r}, {0, -r}};
  for (const auto& step : around) {
    Eigen::Vector3f beside;
    if (!pointAt(rendering, x + step[0], y + step[1], &beside)) return false;
    if ((beside - *point).norm() > most) return false;
  }
  return true;
}

}  // namespace

void LandmarkSettings::validate() const {
  require(views >= 1 && views <= 10000, "LandmarkSettings::views", views);
  require(object_px >= 32, "LandmarkSettings::object_px", object_px);
  require(distance > 1, "LandmarkSettings::distance", distance);
  require(photos >= 1, "LandmarkSettings::photos", photos);
  require(photo_px >= 32, "LandmarkSettings::photo_px", photo_px);
  require(least_support >= 0 && least_support <= 1, "LandmarkSettings::least_support",
          least_support);
  require(same_place > 0, "LandmarkSettings::same_place", same_place);
  require(same_look >= 0, "LandmarkSettings::same_look", same_look);
  require(max_landmarks >= 1, "LandmarkSettings::max_landmarks", max_landmarks);
}

Eigen::Matrix3d featureAxes(const Camera& camera, const FeaturePlace& feature) {
  const Eigen::Vector3d z = camera.direction(feature.x, feature.y).normalized();
  const Eigen::Vector3d along(std::cos(feature.angle_rad), std::sin(feature.angle_rad), 0);
  const Eigen::Vector3d x = (along - along.dot(z) * z).normalized();
  Eigen::Matrix3d axes;
  axes << x, z.cross(x), z;
  return axes;
}

Pose poseFromMatch(const Camera& camera, const FeaturePlace& feature, const Landmark& landmark) {
  const double depth = landmark.size * camera.fx / feature.size_px;
  const Eigen::Vector3d point_C = depth * camera.direction(feature.x, feature.y);
  Pose T_O_C;
  T_O_C.R = landmark.R_O_F.cast<double>() * featureAxes(camera, feature).transpose();
  T_O_C.t = landmark.point.cast<double>() - T_O_C.R * point_C;
  return T_O_C;
}

Landmarks landmarksOf(const Rendering& rendering, const View& view,
                      const LandmarkSettings& settings) {
  constexpr double kMiddle = 3;  // [sizes]: side of the middle of a descriptor, half of its own
  const ImageFeatures features =
      findFeatures(luminance(beforeMeanColour(rendering)), {}, settings.features);
  const AlphaSums alpha(rendering.alpha);
  Landmarks seen;
  seen.kind = settings.features.kind;
  std::vector<int> kept;
  for (int i = 0; i < features.size(); ++i) {
    const FeaturePlace& place = features.places[static_cast<std::size_t>(i)];
    const double half = 0.5 * kMiddle * place.size_px;
    if (alpha.meanAround(place.x, place.y, half) < settings.least_support) continue;
    Landmark landmark;
    if (!surfacePoint(rendering, view, place, &landmark.point)) continue;
    landmark.size =
        static_cast<float>(place.size_px * depthOf(landmark.point, view) / view.camera.fx);
    landmark.R_O_F = (view.T_O_C.R * featureAxes(view.camera, place)).cast<float>();
    seen.places.push_back(landmark);
    kept.push_back(i);
  }
  seen.descriptors.resize(static_cast<Eigen::Index>(kept.size()), features.descriptors.cols());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    seen.descriptors.row(static_cast<Eigen::Index>(i)) = features.descriptors.row(kept[i]);
  }
  return seen;
}

LandmarkMerger::LandmarkMerger(const LandmarkSettings& settings, double diameter)
    : settings_(settings), reach_(static_cast<float>(settings.same_place * diameter)) {}

LandmarkMerger::Cell LandmarkMerger::cellOf(const Eigen::Vector3f& point) const {
  const Eigen::Array3f cell = (point / reach_).array().floor();
  return {static_cast<int>(cell[0]), static_cast<int>(cell[1]), static_cast<int>(cell[2])};
}

int LandmarkMerger::find(const Landmark& place, const Eigen::RowVectorXf& descriptor) const {
  constexpr float kSameSide = 0.82f;  // cosine of 35 degrees
  constexpr float kSameSize = 1.5f;
  const Cell middle = cellOf(place.point);
  int best = -1;
  float least = static_cast<float>(settings_.same_look);
  for (int i = 0; i < 27; ++i) {
    const auto cell =
        cells_.find({middle[0] + i % 3 - 1, middle[1] + i / 3 % 3 - 1, middle[2] + i / 9 - 1});
    if (cell == cells_.end()) continue;
    for (const int number : cell->second) {
      const Landmark& known = places_[static_cast<std::size_t>(number)];
      const float larger = std::max(known.size / place.size, place.size / known.size);
      if (larger > kSameSize || (known.point - place.point).norm() > reach_ ||
          known.R_O_F.col(2).dot(place.R_O_F.col(2)) < kSameSide) {
        continue;
      }
      const float away = (sums_[static_cast<std::size_t>(number)].normalized() - descriptor).norm();
      if (away < least) {
        least = away;
        best = number;
      }
    }
  }
  return best;
}

void LandmarkMerger::add(const Landmarks& seen) {
  for (int i = 0; i < seen.size(); ++i) {
    const Landmark& place = seen.places[static_cast<std::size_t>(i)];
    const Eigen::RowVectorXf descriptor = seen.descriptors.row(i);
    const int known = find(place, descriptor);
    if (known >= 0) {
      sums_[static_cast<std::size_t>(known)] += descriptor;
      ++places_[static_cast<std::size_t>(known)].views;
      continue;
    }
    cells_[cellOf(place.point)].push_back(static_cast<int>(places_.size()));
    places_.push_back(place);
    sums_.push_back(descriptor);
  }
}

Landmarks LandmarkMerger::best() const {
  std::vector<int> order(places_.size());
  std::iota(order.begin(), order.end(), 0);
  const auto views = [this](int i) { return places_[static_cast<std::size_t>(i)].views; };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return views(a) > views(b); });
  if (order.size() > static_cast<std::size_t>(settings_.max_landmarks)) {
    order.resize(static_cast<std::size_t>(settings_.max_landmarks));
  }
  Landmarks best;
  best.kind = settings_.features.kind;
  const Eigen::Index width = sums_.empty() ? 0 : sums_.front().size();
  best.descriptors.resize(static_cast<Eigen::Index>(order.size()), width);
  for (std::size_t i = 0; i < order.size(); ++i) {
    best.places.push_back(places_[static_cast<std::size_t>(order[i])]);
    best.descriptors.row(static_cast<Eigen::Index>(i)) =
        sums_[static_cast<std::size_t>(order[i])].normalized();
  }
  return best;
}

void addRenderings(const LoadedField& field, const LandmarkSettings& settings,
                   const CancellationToken& cancellation, LandmarkMerger* merger) {
  for (const View& view :
       viewsAround(field.field().metadata, settings.views, settings.object_px, settings.distance)) {
    merger->add(landmarksOf(field.render(view, {}, cancellation), view, settings));
  }
}

Landmarks makeLandmarks(const LoadedField& field, const LandmarkSettings& settings,
                        const CancellationToken& cancellation) {
  settings.validate();
  LandmarkMerger merger(settings, field.field().metadata.diameter);
  addRenderings(field, settings, cancellation, &merger);
  return merger.best();
}

}  // namespace nerf_pose_refiner
