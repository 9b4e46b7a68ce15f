// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "support/recording_backend.h"

namespace nerf_pose_refiner {

/// A field that is held and nothing else.
struct FieldOnly final : LoadedField {
  explicit FieldOnly(std::shared_ptr<const Field> f) : field_(std::move(f)) {}
  const Field& field() const override { return *field_; }
  std::shared_ptr<const Field> field_;
};

/// Trains nothing and writes down what it was asked for; its renderings are grey and as wrong as
/// the test wants, by the number of steps and the view. For tests of registration.
class ScriptedBackend final : public RecordingBackend {
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

  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override {
    return std::make_shared<FieldOnly>(field);
  }

  Rendering render(const LoadedField& loaded, const Camera& camera, const Pose& T_O_C,
                   const RenderOptions&, const CancellationToken& stop) override {
    stop.check();
    const int steps = static_cast<int>(loaded.field().metadata.training_steps);
    const float value = kGrey + static_cast<float>(error(steps, T_O_C));
    return {Image(camera.width, camera.height, 3, value), Image(camera.width, camera.height, 1, 1),
            Image(camera.width, camera.height, 3)};
  }

  std::unique_ptr<FieldTrainer> trainer(const FieldConfig&, const Box& of,
                                        std::vector<TrainingView> from,
                                        const TrainingPlan& with) override {
    box = of;
    views = std::move(from);
    plan = with;
    return std::make_unique<Trainer>(this);
  }

 private:
  class Trainer final : public FieldTrainer {
   public:
    explicit Trainer(ScriptedBackend* backend) : backend_(backend) {}
    double step(double progress) override {
      backend_->progress.push_back(progress);
      std::this_thread::sleep_for(std::chrono::milliseconds(backend_->step_ms));
      return 0.25;
    }
    int stepsDone() const override { return static_cast<int>(backend_->progress.size()); }
    Field finish(const CancellationToken& stop) override { return snapshot(stop); }
    Field snapshot(const CancellationToken& stop) override {
      stop.check();
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
