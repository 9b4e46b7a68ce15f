// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Points are distributed evenly over cells of this size [px].
constexpr int kChoiceCell = 8;

/// A pixel that may be chosen as a point, y * width + x.
struct PointCandidate {
  int pixel = 0;
  float information = 0;
};

/// The candidates of cells, cell by cell.
struct CellCandidates {
  std::vector<PointCandidate> all;
  std::vector<std::size_t> ends;  ///< of cells that have any, in `all`
};

/// Pixels that say something of the pose: the squared gradient of their colours.
/// @param normalised [h][w][3] locally normalised colours. @param shown [h][w], 0: not known; a
/// pixel with such a neighbour says nothing. @param first, last rows from `first` to before `last`;
/// `first` is a multiple of kChoiceCell.
CellCandidates candidatesIn(const Image& normalised, const std::vector<char>& shown, int first,
                            int last);

/// Those that say most, evenly over a keyframe: the best of every small cell first, then the second
/// best, until there are enough.
/// @param parts of the keyframe.
/// @return their pixels; fewer than `max_count` where fewer say something.
std::vector<int> choosePoints(std::vector<CellCandidates> parts, int max_count);

}  // namespace nerf_pose_refiner
