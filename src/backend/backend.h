// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/cost_counters.h"
#include "backend/descriptor_index.h"
#include "nerf_pose_refiner/backend.h"

namespace nerf_pose_refiner {

class FieldTrainer;
class KeyframeAligner;
class LoadedField;
class TemplateMatcher;
struct Box;
struct Field;
struct FieldConfig;
struct TemplateBank;
struct TemplateMatchSettings;
struct TrainingPlan;
struct TrainingView;

/// A processor that renders fields, trains them and searches for their poses.
///
/// Backends differ in speed alone; their callers make the schedules (which calls, in which order,
/// with which numbers). An implementation is called by one thread at a time, together with all that
/// it has created. (The public makeBackend gives one that threads may share.)
class Backend {
 public:
  virtual ~Backend() = default;

  virtual BackendInfo info() const = 0;

  /// Copies a field to the processor. @throws std::invalid_argument for a field that is incomplete
  /// or has a shape that the processor does not support.
  virtual std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) = 0;

  /// A new aligner of keyframes with images. One thread may use it, also during other calls.
  virtual std::unique_ptr<KeyframeAligner> makeKeyframeAligner() = 0;

  /// A new matcher of templates. One thread may use it, also during other calls.
  /// @throws std::invalid_argument for settings that are out of range or a bank that shows nothing.
  virtual std::unique_ptr<TemplateMatcher> makeTemplateMatcher(
      std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) = 0;

  /// A new index of descriptors. One thread may use it, also during other calls.
  /// @param rows live longer. @throws std::invalid_argument for none, or for more than
  /// DescriptorIndex::kMostColumns columns.
  virtual std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) = 0;

  /// A trainer of one new field; it keeps the images.
  virtual std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig& config, const Box& box,
                                                    std::vector<TrainingView> views,
                                                    const TrainingPlan& plan) = 0;

  /// The work of all that the backend has created. Calls count once they have been waited for.
  virtual CostCounters costs() const = 0;
};

}  // namespace nerf_pose_refiner
