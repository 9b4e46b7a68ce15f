// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "refinement/keyframe_refiner.h"
#include "refinement/plan.h"
#include "refinement/pose_probability.h"
#include "refinement/start_poses.h"

// The part of KeyframeRefiner for images of depth alone: it takes the surfaces of keyframes.

namespace nerf_pose_refiner {
namespace {

// The hypotheses of colours, so that all that shows them shows these.
HypothesisTable hypothesesOf(const std::vector<DepthFit>& fits) {
  HypothesisTable table;
  for (const DepthFit& fit : fits) {
    Hypothesis one;
    one.T_O_C = fit.T_O_C;
    one.loss = -fit.evidence;
    one.visible_fraction = shownFraction(fit.counts);
    one.score = one.visible_fraction;
    table.push_back(one);
  }
  return table;
}

}  // namespace

Refinement KeyframeRefiner::refineByDepth(const TimedObservation& image,
                                          const Expectation& expected,
                                          const std::function<std::vector<DepthFit>()>& search) {
  const FieldMetadata& object = field_->field().metadata;
  const auto begin = std::chrono::steady_clock::now();
  expected.prior.validate();
  Refinement result;
  result.T_O_C = expected.prior.T_O_C;
  result.outcome = Outcome::kNoOverlap;
  if (!(object.metres_per_unit > 0)) {
    result.outcome = Outcome::kDiverged;
    result.depth.use = DepthUse::kRefused;
    result.depth.message = "the model has no scale, so depth cannot be compared with it";
  } else if (objectRegion(image.observation.camera, expected.prior, object)) {
    try {
      if (!depth_search_) depth_search_.emplace(field_, settings_.bank);
      result = concludeByDepth(*image.observation.depth, search(), expected);
    } catch (const Cancelled&) {
      result.outcome = Outcome::kCancelled;
    }
  }
  if (result.outcome != Outcome::kRefined) holdTrack(result, 0);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

Refinement KeyframeRefiner::findByDepth(const TimedObservation& image, const Expectation& hint,
                                        const CancellationToken& cancellation) {
  constexpr std::size_t kRendered = 2;
  const DepthImage& depth = *image.observation.depth;
  const FieldMetadata& object = field_->field().metadata;
  const Refinement result = refineByDepth(image, hint, [&] {
    waitForRenderings(cancellation);
    const DepthPrior known = depth_.priorAlone(depth.noise, object, hint.prior);
    std::vector<DepthFit> rough = depth_search_->around(depth, known, hint.prior, cancellation);
    std::vector<Pose> starts;
    for (const DepthFit& fit : rough) starts.push_back(fit.T_O_C);
    const std::vector<Pose> best(starts.begin(),
                                 starts.begin() + std::min(kRendered, starts.size()));
    makeAt(image.observation.camera, best, cancellation);
    const auto keyframe = best.empty() ? nullptr : search_->nearestTo(best.front());
    return keyframe ? depth_search_->from(depth, known, keyframe, starts, cancellation)
                    : std::vector<DepthFit>();
  });
  if (result.outcome == Outcome::kRefined) remember(image.stamp_ns, result.T_O_C);
  return result;
}

Refinement KeyframeRefiner::followByDepth(const TimedObservation& image, const Expectation& near,
                                          const CancellationToken& cancellation) {
  constexpr double kDoubtful = 0.5, kSpread = 3;
  constexpr int kWideStarts = 24;
  const DepthImage& depth = *image.observation.depth;
  const Camera& camera = image.observation.camera;
  const FieldMetadata& object = field_->field().metadata;
  const Refinement result = refineByDepth(image, near, [&]() -> std::vector<DepthFit> {
    takeRenewal(image.stamp_ns, cancellation);
    if (!search_->distanceOfNearest(near.prior.T_O_C)) {
      makeAt(camera, {near.prior.T_O_C}, cancellation);
    }
    const auto keyframe = search_->nearestTo(near.prior.T_O_C);
    if (!keyframe) return {};
    const DepthPrior known = depth_.priorAlone(depth.noise, object, near.prior);
    std::vector<DepthFit> fits =
        depth_search_->from(depth, known, keyframe, {near.prior.T_O_C}, cancellation);
    if (!fits.empty() && depthProbability(fits.front()) >= kDoubtful) return fits;
    return depth_search_->from(depth, known, keyframe,
                               posesAround(near.prior, object, kSpread, kWideStarts), cancellation);
  });
  if (result.outcome == Outcome::kRefined) renewFor({camera, result.T_O_C}, image.stamp_ns);
  return result;
}

Refinement KeyframeRefiner::concludeByDepth(const DepthImage& depth,
                                            const std::vector<DepthFit>& fits,
                                            const Expectation& expected) {
  const FieldMetadata& object = field_->field().metadata;
  Refinement result;
  result.T_O_C = expected.prior.T_O_C;
  result.outcome = Outcome::kDiverged;
  if (!fits.empty()) result.depth = reportOf(fits.front().counts);
  if (fits.empty() || fits.front().counts.agreeing < kFewestDepthPlaces) {
    result.depth.use = DepthUse::kRefused;
    result.depth.message = fits.empty() ? "too little of the object's surface is known here"
                                        : "depth does not show the object here";
    return result;
  }
  result.outcome = Outcome::kRefined;
  result.depth.use = DepthUse::kUsed;
  result.depth.bias_m = fits.front().bias * object.metres_per_unit;
  result.depth.bias_dev_m = std::sqrt(fits.front().bias_variance) * object.metres_per_unit;
  result.hypotheses = nearestEquivalents(hypothesesOf(fits), expected.prior, object);
  const Hypothesis& best = result.hypotheses.front();
  result.T_O_C = {nearestRotation(best.T_O_C.R), best.T_O_C.t};
  result.visible_fraction = best.visible_fraction;
  std::vector<DepthFit> all = fits;
  for (const DepthFit& other : depth_search_->beside(depth, fits.front())) all.push_back(other);
  // What was found may be another of equal poses: the axes of O are then others, too.
  const Eigen::Matrix3d R_equal = result.T_O_C.R * fits.front().T_O_C.R.transpose();
  result.covariance = rotated(fits.front().covariance + spreadOf(all, object), R_equal);
  if (const std::optional<SymmetryAxis>& axis = object.symmetries.axis()) {
    result.covariance = freeAbout(*axis, result.covariance, object.centre);
  }
  if (!result.covariance.allFinite()) {
    result.outcome = Outcome::kDiverged;
    return result;
  }
  const double by_image = depthProbability(fits.front());
  const double odds = priorOdds(result.T_O_C, expected.prior, object);
  const bool is_there = distanceFromPrior(result.T_O_C, expected.prior, object) <= kWithinPrior;
  result.found_probability = withOdds(by_image, is_there ? expected.odds : odds);
  result.score = *result.found_probability * withinProbability(result.covariance, object);
  holdTrack(result, by_image);
  return result;
}

}  // namespace nerf_pose_refiner
