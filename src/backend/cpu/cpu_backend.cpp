// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_backend.h"

#include <stdexcept>

#include "backend/cpu/cpu_field.h"
#include "backend/cpu/cpu_trainer.h"
#include "backend/cpu/rendered_image.h"
#include "concurrency/parallel.h"

namespace nerf_pose_refiner {

CpuBackend::CpuBackend(int threads, const CpuKernels& kernels)
    : threads_(threads), kernels_(&kernels) {}

std::string CpuBackend::describe() const {
  return std::string("CPU, ") + kernels_->name + ", " + std::to_string(threads_) +
         (threads_ == 1 ? " thread" : " threads");
}

std::shared_ptr<const LoadedField> CpuBackend::load(std::shared_ptr<const Field> field) {
  return makeCpuField(std::move(field), *kernels_);
}

Rendering CpuBackend::render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                             const RenderOptions& options, const CancellationToken& stop) {
  camera.validate();
  if (!T_O_C.isFinite()) throw std::invalid_argument("render: the pose is not finite");
  Image image;
  renderImages(rayRenderer(field), {{camera, T_O_C, 1, &image}}, options, threads_, stop, &work_);
  const Eigen::Vector3f centre = field.field().metadata.centre.cast<float>();
  Rendering rendering;
  rendering.colour = Image(camera.width, camera.height, 3);
  rendering.alpha = Image(camera.width, camera.height, 1);
  rendering.point = Image(camera.width, camera.height, 3);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const float* pixel = image.values.data() + kImageChannels * i;
    rendering.alpha.values[i] = pixel[kOpacity];
    for (int c = 0; c < 3; ++c) {
      rendering.colour.values[3 * i + c] = pixel[c];
      rendering.point.values[3 * i + c] = pixel[kPoint + c] + pixel[kOpacity] * centre[c];
    }
  }
  return rendering;
}

std::unique_ptr<FieldTrainer> CpuBackend::trainer(const FieldConfig& config, const Box& box,
                                                  std::vector<TrainingView> views,
                                                  const TrainingPlan& plan) {
  return std::make_unique<CpuTrainer>(config, box, std::move(views), plan, *kernels_, threads_,
                                      &work_);
}

const RayRenderer& rayRenderer(const LoadedField& field) {
  const auto* renderer = dynamic_cast<const RayRenderer*>(&field);
  if (renderer == nullptr) throw std::invalid_argument("the field is not loaded in the CPU engine");
  return *renderer;
}

const CpuObservation& cpuObservation(const LoadedObservation& observation) {
  const auto* own = dynamic_cast<const CpuObservation*>(&observation);
  if (own == nullptr) throw std::invalid_argument("the observation is not of the CPU engine");
  return *own;
}

std::unique_ptr<Backend> makeCpuBackend(int threads, const std::string& instruction_set) {
  if (threads < 0) {
    throw std::invalid_argument("threads is " + std::to_string(threads) +
                                ", must be 0 (all cores) or more");
  }
  return std::make_unique<CpuBackend>(threadCount(threads), selectCpuKernels(instruction_set));
}

}  // namespace nerf_pose_refiner
