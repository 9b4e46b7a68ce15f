// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_fusion.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace nerf_pose_refiner {
namespace {

// Images share most of their errors with those before: so many are worth one.
constexpr double kImagesAlike = 30;
constexpr double kMaxGain = 0.1;    // of what a single image says
constexpr double kMaxLearnt = 0.1;  // of the bias' deviation is left at least
constexpr double kMinMeasured = 0.1, kMinAgreeing = 0.6, kMinUncovered = 0.2;
// Squared distances of six unknowns and the bias: one in a thousand is larger; twice the mean. Of
// plain objects, colours are less sure of themselves than they say by as much as kModesty.
constexpr double kModesty = 3, kMaxDistance = 24.3 * kModesty, kMaxSurprise = 14 * kModesty;
constexpr double kSurpriseMemory = 0.9;
constexpr double kMaxRatio = 1.5;

std::string text(const char* format, double value) {
  char line[160];
  std::snprintf(line, sizeof line, format, value);
  return line;
}

/// Of what something nearer does not cover.
double uncoveredAgreement(const DepthCounts& counts) {
  return fractionOf(counts.agreeing, counts.agreeing + counts.farther);
}

/// Whether depth shows the object where it was fitted.
bool shows(const DepthFit& fit) {
  const DepthCounts& counts = fit.counts;
  return counts.measured >= kMinMeasured * counts.facing && counts.agreeing >= kFewestDepthPlaces &&
         fractionOf(counts.agreeing, counts.measured) > kMinAgreeing;
}

}  // namespace

/// Another distance makes the bias less certain.
DepthFusion::Bias DepthFusion::biasAt(const DepthNoise& noise, double distance_m) const {
  constexpr double kLeast_m2 = 1e-12;  // for a sensor that is said to have none
  const double first = std::max(std::sqrt(kLeast_m2), noise.biasDeviation_m(distance_m));
  if (!bias_) return {0, first * first};
  const double apart = noise.bias_fraction * (distance_m - learnt_at_m_);
  return {bias_->mean_m, std::min(first * first, bias_->variance_m2 + apart * apart)};
}

/// Why depth must not be used; empty: it may.
std::string DepthFusion::objection(const DepthFit& fit) const {
  const DepthCounts& at_colours = fit.before;
  if (at_colours.facing < kFewestDepthPlaces) {
    return "the depth image does not show the place where the object is";
  }
  const double ratio = fit.median_ratio;
  if (ratio > kMaxRatio * 100 || ratio < 0.01 / kMaxRatio) {
    return text(
        "depth measures %.4g times the distance that the colour image shows: its unit is "
        "wrong (metres or millimetres?)",
        ratio);
  }
  if (at_colours.measured <
      std::max<double>(kFewestDepthPlaces, kMinMeasured * at_colours.facing)) {
    return text("depth is missing on %.0f %% of the object",
                100 * (1 - fractionOf(at_colours.measured, at_colours.facing)));
  }
  if (ratio > kMaxRatio || ratio < 1 / kMaxRatio) {
    return text("depth measures %.2f times the distance that the colour image shows", ratio);
  }
  const DepthCounts& counts = fit.counts;
  if (uncoveredAgreement(counts) < kMinAgreeing) {
    return text("depth sees through %.0f %% of the place where the colour image shows the object",
                100 * fractionOf(counts.farther, counts.measured));
  }
  if (fractionOf(counts.agreeing, counts.measured) < kMinUncovered) {
    return text("something hides %.0f %% of the object from the depth camera",
                100 * fractionOf(counts.nearer, counts.measured));
  }
  if (!(fit.squared_distance < kMaxDistance)) {
    return text("depth shows another pose than the colour image, %.1f standard deviations away",
                std::sqrt(fit.squared_distance));
  }
  if (const std::optional<double> delay_s = delay_.found_s()) {
    const bool is_late = *delay_s > 0;
    return text(is_late
                    ? "depth is %.0f ms later than its stamps say: it shows where the object was"
                    : "depth is %.0f ms earlier than its stamps say: it shows where the object "
                      "will be",
                1000 * std::abs(*delay_s));
  }
  if (surprise_ > kMaxSurprise) {
    return "depth and colour images disagree from image to image: check their stamps, cameras and "
           "the transform between them";
  }
  return "";
}

void DepthFusion::learn(const DepthFit& fit, const Bias& before, const DepthNoise& noise,
                        double distance_m, double metres_per_unit) {
  const double variance = fit.bias_variance * metres_per_unit * metres_per_unit;
  const double gained = 1 / variance - 1 / before.variance_m2;
  learnt_at_m_ = distance_m;
  bias_ = before;
  if (!(gained > 0)) return;
  // What this image says alone, and what is left of it as one of many that are alike.
  const double seen =
      before.mean_m + (fit.bias * metres_per_unit - before.mean_m) / (gained * variance);
  const double first = noise.biasDeviation_m(distance_m);
  const double least = kMaxLearnt * kMaxLearnt * first * first;
  const double gain = std::min(
      kMaxGain, before.variance_m2 * gained / (kImagesAlike + before.variance_m2 * gained));
  bias_->variance_m2 = std::max(least, (1 - gain) * before.variance_m2);
  bias_->mean_m += gain * (seen - before.mean_m);
}

/// @param found by colours.
void DepthFusion::learnDelay(const DepthImage& depth, const FieldMetadata& object,
                             const Vector6& motion, const Refinement& found) {
  constexpr double kTurn_rad = 0.2, kOffset = 0.2;  // that it is looked for within
  Prior near;
  near.T_O_C = found.T_O_C;
  near.rotation_rad = kTurn_rad;
  near.translation = kOffset;
  const DepthFit fit = fitDepth(surface_, depth, priorAlone(depth.noise, object, near), object);
  if (!shows(fit)) return;
  const Vector6 away = cameraTwist(found.T_O_C, fit.T_O_C, object.centre);
  delay_.learn({motion, away, withoutFreeTurn(found.covariance, object) + fit.covariance});
}

/// @return false: too little of the surface is known.
bool DepthFusion::lookAt(const std::shared_ptr<const KeyframePoints>& keyframe) {
  if (keyframe != keyframe_) {
    keyframe_ = keyframe;
    surface_ = keyframe ? depthSurfaceOf(*keyframe) : DepthSurface();
  }
  return surface_.places.size() >= static_cast<std::size_t>(kFewestDepthPlaces);
}

DepthPrior DepthFusion::priorAlone(const DepthNoise& noise, const FieldMetadata& object,
                                   const Prior& prior) const {
  const double unit_m = object.metres_per_unit;
  const Bias bias = biasAt(noise, unit_m * (prior.T_O_C.t - object.centre).norm());
  constexpr double kLeast = 1e-3;  // of widths
  DepthPrior from;
  from.T_O_C = prior.T_O_C;
  from.covariance.setZero();
  from.covariance.diagonal() << Eigen::Vector3d::Constant(
      std::pow(std::max(kLeast, prior.translation) * object.diameter, 2) / 3),
      Eigen::Vector3d::Constant(std::pow(std::max(kLeast, prior.rotation_rad), 2) / 3);
  from.covariance = withoutFreeTurn(from.covariance, object);
  from.bias = bias.mean_m / unit_m;
  from.bias_variance = bias.variance_m2 / (unit_m * unit_m);
  return from;
}

std::optional<Pose> DepthFusion::alone(const DepthImage& depth,
                                       const std::shared_ptr<const KeyframePoints>& keyframe,
                                       const FieldMetadata& object, const Prior& prior) {
  if (!(object.metres_per_unit > 0) || !lookAt(keyframe)) return std::nullopt;
  const DepthFit fit = fitDepth(surface_, depth, priorAlone(depth.noise, object, prior), object);
  if (!shows(fit)) return std::nullopt;
  return Pose(nearestRotation(fit.T_O_C.R), fit.T_O_C.t);
}

double DepthFusion::fuse(const DepthImage& depth,
                         const std::shared_ptr<const KeyframePoints>& keyframe,
                         const FieldMetadata& object, const Vector6& motion, Refinement* found) {
  constexpr double kSeenThrough = 0.05;  // odds of a pose where an established sensor sees nothing
  DepthReport& report = found->depth;
  report = {};
  report.use = DepthUse::kRefused;
  if (!(object.metres_per_unit > 0)) {
    report.message = "the model has no scale, so depth cannot be compared with it";
    return 1;
  }
  if (!lookAt(keyframe)) {
    report.message = "too little of the object's surface is known here";
    return 1;
  }
  const double unit_m = object.metres_per_unit;
  const double distance_m = unit_m * (found->T_O_C.t - object.centre).norm();
  const Bias bias = biasAt(depth.noise, distance_m);
  DepthPrior prior;
  prior.T_O_C = found->T_O_C;
  prior.covariance = withoutFreeTurn(found->covariance, object);
  prior.bias = bias.mean_m / unit_m;
  prior.bias_variance = bias.variance_m2 / (unit_m * unit_m);
  const DepthFit fit = fitDepth(surface_, depth, prior, object);

  constexpr double kSure = 0.9;
  if (found->found_probability.value_or(0) > kSure && !motion.isZero()) {
    learnDelay(depth, object, motion, *found);
  }
  if (delay_.found_s()) agreed_ = 0;
  const std::string why_not = objection(fit);
  const bool was_established = isEstablished();
  report = reportOf(why_not.empty() ? fit.counts : fit.before);
  report.bias_m = bias.mean_m;
  report.bias_dev_m = std::sqrt(bias.variance_m2);
  if (fit.counts.agreeing >= kFewestDepthPlaces) {
    surprise_ = kSurpriseMemory * surprise_ +
                (1 - kSurpriseMemory) * std::min(fit.squared_distance, 2 * kMaxDistance);
  }
  if (!why_not.empty()) {
    report.use = DepthUse::kRefused;
    report.message = why_not;
    const bool sees_through = report.farther > 1 - kMinAgreeing && report.farther > report.nearer;
    return was_established && sees_through ? kSeenThrough : 1;
  }
  report.use = DepthUse::kUsed;
  found->T_O_C = {nearestRotation(fit.T_O_C.R), fit.T_O_C.t};
  found->covariance = fit.covariance;
  const std::optional<SymmetryAxis>& axis = object.symmetries.axis();
  if (axis) found->covariance = freeAbout(*axis, found->covariance, object.centre);
  learn(fit, bias, depth.noise, distance_m, unit_m);
  report.bias_m = bias_->mean_m;
  report.bias_dev_m = std::sqrt(bias_->variance_m2);
  agreed_ = std::min(agreed_ + 1, kEstablished);
  return 1;
}

}  // namespace nerf_pose_refiner
