// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "math/keyframe_alignment.h"
#include "math/outline_alignment.h"
#include "math/relighting.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Points of the object, coordinate by coordinate: relative to its centre, in the axes of O [model
/// units].
struct PointColumns {
  std::vector<float> x, y, z;
  std::vector<std::int32_t> cell;  ///< the pixel y * width + x of the level's grid

  int size() const { return static_cast<int>(cell.size()); }
};

/// The surface around a point, for steps of a pixel of the keyframe to the right and down.
struct ChosenSurface {
  Eigen::Vector3f tangent[2];   ///< how the point moves, in the axes of O [model units]
  Eigen::Vector2f gradient[3];  ///< how its locally normalised colour changes
};

/// Mean and spread of the colours around points, channel by channel.
struct LocalColourColumns {
  std::vector<float> mean[3];
  std::vector<float> inverse_deviation[3];

  void resize(std::size_t points) {
    for (int c = 0; c < 3; ++c) {
      mean[c].resize(points);
      inverse_deviation[c].resize(points);
    }
  }
  LocalColours<float> at(std::size_t i) const {
    return {{mean[0][i], mean[1][i], mean[2][i]},
            {inverse_deviation[0][i], inverse_deviation[1][i], inverse_deviation[2][i]}};
  }
};

/// A place on the outline of the object.
struct OutlinePoint {
  Eigen::Vector3f point;    ///< relative to the object's centre, in the axes of O [model units]
  Eigen::Vector3f normal;   ///< a pixel of the keyframe to the outside, at the point's depth, alike
  OutlineLook<float> look;  ///< along the normal
};

/// One resolution of a keyframe: what alignment compares with an image.
struct KeyframeLevel {
  /// Local colours are taken on a grid of every so many-th pixel of the keyframe, along both axes.
  int spacing = 1;
  int width = 0, height = 0;  ///< of this grid; cells of points are its pixels
  int window = 0;             ///< half width of the neighbourhood of local colours, in it

  /// Every pixel of the grid that shows the object for certain, and its colours, not normalised;
  /// local colours are taken over these. Groups are filled up with the pixel width * height, which
  /// is none.
  PointColumns shown;
  std::vector<float> shown_colour[3];
  std::vector<Vec3<float>> shown_normal;    ///< of the surface, @see surfaceNormal; 0: not known
  std::vector<std::int32_t> light_samples;  ///< some of them, which tell the light, in order

  /// Pixels that say most about the pose, sorted by tiles; each tile is a whole number of groups.
  PointColumns chosen;
  int point_count = 0;                 ///< of the chosen ones, without what fills groups
  std::vector<float> weight;           ///< of the chosen ones: 1, or 0 for what fills a group
  std::vector<float> colour[3];        ///< of the chosen ones, locally normalised ...
  LocalColourColumns local;            ///< ... by this: the colour is (colour - mean) / deviation
  std::vector<ChosenSurface> surface;  ///< around the chosen ones
  std::vector<OutlinePoint> outline;   ///< evenly along it, sorted by tiles
  float outline_weight = 0;            ///< of one of them in alignment, beside a chosen point
  float outline_evidence = 0;          ///< the same in what speaks for a pose
  std::vector<std::int32_t> outline_tiles;  ///< where each tile begins; last: their number
  std::vector<std::int32_t> tiles;  ///< where each tile begins among the chosen; last: their number
};

/// A rendering of the object that is made once and aligned with many images.
struct KeyframePoints {
  Camera camera;           ///< of the images that it was made for
  Pose T_O_C;              ///< it was rendered from here
  Eigen::Vector3d centre;  ///< of the object, in O [model units]
  double diameter = 0;     ///< of the object [model units]
  int reduction = 1;       ///< pixels of the image along a pixel of the first level: a power of two
  std::vector<KeyframeLevel> levels;  ///< finest first, each half as fine as the one before
};

}  // namespace nerf_pose_refiner
