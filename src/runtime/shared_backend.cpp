// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/shared_backend.h"

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <utility>

#include "backend/hypotheses.h"
#include "backend/keyframe_aligner.h"
#include "backend/plans.h"
#include "backend/training.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A queue of threads. (A mutex would give the turn to whoever just had it.)
class SharedBackend::Turns {
 public:
  /// Runs a call when its turn has come. @return what it returns.
  template <typename Call>
  auto take(const Call& call) {
    const Turn turn(this);
    return call();
  }

 private:
  class Turn {
   public:
    explicit Turn(Turns* turns) : turns_(turns) {
      std::unique_lock<std::mutex> lock(turns_->mutex_);
      const std::uint64_t ticket = turns_->asked_++;
      turns_->next_.wait(lock, [&] { return turns_->served_ == ticket; });
    }
    ~Turn() {
      {
        std::lock_guard<std::mutex> lock(turns_->mutex_);
        ++turns_->served_;
      }
      turns_->next_.notify_all();
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    Turns* turns_;
  };

  std::mutex mutex_;  ///< guards all below
  std::condition_variable next_;
  std::uint64_t asked_ = 0;   ///< tickets given out
  std::uint64_t served_ = 0;  ///< the ticket whose turn it is
};

namespace {

using TurnsPtr = std::shared_ptr<SharedBackend::Turns>;

/// What a backend made, for one call in a turn each; it ends in a turn, too.
template <typename Made>
class InTurns {
 public:
  InTurns(TurnsPtr turns, Made made) : turns_(std::move(turns)), made_(std::move(made)) {}
  ~InTurns() {
    turns_->take([&] { made_.reset(); });
  }
  InTurns(const InTurns&) = delete;
  InTurns& operator=(const InTurns&) = delete;

  template <typename Call>
  auto operator()(const Call& call) const {
    return turns_->take([&] { return call(*made_); });
  }
  const TurnsPtr& turns() const { return turns_; }
  const Made& made() const { return made_; }

 private:
  TurnsPtr turns_;
  Made made_;
};

class SharedSolver final : public PoseSolver {
 public:
  SharedSolver(TurnsPtr turns, std::unique_ptr<PoseSolver> solver)
      : in_turn_(std::move(turns), std::move(solver)) {}

  void sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) override {
    in_turn_([&](PoseSolver& solver) { solver.sample(priors_T_O_C, plan); });
  }
  void align(int level, const AlignStage& stage, const CancellationToken& cancellation) override {
    in_turn_([&](PoseSolver& solver) { solver.align(level, stage, cancellation); });
  }
  void score(int level, const AlignStage& stage, const CancellationToken& cancellation) override {
    in_turn_([&](PoseSolver& solver) { solver.score(level, stage, cancellation); });
  }
  void optimise(int level, const OptimisationPlan& plan, const StepRange& steps,
                const CancellationToken& cancellation) override {
    in_turn_([&](PoseSolver& solver) { solver.optimise(level, plan, steps, cancellation); });
  }
  void evaluate(int level, const OptimisationPlan& plan, int pixels,
                const CancellationToken& cancellation) override {
    in_turn_([&](PoseSolver& solver) { solver.evaluate(level, plan, pixels, cancellation); });
  }
  void resample(const ResamplingPlan& plan) override {
    in_turn_([&](PoseSolver& solver) { solver.resample(plan); });
  }
  void snapshot() override {
    in_turn_([](PoseSolver& solver) { solver.snapshot(); });
  }
  std::vector<SolverSnapshot> read() override {
    return in_turn_([](PoseSolver& solver) { return solver.read(); });
  }

 private:
  InTurns<std::unique_ptr<PoseSolver>> in_turn_;
};

class SharedField final : public LoadedField {
 public:
  SharedField(TurnsPtr turns, std::shared_ptr<const LoadedField> field)
      : in_turn_(std::move(turns), std::move(field)) {}

  const Field& field() const override { return in_turn_.made()->field(); }
  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const override {
    return in_turn_(
        [&](const LoadedField& field) { return field.render(view, options, cancellation); });
  }
  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override {
    auto solver = in_turn_(
        [&](const LoadedField& field) { return field.makeSolver(observation, levels, capacity); });
    return std::make_unique<SharedSolver>(in_turn_.turns(), std::move(solver));
  }

 private:
  InTurns<std::shared_ptr<const LoadedField>> in_turn_;
};

class SharedTrainer final : public FieldTrainer {
 public:
  SharedTrainer(TurnsPtr turns, std::unique_ptr<FieldTrainer> trainer)
      : in_turn_(std::move(turns), std::move(trainer)) {}

  double step(double progress) override {
    return in_turn_([&](FieldTrainer& trainer) { return trainer.step(progress); });
  }
  int stepsDone() const override { return in_turn_.made()->stepsDone(); }
  Field finish(const CancellationToken& cancellation) override {
    return in_turn_([&](FieldTrainer& trainer) { return trainer.finish(cancellation); });
  }
  Field snapshot(const CancellationToken& cancellation) override {
    return in_turn_([&](FieldTrainer& trainer) { return trainer.snapshot(cancellation); });
  }

 private:
  InTurns<std::unique_ptr<FieldTrainer>> in_turn_;
};

}  // namespace

SharedBackend::SharedBackend(std::unique_ptr<Backend> backend)
    : turns_(std::make_shared<Turns>()), backend_(std::move(backend)) {}

SharedBackend::~SharedBackend() = default;

BackendInfo SharedBackend::info() const { return backend_->info(); }

std::shared_ptr<const LoadedField> SharedBackend::load(std::shared_ptr<const Field> field) {
  return turns_->take([&] {
    for (auto entry = loaded_.begin(); entry != loaded_.end();) {
      entry = entry->second.expired() ? loaded_.erase(entry) : std::next(entry);
    }
    // A loaded field keeps its field: while it lives, no other one has this address.
    std::weak_ptr<const LoadedField>& known = loaded_[field.get()];
    std::shared_ptr<const LoadedField> loaded = known.lock();
    if (loaded) return loaded;
    loaded = std::make_shared<SharedField>(turns_, backend_->load(std::move(field)));
    known = loaded;
    return loaded;
  });
}

std::unique_ptr<KeyframeAligner> SharedBackend::makeKeyframeAligner() {
  return backend_->makeKeyframeAligner();
}

std::unique_ptr<FieldTrainer> SharedBackend::makeTrainer(const FieldConfig& config, const Box& box,
                                                         std::vector<TrainingView> views,
                                                         const TrainingPlan& plan) {
  auto trainer =
      turns_->take([&] { return backend_->makeTrainer(config, box, std::move(views), plan); });
  return std::make_unique<SharedTrainer>(turns_, std::move(trainer));
}

CostCounters SharedBackend::costs() const {
  return turns_->take([&] { return backend_->costs(); });
}

}  // namespace nerf_pose_refiner
