// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "backend/keyframe_aligner.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend/template_matcher.h"
#include "support/recording_backend.h"

namespace nerf_pose_refiner {

/// Trains nothing and writes down what it was asked for; its renderings are grey and as wrong as
/// the test wants, by the number of steps and the view. For tests of registration.
class ScriptedBackend final : public Backend {
 public:
  static constexpr float kGrey = 128.0f / 255;

  Box box;
  std::vector<TrainingView> views;
  TrainingPlan plan;
  std::vector<double> progress;  ///< given to each step
  int step_ms = 0;               ///< that a step takes
  Field model;                   ///< what is trained, but for box, steps and
  double diameter = 1;           ///< its diameter
  std::function<double(int, const Pose&)> error = [](int, const Pose&) { return 0.1; };

  BackendInfo info() const override { return {"scripted", "scripted"}; }

  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override {
    return std::make_shared<GreyField>(std::move(field), *this);
  }

  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig&, const Box& of,
                                            std::vector<TrainingView> from,
                                            const TrainingPlan& with) override {
    box = of;
    views = std::move(from);
    plan = with;
    return std::make_unique<Trainer>(this);
  }

  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override {
    return makeCpuKeyframeAligner(1);
  }
  std::unique_ptr<TemplateMatcher> makeTemplateMatcher(
      std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) override {
    return makeCpuBackend(1)->makeTemplateMatcher(std::move(bank), settings);
  }
  std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) override {
    return makeCpuBackend(1)->makeDescriptorIndex(rows);
  }

  CostCounters costs() const override { return {}; }

 private:
  class GreyField final : public RecordingField {
   public:
    GreyField(std::shared_ptr<const Field> field, const ScriptedBackend& script)
        : RecordingField(std::move(field)), script_(script) {}
    Rendering render(const View& view, const RenderOptions&,
                     const CancellationToken& cancellation) const override {
      cancellation.check();
      const int steps = static_cast<int>(field().metadata.training_steps);
      const float value = kGrey + static_cast<float>(script_.error(steps, view.T_O_C));
      const int width = view.camera.width, height = view.camera.height;
      return {Image(width, height, 3, value), Image(width, height, 1, 1), Image(width, height, 3)};
    }

   private:
    const ScriptedBackend& script_;
  };

  class Trainer final : public FieldTrainer {
   public:
    explicit Trainer(ScriptedBackend* backend) : backend_(backend) {}
    double step(double progress) override {
      backend_->progress.push_back(progress);
      std::this_thread::sleep_for(std::chrono::milliseconds(backend_->step_ms));
      return 0.25;
    }
    int stepsDone() const override { return static_cast<int>(backend_->progress.size()); }
    Field finish(const CancellationToken& cancellation) override { return snapshot(cancellation); }
    Field snapshot(const CancellationToken& cancellation) override {
      cancellation.check();
      Field field = backend_->model;
      field.box = backend_->box;
      field.metadata.diameter = backend_->diameter;
      field.metadata.training_steps = static_cast<std::uint64_t>(stepsDone());
      return field;
    }

   private:
    ScriptedBackend* backend_;
  };
};

}  // namespace nerf_pose_refiner
