// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>

#include "refinement/refiner.h"
#include "runtime/backend_pool.h"

namespace nerf_pose_refiner {

/// What tracking asks of the library: find the object in an image. (Tests put another one in its
/// place.) One thread at a time.
class ObjectSearch {
 public:
  virtual ~ObjectSearch() = default;

  /// The object to look for from now on.
  virtual void use(std::shared_ptr<const Field> field) = 0;

  /// Searches in another way from now on.
  virtual void configure(const RefinerSettings& initial, const RefinerSettings& tracking) = 0;

  /// @param tracked the prior is the pose of the image before.
  virtual Refinement search(const Observation& observation, const Prior& prior, bool tracked,
                            const CancellationToken& stop) = 0;
};

/// Searches with an backend: widely from an initial pose, narrowly from the last one. The backend
/// is made by the thread that searches, with the first object.
class RefinerSearch : public ObjectSearch {
 public:
  /// @param find_schedule of the backend's processor: trainings rest while it searches.
  RefinerSearch(BackendFactory make_backend, const RefinerSettings& initial,
                const RefinerSettings& tracking, ScheduleFactory find_schedule);

  void use(std::shared_ptr<const Field> field) override;
  void configure(const RefinerSettings& initial, const RefinerSettings& tracking) override;
  Refinement search(const Observation& observation, const Prior& prior, bool tracked,
                    const CancellationToken& stop) override;

 private:
  BackendFactory make_backend_;
  RefinerSettings initial_settings_;
  RefinerSettings tracking_settings_;
  ScheduleFactory find_schedule_;
  std::shared_ptr<ProcessorSchedule> schedule_;
  std::shared_ptr<Backend> backend_;
  std::optional<Refiner> initial_;
  std::optional<Refiner> tracking_;
  std::shared_ptr<const LoadedField> field_;
};

}  // namespace nerf_pose_refiner
