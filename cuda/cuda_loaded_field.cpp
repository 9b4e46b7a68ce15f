// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_loaded_field.h"

#include <utility>

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
  return std::move(renderAll(view.camera, {view.T_O_C}, options, cancellation).front());
}

std::vector<Rendering> CudaLoadedField::renderAll(const Camera& camera,
                                                  const std::vector<Pose>& poses_T_O_C,
                                                  const RenderOptions& options,
                                                  const CancellationToken& cancellation) const {
  processor_->enter();
  std::vector<CameraPose<double>> poses;
  for (const Pose& T_O_C : poses_T_O_C) {
    requireView({camera, T_O_C});
    poses.push_back(plainPose(T_O_C));
  }
  cancellation.check();
  if (poses.empty()) return {};
  CudaWorkspace& space = processor_->space();
  const auto views = static_cast<int>(poses.size());
  RenderTask task = processor_->renderTask(*memory_, plainCamera(camera), views, 1);
  task.near = options.near;
  task.step_scale = options.step_scale;
  task.min_transmittance = options.min_transmittance;
  task.min_weight = options.min_weight;
  task.use_occupancy = options.use_occupancy;
  space.poses.upload(poses, processor_->stream());
  renderImages(memory_->view(), task, processor_->stream());

  const std::size_t pixels = static_cast<std::size_t>(camera.width) * camera.height;
  const std::size_t floats = 2 * pixels * poses.size();  // of four
  space.pinned_image.reserve(floats);
  NPR_CUDA_CHECK(cudaMemcpyAsync(space.pinned_image.data(), space.images.data(),
                                 floats * sizeof(float4), cudaMemcpyDeviceToHost,
                                 processor_->stream()));
  processor_->mark(&space.rendered);
  processor_->wait();
  processor_->waitedFor(space.rendered);
  const auto centre = field().metadata.centre.cast<float>();
  std::vector<Rendering> renderings;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    renderings.push_back(
        unpacked(camera, &(space.pinned_image.data() + 2 * pixels * i)->x, centre));
  }
  return renderings;
}

std::unique_ptr<PoseSolver> CudaLoadedField::makeSolver(const Observation& observation,
                                                        const std::vector<ImageLevel>& levels,
                                                        int capacity) const {
  processor_->enter();
  requireSolver(observation, levels, capacity);
  return std::make_unique<CudaSolver>(*this, observation, levels, capacity);
}

}  // namespace nerf_pose_refiner
