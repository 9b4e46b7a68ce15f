// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/refiner.h"

#include <stdexcept>
#include <utility>

#include "backend/backend.h"
#include "field/field.h"
#include "field/object_frame.h"
#include "math/require.h"
#include "refinement/covariance.h"
#include "tracking/object_search.h"
#include "trust/check_trust.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {
namespace {

RefinerSettings settingsOf(const RefinerOptions& options) {
  RefinerSettings settings = RefinerSettings::named(options.preset);
  settings.seed = options.seed;
  settings.keyframes.real_time = false;  // or what a late keyframe changes would depend on speed
  return settings;
}

}  // namespace

struct Refiner::Parts {
  Parts(std::shared_ptr<Backend> backend, const Object& known, const RefinerOptions& options)
      : object(known),
        trust_score(options.trust_score),
        search([backend = std::move(backend)] { return SearchProcessor{backend}; },
               settingsOf(options), settingsOf(options)) {
    search.use(ObjectInside::field(object));
  }

  Object object;
  double trust_score;
  RefinerSearch search;
};

Refiner::Refiner(std::shared_ptr<Backend> backend, const Object& object,
                 const RefinerOptions& options) {
  if (!backend) throw std::invalid_argument("Refiner: the backend is null");
  require(options.trust_score >= 0 && options.trust_score <= 1, "trust_score", options.trust_score,
          "0..1");
  parts_ = std::make_unique<Parts>(std::move(backend), object, options);
}

Refiner::~Refiner() = default;
Refiner::Refiner(Refiner&&) noexcept = default;
Refiner& Refiner::operator=(Refiner&&) noexcept = default;

RefineResult Refiner::refine(const Observation& observation, const PosePrior& prior,
                             const CancellationToken& cancellation) {
  observation.validate();
  const Object& object = parts_->object;
  SearchRequest request{observation, {}};
  const ObjectFrame frame = ObjectInside::frame(object);
  request.prior.T_O_C = frame.cameraInModel(prior.T_C_O);
  request.prior.rotation_rad = prior.rotation_rad;
  request.prior.translation = prior.translation;
  const Refinement refined = parts_->search.search(request, cancellation);
  cancellation.check();

  RefineResult result;
  const TrustVerdict verdict = checkTrust(refined, parts_->trust_score);
  result.trusted = verdict == TrustVerdict::kTrusted;
  result.message = textOf(verdict);
  result.T_C_O = frame.objectInCamera(refined.T_O_C);
  result.score = refined.score;
  result.visible_fraction = refined.visible_fraction;
  result.depth = refined.depth;
  result.side_views = refined.side_views;
  result.seconds = refined.seconds;
  result.found = refined.outcome == Outcome::kRefined;
  if (!result.found) return result;
  result.covariance = covarianceInCamera(refined.covariance, refined.T_O_C,
                                         ObjectInside::field(object)->metadata, frame);
  const std::vector<double> weights = hypothesisWeights(refined.hypotheses);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    result.hypotheses.push_back({frame.objectInCamera(refined.hypotheses[i].T_O_C), weights[i]});
  }
  return result;
}

}  // namespace nerf_pose_refiner
