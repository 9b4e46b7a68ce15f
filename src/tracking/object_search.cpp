// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <utility>

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
  field_ = processor_.backend->load(std::move(field));
}

void RefinerSearch::configure(const RefinerSettings& initial, const RefinerSettings& tracking) {
  initial_settings_ = initial;
  tracking_settings_ = tracking;
  if (!processor_.backend) return;
  initial_.emplace(processor_.backend, initial_settings_);
  tracking_.emplace(processor_.backend, tracking_settings_);
}

Refinement RefinerSearch::search(const Observation& observation, const Prior& prior, bool tracked,
                                 const CancellationToken& stop) {
  std::unique_ptr<ProcessorTurn> turn;
  if (processor_.take_turn) turn = processor_.take_turn(stop);
  return (tracked ? tracking_ : initial_)->refine(*field_, observation, prior, stop);
}

}  // namespace nerf_pose_refiner
