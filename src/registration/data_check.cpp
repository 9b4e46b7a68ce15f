// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/data_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "math/checksum.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMinViews = 3;
constexpr double kSamePose = 1e-6;  // of rotation matrices, and of positions relative to their size
constexpr double kMinAngle_rad = 0.035;
constexpr double kMinObjectPsnr_db = 10;
constexpr double kMinFoundFraction = 0.25;
constexpr double kGoodObjectPsnr_db = 15;  // then a short training may be why poses are not found
constexpr int kMinSearched = 4;

[[noreturn]] void refuse(const std::string& fact, const std::string& advice) {
  throw std::runtime_error(fact + ". " + advice +
                           ", or set accept_poor_data to register it nevertheless");
}

int distinctPhotos(const Dataset& dataset) {
  std::set<std::uint64_t> checksums;
  for (const PosedView& view : dataset.views) {
    Checksum checksum;
    checksum.add(view.rgba->values.data(), view.rgba->values.size());
    checksums.insert(checksum.value());
  }
  return static_cast<int>(checksums.size());
}

bool isSame(const Pose& a, const Pose& b) {
  return (a.R - b.R).norm() <= kSamePose && (a.t - b.t).norm() <= kSamePose * (1 + a.t.norm());
}

/// Poses that differ; no more than are needed are counted.
int distinctPoses(const Dataset& dataset) {
  std::vector<Pose> distinct;
  for (const PosedView& view : dataset.views) {
    const bool known = std::any_of(distinct.begin(), distinct.end(),
                                   [&](const Pose& pose) { return isSame(pose, view.T_O_C); });
    if (!known) distinct.push_back(view.T_O_C);
    if (distinct.size() == kMinViews) break;
  }
  return static_cast<int>(distinct.size());
}

}  // namespace

void requireDifferentViews(const Dataset& dataset) {
  const std::string total = std::to_string(dataset.views.size());
  const int photos = distinctPhotos(dataset);
  if (photos < kMinViews) {
    refuse("of the " + total + " photos only " + std::to_string(photos) + " differ, " +
               std::to_string(kMinViews) + " are needed at least",
           "Take 20 or more from all sides");
  }
  const int poses = distinctPoses(dataset);
  if (poses < kMinViews) {
    refuse("the " + total + " photos have " + std::to_string(poses) + " different poses, " +
               std::to_string(kMinViews) + " are needed at least",
           "Move the camera around the object, and check where the poses come from");
  }
}

void requireDirections(const Dataset& dataset, const Eigen::Vector3d& centre) {
  const auto direction = [&](const PosedView& view) -> Eigen::Vector3d {
    return (view.T_O_C.t - centre).normalized();
  };
  const Eigen::Vector3d first = direction(dataset.views.front());
  const bool spread =
      std::any_of(dataset.views.begin(), dataset.views.end(), [&](const PosedView& view) {
        return std::acos(std::min(1.0, first.dot(direction(view)))) >= kMinAngle_rad;
      });
  if (spread) return;
  refuse("all photos look at the object from one direction",
         "Move the camera around the object, and check where the poses come from");
}

void requireUsableModel(const FieldMetadata& object, int searched) {
  const char* advice =
      "Check that the poses belong to the photos and that the box holds the whole object, or train "
      "with more steps";
  char fact[160];
  const double psnr_db = -20 * std::log10(std::max(1e-9, object.score.mean_loss));
  const bool known = object.score.views > 0;
  if (known && psnr_db < kMinObjectPsnr_db) {
    std::snprintf(fact, sizeof fact,
                  "the model does not look like its photos: PSNR %.1f dB on the object in held-out "
                  "photos, %.0f dB is needed",
                  psnr_db, kMinObjectPsnr_db);
    refuse(fact, advice);
  }
  if (known && psnr_db >= kGoodObjectPsnr_db) return;
  if (searched >= kMinSearched && object.pose.views < kMinFoundFraction * searched) {
    std::snprintf(fact, sizeof fact,
                  "of %d photos the model finds the poses of %d again, %.0f %% are needed",
                  searched, object.pose.views, 100 * kMinFoundFraction);
    refuse(fact, advice);
  }
}

}  // namespace nerf_pose_refiner
