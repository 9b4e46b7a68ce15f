// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_loaded_field.h"

#include "backend/common/image_channels.h"
#include "backend/common/plain_pose.h"
#include "backend/common/solver_rules.h"
#include "cuda_solver.h"

namespace nerf_pose_refiner {

CudaLoadedField::CudaLoadedField(std::shared_ptr<const Field> field,
                                 std::shared_ptr<CudaProcessor> processor)
    : processor_(std::move(processor)),
      memory_(std::make_unique<CudaField>(std::move(field), processor_->stream())) {}

CudaLoadedField::~CudaLoadedField() {
  cudaSetDevice(processor_->device());  // a destructor never throws
}

Rendering CudaLoadedField::render(const View& view, const RenderOptions& options,
                                  const CancellationToken& cancellation) const {
  processor_->enter();
  requireView(view);
  cancellation.check();
  const Camera& camera = view.camera;
  CudaWorkspace& space = processor_->space();
  RenderTask task = processor_->renderTask(*memory_, plainCamera(camera), 1, 1);
  task.near = options.near;
  task.step_scale = options.step_scale;
  task.min_transmittance = options.min_transmittance;
  task.min_weight = options.min_weight;
  task.use_occupancy = options.use_occupancy;
  const CameraPose<double> pose = plainPose(view.T_O_C);
  space.poses.upload(&pose, 1, processor_->stream());
  renderImages(memory_->view(), task, processor_->stream());

  const std::size_t pixels = static_cast<std::size_t>(camera.width) * camera.height;
  space.pinned_image.reserve(2 * pixels);
  NPR_CUDA_CHECK(cudaMemcpyAsync(space.pinned_image.data(), space.images.data(),
                                 2 * pixels * sizeof(float4), cudaMemcpyDeviceToHost,
                                 processor_->stream()));
  processor_->mark(&space.rendered);
  processor_->wait();
  processor_->waitedFor(space.rendered);
  return unpacked(camera, &space.pinned_image.data()->x, field().metadata.centre.cast<float>());
}

std::unique_ptr<PoseSolver> CudaLoadedField::makeSolver(const Observation& observation,
                                                        const std::vector<ImageLevel>& levels,
                                                        int capacity) const {
  processor_->enter();
  requireSolver(observation, levels, capacity);
  return std::make_unique<CudaSolver>(*this, observation, levels, capacity);
}

}  // namespace nerf_pose_refiner
