// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <utility>

namespace nerf_pose_refiner {

RefinerSearch::RefinerSearch(EngineFactory make_engine, const RefinerSettings& initial,
                             const RefinerSettings& tracking, ScheduleFactory find_schedule)
    : make_engine_(std::move(make_engine)),
      initial_settings_(initial),
      tracking_settings_(tracking),
      find_schedule_(std::move(find_schedule)) {}

void RefinerSearch::use(std::shared_ptr<const Field> field) {
  if (!engine_) {
    schedule_ = find_schedule_();
    engine_ = make_engine_();
    initial_.emplace(engine_, initial_settings_);
    tracking_.emplace(engine_, tracking_settings_);
  }
  field_ = engine_->load(std::move(field));
}

void RefinerSearch::configure(const RefinerSettings& initial, const RefinerSettings& tracking) {
  initial_settings_ = initial;
  tracking_settings_ = tracking;
  if (!engine_) return;
  initial_.emplace(engine_, initial_settings_);
  tracking_.emplace(engine_, tracking_settings_);
}

Refinement RefinerSearch::search(const Observation& observation, const Prior& prior, bool tracked,
                                 const StopToken& stop) {
  const ProcessorSchedule::Refinement before_trainings(schedule_.get(), stop);
  return (tracked ? tracking_ : initial_)->refine(*field_, observation, prior, stop);
}

}  // namespace nerf_pose_refiner
