// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "backend/backend.h"

namespace nerf_pose_refiner {

/// An backend that writes down what it is asked for and does nothing: for tests of schedules.
class RecordingBackend : public Backend {
 public:
  std::vector<std::string> calls;
  SamplingPlan scattered;
  std::vector<Pose> priors;                    ///< of all calls of scatter
  HypothesisTable table = HypothesisTable(1);  ///< what is read
  std::vector<ResamplingPlan> selected;
  std::vector<OptimisationPlan> optimised;

  std::string describe() const override { return "recording"; }
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field>) override { return nullptr; }
  Rendering render(const LoadedField&, const Camera&, const Pose&, const RenderOptions&,
                   const CancellationToken&) override {
    return {};
  }
  std::unique_ptr<FieldTrainer> trainer(const FieldConfig&, const Box&, std::vector<TrainingView>,
                                        const TrainingPlan&) override {
    return nullptr;
  }
  std::shared_ptr<const LoadedObservation> observe(const Observation&,
                                                   const std::vector<ImageLevel>&) override {
    return std::make_shared<LoadedObservation>();
  }
  std::unique_ptr<HypothesisBatch> batch(int) override {
    return std::make_unique<HypothesisBatch>();
  }
  void sample(HypothesisBatch*, const std::vector<Pose>& from, const SamplingPlan& plan) override {
    if (calls.empty()) scattered = plan;
    priors.insert(priors.end(), from.begin(), from.end());
    calls.push_back("scatter " + std::to_string(plan.count));
  }
  void align(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int, const AlignStage&,
             const CancellationToken&) override {
    calls.push_back("align");
  }
  void score(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int, const AlignStage&,
             const CancellationToken&) override {
    calls.push_back("score");
  }
  void optimise(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int,
                const OptimisationPlan& plan, int first_step, int steps,
                const CancellationToken&) override {
    optimised.push_back(plan);
    calls.push_back("descend " + std::to_string(first_step) + "+" + std::to_string(steps));
  }
  void evaluate(HypothesisBatch*, const LoadedField&, const LoadedObservation&, int,
                const OptimisationPlan&, int pixels, const CancellationToken&) override {
    calls.push_back("measure " + std::to_string(pixels));
  }
  void resample(HypothesisBatch*, const ResamplingPlan& plan) override {
    selected.push_back(plan);
    calls.push_back("select " + std::to_string(plan.keep) + " for " +
                    std::to_string(plan.offspring));
  }
  HypothesisTable read(const HypothesisBatch&) override { return table; }
  CostCounters work() const override { return {}; }
};

}  // namespace nerf_pose_refiner
