// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/descriptor_index.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Kinds of local features.
enum class FeatureKind : std::uint32_t {
  kSift = 1,   ///< SIFT (Lowe 2004), descriptors as RootSIFT (Arandjelovic and Zisserman 2012)
  kAkaze = 2,  ///< AKAZE's places (Alcantarilla et al. 2013), with the descriptors of KAZE
};

/// SIFT where OpenCV has it (4.4 and later), else AKAZE.
FeatureKind bestFeatureKind();

/// Where a feature is, and how large.
struct FeaturePlace {
  float x = 0, y = 0;   ///< [px]
  float size_px = 0;    ///< diameter of what it describes, before the descriptor's margin
  float angle_rad = 0;  ///< its orientation, from x to y
};

/// Local features of an image: places and descriptors in the same order.
struct ImageFeatures {
  std::vector<FeaturePlace> places;
  Descriptors descriptors;  ///< of length 1

  int size() const { return static_cast<int>(places.size()); }
};

struct FeatureSettings {
  FeatureKind kind = bestFeatureKind();
  int max_features = 1500;  ///< those of the strongest response are kept
  double contrast = 0.02;   ///< least contrast of SIFT, as OpenCV counts; AKAZE has a fixed one
};

/// Finds local features. @param grey [h][w][1]. @param where [h][w][1], 0 where none is wanted;
/// empty: everywhere. @throws std::invalid_argument for images of other channels or sizes, and for
/// a kind that this build's OpenCV lacks.
ImageFeatures findFeatures(const Image8& grey, const Image8& where,
                           const FeatureSettings& settings);

/// The luminance of a colour image, [h][w][1]. @param colour [h][w][3], 0..1, sRGB-encoded.
Image8 luminance(const Image& colour);

}  // namespace nerf_pose_refiner
