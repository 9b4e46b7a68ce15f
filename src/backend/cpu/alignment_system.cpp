// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/alignment_system.h"

#include <algorithm>
#include <cmath>

#include "backend/cpu/region_model.h"

namespace nerf_pose_refiner {
namespace {

Vec3<float> toVec(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

ImageSample<float> sampleAt(const Image& image, int x, int y) {
  const float* left = image.pixel(std::max(x - 1, 0), y);
  const float* right = image.pixel(std::min(x + 1, image.width - 1), y);
  const float* above = image.pixel(x, std::max(y - 1, 0));
  const float* below = image.pixel(x, std::min(y + 1, image.height - 1));
  const float* here = image.pixel(x, y);
  ImageSample<float> sample;
  for (int c = 0; c < 4; ++c) {
    sample.value[c] = here[c];
    sample.du[c] = 0.5f * (right[c] - left[c]);
    sample.dv[c] = 0.5f * (below[c] - above[c]);
  }
  return sample;
}

RegionPixel regionAt(const AlignmentTarget& target, int x, int y) {
  if (target.regions == nullptr) return {};
  const float* regions = target.observed->pixel(x, y);
  return {regions[kConfidence], regions[kInside], target.regions->background_density.at(x, y, 0)};
}

void addTile(const NormalEquations6<float>& tile, AlignmentSums* sums) {
  for (int i = 0; i < 21; ++i) sums->equations.information[i] += tile.information[i];
  for (int i = 0; i < 6; ++i) sums->equations.gradient[i] += tile.gradient[i];
  sums->scatter.addTile(tile);
}

}  // namespace

AlignmentView viewOf(const AlignmentTarget& target, const Pose& T_O_C) {
  const Camera& camera = target.level->camera;
  AlignmentView view;
  view.K = {static_cast<float>(camera.fx), static_cast<float>(camera.fy),
            static_cast<float>(camera.cx), static_cast<float>(camera.cy)};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) view.pose.R.m[i][j] = static_cast<float>(T_O_C.R(i, j));
  }
  view.pose.o = toVec(T_O_C.t);
  view.centre = toVec(target.centre);
  view.centre_depth = static_cast<float>((T_O_C.inverse() * target.centre).z());
  return view;
}

PixelResidual<float> residualAt(const AlignmentTarget& target, const Image& image,
                                const GainBias<float>& gain_bias, int x, int y) {
  return comparePixel(target.rules, sampleAt(image, x, y), sampleAt(*target.observed, x, y),
                      gain_bias, regionAt(target, x, y));
}

PixelFlow<float> flowAt(const AlignmentView& view, const Image& image, int x, int y) {
  const float* pixel = image.pixel(x, y);
  return surfaceFlow(view, {pixel[kPoint], pixel[kPoint + 1], pixel[kPoint + 2]}, pixel[kOpacity],
                     x, y);
}

void GainBiasMoments::add(const GainBiasMoments& other) {
  for (int c = 0; c < 3; ++c) {
    weight[c] += other.weight[c];
    x[c] += other.x[c];
    y[c] += other.y[c];
    xx[c] += other.xx[c];
    xy[c] += other.xy[c];
  }
}

void AlignmentSums::add(const AlignmentSums& other) {
  weight += other.weight;
  cost += other.cost;
  opacity += other.opacity;
  agreeing += other.agreeing;
  unexplained += other.unexplained;
  squared_residual += other.squared_residual;
  residual_weight += other.residual_weight;
  scatter.add(other.scatter);
  for (int i = 0; i < 21; ++i) equations.information[i] += other.equations.information[i];
  for (int i = 0; i < 6; ++i) equations.gradient[i] += other.equations.gradient[i];
}

GainBiasMoments sumGainBias(const AlignmentTarget& target, const Image& image,
                            const GainBias<float>& gain_bias, RowRange rows) {
  GainBiasMoments sums;
  for (int y = rows.first; y < rows.end; ++y) {
    for (int x = 0; x < image.width; ++x) {
      sums.addPixel(image.pixel(x, y), target.observed->pixel(x, y),
                    target.level->weight.at(x, y, 0), gain_bias, target.rules.robust_scale);
    }
  }
  return sums;
}

AlignmentSums sumAlignment(const AlignmentTarget& target, const Image& image, const Pose& T_O_C,
                           const GainBias<float>& gain_bias, RowRange rows) {
  const AlignmentView view = viewOf(target, T_O_C);
  AlignmentSums sums;
  for (int left = 0; left < image.width; left += kTileSide) {
    const int right = std::min(image.width, left + kTileSide);
    NormalEquations6<float> tile;  // single precision suffices for a tile
    for (int y = rows.first; y < rows.end; ++y) {
      for (int x = left; x < right; ++x) {
        const float pixel_weight = target.level->weight.at(x, y, 0);
        if (pixel_weight == 0) continue;
        const ComparedPixel pixel = {residualAt(target, image, gain_bias, x, y),
                                     flowAt(view, image, x, y), regionAt(target, x, y),
                                     image.at(x, y, kOpacity), pixel_weight};
        addComparedPixel<double>(target.rules, pixel, &sums, &tile);
      }
    }
    addTile(tile, &sums);
  }
  return sums;
}

}  // namespace nerf_pose_refiner
