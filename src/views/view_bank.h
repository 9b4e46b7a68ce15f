// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "backend/keyframe_points.h"
#include "backend/loaded_field.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

/// Keyframes for coarse alignment from many starts.
inline KeyframeSettings smallKeyframes() {
  KeyframeSettings settings;
  settings.levels = 3;
  settings.max_side_px = 128;
  settings.max_rays_of_side = 0;
  settings.finest_window_px = 8;
  settings.max_points = 700;
  settings.max_outline = 120;
  settings.max_shown = 2500;
  settings.for_starts = true;
  return settings;
}

/// Settings of a view bank.
struct ViewBankSettings {
  int views = 162;      ///< number of viewpoints; 162 are about 16 degrees apart
  int object_px = 100;  ///< object diameter in the views [px]
  double distance = 4;  ///< of the camera from the object's centre [object diameters]
  KeyframeSettings keyframe = smallKeyframes();

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

bool operator==(const ViewBankSettings& a, const ViewBankSettings& b);

/// What a bank's keyframes show, in its order. @throws std::invalid_argument as `validate`.
std::vector<View> viewsOf(const FieldMetadata& object, const ViewBankSettings& settings);

/// Small keyframes of an object from all sides, with which a search begins. Each is rendered on
/// first use. Any thread may use it if its field may be.
class ViewBank {
 public:
  ViewBank(std::shared_ptr<const LoadedField> field, const ViewBankSettings& settings);

  /// The bank that others of this process use already for the same field with the same settings, or
  /// else a new one.
  static std::shared_ptr<ViewBank> of(const std::shared_ptr<const LoadedField>& field,
                                      const ViewBankSettings& settings);

  /// Indices of the views whose line of sight to the object's centre differs from that of a pose by
  /// at most an angle; at least the nearest one.
  std::vector<int> around(const Pose& T_O_C, double angle_rad) const;

  int size() const { return static_cast<int>(seen_from_.size()); }

  /// Renders those of these views that were not yet. @throws Cancelled.
  void make(const std::vector<int>& numbers, const CancellationToken& cancellation);

  /// A view, which is rendered on first use. @throws Cancelled.
  std::shared_ptr<const KeyframePoints> view(int number, const CancellationToken& cancellation);

  /// Whether a view was rendered.
  bool isMade(int number) const;

  /// Number of the views rendered so far.
  int made() const;

  /// Memory of them.
  std::size_t memory_bytes() const;

 private:
  std::shared_ptr<const LoadedField> field_;
  ViewBankSettings settings_;
  std::vector<View> seen_from_;

  mutable std::mutex mutex_;                                  // guards what follows
  std::vector<std::shared_ptr<const KeyframePoints>> views_;  // null: not rendered yet
};

/// Memory of a keyframe [bytes].
std::size_t memoryBytes(const KeyframePoints& keyframe);

}  // namespace nerf_pose_refiner
