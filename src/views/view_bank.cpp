// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/view_bank.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>

#include "math/require.h"
#include "views/sphere_directions.h"

namespace nerf_pose_refiner {
namespace {

std::size_t bytesOf(const PointColumns& points) {
  return points.cell.size() * (3 * sizeof(float) + sizeof(std::int32_t));
}

}  // namespace

bool operator==(const ViewBankSettings& a, const ViewBankSettings& b) {
  return a.views == b.views && a.object_px == b.object_px && a.distance == b.distance &&
         a.keyframe == b.keyframe;
}

std::vector<View> viewsOf(const FieldMetadata& object, const ViewBankSettings& settings) {
  settings.validate();
  constexpr double kWidth = 2;  // of an image [diameters of the object]
  return viewsAround(object, settings.views, settings.object_px, settings.distance, kWidth);
}

void ViewBankSettings::validate() const {
  require(views >= 1 && views <= 10000, "ViewBankSettings::views", views);
  require(object_px >= 16, "ViewBankSettings::object_px", object_px);
  require(distance > 1, "ViewBankSettings::distance", distance);
  keyframe.validate();
}

ViewBank::ViewBank(std::shared_ptr<const LoadedField> field, const ViewBankSettings& settings)
    : field_(std::move(field)),
      settings_(settings),
      seen_from_(viewsOf(field_->field().metadata, settings)),
      views_(seen_from_.size()) {}

std::shared_ptr<ViewBank> ViewBank::of(const std::shared_ptr<const LoadedField>& field,
                                       const ViewBankSettings& settings) {
  static std::mutex mutex;
  static std::vector<std::weak_ptr<ViewBank>> banks;  // those that are in use, and past ones
  const std::lock_guard<std::mutex> lock(mutex);
  banks.erase(std::remove_if(banks.begin(), banks.end(),
                             [](const std::weak_ptr<ViewBank>& bank) { return bank.expired(); }),
              banks.end());
  for (const std::weak_ptr<ViewBank>& one : banks) {
    const std::shared_ptr<ViewBank> bank = one.lock();
    if (bank && bank->field_ == field && bank->settings_ == settings) return bank;
  }
  const auto bank = std::make_shared<ViewBank>(field, settings);
  banks.push_back(bank);
  return bank;
}

std::vector<int> ViewBank::around(const Pose& T_O_C, double angle_rad) const {
  const Eigen::Vector3d sight = (T_O_C.t - field_->field().metadata.centre).normalized();
  const auto cosine = [&](int i) { return -seen_from_[i].T_O_C.R.col(2).dot(sight); };
  std::vector<int> numbers;
  int nearest = 0;
  for (int i = 0; i < static_cast<int>(seen_from_.size()); ++i) {
    if (cosine(i) > cosine(nearest)) nearest = i;
    if (cosine(i) >= std::cos(angle_rad)) numbers.push_back(i);
  }
  if (numbers.empty()) numbers.push_back(nearest);
  return numbers;
}

/// Two threads that need a view at the same time may both render it: the first one's stays.
void ViewBank::make(const std::vector<int>& numbers, const CancellationToken& cancellation) {
  std::vector<int> missing;
  std::vector<View> views;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const int number : numbers) {
      if (views_.at(number)) continue;
      missing.push_back(number);
      views.push_back(seen_from_[number]);
    }
  }
  std::vector<KeyframePoints> made =
      renderKeyframes(*field_, views, settings_.keyframe, cancellation);
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < made.size(); ++i) {
    std::shared_ptr<const KeyframePoints>& view = views_[missing[i]];
    if (!view) view = std::make_shared<const KeyframePoints>(std::move(made[i]));
  }
}

std::shared_ptr<const KeyframePoints> ViewBank::view(int number,
                                                     const CancellationToken& cancellation) {
  make({number}, cancellation);
  const std::lock_guard<std::mutex> lock(mutex_);
  return views_[number];
}

bool ViewBank::isMade(int number) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return views_.at(number) != nullptr;
}

int ViewBank::made() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto missing = std::count(views_.begin(), views_.end(), nullptr);
  return static_cast<int>(static_cast<std::ptrdiff_t>(views_.size()) - missing);
}

std::size_t ViewBank::memory_bytes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::size_t bytes = 0;
  for (const auto& view : views_) bytes += view ? memoryBytes(*view) : 0;
  return bytes;
}

std::size_t memoryBytes(const KeyframePoints& keyframe) {
  std::size_t bytes = sizeof keyframe;
  for (const KeyframeLevel& level : keyframe.levels) {
    const std::size_t chosen = level.chosen.cell.size();
    bytes += bytesOf(level.shown) + 3 * sizeof(float) * level.shown.cell.size();
    bytes += bytesOf(level.chosen) + chosen * (10 * sizeof(float) + sizeof(ChosenSurface));
    bytes += level.outline.size() * sizeof(OutlinePoint);
    bytes += (level.tiles.size() + level.outline_tiles.size()) * sizeof(std::int32_t);
  }
  return bytes;
}

}  // namespace nerf_pose_refiner
