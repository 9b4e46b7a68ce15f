// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/group_placement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include "evaluation/aimed_view.h"
#include "evaluation/placement.h"
#include "image/colour.h"
#include "math/angle.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kGroupStream = 72;  // of random numbers

/// Puts instances into an image, one after the other.
class Group {
 public:
  Group(const GroupPlacement& placement, const DisturbanceDraw& draw)
      : placement_(placement),
        draw_(draw),
        image_{Image(placement.width, placement.height, 3),
               Image(placement.width, placement.height, 1)},
        owners_(placement.width, placement.height, 1) {}

  GroupView of(const std::vector<PosedView>& views, std::size_t first) {
    constexpr int kTries = 30;  // a place
    const int count = placement_.least + drawnBelow(placement_.most - placement_.least + 1);
    aim(views.at(first));
    for (int i = 0; i < count; ++i) {
      const std::size_t number = i == 0 ? first : drawnBelow(static_cast<int>(views.size()));
      for (int k = 0; k < kTries && !add(views[number]); ++k) {
      }
    }
    GroupView result = {views[first], {}};
    result.view.camera = result.view.photo_camera = camera_;
    result.view.distortion = {};
    result.view.T_O_C = placed_.front().T_O_C;
    result.view.rgba = std::make_shared<const Image8>(straightBytes(image_));
    for (std::size_t i = 0; i < placed_.size(); ++i) {
      result.instances.push_back({placed_[i].T_O_C, visiblePart(i, owners_)});
    }
    return result;
  }

 private:
  /// An instance in the image.
  struct Placed {
    Pose T_O_C;
    Eigen::Vector2d middle;
    double size;  // its longer side [px]
    int pixels;   // hidden ones, too
  };

  double drawn() {
    const std::uint64_t first = draw_.index << 16;
    return static_cast<double>(randomUniform(draw_.seed, kGroupStream, first + drawn_count_++));
  }
  int drawnBelow(int n) { return std::min(n - 1, static_cast<int>(drawn() * n)); }

  /// Sets the camera, so that the first instance is as large as is drawn.
  void aim(const PosedView& first) {
    const double ratio = placement_.most_width / placement_.least_width;
    const double width = placement_.width;
    const double longest = silhouetteBox(first).sizes().maxCoeff();
    const double scale = width * placement_.least_width * std::pow(ratio, drawn()) / longest;
    const double focal = std::max(first.camera.fx * scale, placement_.least_focal * width);
    camera_ = {placement_.width,
               placement_.height,
               focal,
               focal,
               (width - 1) / 2,
               (placement_.height - 1) / 2.0};
  }

  double visiblePart(std::size_t instance, const Image8& owners) const {
    const auto own = std::count(owners.values.begin(), owners.values.end(), instance + 1);
    return static_cast<double>(own) / placed_[instance].pixels;
  }

  /// A place where an object is wholly in the image, if there is one.
  Eigen::Vector2d drawnPlace(double radius_px) {
    const auto along = [&](int side) {
      const double margin = std::min(radius_px, (side - 1) / 2.0);
      return margin + drawn() * (side - 1 - 2 * margin);
    };
    const double x = along(camera_.width);
    return {x, along(camera_.height)};
  }

  /// At a place that is drawn, in front of the others. @return false: it would hide too much.
  bool add(const PosedView& view) {
    const Eigen::AlignedBox2d box = silhouetteBox(view);
    const double enlarged = camera_.fx / view.camera.fx;
    const Eigen::Vector2d place = drawnPlace(enlarged * box.sizes().norm() / 2);
    const double size = enlarged * box.sizes().maxCoeff();
    for (const Placed& other : placed_) {
      const double apart = placement_.least_apart * (size + other.size) / 2;
      if ((place - other.middle).norm() < apart) return false;
    }
    const Eigen::Matrix3d R = rotationToPlace(view, camera_, place, 2 * kPi * drawn());
    const AimedView aimed = aimedView(view, R, camera_);
    const Image& alpha = aimed.object.alpha;

    Image8 owners = owners_;
    int pixels = 0;
    for (std::size_t i = 0; i < alpha.values.size(); ++i) {
      if (alpha.values[i] < 0.5f) continue;
      owners.values[i] = static_cast<std::uint8_t>(placed_.size() + 1);
      ++pixels;
    }
    if (pixels == 0) return false;
    for (std::size_t i = 0; i < placed_.size(); ++i) {
      if (visiblePart(i, owners) < placement_.least_visible) return false;
    }
    owners_ = owners;
    placed_.push_back({aimed.T_O_C, place, size, pixels});
    putInFront(aimed.object, &image_);
    return true;
  }

  const GroupPlacement& placement_;
  const DisturbanceDraw draw_;
  std::uint64_t drawn_count_ = 0;
  Camera camera_;
  PremultipliedImage image_;
  Image8 owners_;  // of each pixel: 1 + number of its instance; 0: none
  std::vector<Placed> placed_;
};

}  // namespace

GroupView placedGroup(const std::vector<PosedView>& views, std::size_t first,
                      const GroupPlacement& placement, const DisturbanceDraw& draw) {
  return Group(placement, draw).of(views, first);
}

}  // namespace nerf_pose_refiner
