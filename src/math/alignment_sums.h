// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>

#include "math/alignment.h"
#include "math/colour_density.h"

namespace nerf_pose_refiner {

/// Sums over the pixels of an image: how well a pose fits, and how to improve it.
template <typename T>
struct AlignmentSumsOf {
  T weight = 0;            ///< of the pixels
  T cost = 0;              ///< weighted sum; divided by `weight`, the loss of the pose
  T opacity = 0;           ///< rendered
  T agreeing = 0;          ///< rendered opacity where the object looks as rendered
  T unexplained = 0;       ///< emptiness where a known background does not look as known
  T squared_residual = 0;  ///< robustly weighted
  T residual_weight = 0;   ///< the weights' sum
  NormalEquations6<T> equations;
};

/// A pose's rendering as seen through its camera: what says how pixels move.
struct AlignmentView {
  Pinhole<float> K;
  CameraPose<float> pose;
  Vec3<float> centre;  ///< of the object, in O [model units]
  float centre_depth;  ///< of it, before the camera [model units]
};

/// How the image flows past pixel (x, y) when the camera moves. Where the rendering is empty, the
/// pixel is taken to show the plane through the object's centre, so that the observation attracts
/// it.
/// @param point opacity times the point that the pixel shows, relative to the centre.
NPR_HOST_DEVICE inline PixelFlow<float> surfaceFlow(const AlignmentView& view,
                                                    const Vec3<float>& point, float opacity, int x,
                                                    int y) {
  constexpr float kPlaneOpacity = 0.01f;  // below it the object's plane stands in for the point
  const Vec3<float> q = {(static_cast<float>(x) - view.K.cx) / view.K.fx * view.centre_depth,
                         (static_cast<float>(y) - view.K.cy) / view.K.fy * view.centre_depth,
                         view.centre_depth};
  const Vec3<float> on_plane = view.pose.R * q + view.pose.o - view.centre;
  const Vec3<float> shown = (1 / (opacity + kPlaneOpacity)) * (point + kPlaneOpacity * on_plane);
  return pixelFlow(view.K, view.pose, view.centre, shown);
}

/// A pixel's residuals, robustly.
struct RobustResidual {
  float squared;  ///< of the colours
  RobustTerm<float> colour, opacity;
};

NPR_HOST_DEVICE inline RobustResidual robustResidual(const PixelResidual<float>& r,
                                                     float colour_scale, float opacity_scale) {
  RobustResidual robust;
  robust.squared = r.value[0] * r.value[0] + r.value[1] * r.value[1] + r.value[2] * r.value[2];
  robust.colour = gemanMcClure(robust.squared, colour_scale);
  robust.opacity = gemanMcClure(r.value[3] * r.value[3], opacity_scale);
  return robust;
}

/// What a pixel says of how well a pose fits.
struct PixelJudgement {
  float cost;
  bool agrees;  ///< the object looks there as it is rendered
};

/// By its residuals.
NPR_HOST_DEVICE inline PixelJudgement judgeResidual(const PixelResidual<float>& r,
                                                    const RobustResidual& robust, float scale) {
  return {r.colour_weight * robust.colour.value + r.opacity_weight * robust.opacity.value,
          robust.squared < 4 * scale * scale};
}

/// Weight of a pixel in comparisons with an unknown background, by its opacity under the blur: at
/// the rim the observation mixes the object with others, which would move the outline inwards.
NPR_HOST_DEVICE inline float interiorWeight(float opacity) {
  const float squared = opacity * opacity;
  return squared * squared;
}

/// Robust difference of contrasts that have nothing in common.
constexpr float kChanceDifference = 0.8f;

/// By contrasts before an unknown background. What the object explains better than chance is worth
/// its pixels, what it explains worse costs them: showing less of it is not cheaper as such.
NPR_HOST_DEVICE inline PixelJudgement judgeContrast(const RobustResidual& robust, float opacity,
                                                    float scale) {
  const float own = opacity > 1e-2f ? robust.squared / (opacity * opacity) : 0.0f;
  const float difference = own / (own + scale * scale);
  return {interiorWeight(opacity) * opacity * (difference - kChanceDifference),
          difference < kChanceDifference};
}

/// How a pixel of a rendering is compared with the observation's.
enum class Comparison {
  kKnownBackground,
  kRegions,   ///< unknown background: colours of the object against those around it
  kContrasts  ///< unknown background: images hold contrasts, not colours
};

/// What holds for all pixels of a stage.
struct ComparisonRules {
  Comparison kind = Comparison::kKnownBackground;
  float background[3] = {0, 0, 0};  ///< of the object, if it is known
  float robust_scale = 0.1f;
  float observed_fraction =
      0.5f;                  ///< of the observation in the gradients, @see knownBackgroundResidual
  float opacity_weight = 1;  ///< 0: no opacity is observed
  /// The cost is a log-likelihood (mixtureCost) instead of robust residuals: comparable between
  /// poses that show different parts of the object.
  bool rank_by_regions = false;
};

/// What the observation says of a pixel, where it is split into regions.
struct RegionPixel {
  float confidence = 0;          ///< in the probability that it shows the object
  float inside = 0;              ///< whether it and its neighbours do
  float background_density = 1;  ///< of its colour, among those of the background
};

NPR_HOST_DEVICE inline PixelResidual<float> comparePixel(const ComparisonRules& rules,
                                                         const ImageSample<float>& rendered,
                                                         const ImageSample<float>& observed,
                                                         const GainBias<float>& gain_bias,
                                                         const RegionPixel& region) {
  switch (rules.kind) {
    case Comparison::kContrasts:
      return unknownBackgroundResidual(
          rendered, observed, gain_bias,
          {interiorWeight(rendered.value[3]), 0.0f, rules.observed_fraction});
    case Comparison::kRegions:
      return unknownBackgroundResidual(
          rendered, observed, gain_bias,
          {region.inside, rules.opacity_weight * region.confidence, rules.observed_fraction});
    default:
      return knownBackgroundResidual(rendered, observed, gain_bias, rules.background,
                                     {1.0f, rules.opacity_weight, rules.observed_fraction});
  }
}

/// A pixel of a rendering after its comparison with the observation's.
struct ComparedPixel {
  PixelResidual<float> residual;  ///< @see comparePixel
  PixelFlow<float> flow;          ///< @see surfaceFlow
  RegionPixel region;
  float opacity;  ///< rendered
  float weight;   ///< observed
};

/// Adds a pixel to the sums of its pose, robustly. @param equations may be those of a part of the
/// image.
template <typename T>
NPR_HOST_DEVICE inline void addComparedPixel(const ComparisonRules& rules,
                                             const ComparedPixel& pixel, AlignmentSumsOf<T>* sums,
                                             NormalEquations6<float>* equations) {
  constexpr float kContrastScale = 2;  // contrasts differ by more than colours
  // Wider than the colours': outlines attract from afar. Bounded: where something covers the
  // object, the outline is not its own.
  constexpr float kOpacityScale = 3;
  const PixelResidual<float>& r = pixel.residual;
  const float opacity = pixel.opacity;
  const float scale = rules.robust_scale;
  const bool contrasts = rules.kind == Comparison::kContrasts;
  const float colour_scale = (contrasts ? kContrastScale : 1) * scale;
  const RobustResidual robust = robustResidual(r, colour_scale, kOpacityScale * scale);
  PixelJudgement judgement =
      contrasts ? judgeContrast(robust, opacity, colour_scale) : judgeResidual(r, robust, scale);
  if (rules.kind == Comparison::kRegions) {
    const float object = objectDensity(robust.squared / std::max(opacity * opacity, 1e-4f));
    judgement.agrees = object > pixel.region.background_density;
    if (rules.rank_by_regions) {
      judgement.cost = mixtureCost(opacity, object, pixel.region.background_density);
    }
  }
  sums->weight += pixel.weight;
  sums->cost += pixel.weight * judgement.cost;
  sums->opacity += pixel.weight * opacity;
  if (judgement.agrees) sums->agreeing += pixel.weight * opacity;
  if (!judgement.agrees && rules.kind == Comparison::kKnownBackground) {
    sums->unexplained += pixel.weight * (1 - opacity);
  }
  const float colour_weight = pixel.weight * r.colour_weight * robust.colour.weight;
  const float opacity_weight = pixel.weight * r.opacity_weight * robust.opacity.weight;
  sums->squared_residual += colour_weight * robust.squared;
  sums->residual_weight += 3 * colour_weight;
  const float weights[4] = {colour_weight, colour_weight, colour_weight, opacity_weight};
  addPixel(pixel.flow, r, weights, equations);
}

/// Moments of rendered against observed colours, from which gain and bias follow.
template <typename T>
struct GainBiasMomentsOf {
  T weight[3] = {}, x[3] = {}, y[3] = {}, xx[3] = {}, xy[3] = {};

  /// Adds a pixel, if it shows the object. @param rendered premultiplied RGB, opacity.
  /// @param observed RGB. @param gain_bias so far: pixels that it explains badly count less.
  NPR_HOST_DEVICE void addPixel(const float rendered[4], const float observed[3],
                                float pixel_weight, const GainBias<float>& gain_bias,
                                float robust_scale) {
    const float A = rendered[3];
    if (A < 0.5f || pixel_weight == 0) return;
    float colour[3], squared = 0;
    for (int c = 0; c < 3; ++c) {
      colour[c] = rendered[c] / A;
      const float r = gain_bias.gain[c] * colour[c] + gain_bias.bias[c] - observed[c];
      squared += r * r;
    }
    const float w =
        pixel_weight * A * A * interiorWeight(A) * gemanMcClure(squared, 2 * robust_scale).weight;
    for (int c = 0; c < 3; ++c) {
      weight[c] += w;
      x[c] += w * colour[c];
      y[c] += w * observed[c];
      xx[c] += w * colour[c] * colour[c];
      xy[c] += w * colour[c] * observed[c];
    }
  }
};

/// Gain and bias by least squares, drawn towards 1 and 0.
NPR_HOST_DEVICE inline GainBias<float> solveGainBias(const GainBiasMomentsOf<double>& m) {
  GainBias<float> gain_bias;
  for (int c = 0; c < 3; ++c) {
    // Towards gain 1 and bias 0, each with the weight of a fraction of the pixels.
    const double gain_prior = 0.02 * m.weight[c] + 1e-6;
    const double bias_prior = 0.3 * m.weight[c] + 1e-6;
    const double a = m.xx[c] + gain_prior, b = m.x[c], d = m.weight[c] + bias_prior;
    const double right_gain = m.xy[c] + gain_prior, right_bias = m.y[c];
    const double determinant = a * d - b * b;
    const double gain = (d * right_gain - b * right_bias) / determinant;
    const double bias = (a * right_bias - b * right_gain) / determinant;
    gain_bias.gain[c] = static_cast<float>(gain);
    gain_bias.bias[c] = static_cast<float>(bias);
  }
  return gain_bias;
}

}  // namespace nerf_pose_refiner
