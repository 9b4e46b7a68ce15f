// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/projection.h"
#include "math/vec.h"
#include "nerf_pose_refiner/depth.h"

namespace nerf_pose_refiner {

/// A place on the outline of an object.
struct OutlineEdge {
  Vec3<double> p;       ///< relative to the object's centre, in the axes of O [model units]
  Vec3<double> normal;  ///< to the outside, across the line of sight, alike; of any length
};

/// Where a depth image is looked at for an edge.
struct EdgeProfile {
  Pixel<double> middle;                  ///< where the outline is expected [px]
  Pixel<double> outside;                 ///< direction in the image, of length 1
  double nearest_m = 0, farthest_m = 0;  ///< depths that the object may have inside
};

/// What it shows there.
struct DepthEdge {
  enum class Kind {
    kUnknown,  ///< too little was measured, or something nearer is there
    kNone,     ///< depth goes on as it is
    kFound     ///< depth falls off
  };
  Kind kind = Kind::kUnknown;
  double offset_px = 0;     ///< from the middle to where it does, outwards
  double deviation_px = 0;  ///< of that
};

/// Pixels on either side that are looked at.
constexpr int kEdgeReach_px = 6;

/// Looks for the place beside which depth falls off.
DepthEdge findDepthEdge(const DepthImage& depth, const EdgeProfile& profile);

}  // namespace nerf_pose_refiner
