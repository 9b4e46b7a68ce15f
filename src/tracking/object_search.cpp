// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <utility>

namespace nerf_pose_refiner {

RefinerSearch::RefinerSearch(BackendFactory make_backend, const RefinerSettings& initial,
                             const RefinerSettings& tracking, ScheduleFactory find_schedule)
    : make_backend_(std::move(make_backend)),
      initial_settings_(initial),
      tracking_settings_(tracking),
      find_schedule_(std::move(find_schedule)) {}

void RefinerSearch::use(std::shared_ptr<const Field> field) {
  if (!backend_) {
    schedule_ = find_schedule_();
    backend_ = make_backend_();
    initial_.emplace(backend_, initial_settings_);
    tracking_.emplace(backend_, tracking_settings_);
  }
  field_ = backend_->load(std::move(field));
}

void RefinerSearch::configure(const RefinerSettings& initial, const RefinerSettings& tracking) {
  initial_settings_ = initial;
  tracking_settings_ = tracking;
  if (!backend_) return;
  initial_.emplace(backend_, initial_settings_);
  tracking_.emplace(backend_, tracking_settings_);
}

Refinement RefinerSearch::search(const Observation& observation, const Prior& prior, bool tracked,
                                 const CancellationToken& stop) {
  const ProcessorSchedule::Refinement before_trainings(schedule_.get(), stop);
  return (tracked ? tracking_ : initial_)->refine(*field_, observation, prior, stop);
}

}  // namespace nerf_pose_refiner
