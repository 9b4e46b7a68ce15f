// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/host_device.h"
#include "math/projection.h"
#include "math/robust.h"
#include "math/solve6.h"

namespace nerf_pose_refiner {

/// Channels of an image and their derivatives at one pixel: red, green, blue, opacity.
template <typename T>
struct ImageSample {
  T value[4];
  T du[4];  ///< [1 / px]
  T dv[4];
};

/// The observed colour that explains a rendered one is gain * rendered + bias, per channel.
template <typename T>
struct GainBias {
  T gain[3] = {1, 1, 1};
  T bias[3] = {0, 0, 0};
};

/// Residuals of one pixel, three of colour and one of opacity, with the gradients of the image
/// that predict how they change when the camera moves, and a weight for each of the two kinds.
template <typename T>
struct PixelResidual {
  T value[4];
  T du[4];
  T dv[4];
  T colour_weight;
  T opacity_weight;
};

/// How a pixel's residuals count.
template <typename T>
struct ResidualWeights {
  T colour = 1;                  ///< 0..1: 0 where other things may tint the colours
  T opacity = 0;                 ///< 0 if the observed opacity is not known
  T observed_fraction = T(0.5);  ///< of the observation in the gradients, 0..1
};

/// Residual where the background is known: C' + (1 - A) B - I, and A - A_observed.
///
/// C' = gain C + bias A is the premultiplied rendering with the observation's gain and bias.
/// Gradients are the mean of the rendered and the observed image's (ESM, Malis 2004): exact to
/// second order, and the observation attracts where the rendering is still empty. Near the end they
/// are the rendering's alone: noise in the observation's is correlated with noise in the residual,
/// and makes the object look nearer or farther.
template <typename T>
NPR_HOST_DEVICE inline PixelResidual<T> knownBackgroundResidual(const ImageSample<T>& rendered,
                                                                const ImageSample<T>& observed,
                                                                const GainBias<T>& gain_bias,
                                                                const T background[3],
                                                                const ResidualWeights<T>& weights) {
  const T observed_fraction = weights.observed_fraction;
  const T rendered_fraction = 1 - observed_fraction;
  PixelResidual<T> r;
  for (int c = 0; c < 3; ++c) {
    const T lift = gain_bias.bias[c] - background[c];
    r.value[c] = gain_bias.gain[c] * rendered.value[c] + lift * rendered.value[3] + background[c] -
                 observed.value[c];
    r.du[c] = rendered_fraction * (gain_bias.gain[c] * rendered.du[c] + lift * rendered.du[3]) +
              observed_fraction * observed.du[c];
    r.dv[c] = rendered_fraction * (gain_bias.gain[c] * rendered.dv[c] + lift * rendered.dv[3]) +
              observed_fraction * observed.dv[c];
  }
  r.value[3] = rendered.value[3] - observed.value[3];
  r.du[3] = rendered_fraction * rendered.du[3] + observed_fraction * observed.du[3];
  r.dv[3] = rendered_fraction * rendered.dv[3] + observed_fraction * observed.dv[3];
  r.colour_weight = weights.colour;
  r.opacity_weight = weights.opacity;
  return r;
}

/// Residual before an unknown background: A (C' / A - I), and A - P.
///
/// The opacity A before the colours is a weight and held constant in the derivative: there is
/// nothing to gain by moving the outline off the object or by shrinking it. The outline is held by
/// P, the probability that the pixel shows the object.
/// @param observed colour I of the object, and P as its opacity.
template <typename T>
NPR_HOST_DEVICE inline PixelResidual<T> unknownBackgroundResidual(
    const ImageSample<T>& rendered, const ImageSample<T>& observed, const GainBias<T>& gain_bias,
    const ResidualWeights<T>& weights) {
  const T A = rendered.value[3];
  const T inverse = 1 / (A > T(1e-3) ? A : T(1e-3));
  const T observed_fraction = weights.observed_fraction;
  const T rendered_fraction = 1 - observed_fraction;
  PixelResidual<T> r;
  for (int c = 0; c < 3; ++c) {
    const T colour = rendered.value[c] * inverse;
    r.value[c] =
        gain_bias.gain[c] * rendered.value[c] + (gain_bias.bias[c] - observed.value[c]) * A;
    // A grad(C / A) = grad C - C / A grad A
    r.du[c] = rendered_fraction * gain_bias.gain[c] * (rendered.du[c] - colour * rendered.du[3]) +
              observed_fraction * A * observed.du[c];
    r.dv[c] = rendered_fraction * gain_bias.gain[c] * (rendered.dv[c] - colour * rendered.dv[3]) +
              observed_fraction * A * observed.dv[c];
  }
  r.value[3] = A - observed.value[3];
  r.du[3] = rendered_fraction * rendered.du[3] + observed_fraction * observed.du[3];
  r.dv[3] = rendered_fraction * rendered.dv[3] + observed_fraction * observed.dv[3];
  r.colour_weight = weights.colour;
  r.opacity_weight = weights.opacity;
  return r;
}

/// How much worse a pixel is explained with the object than without: -log((1 - A) + A q / b).
///
/// q is the density of the observed colour if the pixel shows the object: that of the rendered
/// colour's neighbourhood, or, for a fraction of outliers, as in the background; b is the density
/// of the observed colour in the background. Covering pixels of the right colours is rewarded,
/// covering others costs, and what is outside of the image counts nothing.
template <typename T>
NPR_HOST_DEVICE inline T mixtureCost(T opacity, T object_density, T background_density) {
  constexpr T kOutlierFraction = T(0.1);
  const T ratio = (1 - kOutlierFraction) * object_density / background_density + kOutlierFraction;
  return -std::log(1 - opacity + opacity * ratio);
}

/// Adds a pixel to the normal equations.
/// @param weights of the four residuals, robust weights included.
template <typename T>
NPR_HOST_DEVICE inline void addPixel(const PixelFlow<T>& flow, const PixelResidual<T>& r,
                                     const T weights[4], NormalEquations6<T>* equations) {
  // All channels share the flow, so their gradients are summed before they meet it.
  T uu = 0, uv = 0, vv = 0, ur = 0, vr = 0;
  for (int c = 0; c < 4; ++c) {
    const T wu = weights[c] * r.du[c];
    const T wv = weights[c] * r.dv[c];
    uu += wu * r.du[c];
    uv += wu * r.dv[c];
    vv += wv * r.dv[c];
    ur += wu * r.value[c];
    vr += wv * r.value[c];
  }
  T* entry = equations->information;
  for (int i = 0; i < 6; ++i) {
    const T a = uu * flow.u[i] + uv * flow.v[i];
    const T b = uv * flow.u[i] + vv * flow.v[i];
    for (int j = 0; j <= i; ++j) *entry++ += a * flow.u[j] + b * flow.v[j];
    equations->gradient[i] += ur * flow.u[i] + vr * flow.v[i];
  }
}

}  // namespace nerf_pose_refiner
