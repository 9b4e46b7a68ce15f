// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <utility>

#include "trust/keyframe_scores.h"
#include "trust/mask_agreement.h"

namespace nerf_pose_refiner {

RefinerSearch::RefinerSearch(ProcessorFactory find_processor, const RefinerSettings& initial,
                             const RefinerSettings& tracking)
    : find_processor_(std::move(find_processor)),
      initial_settings_(initial),
      tracking_settings_(tracking) {}

void RefinerSearch::use(std::shared_ptr<const Field> field) {
  if (!processor_.backend) {
    processor_ = find_processor_();
    configure(initial_settings_, tracking_settings_);
  }
  keyframes_.reset();
  scores_.reset();
  field_ = processor_.backend->load(std::move(field));
}

void RefinerSearch::configure(const RefinerSettings& initial, const RefinerSettings& tracking) {
  initial_settings_ = initial;
  tracking_settings_ = tracking;
  if (!processor_.backend) return;
  keyframes_.reset();
  initial_.emplace(processor_.backend, initial_settings_);
  tracking_.emplace(processor_.backend, tracking_settings_);
}

Refinement RefinerSearch::search(const SearchRequest& request,
                                 const CancellationToken& cancellation) {
  Refinement result;
  try {
    result = find(request, cancellation);
    const bool has_mask = request.observation.background == Background::kMask;
    if (has_mask && result.outcome == Outcome::kRefined) {
      if (keyframes_) keyframes_->waitForRenderings(cancellation);
      result.mask_agreement =
          maskAgreement(*field_, request.observation, result.T_O_C, cancellation);
    }
  } catch (const Cancelled&) {
    result.outcome = Outcome::kCancelled;
    result.T_O_C = request.prior.T_O_C;
  }
  return result;
}

void RefinerSearch::beginKeyframes(const CancellationToken& cancellation) {
  Backend* const backend = processor_.backend.get();
  if (!scores_) {
    scores_ = field_->field().metadata.pose.keyframes;
    // A model of before: what registration measures nowadays is measured here.
    if (scores_->poses == 0) scores_ = measureKeyframeScores(backend, *field_, cancellation);
  }
  keyframes_.emplace(backend, field_, tracking_settings_.keyframes);
  keyframes_->use(*scores_);
}

Refinement RefinerSearch::find(const SearchRequest& request,
                               const CancellationToken& cancellation) {
  const RefinerSettings& settings = request.tracked ? tracking_settings_ : initial_settings_;
  if (settings.method == Method::kKeyframes) {
    if (!keyframes_) beginKeyframes(cancellation);
    const TimedObservation image = {request.observation, request.stamp_ns};
    return request.tracked ? keyframes_->follow(image, request.prior, cancellation)
                           : keyframes_->find(image, request.prior, cancellation);
  }
  // A processor that is not shared has no turns, so a rendering must end before the search begins.
  if (keyframes_) keyframes_->waitForRenderings(cancellation);
  std::unique_ptr<ProcessorTurn> turn;
  if (processor_.take_turn) turn = processor_.take_turn(cancellation);
  FieldRefiner& refiner = request.tracked ? *tracking_ : *initial_;
  return refiner.refine(*field_, request.observation, request.prior, cancellation);
}

}  // namespace nerf_pose_refiner
