// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "backend/engine.h"

namespace nerf_pose_refiner {

/// One engine for many threads: they take turns call by call, in the order in which they ask, so
/// that of two refinements at once each is done in about twice its time. A field is loaded once,
/// whoever asks for it. A batch still belongs to one thread.
///
/// `work` is that of all threads together. A training takes long and needs an engine of its own.
class SharedEngine final : public Engine {
 public:
  explicit SharedEngine(std::unique_ptr<Engine> engine);

  std::string describe() const override;
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override;
  Rendering render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                   const RenderOptions& options, const StopToken& stop) override;
  /// @throws std::logic_error always.
  std::unique_ptr<FieldTrainer> trainer(const FieldConfig& config, const Box& box,
                                        std::vector<TrainingView> views,
                                        const TrainingPlan& plan) override;
  std::shared_ptr<const LoadedObservation> observe(const Observation& observation,
                                                   const std::vector<ImageLevel>& levels) override;
  std::unique_ptr<HypothesisBatch> batch(int capacity) override;
  void scatter(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
               const ScatterPlan& plan) override;
  void align(HypothesisBatch* batch, const LoadedField& field, const LoadedObservation& observation,
             int level, const AlignStage& stage, const StopToken& stop) override;
  void score(HypothesisBatch* batch, const LoadedField& field, const LoadedObservation& observation,
             int level, const AlignStage& stage, const StopToken& stop) override;
  void descend(HypothesisBatch* batch, const LoadedField& field,
               const LoadedObservation& observation, int level, const DescentPlan& plan,
               int first_step, int steps, const StopToken& stop) override;
  void measure(HypothesisBatch* batch, const LoadedField& field,
               const LoadedObservation& observation, int level, const DescentPlan& plan, int pixels,
               const StopToken& stop) override;
  void select(HypothesisBatch* batch, const SelectPlan& plan) override;
  HypothesisTable read(const HypothesisBatch& batch) override;
  Work work() const override;

 private:
  /// A queue of threads. (A mutex would give the turn to whoever just had it.)
  class Turn {
   public:
    explicit Turn(const SharedEngine* engine);
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    const SharedEngine* engine_;
  };

  std::unique_ptr<Engine> engine_;
  std::map<const Field*, std::weak_ptr<const LoadedField>> loaded_;  ///< used in a turn only
  mutable std::mutex mutex_;                                         ///< guards all below
  mutable std::condition_variable next_;
  mutable std::uint64_t asked_ = 0;   ///< tickets given out
  mutable std::uint64_t served_ = 0;  ///< the ticket whose turn it is
};

}  // namespace nerf_pose_refiner
