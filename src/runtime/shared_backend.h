// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "backend/backend.h"

namespace nerf_pose_refiner {

/// One backend for many threads: they take turns call by call, in the order in which they ask, so
/// that of two refinements at once each is done in about twice its time. A field is loaded once,
/// whoever asks for it. A batch still belongs to one thread.
///
/// `work` is that of all threads together. A training takes long and needs an backend of its own.
class SharedBackend final : public Backend {
 public:
  explicit SharedBackend(std::unique_ptr<Backend> backend);

  std::string describe() const override;
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override;
  Rendering render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                   const RenderOptions& options, const CancellationToken& stop) override;
  /// @throws std::logic_error always.
  std::unique_ptr<FieldTrainer> trainer(const FieldConfig& config, const Box& box,
                                        std::vector<TrainingView> views,
                                        const TrainingPlan& plan) override;
  std::shared_ptr<const LoadedObservation> observe(const Observation& observation,
                                                   const std::vector<ImageLevel>& levels) override;
  std::unique_ptr<HypothesisBatch> batch(int capacity) override;
  void sample(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
              const SamplingPlan& plan) override;
  void align(HypothesisBatch* batch, const LoadedField& field, const LoadedObservation& observation,
             int level, const AlignStage& stage, const CancellationToken& stop) override;
  void score(HypothesisBatch* batch, const LoadedField& field, const LoadedObservation& observation,
             int level, const AlignStage& stage, const CancellationToken& stop) override;
  void optimise(HypothesisBatch* batch, const LoadedField& field,
                const LoadedObservation& observation, int level, const OptimisationPlan& plan,
                int first_step, int steps, const CancellationToken& stop) override;
  void evaluate(HypothesisBatch* batch, const LoadedField& field,
                const LoadedObservation& observation, int level, const OptimisationPlan& plan,
                int pixels, const CancellationToken& stop) override;
  void resample(HypothesisBatch* batch, const ResamplingPlan& plan) override;
  HypothesisTable read(const HypothesisBatch& batch) override;
  CostCounters work() const override;

 private:
  /// A queue of threads. (A mutex would give the turn to whoever just had it.)
  class TicketLock {
   public:
    explicit TicketLock(const SharedBackend* backend);
    ~TicketLock();
    TicketLock(const TicketLock&) = delete;
    TicketLock& operator=(const TicketLock&) = delete;

   private:
    const SharedBackend* backend_;
  };

  std::unique_ptr<Backend> backend_;
  std::map<const Field*, std::weak_ptr<const LoadedField>> loaded_;  ///< used in a turn only
  mutable std::mutex mutex_;                                         ///< guards all below
  mutable std::condition_variable next_;
  mutable std::uint64_t asked_ = 0;   ///< tickets given out
  mutable std::uint64_t served_ = 0;  ///< the ticket whose turn it is
};

}  // namespace nerf_pose_refiner
