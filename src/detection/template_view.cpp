// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_view.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "backend/common/image_levels.h"
#include "field/field.h"
#include "math/require.h"
#include "views/sphere_directions.h"

namespace nerf_pose_refiner {
namespace {

constexpr float kOutlineStrength = 1;       // of an edge on the contour; inner ones have less
constexpr float kMinInnerStrength = 0.05f;  // change of a colour over two pixels
constexpr float kMostFlat = 0.02f;          // the same where there is no edge

/// A pixel on an edge, or away from all edges.
struct EdgePixel {
  int x, y;
  float strength;
  float normal_rad;  // of the edge, or kNoNormal
};

/// Half the change from neighbour to neighbour along both axes.
Eigen::Vector2f gradientAt(const Image& image, int x, int y, int c) {
  return 0.5f * Eigen::Vector2f(image.at(x + 1, y, c) - image.at(x - 1, y, c),
                                image.at(x, y + 1, c) - image.at(x, y - 1, c));
}

class EdgeFinder {
 public:
  explicit EdgeFinder(const Rendering& rendering) : alpha_(rendering.alpha) {
    smoothImage(rendering.alpha, &smooth_alpha_);
    smoothImage(rendering.colour, &smooth_colour_);
    for (std::size_t i = 0; i < smooth_colour_.values.size(); ++i) {
      smooth_colour_.values[i] /= std::max(0.5f, smooth_alpha_.values[i / 3]);
    }
    strength_ = Image(alpha_.width, alpha_.height, 1);
    for (int y = 1; y + 1 < alpha_.height; ++y) {
      for (int x = 1; x + 1 < alpha_.width; ++x) strength_.at(x, y, 0) = strongestAt(x, y).norm();
    }
  }

  std::vector<EdgePixel> find() const {
    std::vector<EdgePixel> edges;
    for (int y = 2; y + 2 < alpha_.height; ++y) {
      for (int x = 2; x + 2 < alpha_.width; ++x) {
        if (alpha_.at(x, y, 0) < 0.5f) continue;
        if (isOnContour(x, y)) {
          const Eigen::Vector2f slope = gradientAt(smooth_alpha_, x, y, 0);
          edges.push_back({x, y, kOutlineStrength, std::atan2(slope.y(), slope.x())});
        } else if (isInside(x, y) && isRidge(x, y)) {
          const Eigen::Vector2f slope = strongestAt(x, y);
          edges.push_back({x, y, std::min(0.9f, slope.norm()), std::atan2(slope.y(), slope.x())});
        }
      }
    }
    return edges;
  }

  /// Pixels of the object away from all edges.
  std::vector<EdgePixel> findFlat() const {
    std::vector<EdgePixel> flat;
    for (int y = kReach + 1; y + kReach + 1 < alpha_.height; ++y) {
      for (int x = kReach + 1; x + kReach + 1 < alpha_.width; ++x) {
        if (isFlat(x, y)) flat.push_back({x, y, 1 - strength_.at(x, y, 0), kNoNormal});
      }
    }
    return flat;
  }

 private:
  // Of 128 that an object spans; of the 72 in images that are scanned, two: responses spread by
  // one, poses are off by another.
  static constexpr int kReach = 4;

  bool isFlat(int x, int y) const {
    for (int v = y - kReach; v <= y + kReach; ++v) {
      for (int u = x - kReach; u <= x + kReach; ++u) {
        if (alpha_.at(u, v, 0) < 0.9f || strength_.at(u, v, 0) > kMostFlat) return false;
      }
    }
    return true;
  }

  bool isOnContour(int x, int y) const {
    return std::min({alpha_.at(x - 1, y, 0), alpha_.at(x + 1, y, 0), alpha_.at(x, y - 1, 0),
                     alpha_.at(x, y + 1, 0)}) < 0.5f;
  }

  // Not so near to the contour that what is behind shows.
  bool isInside(int x, int y) const {
    for (int v = y - 1; v <= y + 1; ++v) {
      for (int u = x - 1; u <= x + 1; ++u) {
        if (smooth_alpha_.at(u, v, 0) < 0.95f) return false;
      }
    }
    return true;
  }

  Eigen::Vector2f strongestAt(int x, int y) const {
    Eigen::Vector2f strongest = gradientAt(smooth_colour_, x, y, 0);
    for (int c = 1; c < 3; ++c) {
      const Eigen::Vector2f gradient = gradientAt(smooth_colour_, x, y, c);
      if (gradient.squaredNorm() > strongest.squaredNorm()) strongest = gradient;
    }
    return strongest;
  }

  // Whether the gradient is strong, and no stronger to either side across the edge.
  bool isRidge(int x, int y) const {
    const Eigen::Vector2f here = strongestAt(x, y);
    const float strength = here.norm();
    if (strength < kMinInnerStrength) return false;
    const Eigen::Vector2f across = here / strength;
    const int dx = static_cast<int>(std::lround(across.x()));
    const int dy = static_cast<int>(std::lround(across.y()));
    return strength >= strongestAt(x + dx, y + dy).norm() &&
           strength > strongestAt(x - dx, y - dy).norm();
  }

  const Image& alpha_;
  Image smooth_alpha_, smooth_colour_;
  Image strength_;  // of edges, whatever their direction
};

using EdgeRange = std::pair<std::vector<EdgePixel>::iterator, std::vector<EdgePixel>::iterator>;

/// Divides the edges by their places into halves of halves, and takes the strongest one of each:
/// any run of 2^k chosen ones is about one place.
void chooseEvenly(EdgeRange range, int count, std::vector<EdgePixel>* chosen) {
  const auto [first, last] = range;
  if (count == 1 || last - first == 1) {
    const auto best = std::max_element(first, last, [](const EdgePixel& a, const EdgePixel& b) {
      return std::tie(a.strength, a.y, a.x) < std::tie(b.strength, b.y, b.x);
    });
    chosen->insert(chosen->end(), count, *best);
    return;
  }
  const auto by_x = [](const EdgePixel& a, const EdgePixel& b) {
    return std::tie(a.x, a.y) < std::tie(b.x, b.y);
  };
  const auto by_y = [](const EdgePixel& a, const EdgePixel& b) {
    return std::tie(a.y, a.x) < std::tie(b.y, b.x);
  };
  const auto [left, right] = std::minmax_element(first, last, by_x);
  const auto [top, bottom] = std::minmax_element(first, last, by_y);
  const bool is_wide = right->x - left->x >= bottom->y - top->y;
  const auto middle = first + (last - first) / 2;
  if (is_wide) {
    std::nth_element(first, middle, last, by_x);
  } else {
    std::nth_element(first, middle, last, by_y);
  }
  chooseEvenly({first, middle}, count / 2, chosen);
  chooseEvenly({middle, last}, count - count / 2, chosen);
}

/// A part of a template: edges, and flat pixels near to them.
class TemplatePart {
 public:
  explicit TemplatePart(EdgeRange edges) : pixels_(edges.first, edges.second) {
    for (const EdgePixel& edge : pixels_) {
      x_ += edge.x / static_cast<double>(pixels_.size());
      y_ += edge.y / static_cast<double>(pixels_.size());
    }
  }

  /// Takes the nearest one out of the rest.
  void takeFrom(std::vector<EdgePixel>* rest) {
    const auto nearest = std::min_element(
        rest->begin(), rest->end(), [this](const EdgePixel& a, const EdgePixel& b) {
          return std::hypot(a.x - x_, a.y - y_) < std::hypot(b.x - x_, b.y - y_);
        });
    pixels_.push_back(*nearest);
    rest->erase(nearest);
  }

  const std::vector<EdgePixel>& pixels() const { return pixels_; }

 private:
  std::vector<EdgePixel> pixels_;
  double x_ = 0, y_ = 0;  // middle of the edges
};

/// Part after part. @return nothing: there is next to nothing to be seen.
std::vector<EdgePixel> chooseFeatures(const EdgeFinder& finder, int count) {
  constexpr std::size_t kFew = 24;
  std::vector<EdgePixel> all = finder.find(), all_flat = finder.findFlat(), edges, flat, chosen;
  if (all.size() < kFew) return chosen;
  const int flat_count = static_cast<int>(all_flat.size()) < count / 4 ? 0 : count / 4;
  chooseEvenly({all.begin(), all.end()}, count - flat_count, &edges);
  if (flat_count > 0) chooseEvenly({all_flat.begin(), all_flat.end()}, flat_count, &flat);
  std::vector<TemplatePart> parts;
  const std::ptrdiff_t per_part = (count - flat_count) / kTemplateParts;
  for (auto first = edges.begin(); first < edges.end(); first += per_part) {
    parts.emplace_back(EdgeRange{first, first + per_part});
  }
  while (!flat.empty()) {
    for (TemplatePart& part : parts) part.takeFrom(&flat);
  }
  for (const TemplatePart& part : parts) {
    chosen.insert(chosen.end(), part.pixels().begin(), part.pixels().end());
  }
  return chosen;
}

}  // namespace

void TemplateBankSettings::validate() const {
  require(views >= 1 && views <= 5000, "TemplateBankSettings::views", views);
  require(object_px >= 32 && object_px <= 512, "TemplateBankSettings::object_px", object_px);
  require(distance > 1, "TemplateBankSettings::distance", distance);
  require(features >= 1 && features <= 1024 && features % TemplateView::kRun == 0,
          "TemplateBankSettings::features", features);
}

TemplateView makeTemplateView(const Rendering& rendering, const View& view,
                              const FieldMetadata& object, int count) {
  TemplateView made;
  made.R_O_V = view.T_O_C.R;
  const Pose T_C_O = view.T_O_C.inverse();
  const Eigen::Vector3d centre_C = T_C_O * object.centre;
  for (const EdgePixel& edge : chooseFeatures(EdgeFinder(rendering), count)) {
    const float* point = rendering.point.pixel(edge.x, edge.y);
    const double alpha = rendering.alpha.at(edge.x, edge.y, 0);
    const Eigen::Vector3d point_O = Eigen::Map<const Eigen::Vector3f>(point).cast<double>() / alpha;
    const double depth = (T_C_O * point_O).z();
    const Eigen::Vector3d point_C = depth * view.camera.direction(edge.x, edge.y);
    made.features.push_back(
        {((point_C - centre_C) / object.diameter).cast<float>(), edge.normal_rad});
  }
  return made;
}

TemplateBank makeTemplateBank(const LoadedField& field, const TemplateBankSettings& settings,
                              const CancellationToken& cancellation) {
  settings.validate();
  const FieldMetadata& object = field.field().metadata;
  TemplateBank bank;
  for (const View& view :
       viewsAround(object, settings.views, settings.object_px, settings.distance)) {
    bank.views.push_back(
        makeTemplateView(field.render(view, {}, cancellation), view, object, settings.features));
  }
  return bank;
}

}  // namespace nerf_pose_refiner
