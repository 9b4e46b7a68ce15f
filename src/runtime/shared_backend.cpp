// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/shared_backend.h"

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <utility>

#include "backend/hypotheses.h"
#include "backend/keyframe_aligner.h"
#include "backend/plans.h"
#include "backend/template_matcher.h"
#include "backend/training.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A lock that threads get in the order in which they asked for it. (A mutex may give it to the
/// thread that has just released it.)
class SharedBackend::TicketLock {
 public:
  void lock() {
    std::unique_lock<std::mutex> lock(mutex_);
    const std::uint64_t ticket = next_ticket_++;
    served_changed_.wait(lock, [&] { return served_ == ticket; });
  }
  void unlock() {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      ++served_;
    }
    served_changed_.notify_all();
  }

 private:
  std::mutex mutex_;  ///< guards all below
  std::condition_variable served_changed_;
  std::uint64_t next_ticket_ = 0;
  std::uint64_t served_ = 0;  ///< the ticket that holds the lock, or gets it next
};

namespace {

using TicketLock = SharedBackend::TicketLock;
using TicketGuard = std::lock_guard<TicketLock>;

/// An object that a backend has created. Each call to it holds the backend's lock, as does its
/// destruction.
template <typename Pointer>
class Serialised {
 public:
  Serialised(std::shared_ptr<TicketLock> lock, Pointer object)
      : lock_(std::move(lock)), object_(std::move(object)) {}
  ~Serialised() {
    const TicketGuard guard(*lock_);
    object_.reset();
  }
  Serialised(const Serialised&) = delete;
  Serialised& operator=(const Serialised&) = delete;

  template <typename Call>
  auto operator()(const Call& call) const {
    const TicketGuard guard(*lock_);
    return call(*object_);
  }
  const std::shared_ptr<TicketLock>& lock() const { return lock_; }
  /// For calls that need no lock.
  const Pointer& object() const { return object_; }

 private:
  std::shared_ptr<TicketLock> lock_;
  Pointer object_;
};

class SharedSolver final : public PoseSolver {
 public:
  SharedSolver(std::shared_ptr<TicketLock> lock, std::unique_ptr<PoseSolver> solver)
      : serialised_(std::move(lock), std::move(solver)) {}

  void sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) override {
    serialised_([&](PoseSolver& solver) { solver.sample(priors_T_O_C, plan); });
  }
  void align(int level, const AlignStage& stage, const CancellationToken& cancellation) override {
    serialised_([&](PoseSolver& solver) { solver.align(level, stage, cancellation); });
  }
  void score(int level, const AlignStage& stage, const CancellationToken& cancellation) override {
    serialised_([&](PoseSolver& solver) { solver.score(level, stage, cancellation); });
  }
  void optimise(int level, const OptimisationPlan& plan, const StepRange& steps,
                const CancellationToken& cancellation) override {
    serialised_([&](PoseSolver& solver) { solver.optimise(level, plan, steps, cancellation); });
  }
  void evaluate(int level, const OptimisationPlan& plan, int pixels,
                const CancellationToken& cancellation) override {
    serialised_([&](PoseSolver& solver) { solver.evaluate(level, plan, pixels, cancellation); });
  }
  void resample(const ResamplingPlan& plan) override {
    serialised_([&](PoseSolver& solver) { solver.resample(plan); });
  }
  void snapshot() override {
    serialised_([](PoseSolver& solver) { solver.snapshot(); });
  }
  std::vector<SolverSnapshot> read() override {
    return serialised_([](PoseSolver& solver) { return solver.read(); });
  }

 private:
  Serialised<std::unique_ptr<PoseSolver>> serialised_;
};

class SharedField final : public LoadedField {
 public:
  SharedField(std::shared_ptr<TicketLock> lock, std::shared_ptr<const LoadedField> field)
      : serialised_(std::move(lock), std::move(field)) {}

  const Field& field() const override { return serialised_.object()->field(); }
  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const override {
    return serialised_(
        [&](const LoadedField& field) { return field.render(view, options, cancellation); });
  }
  /// Where nothing is gained by it, others have their turn in between.
  std::vector<Rendering> renderAll(const Camera& camera, const std::vector<Pose>& poses_T_O_C,
                                   const RenderOptions& options,
                                   const CancellationToken& cancellation) const override {
    if (!rendersTogether()) {
      return LoadedField::renderAll(camera, poses_T_O_C, options, cancellation);
    }
    return serialised_([&](const LoadedField& field) {
      return field.renderAll(camera, poses_T_O_C, options, cancellation);
    });
  }
  bool rendersTogether() const override { return serialised_.object()->rendersTogether(); }
  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override {
    auto solver = serialised_(
        [&](const LoadedField& field) { return field.makeSolver(observation, levels, capacity); });
    return std::make_unique<SharedSolver>(serialised_.lock(), std::move(solver));
  }

 private:
  Serialised<std::shared_ptr<const LoadedField>> serialised_;
};

class SharedTrainer final : public FieldTrainer {
 public:
  SharedTrainer(std::shared_ptr<TicketLock> lock, std::unique_ptr<FieldTrainer> trainer)
      : serialised_(std::move(lock), std::move(trainer)) {}

  double step(double progress) override {
    return serialised_([&](FieldTrainer& trainer) { return trainer.step(progress); });
  }
  int stepsDone() const override { return serialised_.object()->stepsDone(); }
  Field finish(const CancellationToken& cancellation) override {
    return serialised_([&](FieldTrainer& trainer) { return trainer.finish(cancellation); });
  }
  Field snapshot(const CancellationToken& cancellation) override {
    return serialised_([&](FieldTrainer& trainer) { return trainer.snapshot(cancellation); });
  }

 private:
  Serialised<std::unique_ptr<FieldTrainer>> serialised_;
};

}  // namespace

SharedBackend::SharedBackend(std::unique_ptr<Backend> backend)
    : lock_(std::make_shared<TicketLock>()), backend_(std::move(backend)) {}

SharedBackend::~SharedBackend() = default;

BackendInfo SharedBackend::info() const { return backend_->info(); }

std::shared_ptr<const LoadedField> SharedBackend::load(std::shared_ptr<const Field> field) {
  const TicketGuard guard(*lock_);
  for (auto entry = loaded_.begin(); entry != loaded_.end();) {
    entry = entry->second.expired() ? loaded_.erase(entry) : std::next(entry);
  }
  // A loaded field keeps its field alive: meanwhile no other field has its address.
  std::weak_ptr<const LoadedField>& known = loaded_[field.get()];
  std::shared_ptr<const LoadedField> loaded = known.lock();
  if (loaded) return loaded;
  loaded = std::make_shared<SharedField>(lock_, backend_->load(std::move(field)));
  known = loaded;
  return loaded;
}

std::unique_ptr<KeyframeAligner> SharedBackend::makeKeyframeAligner() {
  return backend_->makeKeyframeAligner();
}

std::unique_ptr<TemplateMatcher> SharedBackend::makeTemplateMatcher(
    std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) {
  return backend_->makeTemplateMatcher(std::move(bank), settings);
}

std::unique_ptr<DescriptorIndex> SharedBackend::makeDescriptorIndex(const Descriptors& rows) {
  return backend_->makeDescriptorIndex(rows);
}

std::unique_ptr<FieldTrainer> SharedBackend::makeTrainer(const FieldConfig& config, const Box& box,
                                                         std::vector<TrainingView> views,
                                                         const TrainingPlan& plan) {
  const TicketGuard guard(*lock_);
  return std::make_unique<SharedTrainer>(
      lock_, backend_->makeTrainer(config, box, std::move(views), plan));
}

CostCounters SharedBackend::costs() const {
  const TicketGuard guard(*lock_);
  return backend_->costs();
}

}  // namespace nerf_pose_refiner
