// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/shared_backend.h"

#include <stdexcept>
#include <utility>

namespace nerf_pose_refiner {

SharedBackend::TicketLock::TicketLock(const SharedBackend* backend) : backend_(backend) {
  std::unique_lock<std::mutex> lock(backend_->mutex_);
  const std::uint64_t ticket = backend_->asked_++;
  backend_->next_.wait(lock, [&] { return backend_->served_ == ticket; });
}

SharedBackend::TicketLock::~TicketLock() {
  {
    std::lock_guard<std::mutex> lock(backend_->mutex_);
    ++backend_->served_;
  }
  backend_->next_.notify_all();
}

SharedBackend::SharedBackend(std::unique_ptr<Backend> backend) : backend_(std::move(backend)) {}

std::string SharedBackend::describe() const { return backend_->describe(); }

std::shared_ptr<const LoadedField> SharedBackend::load(std::shared_ptr<const Field> field) {
  const TicketLock turn(this);
  for (auto entry = loaded_.begin(); entry != loaded_.end();) {
    entry = entry->second.expired() ? loaded_.erase(entry) : std::next(entry);
  }
  // A loaded field keeps its field: while it lives, no other one has this address.
  std::weak_ptr<const LoadedField>& known = loaded_[field.get()];
  if (std::shared_ptr<const LoadedField> loaded = known.lock()) return loaded;
  const std::shared_ptr<const LoadedField> loaded = backend_->load(std::move(field));
  known = loaded;
  return loaded;
}

Rendering SharedBackend::render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                                const RenderOptions& options, const CancellationToken& stop) {
  const TicketLock turn(this);
  return backend_->render(field, camera, T_O_C, options, stop);
}

std::unique_ptr<FieldTrainer> SharedBackend::trainer(const FieldConfig&, const Box&,
                                                     std::vector<TrainingView>,
                                                     const TrainingPlan&) {
  throw std::logic_error("a shared engine does not train");
}

std::shared_ptr<const LoadedObservation> SharedBackend::observe(
    const Observation& observation, const std::vector<ImageLevel>& levels) {
  const TicketLock turn(this);
  return backend_->observe(observation, levels);
}

std::unique_ptr<HypothesisBatch> SharedBackend::batch(int capacity) {
  const TicketLock turn(this);
  return backend_->batch(capacity);
}

void SharedBackend::sample(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
                           const SamplingPlan& plan) {
  const TicketLock turn(this);
  backend_->sample(batch, priors_T_O_C, plan);
}

void SharedBackend::align(HypothesisBatch* batch, const LoadedField& field,
                          const LoadedObservation& observation, int level, const AlignStage& stage,
                          const CancellationToken& stop) {
  const TicketLock turn(this);
  backend_->align(batch, field, observation, level, stage, stop);
}

void SharedBackend::score(HypothesisBatch* batch, const LoadedField& field,
                          const LoadedObservation& observation, int level, const AlignStage& stage,
                          const CancellationToken& stop) {
  const TicketLock turn(this);
  backend_->score(batch, field, observation, level, stage, stop);
}

void SharedBackend::optimise(HypothesisBatch* batch, const LoadedField& field,
                             const LoadedObservation& observation, int level,
                             const OptimisationPlan& plan, int first_step, int steps,
                             const CancellationToken& stop) {
  const TicketLock turn(this);
  backend_->optimise(batch, field, observation, level, plan, first_step, steps, stop);
}

void SharedBackend::evaluate(HypothesisBatch* batch, const LoadedField& field,
                             const LoadedObservation& observation, int level,
                             const OptimisationPlan& plan, int pixels,
                             const CancellationToken& stop) {
  const TicketLock turn(this);
  backend_->evaluate(batch, field, observation, level, plan, pixels, stop);
}

void SharedBackend::resample(HypothesisBatch* batch, const ResamplingPlan& plan) {
  const TicketLock turn(this);
  backend_->resample(batch, plan);
}

HypothesisTable SharedBackend::read(const HypothesisBatch& batch) {
  const TicketLock turn(this);
  return backend_->read(batch);
}

CostCounters SharedBackend::work() const {
  const TicketLock turn(this);
  return backend_->work();
}

}  // namespace nerf_pose_refiner
