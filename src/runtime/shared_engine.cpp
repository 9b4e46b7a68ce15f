// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/shared_engine.h"

#include <stdexcept>
#include <utility>

namespace nerf_pose_refiner {

SharedEngine::Turn::Turn(const SharedEngine* engine) : engine_(engine) {
  std::unique_lock<std::mutex> lock(engine_->mutex_);
  const std::uint64_t ticket = engine_->asked_++;
  engine_->next_.wait(lock, [&] { return engine_->served_ == ticket; });
}

SharedEngine::Turn::~Turn() {
  {
    std::lock_guard<std::mutex> lock(engine_->mutex_);
    ++engine_->served_;
  }
  engine_->next_.notify_all();
}

SharedEngine::SharedEngine(std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {}

std::string SharedEngine::describe() const { return engine_->describe(); }

std::shared_ptr<const LoadedField> SharedEngine::load(std::shared_ptr<const Field> field) {
  const Turn turn(this);
  for (auto entry = loaded_.begin(); entry != loaded_.end();) {
    entry = entry->second.expired() ? loaded_.erase(entry) : std::next(entry);
  }
  // A loaded field keeps its field: while it lives, no other one has this address.
  std::weak_ptr<const LoadedField>& known = loaded_[field.get()];
  if (std::shared_ptr<const LoadedField> loaded = known.lock()) return loaded;
  const std::shared_ptr<const LoadedField> loaded = engine_->load(std::move(field));
  known = loaded;
  return loaded;
}

Rendering SharedEngine::render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                               const RenderOptions& options, const StopToken& stop) {
  const Turn turn(this);
  return engine_->render(field, camera, T_O_C, options, stop);
}

std::unique_ptr<FieldTrainer> SharedEngine::trainer(const FieldConfig&, const Box&,
                                                    std::vector<TrainingView>,
                                                    const TrainingPlan&) {
  throw std::logic_error("a shared engine does not train");
}

std::shared_ptr<const LoadedObservation> SharedEngine::observe(
    const Observation& observation, const std::vector<ImageLevel>& levels) {
  const Turn turn(this);
  return engine_->observe(observation, levels);
}

std::unique_ptr<HypothesisBatch> SharedEngine::batch(int capacity) {
  const Turn turn(this);
  return engine_->batch(capacity);
}

void SharedEngine::scatter(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
                           const ScatterPlan& plan) {
  const Turn turn(this);
  engine_->scatter(batch, priors_T_O_C, plan);
}

void SharedEngine::align(HypothesisBatch* batch, const LoadedField& field,
                         const LoadedObservation& observation, int level, const AlignStage& stage,
                         const StopToken& stop) {
  const Turn turn(this);
  engine_->align(batch, field, observation, level, stage, stop);
}

void SharedEngine::score(HypothesisBatch* batch, const LoadedField& field,
                         const LoadedObservation& observation, int level, const AlignStage& stage,
                         const StopToken& stop) {
  const Turn turn(this);
  engine_->score(batch, field, observation, level, stage, stop);
}

void SharedEngine::descend(HypothesisBatch* batch, const LoadedField& field,
                           const LoadedObservation& observation, int level, const DescentPlan& plan,
                           int first_step, int steps, const StopToken& stop) {
  const Turn turn(this);
  engine_->descend(batch, field, observation, level, plan, first_step, steps, stop);
}

void SharedEngine::measure(HypothesisBatch* batch, const LoadedField& field,
                           const LoadedObservation& observation, int level, const DescentPlan& plan,
                           int pixels, const StopToken& stop) {
  const Turn turn(this);
  engine_->measure(batch, field, observation, level, plan, pixels, stop);
}

void SharedEngine::select(HypothesisBatch* batch, const SelectPlan& plan) {
  const Turn turn(this);
  engine_->select(batch, plan);
}

HypothesisTable SharedEngine::read(const HypothesisBatch& batch) {
  const Turn turn(this);
  return engine_->read(batch);
}

Work SharedEngine::work() const {
  const Turn turn(this);
  return engine_->work();
}

}  // namespace nerf_pose_refiner
