// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"
#include "math/projection.h"
#include "math/robust.h"
#include "math/solve6.h"
#include "math/vec.h"

namespace nerf_pose_refiner {

// Alignment of a keyframe's points with an image. T is a number or a vector of numbers, one of each
// point: nothing here branches. S is the number itself.

/// Vectors of points end at a multiple of this; what fills them up has weight 0.
constexpr int kPointGroup = 8;

/// Where a pose puts points that are given relative to the object's centre: q_C = R^T p + t with
/// t = R^T (c - o).
template <typename S>
struct PointTransform {
  Mat3<S> R;  ///< of the pose: C to O
  Vec3<S> t;  ///< the object's centre in C [model units]
};

template <typename S>
NPR_HOST_DEVICE inline PointTransform<S> pointTransform(const CameraPose<S>& pose,
                                                        const Vec3<S>& centre) {
  return {pose.R, transposedTimes(pose.R, centre - pose.o)};
}

/// A point in the camera's frame. @param p relative to the object's centre, in the axes of O.
template <typename S, typename T>
NPR_HOST_DEVICE inline Vec3<T> inCamera(const PointTransform<S>& pose, const Vec3<T>& p) {
  const Mat3<S>& R = pose.R;
  return {R.m[0][0] * p.x + R.m[1][0] * p.y + R.m[2][0] * p.z + pose.t.x,
          R.m[0][1] * p.x + R.m[1][1] * p.y + R.m[2][1] * p.z + pose.t.y,
          R.m[0][2] * p.x + R.m[1][2] * p.y + R.m[2][2] * p.z + pose.t.z};
}

/// Four pixels around a place in an image, and where between them it lies.
template <typename P, typename F>
struct PixelQuad {
  P upper_left, upper_right, lower_left, lower_right;
  F u, v;  ///< 0..1, from the left and from above
};

/// Value of an image between its pixels and its derivatives [1 / px].
template <typename P>
struct InterpolatedPixel {
  P value, du, dv;
};

/// Bilinear interpolation. P may be a vector of channels.
template <typename P, typename F>
NPR_HOST_DEVICE inline InterpolatedPixel<P> interpolate(const PixelQuad<P, F>& quad) {
  const P upper_du = quad.upper_right - quad.upper_left;
  const P lower_du = quad.lower_right - quad.lower_left;
  const P left_dv = quad.lower_left - quad.upper_left;
  const P right_dv = quad.lower_right - quad.upper_right;
  const P dv = left_dv + quad.u * (right_dv - left_dv);
  return {quad.upper_left + quad.u * upper_du + quad.v * dv,
          upper_du + quad.v * (lower_du - upper_du), dv};
}

/// How the image that a pose shows flows past a point's pixel when the camera moves, as pixelFlow:
/// the point's own pixel moves by the opposite.
/// @param q the same point in C.
template <typename S, typename T>
NPR_HOST_DEVICE inline PixelFlow<T> pointFlow(const Pinhole<S>& K, const PointTransform<S>& pose,
                                              const Vec3<T>& p, const Vec3<T>& q) {
  const T inverse_depth = S(1) / q.z;
  const T scale_u = K.fx * inverse_depth, scale_v = K.fy * inverse_depth;
  const T slope_u = q.x * inverse_depth, slope_v = q.y * inverse_depth;
  const Mat3<S>& R = pose.R;
  const Vec3<T> u = {scale_u * (R.m[0][0] - slope_u * R.m[0][2]),
                     scale_u * (R.m[1][0] - slope_u * R.m[1][2]),
                     scale_u * (R.m[2][0] - slope_u * R.m[2][2])};
  const Vec3<T> v = {scale_v * (R.m[0][1] - slope_v * R.m[0][2]),
                     scale_v * (R.m[1][1] - slope_v * R.m[1][2]),
                     scale_v * (R.m[2][1] - slope_v * R.m[2][2])};
  const Vec3<T> u_turn = cross(p, u);  // u . (w x p) = w . (p x u)
  const Vec3<T> v_turn = cross(p, v);
  return {{u.x, u.y, u.z, u_turn.x, u_turn.y, u_turn.z},
          {v.x, v.y, v.z, v_turn.x, v_turn.y, v_turn.z}};
}

/// Mean and spread of the colours around a pixel, by which its own colour is normalised: what is
/// left does not depend on the light.
template <typename T>
struct LocalColours {
  T mean[3];
  T inverse_deviation[3];
};

/// Deviation that is taken for flat: what is left of colours there is noise.
constexpr float kFlatDeviation = 0.03f;

/// Numbers that are summed around a pixel: red, green, blue, and their squares.
constexpr int kLocalSums = 6;
/// Where the sum of their weights stands, behind them.
constexpr int kLocalWeight = 6;
/// Weights are taken to be this at least: where nothing is seen, colours are black without
/// contrast.
constexpr float kMinLocalWeight = 1e-3f;

/// Mean and variance of colours; rounding may leave the latter a little below 0.
template <typename T>
struct LocalMoments {
  T mean[3], variance[3];
};

template <typename T>
NPR_HOST_DEVICE inline LocalMoments<T> localMoments(const T sums[kLocalSums], T inverse_count) {
  LocalMoments<T> moments;
  for (int c = 0; c < 3; ++c) {
    moments.mean[c] = inverse_count * sums[c];
    moments.variance[c] = inverse_count * sums[3 + c] - moments.mean[c] * moments.mean[c];
  }
  return moments;
}

/// Each channel has its own deviation: lights differ in colour. T is a number.
template <typename T>
NPR_HOST_DEVICE inline LocalColours<T> localColours(const T sums[kLocalSums], T inverse_count) {
  const LocalMoments<T> moments = localMoments(sums, inverse_count);
  LocalColours<T> local;
  for (int c = 0; c < 3; ++c) {
    const T variance = moments.variance[c] > 0 ? moments.variance[c] : T(0);
    local.mean[c] = moments.mean[c];
    local.inverse_deviation[c] = 1 / std::sqrt(variance + T(kFlatDeviation * kFlatDeviation));
  }
  return local;
}

/// Gradient of an image where it shows a surface, from that of another image of the same surface.
/// @param tangent of the surface, in C: how the point moves with a pixel of the other image.
/// @param gradient of the other image [1 / px of it].
/// @return [1 / px]; zero where the surface is seen edge-on.
template <typename T>
NPR_HOST_DEVICE inline Pixel<T> carriedGradient(const ProjectionJacobian<T>& projection,
                                                const Vec3<T> tangent[2],
                                                const Pixel<T>& gradient) {
  // The chain rule, gradient = A^T result with A the pixels' motion, solved for the result.
  const T a = dot(projection.du, tangent[0]), b = dot(projection.du, tangent[1]);
  const T c = dot(projection.dv, tangent[0]), d = dot(projection.dv, tangent[1]);
  const T determinant = a * d - b * c;
  constexpr T kEdgeOn = T(0.05);
  if (!(determinant > kEdgeOn)) return {0, 0};
  return {(d * gradient.u - c * gradient.v) / determinant,
          (a * gradient.v - b * gradient.u) / determinant};
}

/// Residual of a keyframe's point, normalised colours rendered minus observed, and the gradient of
/// the image that predicts how it changes.
template <typename T>
struct PointResidual {
  T value[3];
  T du[3];  ///< [1 / px]
  T dv[3];
  T unrelated;  ///< mean square, summed, of a residual between such colours drawn at random
};

/// What a keyframe shows at a point, locally normalised, and its gradient in the image [1 / px].
template <typename T>
struct RenderedPoint {
  T value[3];
  T du[3];
  T dv[3];
};

/// The normalisation is held constant. Gradients are the rendering's and the observation's, mixed:
/// the mean of both is exact to second order (ESM, Malis 2004); noise of the observation's goes
/// together with noise of the residual, and biases the pose.
/// @param observed_fraction of the observation's, 0..1.
template <typename T, typename S>
NPR_HOST_DEVICE inline PointResidual<T> pointResidual(const RenderedPoint<T>& rendered,
                                                      const InterpolatedPixel<T> observed[3],
                                                      const LocalColours<T>& local,
                                                      S observed_fraction) {
  const S rendered_fraction = 1 - observed_fraction;
  PointResidual<T> r;
  r.unrelated = T{};
  for (int c = 0; c < 3; ++c) {
    const T normalised = (observed[c].value - local.mean[c]) * local.inverse_deviation[c];
    r.value[c] = rendered.value[c] - normalised;
    r.unrelated += rendered.value[c] * rendered.value[c] + normalised * normalised;
    const T slope = observed_fraction * local.inverse_deviation[c];
    r.du[c] = rendered_fraction * rendered.du[c] + slope * observed[c].du;
    r.dv[c] = rendered_fraction * rendered.dv[c] + slope * observed[c].dv;
  }
  return r;
}

/// Sums over points that judge a pose and say how to better it.
template <typename T>
struct PointSums {
  T weight;            ///< of the points that are in the image
  T cost;              ///< robust
  T robust_weight;     ///< what is left of `weight` where outliers lose theirs
  T squared_residual;  ///< robustly weighted
  T information[21];   ///< J^T W J and J^T W r, as NormalEquations6 has them
  T gradient[6];
};

/// Adds points. @param weight 0 for a point that is not seen. @param scale of the robust loss.
template <typename T>
NPR_HOST_DEVICE inline void addPoint(const PixelFlow<T>& flow, const PointResidual<T>& r, T weight,
                                     T scale, PointSums<T>* sums) {
  T squared = r.value[0] * r.value[0];
  T uu = r.du[0] * r.du[0], uv = r.du[0] * r.dv[0], vv = r.dv[0] * r.dv[0];
  T ur = r.du[0] * r.value[0], vr = r.dv[0] * r.value[0];
  for (int c = 1; c < 3; ++c) {
    squared += r.value[c] * r.value[c];
    uu += r.du[c] * r.du[c];
    uv += r.du[c] * r.dv[c];
    vv += r.dv[c] * r.dv[c];
    ur += r.du[c] * r.value[c];
    vr += r.dv[c] * r.value[c];
  }
  const RobustTerm<T> robust = gemanMcClure(squared, scale);
  const T w = weight * robust.weight;
  sums->weight += weight;
  sums->cost += weight * robust.value;
  sums->robust_weight += w;
  sums->squared_residual += w * squared;
  T* entry = sums->information;
  for (int i = 0; i < 6; ++i) {
    const T a = w * (uu * flow.u[i] + uv * flow.v[i]);
    const T b = w * (uv * flow.u[i] + vv * flow.v[i]);
    for (int j = 0; j <= i; ++j) *entry++ += a * flow.u[j] + b * flow.v[j];
    sums->gradient[i] += w * (ur * flow.u[i] + vr * flow.v[i]);
  }
}

}  // namespace nerf_pose_refiner
