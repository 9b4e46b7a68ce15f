// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "backend/backend.h"
#include "backend/keyframe_aligner.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend/pose_solver.h"
#include "backend/template_matcher.h"
#include "backend/training.h"
#include "field/field.h"
#include "runtime/shared_backend.h"

namespace nerf_pose_refiner {

/// An object that was judged when it was registered: nothing of it has to be measured. Its scores
/// are those of a textured object.
inline FieldMetadata judged(FieldMetadata object) {
  object.pose.keyframes.poses = 1000;
  object.pose.keyframes.wrong_mean = 0.14;
  object.pose.keyframes.wrong_deviation = 0.07;
  object.pose.keyframes.right_mean = 0.8;
  object.pose.keyframes.right_deviation = 0.1;
  object.look_alikes.measured = true;
  return object;
}

/// A scene of which other things are said. Counts its renderings.
class DescribedScene final : public LoadedField {
 public:
  DescribedScene(std::shared_ptr<const LoadedField> scene, FieldMetadata object)
      : scene_(std::move(scene)), field_(scene_->field()) {
    field_.metadata = std::move(object);
  }

  const Field& field() const override { return field_; }
  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const override {
    ++renderings;
    if (on_render) on_render();
    return scene_->render(view, options, cancellation);
  }
  /// A keyframe is one rendering, not several strips.
  bool rendersTogether() const override { return true; }
  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override {
    return scene_->makeSolver(observation, levels, capacity);
  }

  mutable std::atomic<int> renderings{0};
  std::function<void()> on_render;  ///< called by the threads that render

 private:
  std::shared_ptr<const LoadedField> scene_;
  Field field_;
};

/// Has one scene, whatever is loaded.
class SceneBackend : public Backend {
 public:
  /// @param memory_bytes what it says of its own memory, @see BackendInfo.
  explicit SceneBackend(std::shared_ptr<const LoadedField> scene, std::size_t memory_bytes = 0)
      : scene_(std::move(scene)), memory_bytes_(memory_bytes) {}

  BackendInfo info() const override {
    BackendInfo info;
    info.memory_bytes = memory_bytes_;
    return info;
  }
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field>) override { return scene_; }
  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override {
    return makeCpuKeyframeAligner(2);
  }
  std::unique_ptr<TemplateMatcher> makeTemplateMatcher(
      std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) override {
    return makeCpuBackend(2)->makeTemplateMatcher(std::move(bank), settings);
  }
  std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) override {
    return makeCpuBackend(1)->makeDescriptorIndex(rows);
  }
  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig&, const Box&,
                                            std::vector<TrainingView>,
                                            const TrainingPlan&) override {
    throw std::logic_error("a scene is not trained");
  }
  CostCounters costs() const override { return {}; }

 private:
  std::shared_ptr<const LoadedField> scene_;
  std::size_t memory_bytes_;
};

/// A backend that threads may share, as those of a search do.
template <typename Own, typename... Arguments>
std::shared_ptr<Backend> sharedBackend(const Arguments&... arguments) {
  return std::make_shared<SharedBackend>(std::make_unique<Own>(arguments...));
}

}  // namespace nerf_pose_refiner
