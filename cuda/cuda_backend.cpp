// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_backend.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "backend/common/batch_room.h"
#include "cuda_trainer.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMinCapability = 75;  // tensor cores that take halves

cudaDeviceProp propertiesOf(int device) {
  cudaDeviceProp properties;
  NPR_CUDA_CHECK(cudaGetDeviceProperties(&properties, device));
  return properties;
}

}  // namespace

CudaCamera plainCamera(const Camera& camera) {
  return {camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height};
}

std::string whyNoCuda(int device) {
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
  return "";
}

std::unique_ptr<Backend> makeCudaBackend(const BackendChoice& choice) {
  const std::string why = whyNoCuda(choice.device);
  if (!why.empty()) throw std::runtime_error("no CUDA engine: " + why);
  NPR_CUDA_CHECK(cudaSetDevice(choice.device));
  return std::make_unique<CudaBackend>(choice);
}

const CudaLevel& CudaObservation::level(int index) const {
  const CudaLevels& all = *lease_.get();
  if (index < 0 || index >= static_cast<int>(all.count)) {
    throw std::invalid_argument("level " + std::to_string(index) + " of an observation with " +
                                std::to_string(all.count));
  }
  return all.levels[static_cast<std::size_t>(index)];
}

CudaBatch::CudaBatch(std::shared_ptr<ScratchPool<CudaBatchMemory>> pool, int device, int capacity)
    : pool_(std::move(pool)), lease_(pool_->borrow()), device_(device) {
  CudaBatchMemory* memory = lease_.get();
  const std::size_t n = static_cast<std::size_t>(capacity);
  memory->items.reserve(n);
  memory->scratch.reserve(n);
  memory->order.reserve(n);
  memory->count.reserve(1);
  memory->samples_per_ray.reserve(1);
  view_ = {memory->items.data(), memory->scratch.data(), memory->order.data(), memory->count.data(),
           capacity};
}

CudaBackend::CudaBackend(const BackendChoice& choice)
    : device_(choice.device),
      levels_(
          std::make_shared<ScratchPool<CudaLevels>>([] { return std::make_unique<CudaLevels>(); })),
      batches_(std::make_shared<ScratchPool<CudaBatchMemory>>(
          [] { return std::make_unique<CudaBatchMemory>(); })) {
  meter_.clear(1, stream_);
  hit_count_.reserve(2);
  pinned_count_.reserve(1);
  pinned_work_.reserve(1);
}

CudaBackend::~CudaBackend() {
  cudaSetDevice(device_);  // a destructor never throws
  cudaStreamSynchronize(stream_);
}

void CudaBackend::enter() const { NPR_CUDA_CHECK(cudaSetDevice(device_)); }

std::string CudaBackend::describe() const {
  const cudaDeviceProp properties = propertiesOf(device_);
  return std::string("CUDA, ") + properties.name + ", " +
         std::to_string(properties.totalGlobalMem >> 20) + " MiB";
}

std::shared_ptr<const LoadedField> CudaBackend::load(std::shared_ptr<const Field> field) {
  enter();
  return std::make_shared<CudaField>(std::move(field), device_, stream_);
}

const CudaField& CudaBackend::own(const LoadedField& field) const {
  const auto* found = dynamic_cast<const CudaField*>(&field);
  if (found == nullptr || found->device() != device_) {
    throw std::invalid_argument("the field is not loaded in this CUDA engine");
  }
  return *found;
}

const CudaObservation& CudaBackend::own(const LoadedObservation& observation) const {
  const auto* found = dynamic_cast<const CudaObservation*>(&observation);
  if (found == nullptr || found->device() != device_) {
    throw std::invalid_argument("the observation is not of this CUDA engine");
  }
  return *found;
}

CudaBatch& CudaBackend::own(HypothesisBatch* batch) const {
  auto* found = dynamic_cast<CudaBatch*>(batch);
  if (found == nullptr || found->device() != device_) {
    throw std::invalid_argument("the batch is not of this CUDA engine");
  }
  return *found;
}

RenderTask CudaBackend::renderTask(const CudaField& field, const CudaCamera& camera, int views,
                                   int rays_per_side) {
  const auto n = static_cast<std::size_t>(views);
  const std::size_t pixels = n * static_cast<std::size_t>(camera.width) * camera.height;
  views_.reserve(n);
  poses_.reserve(n);
  images_.reserve(2 * pixels);
  const std::size_t rays = pixels * static_cast<std::size_t>(rays_per_side * rays_per_side);
  if (rays > std::numeric_limits<unsigned>::max() / 2) {
    throw std::invalid_argument("too many rays to be rendered at once: " + std::to_string(rays));
  }
  hits_.reserve(rays);
  if (rays_per_side > 1) rays_.reserve(2 * rays);
  RenderTask task = {};
  task.camera = camera;
  task.poses = poses_.data();
  task.view_count = views;
  task.rays_per_side = rays_per_side;
  task.step_scale = 1;
  task.min_weight = RenderOptions().min_weight;
  task.use_occupancy = true;
  task.views = views_.data();
  task.hits = {hits_.data(), hit_count_.data()};
  task.images = images_.data();
  task.rays = rays_per_side > 1 ? rays_.data() : images_.data();
  task.costs = field.costs();
  task.work = meter_.data();
  return task;
}

void CudaBackend::copyWork() {
  NPR_CUDA_CHECK(cudaMemcpyAsync(pinned_work_.data(), meter_.data(), sizeof(CudaWork),
                                 cudaMemcpyDeviceToHost, stream_));
}

void CudaBackend::takeWork() {
  const CudaWork& meter = *pinned_work_.data();
  work_.rays = meter.rays;
  work_.samples = meter.samples;
  work_.colour_samples = meter.colour_samples;
  work_.gathers = static_cast<double>(meter.gathers);
  work_.flops = static_cast<double>(meter.flops);
}

Rendering CudaBackend::render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                              const RenderOptions& options, const CancellationToken& stop) {
  enter();
  camera.validate();
  if (!T_O_C.isFinite()) throw std::invalid_argument("render: the pose is not finite");
  stop.check();
  const CudaField& loaded = own(field);
  RenderTask task = renderTask(loaded, plainCamera(camera), 1, 1);
  task.near = options.near;
  task.step_scale = options.step_scale;
  task.min_transmittance = options.min_transmittance;
  task.min_weight = options.min_weight;
  task.use_occupancy = options.use_occupancy;
  const CameraPose<double> pose = plainPose(T_O_C);
  poses_.upload(&pose, 1, stream_);
  renderImages(loaded.view(), task, stream_);

  const std::size_t pixels = static_cast<std::size_t>(camera.width) * camera.height;
  pinned_image_.reserve(2 * pixels);
  NPR_CUDA_CHECK(cudaMemcpyAsync(pinned_image_.data(), images_.data(), 2 * pixels * sizeof(float4),
                                 cudaMemcpyDeviceToHost, stream_));
  copyWork();
  stream_.wait();
  takeWork();
  Rendering rendering;
  rendering.colour = Image(camera.width, camera.height, 3);
  rendering.alpha = Image(camera.width, camera.height, 1);
  rendering.point = Image(camera.width, camera.height, 3);
  const Eigen::Vector3f centre = loaded.field().metadata.centre.cast<float>();
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* pixel = &pinned_image_.data()[2 * i].x;
    rendering.alpha.values[i] = pixel[3];
    for (std::size_t c = 0; c < 3; ++c) {
      rendering.colour.values[3 * i + c] = pixel[c];
      rendering.point.values[3 * i + c] =
          pixel[4 + c] + pixel[3] * centre[static_cast<Eigen::Index>(c)];
    }
  }
  return rendering;
}

std::unique_ptr<FieldTrainer> CudaBackend::trainer(const FieldConfig& config, const Box& box,
                                                   std::vector<TrainingView> views,
                                                   const TrainingPlan& plan) {
  enter();
  return std::make_unique<CudaTrainer>(config, box, std::move(views), plan, device_, &training_);
}

CostCounters CudaBackend::work() const {
  CostCounters all = work_;
  return all += training_;
}

std::unique_ptr<HypothesisBatch> CudaBackend::batch(int capacity) {
  enter();
  if (capacity < 1) {
    throw std::invalid_argument("batch capacity is " + std::to_string(capacity) +
                                ", must be positive");
  }
  auto made = std::make_unique<CudaBatch>(batches_, device_, capacity);
  NPR_CUDA_CHECK(cudaMemsetAsync(made->view().count, 0, sizeof(int), stream_));
  const std::size_t bytes = static_cast<std::size_t>(capacity) * sizeof(CudaHypothesis);
  NPR_CUDA_CHECK(cudaMemsetAsync(made->view().items, 0, bytes, stream_));
  NPR_CUDA_CHECK(cudaMemsetAsync(made->view().scratch, 0, bytes, stream_));
  const double unknown = -1;
  NPR_CUDA_CHECK(cudaMemcpyAsync(made->samplesPerRay(), &unknown, sizeof unknown,
                                 cudaMemcpyHostToDevice, stream_));
  return made;
}

void CudaBackend::sample(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
                         const SamplingPlan& plan) {
  enter();
  CudaBatch& hypotheses = own(batch);
  requireRoom(priors_T_O_C.size(), plan, hypotheses.view().capacity);
  hypotheses.searches = static_cast<int>(priors_T_O_C.size());
  hypotheses.prior_T_O_C = priors_T_O_C.front();
  hypotheses.sampling = plan;
  hypotheses.bound = hypotheses.searches * plan.count;
  std::vector<CameraPose<double>> priors;
  for (const Pose& prior : priors_T_O_C) priors.push_back(plainPose(prior));
  priors_.upload(priors, stream_);
  const PoseSpread spread = {plainVector(plan.rotation_rad), plainVector(plan.translation),
                             plan.rotate_about_object, plainVector(plan.object_centre)};
  sampleHypotheses(hypotheses.view(), priors_.data(), hypotheses.searches, spread, plan.count,
                   plan.seed, stream_);
}

void CudaBackend::resample(HypothesisBatch* batch, const ResamplingPlan& plan) {
  enter();
  CudaBatch& hypotheses = own(batch);
  requireRoom(plan, hypotheses.view().capacity, hypotheses.searches);
  CudaResamplingPlan plain;
  plain.keep = plan.keep;
  plain.offspring = plan.offspring;
  plain.redraw = plan.redraw;
  plain.merge_rotation_rad = plan.merge_rotation_rad;
  plain.merge_translation = plan.merge_translation;
  plain.jitter = {plainVector(Eigen::Vector3d::Constant(plan.rotation_jitter_rad)),
                  plainVector(Eigen::Vector3d::Constant(plan.translation_jitter)),
                  plan.rotate_about_object, plainVector(plan.object_centre)};
  plain.seed = plan.seed;
  resampleHypotheses(hypotheses.view(), plain, stream_);
  hypotheses.bound = std::min(hypotheses.view().capacity,
                              hypotheses.searches * std::max(plan.keep, plan.offspring));
}

HypothesisTable CudaBackend::read(const HypothesisBatch& batch) {
  enter();
  const auto* hypotheses = dynamic_cast<const CudaBatch*>(&batch);
  if (hypotheses == nullptr || hypotheses->device() != device_) {
    throw std::invalid_argument("the batch is not of this CUDA engine");
  }
  const auto bound = static_cast<std::size_t>(hypotheses->bound);
  pinned_hypotheses_.reserve(bound);
  NPR_CUDA_CHECK(cudaMemcpyAsync(pinned_count_.data(), hypotheses->view().count, sizeof(int),
                                 cudaMemcpyDeviceToHost, stream_));
  NPR_CUDA_CHECK(cudaMemcpyAsync(pinned_hypotheses_.data(), hypotheses->view().items,
                                 bound * sizeof(CudaHypothesis), cudaMemcpyDeviceToHost, stream_));
  copyWork();
  stream_.wait();
  takeWork();
  HypothesisTable table(static_cast<std::size_t>(*pinned_count_.data()));
  for (std::size_t k = 0; k < table.size(); ++k) {
    const CudaHypothesis& from = pinned_hypotheses_.data()[k];
    Hypothesis& to = table[k];
    to.T_O_C = poseOf(from.pose);
    to.state = from.state;
    to.search = from.search;
    to.loss = from.loss;
    to.visible_fraction = from.visible_fraction;
    to.score = from.score;
    to.iterations = from.iterations;
    to.residual_variance = from.residual_variance;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j) {
        const int entry = i * (i + 1) / 2 + j;
        to.information(i, j) = to.information(j, i) = from.information[entry];
        to.gradient_scatter(i, j) = to.gradient_scatter(j, i) = from.gradient_scatter[entry];
      }
    }
  }
  std::stable_sort(table.begin(), table.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return isBetter(a.state, a.loss, b.state, b.loss);
  });
  return table;
}

}  // namespace nerf_pose_refiner
