// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "backend/hypotheses.h"
#include "backend/loaded_field.h"
#include "backend/plans.h"
#include "backend/pose_solver.h"
#include "backend/training.h"
#include "field/field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// What a solver was asked for, and what it answers.
struct Recording {
  std::vector<std::string> calls;
  SamplingPlan sampled;      ///< first
  std::vector<Pose> priors;  ///< of all calls of sample
  std::vector<ResamplingPlan> resampled;
  std::vector<OptimisationPlan> optimised;
  HypothesisTable table = HypothesisTable(1);  ///< what is read
};

/// A solver that writes down what it is asked for and does nothing: for tests of schedules.
class RecordingSolver final : public PoseSolver {
 public:
  explicit RecordingSolver(std::shared_ptr<Recording> recording)
      : recording_(std::move(recording)) {}

  void sample(const std::vector<Pose>& from, const SamplingPlan& plan) override {
    if (recording_->calls.empty()) recording_->sampled = plan;
    recording_->priors.insert(recording_->priors.end(), from.begin(), from.end());
    record("sample " + std::to_string(plan.count));
  }
  void align(int, const AlignStage&, const CancellationToken&) override { record("align"); }
  void score(int, const AlignStage&, const CancellationToken&) override { record("score"); }
  void optimise(int, const OptimisationPlan& plan, const StepRange& steps,
                const CancellationToken&) override {
    recording_->optimised.push_back(plan);
    record("optimise " + std::to_string(steps.first) + "+" + std::to_string(steps.count));
  }
  void evaluate(int, const OptimisationPlan&, int pixels, const CancellationToken&) override {
    record("evaluate " + std::to_string(pixels));
  }
  void resample(const ResamplingPlan& plan) override {
    recording_->resampled.push_back(plan);
    record("resample " + std::to_string(plan.keep) + " for " + std::to_string(plan.offspring));
  }
  void snapshot() override { ++snapshots_; }
  std::vector<SolverSnapshot> read() override {
    SolverSnapshot same;
    same.hypotheses = recording_->table;
    return std::vector<SolverSnapshot>(std::exchange(snapshots_, 0), same);
  }

 private:
  void record(const std::string& call) { recording_->calls.push_back(call); }

  std::shared_ptr<Recording> recording_;
  int snapshots_ = 0;
};

/// A field that is held, and searched for by a RecordingSolver; black wherever it is seen from.
class RecordingField : public LoadedField {
 public:
  explicit RecordingField(std::shared_ptr<const Field> field,
                          std::shared_ptr<Recording> recording = std::make_shared<Recording>())
      : field_(std::move(field)), recording_(std::move(recording)) {}

  const Field& field() const override { return *field_; }
  Rendering render(const View& view, const RenderOptions&,
                   const CancellationToken&) const override {
    const int width = view.camera.width, height = view.camera.height;
    return {Image(width, height, 3), Image(width, height, 1), Image(width, height, 3)};
  }
  std::unique_ptr<PoseSolver> makeSolver(const Observation&, const std::vector<ImageLevel>&,
                                         int) const override {
    return std::make_unique<RecordingSolver>(recording_);
  }
  const Recording& recording() const { return *recording_; }

 private:
  std::shared_ptr<const Field> field_;
  std::shared_ptr<Recording> recording_;
};

}  // namespace nerf_pose_refiner
