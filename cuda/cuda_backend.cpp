// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_backend.h"

#include <mutex>
#include <set>
#include <stdexcept>
#include <string>

#include "backend/common/template_rules.h"
#include "backend/make_backend.h"
#include "cuda_descriptor_index.h"
#include "cuda_keyframe_aligner.h"
#include "cuda_loaded_field.h"
#include "cuda_template_matcher.h"
#include "cuda_trainer.h"
#include "probe.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMinCapability = 75;  // tensor cores that take halves
constexpr int kSearchesAtOnce = 5;  // some 100 MiB each

cudaDeviceProp propertiesOf(int device) {
  cudaDeviceProp properties;
  NPR_CUDA_CHECK(cudaGetDeviceProperties(&properties, device));
  return properties;
}

// What works once goes on to work until there is a sticky error.
std::string whyNoKernelsOn(int device) {
  static std::mutex mutex;
  static std::set<int> working;
  std::lock_guard<std::mutex> lock(mutex);
  if (working.count(device) > 0) return "";
  const cudaError_t error = cudaSetDevice(device);
  if (error != cudaSuccess) {
    cudaGetLastError();
    return cudaGetErrorString(error);
  }
  const std::string why = whyNoKernels();
  if (why.empty()) working.insert(device);
  return why;
}

}  // namespace

std::string whyNoCuda(int device) {
  const std::string lost = stickyError();
  if (!lost.empty()) return lost + "; it works again when the process is restarted";
  int count = 0;
  const cudaError_t error = cudaGetDeviceCount(&count);
  if (error != cudaSuccess) {
    cudaGetLastError();
    return cudaGetErrorString(error);
  }
  if (device < 0 || device >= count) {
    return "there is no CUDA device " + std::to_string(device) + ", only " + std::to_string(count);
  }
  const cudaDeviceProp properties = propertiesOf(device);
  if (10 * properties.major + properties.minor < kMinCapability) {
    return std::string(properties.name) + " has compute capability " +
           std::to_string(properties.major) + "." + std::to_string(properties.minor) +
           ", must be 7.5 or more";
  }
  const std::string why = whyNoKernelsOn(device);
  return why.empty() ? why : std::string(properties.name) + ": " + why;
}

std::unique_ptr<Backend> makeCudaBackend(const BackendChoice& choice) {
  const std::string why = whyNoCuda(choice.device);
  if (!why.empty()) throw std::runtime_error("no CUDA backend: " + why);
  NPR_CUDA_CHECK(cudaSetDevice(choice.device));
  return std::make_unique<CudaBackend>(choice.device);
}

CudaBackend::CudaBackend(int device) : processor_(std::make_shared<CudaProcessor>(device)) {}

BackendInfo CudaBackend::info() const {
  const cudaDeviceProp properties = propertiesOf(processor_->device());
  BackendInfo info;
  info.name = "cuda";
  info.description = std::string("CUDA, ") + properties.name + ", " +
                     std::to_string(properties.totalGlobalMem >> 20) + " MiB";
  info.memory_bytes = properties.totalGlobalMem;
  info.searches_at_once = kSearchesAtOnce;
  info.warms_up = true;
  info.scans_fast = true;
  return info;
}

std::shared_ptr<const LoadedField> CudaBackend::load(std::shared_ptr<const Field> field) {
  processor_->enter();
  return std::make_shared<CudaLoadedField>(std::move(field), processor_);
}

std::unique_ptr<KeyframeAligner> CudaBackend::makeKeyframeAligner() {
  processor_->enter();
  return std::make_unique<CudaKeyframeAligner>(processor_->device(), processor_->frames());
}

std::unique_ptr<TemplateMatcher> CudaBackend::makeTemplateMatcher(
    std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) {
  settings.validate();
  requireTemplates(*bank);
  processor_->enter();
  return std::make_unique<CudaTemplateMatcher>(processor_->device(), std::move(bank), settings);
}

std::unique_ptr<DescriptorIndex> CudaBackend::makeDescriptorIndex(const Descriptors& rows) {
  processor_->enter();
  return std::make_unique<CudaDescriptorIndex>(processor_->device(), rows);
}

std::unique_ptr<FieldTrainer> CudaBackend::makeTrainer(const FieldConfig& config, const Box& box,
                                                       std::vector<TrainingView> views,
                                                       const TrainingPlan& plan) {
  processor_->enter();
  return std::make_unique<CudaTrainer>(config, box, std::move(views), plan, processor_);
}

}  // namespace nerf_pose_refiner
