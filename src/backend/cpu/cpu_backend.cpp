// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_backend.h"

#include <stdexcept>

#include "backend/common/template_rules.h"
#include "backend/cpu/cpu_descriptor_index.h"
#include "backend/cpu/cpu_field.h"
#include "backend/cpu/cpu_keyframe_aligner.h"
#include "backend/cpu/cpu_template_matcher.h"
#include "backend/cpu/cpu_trainer.h"
#include "backend/make_backend.h"
#include "concurrency/parallel.h"

namespace nerf_pose_refiner {

CpuBackend::CpuBackend(std::shared_ptr<CpuProcessor> processor)
    : processor_(std::move(processor)) {}

BackendInfo CpuBackend::info() const {
  const int threads = processor_->threads;
  BackendInfo info;
  info.name = "cpu";
  info.threads = threads;
  info.description = std::string("CPU, ") + processor_->kernels->name + ", " +
                     std::to_string(threads) + (threads == 1 ? " thread" : " threads");
  return info;
}

std::shared_ptr<const LoadedField> CpuBackend::load(std::shared_ptr<const Field> field) {
  return std::make_shared<CpuField>(std::move(field), processor_);
}

std::unique_ptr<KeyframeAligner> CpuBackend::makeKeyframeAligner() {
  return std::make_unique<CpuKeyframeAligner>(*processor_->keyframe_kernels, processor_->threads,
                                              processor_->frames);
}

std::unique_ptr<TemplateMatcher> CpuBackend::makeTemplateMatcher(
    std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) {
  settings.validate();
  requireTemplates(*bank);
  return std::make_unique<CpuTemplateMatcher>(
      std::move(bank), settings, ScanWork{processor_->threads, *processor_->template_kernels});
}

std::unique_ptr<DescriptorIndex> CpuBackend::makeDescriptorIndex(const Descriptors& rows) {
  return std::make_unique<CpuDescriptorIndex>(rows, processor_->threads);
}

std::unique_ptr<FieldTrainer> CpuBackend::makeTrainer(const FieldConfig& config, const Box& box,
                                                      std::vector<TrainingView> views,
                                                      const TrainingPlan& plan) {
  return std::make_unique<CpuTrainer>(config, box, std::move(views), plan, processor_);
}

std::unique_ptr<Backend> makeCpuBackend(int threads, const std::string& instruction_set) {
  if (threads < 0) {
    throw std::invalid_argument("threads is " + std::to_string(threads) +
                                ", must be 0 (all cores) or more");
  }
  auto processor = std::make_shared<CpuProcessor>();
  processor->kernels = &selectCpuKernels(instruction_set);
  processor->keyframe_kernels = &selectKeyframeKernels(instruction_set);
  processor->template_kernels = &selectTemplateKernels(instruction_set);
  processor->threads = threadCount(threads);
  return std::make_unique<CpuBackend>(std::move(processor));
}

}  // namespace nerf_pose_refiner
