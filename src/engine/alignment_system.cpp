// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "alignment_system.h"

#include <algorithm>
#include <cmath>

#include "region_model.h"

namespace nerf_pose_refiner {
namespace {

// Robust difference of contrasts that have nothing to do with each other; they agree below half.
constexpr float kChance = 0.8f;
constexpr float kContrastScale = 2;  // of the robust scale: contrasts differ by more than colours

constexpr float kPlaneOpacity = 0.01f;  // below it the object's plane stands in for the point

Vec3<float> toVec(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

PictureSample<float> sampleAt(const Image& picture, int x, int y) {
  const float* left = picture.pixel(std::max(x - 1, 0), y);
  const float* right = picture.pixel(std::min(x + 1, picture.width - 1), y);
  const float* above = picture.pixel(x, std::max(y - 1, 0));
  const float* below = picture.pixel(x, std::min(y + 1, picture.height - 1));
  const float* here = picture.pixel(x, y);
  PictureSample<float> sample;
  for (int c = 0; c < 4; ++c) {
    sample.value[c] = here[c];
    sample.du[c] = 0.5f * (right[c] - left[c]);
    sample.dv[c] = 0.5f * (below[c] - above[c]);
  }
  return sample;
}

float squaredColour(const PixelResidual<float>& r) {
  return r.value[0] * r.value[0] + r.value[1] * r.value[1] + r.value[2] * r.value[2];
}

// What a pixel says of how well a pose fits.
struct PixelJudgement {
  float cost;
  bool agrees;  // the object looks there as it is rendered
};

PixelJudgement judgePixel(const AlignmentTarget& target, const PixelResidual<float>& r, float A,
                          const RobustTerm<float>& colour, const RobustTerm<float>& opacity, int x,
                          int y) {
  const float squared = squaredColour(r), scale = target.robust_scale;
  PixelJudgement judgement;
  judgement.cost = r.colour_weight * colour.value + r.opacity_weight * opacity.value;
  judgement.agrees = squared < 4 * scale * scale;
  if (target.compare_contrast) {
    // What the object explains better than chance is worth its pixels, what it explains worse costs
    // them: neither a small silhouette nor a large one is cheaper as such.
    const float own = A > 1e-2f ? squared / (A * A) : 0.0f;
    const float contrast_scale = kContrastScale * scale;
    judgement.cost = A * (own / (own + contrast_scale * contrast_scale) - kChance);
    judgement.agrees = squared < 4 * contrast_scale * contrast_scale;
  } else if (target.regions != nullptr) {
    const float object = objectDensity(squared / std::max(A * A, 1e-4f));
    const float background = target.regions->background_density.at(x, y, 0);
    judgement.agrees = object > background;
    if (target.rank_by_regions) judgement.cost = mixtureCost(A, object, background);
  }
  return judgement;
}

void addPixelOf(const AlignmentTarget& target, const AlignmentView& view, const Image& picture,
                int x, int y, const GainBias<float>& light, float pixel_weight, AlignmentSums* sums,
                NormalEquations6<float>* equations) {
  const PixelResidual<float> r = residualAt(target, picture, light, x, y);
  const float A = picture.at(x, y, kOpacity);
  const float squared = squaredColour(r);
  const float colour_scale = (target.compare_contrast ? kContrastScale : 1) * target.robust_scale;
  const RobustTerm<float> colour = gemanMcClure(squared, colour_scale);
  const RobustTerm<float> opacity = huber(r.value[3] * r.value[3], target.robust_scale);
  const PixelJudgement judgement = judgePixel(target, r, A, colour, opacity, x, y);
  sums->weight += pixel_weight;
  sums->cost += pixel_weight * judgement.cost;
  sums->opacity += pixel_weight * A;
  if (judgement.agrees) sums->agreeing += pixel_weight * A;
  if (!judgement.agrees && target.regions == nullptr && !target.compare_contrast) {
    sums->unexplained += pixel_weight * (1 - A);
  }
  const float colour_weight = pixel_weight * r.colour_weight * colour.weight;
  const float opacity_weight = pixel_weight * r.opacity_weight * opacity.weight;
  sums->squared_residual += colour_weight * squared;
  sums->residual_weight += 3 * colour_weight;
  const float weights[4] = {colour_weight, colour_weight, colour_weight, opacity_weight};
  addPixel(flowAt(view, picture, x, y), r, weights, equations);
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

PixelResidual<float> residualAt(const AlignmentTarget& target, const Image& picture,
                                const GainBias<float>& light, int x, int y) {
  const PictureSample<float> rendered = sampleAt(picture, x, y);
  const PictureSample<float> observed = sampleAt(*target.observed, x, y);
  if (target.compare_contrast) {
    return unknownBackgroundResidual(rendered, observed, light, 1.0f, 0.0f);
  }
  if (target.regions == nullptr) {
    return knownBackgroundResidual(rendered, observed, light, target.background_colour.data(),
                                   target.opacity_weight);
  }
  const float* regions = target.observed->pixel(x, y);
  return unknownBackgroundResidual(rendered, observed, light, regions[kInside],
                                   target.opacity_weight * regions[kConfidence]);
}

PixelFlow<float> flowAt(const AlignmentView& view, const Image& picture, int x, int y) {
  const float* pixel = picture.pixel(x, y);
  const Vec3<float> q = {(static_cast<float>(x) - view.K.cx) / view.K.fx * view.centre_depth,
                         (static_cast<float>(y) - view.K.cy) / view.K.fy * view.centre_depth,
                         view.centre_depth};
  const Vec3<float> on_plane = view.pose.R * q + view.pose.o - view.centre;
  const Vec3<float> rendered = {pixel[kPoint], pixel[kPoint + 1], pixel[kPoint + 2]};
  const Vec3<float> point =
      (1 / (pixel[kOpacity] + kPlaneOpacity)) * (rendered + kPlaneOpacity * on_plane);
  return pixelFlow(view.K, view.pose, view.centre, point);
}

void LightMoments::add(const LightMoments& other) {
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
  for (int i = 0; i < 21; ++i) equations.information[i] += other.equations.information[i];
  for (int i = 0; i < 6; ++i) equations.gradient[i] += other.equations.gradient[i];
}

LightMoments sumLight(const AlignmentTarget& target, const Image& picture,
                      const GainBias<float>& light, int first_row, int last_row) {
  LightMoments sums;
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const float* rendered = picture.pixel(x, y);
      const float* observed = target.observed->pixel(x, y);
      const float A = rendered[kOpacity];
      const float pixel_weight = target.level->weight.at(x, y, 0);
      if (A < 0.5f || pixel_weight == 0) continue;
      float colour[3], squared = 0;
      for (int c = 0; c < 3; ++c) {
        colour[c] = rendered[c] / A;
        const float r = light.gain[c] * colour[c] + light.bias[c] - observed[c];
        squared += r * r;
      }
      const float weight =
          pixel_weight * A * A * gemanMcClure(squared, 2 * target.robust_scale).weight;
      for (int c = 0; c < 3; ++c) {
        sums.weight[c] += weight;
        sums.x[c] += weight * colour[c];
        sums.y[c] += weight * observed[c];
        sums.xx[c] += weight * colour[c] * colour[c];
        sums.xy[c] += weight * colour[c] * observed[c];
      }
    }
  }
  return sums;
}

GainBias<float> solveLight(const LightMoments& m) {
  GainBias<float> light;
  for (int c = 0; c < 3; ++c) {
    // Towards gain 1 and bias 0, each with the strength of a share of the pixels.
    const double gain_prior = 0.02 * m.weight[c] + 1e-6;
    const double bias_prior = 0.3 * m.weight[c] + 1e-6;
    const double a = m.xx[c] + gain_prior, b = m.x[c], d = m.weight[c] + bias_prior;
    const double right_gain = m.xy[c] + gain_prior, right_bias = m.y[c];
    const double determinant = a * d - b * b;
    const double gain = (d * right_gain - b * right_bias) / determinant;
    const double bias = (a * right_bias - b * right_gain) / determinant;
    light.gain[c] = static_cast<float>(gain);
    light.bias[c] = static_cast<float>(bias);
  }
  return light;
}

AlignmentSums sumAlignment(const AlignmentTarget& target, const Image& picture, const Pose& T_O_C,
                           const GainBias<float>& light, int first_row, int last_row) {
  const AlignmentView view = viewOf(target, T_O_C);
  AlignmentSums sums;
  for (int y = first_row; y < last_row; ++y) {
    NormalEquations6<float> row;  // single precision suffices for a row
    for (int x = 0; x < picture.width; ++x) {
      const float pixel_weight = target.level->weight.at(x, y, 0);
      if (pixel_weight == 0) continue;
      addPixelOf(target, view, picture, x, y, light, pixel_weight, &sums, &row);
    }
    for (int i = 0; i < 21; ++i) sums.equations.information[i] += row.information[i];
    for (int i = 0; i < 6; ++i) sums.equations.gradient[i] += row.gradient[i];
  }
  return sums;
}

}  // namespace nerf_pose_refiner
