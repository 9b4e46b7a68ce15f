// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>

#include "backend/backend.h"
#include "evaluation/trust_rows.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// What came of the images of a row.
struct TrustCounts {
  int images = 0;
  int right = 0;      ///< found within 5 degrees and 5 % of the diameter, published or not
  int published = 0;  ///< poses
  int wrong = 0;      ///< of these: farther off, or of an object that is not there
  int runs = 0;       ///< of tracked rows
  int back = 0;       ///< of these: the last image's pose was published and right

  TrustCounts& operator+=(const TrustCounts& other);
};

/// An image of a row, and what came of it.
struct TrustSample {
  const TrustImage& image;
  int number;  ///< of the image in the row
  const TrackOutcome& outcome;
  double rotation_deg;   ///< error
  double offset;         ///< error [diameters]
  double squared_error;  ///< e^T C^-1 e / 6
  bool right;
};

/// Shows images to a tracker with the node's defaults, and counts what it publishes.
class TrustTable {
 public:
  using Report = std::function<void(const TrustSample&)>;

  /// @throws as ObjectTracker.
  TrustTable(std::shared_ptr<Backend> backend, std::shared_ptr<const Field> object,
             const TrackerSettings& settings);

  /// @param report called with each image; may be empty.
  TrustCounts show(const TrustRow& row, const TrustScene& scene, const Report& report = {});

 private:
  void offerStart(const TrustScene& scene, double rotation_rad, double translation);
  TrustSample judged(const TrustImage& image, const TrustScene& scene,
                     const TrackOutcome& outcome) const;

  std::shared_ptr<const Field> object_;
  ObjectTracker tracker_;
  std::int64_t stamp_ns_ = 0;
  std::uint64_t starts_ = 0;
};

}  // namespace nerf_pose_refiner
