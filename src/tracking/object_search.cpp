// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <utility>

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
  Refinement result = find(request, cancellation);
  if (request.observation.background != Background::kMask || result.outcome != Outcome::kRefined) {
    return result;
  }
  try {
    if (keyframes_) keyframes_->waitForRenderings(cancellation);
    result.mask_agreement =
        maskAgreement(*field_, request.observation, result.T_O_C, cancellation);
  } catch (const Cancelled&) {
    result.outcome = Outcome::kCancelled;
  }
  return result;
}

Refinement RefinerSearch::find(const SearchRequest& request,
                               const CancellationToken& cancellation) {
  const RefinerSettings& settings = request.tracked ? tracking_settings_ : initial_settings_;
  if (settings.method == Method::kKeyframes) {
    if (!keyframes_) {
      keyframes_.emplace(processor_.backend.get(), field_, tracking_settings_.keyframes);
    }
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
