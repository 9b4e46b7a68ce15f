// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

#include <cstddef>
#include <optional>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// What is known of where the object is. All of it may be left out.
struct SearchArea {
  /// Of an observation's boxes, at most: each takes the time of a small image.
  static constexpr std::size_t kMaxBoxes = 20;

  std::optional<Eigen::AlignedBox2d> box;  ///< the object is seen in it: borders of pixels [px]
  std::optional<double> distance;          ///< of its centre from the camera [model units]
  double distance_ratio = 1.5;             ///< it may be so many times nearer or farther, above 1
  /// How much likelier a pose is right than one that is found in a whole image.
  double odds = 1;

  /// @throws std::invalid_argument for a box or a distance that makes no sense.
  void validate() const;
};

/// The odds of poses in an area beside what alignment says of them. Where nobody says that the
/// object is there (no box, no mask, no better odds), its colours have to agree, too; they are not
/// seen in a grey image.
double oddsIn(const SearchArea& area, const Observation& observation);

/// The areas to look in, one after the other: the first of the observation's boxes, or else the
/// area itself.
std::vector<SearchArea> areasOf(const Observation& observation, const SearchArea& area);

/// The part of an image that is searched: a box and what is around it.
struct SearchedPart {
  PixelWindow window;  ///< of the image
  Camera camera;       ///< of the window, reduced
};

/// Nothing, if too little of it is in the image. @param max_side_px of the part, reduced.
std::optional<SearchedPart> searchedPart(const Camera& camera, const SearchArea& area,
                                         int max_side_px);

/// What an observation shows of a part, reduced, [h][w][3].
Image coloursOf(const Observation& observation, const SearchedPart& part);

/// Where an observation says that the object may be, 0 or 255, [h][w][1]; empty: everywhere.
/// @param part of its image, resized.
Image8 allowedPixels(const Observation& observation, const Camera& part);

/// Whether a pixel within a radius of a place is allowed: in the middle a mask may have a hole.
/// @param allowed @see allowedPixels.
bool isAnyAllowed(const Image8& allowed, const Eigen::Vector2d& middle, double radius_px);

/// Whether a candidate's distance is that of the area, if it has one.
bool isAtDistance(const SearchArea& area, double distance);

}  // namespace nerf_pose_refiner
