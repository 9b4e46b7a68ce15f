// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_trainer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "backend/common/pixel_window.h"
#include "backend/common/training_setup.h"
#include "field/occupied_volume.h"
#include "math/half.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kStepsPerWait = 16;
constexpr int kMaxRays = 1 << 17;
constexpr unsigned kRoomPerSample = 4;  // samples that are evaluated for one that is learned from
constexpr float kFirstLossScale = 128;
constexpr int kCellsPerRound = 1 << 18;  // cancellation is checked in between

TrainingCamera plainView(const TrainingView& view, const Box& box, const CudaFieldView& field,
                         std::size_t first_pixel) {
  TrainingCamera camera = {};
  camera.fx = static_cast<float>(view.camera.fx);
  camera.fy = static_cast<float>(view.camera.fy);
  camera.cx = static_cast<float>(view.camera.cx);
  camera.cy = static_cast<float>(view.camera.cy);
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) camera.R[3 * a + b] = static_cast<float>(view.T_O_C.R(a, b));
    camera.origin[a] = (static_cast<float>(view.T_O_C.t[a]) - field.origin[a]) / field.side;
  }
  camera.window = windowOf(view.camera, view.T_O_C, box);
  camera.width = view.camera.width;
  camera.first = first_pixel;
  return camera;
}

}  // namespace

LearnedNumbers CudaTrainer::Parameters::start(const std::vector<float>& from, cudaStream_t stream) {
  values.upload(from, stream);
  for (DeviceBuffer<float>* zeros : {&gradient, &first_moment, &second_moment}) {
    zeros->clear(from.size(), stream);
  }
  const auto quads = [](DeviceBuffer<float>* numbers) {
    return reinterpret_cast<float4*>(numbers->data());
  };
  LearnedNumbers numbers = {};
  numbers.values = quads(&values);
  numbers.gradient = quads(&gradient);
  numbers.first_moment = quads(&first_moment);
  numbers.second_moment = quads(&second_moment);
  numbers.quads = static_cast<unsigned>(from.size() / 4);
  return numbers;
}

CudaTrainer::CudaTrainer(const FieldConfig& config, const Box& box, std::vector<TrainingView> views,
                         const TrainingPlan& plan, std::shared_ptr<CudaProcessor> processor)
    : config_((config.validate(), config)),
      box_(box),
      plan_(plan),
      processor_(std::move(processor)),
      view_(cudaFieldView(config, box)),
      costs_(cudaCosts(config)),
      cells_(config, plan.region, view_.box_min, view_.box_max, plan.seed) {
  uploadPhotos(viewsThatShow(box, std::move(views)));
  startParameters();
  startOccupancy();

  task_.seed = plan.seed;
  task_.random_background = plan.random_background;
  task_.samples_per_step = plan.samples_per_step;
  task_.max_rays = std::max(kMaxRays, dealtRays(plan.samples_per_step));
  task_.room = kEmptyPoints + kRoomPerSample * static_cast<unsigned>(plan.samples_per_step);
  const std::size_t room = task_.room;
  rays_.reserve(static_cast<std::size_t>(task_.max_rays));
  values_.reserve(room);
  learned_.reserve(room);
  gradients_.reserve(room);
  task_.rays = rays_.data();
  // Places that a ray left unused are evaluated all the same.
  points_.clear(room, stream_);
  point_rays_.reserve(room);
  NPR_CUDA_CHECK(cudaMemsetAsync(point_rays_.data(), 0xff, room * sizeof(unsigned), stream_));
  task_.points = points_.data();
  task_.point_rays = point_rays_.data();
  task_.values = values_.data();
  task_.learned = learned_.data();
  task_.gradients = gradients_.data();

  TrainingClock clock = {};
  clock.rays = firstRays(plan.samples_per_step);
  clock.marched = kEmptyPoints;
  clock.loss_scale = kFirstLossScale;
  clock_.upload(&clock, 1, stream_);
  task_.clock = clock_.data();
  pinned_clock_.reserve(1);
  stream_.wait();  // what was copied may end here
}

CudaTrainer::~CudaTrainer() {
  cudaSetDevice(processor_->device());  // a destructor never throws
  cudaStreamSynchronize(stream_);
}

void CudaTrainer::uploadPhotos(const std::vector<TrainingView>& views) {
  std::vector<TrainingCamera> cameras;
  std::size_t pixels = 0;
  for (const TrainingView& view : views) {
    cameras.push_back(plainView(view, box_, view_, pixels));
    pixels += view.rgba->pixels();
  }
  pixels_.reserve(pixels);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::vector<std::uint8_t>& rgba = views[i].rgba->values;
    NPR_CUDA_CHECK(cudaMemcpyAsync(pixels_.data() + cameras[i].first, rgba.data(), rgba.size(),
                                   cudaMemcpyHostToDevice, stream_));
  }
  cameras_.upload(cameras, stream_);
  stream_.wait();  // the photos are the caller's
  task_.cameras = cameras_.data();
  task_.camera_count = static_cast<int>(cameras.size());
  task_.pixels = pixels_.data();
}

void CudaTrainer::startParameters() {
  const GridLevel last = gridLevels(config_).back();
  const std::size_t n =
      (std::size_t{last.offset} + last.entries) * static_cast<std::size_t>(config_.features);
  std::vector<float> features(n);
  std::vector<std::uint16_t> halves(n);
  for (std::size_t i = 0; i < n; ++i) {
    features[i] = initialFeature(plan_.seed, i);
    halves[i] = floatToHalf(features[i]);
  }
  task_.table = table_.start(features, stream_);
  halves_.upload(halves, stream_);
  task_.table.halves = reinterpret_cast<uint2*>(halves_.data());

  const InitialWeights weights = initialWeights(config_, plan_.seed);
  const std::vector<float> padded = padWeights(config_, weights.density, weights.colour);
  const std::vector<WeightPair> tiles = packWeights(config_, weights.density, weights.colour);
  task_.layers.shape = view_.shape;
  task_.weights = weights_.start(padded, stream_);
  tiles_.upload(tiles, stream_);
  task_.tiles = tiles_.data();
  view_.grid = halves_.data();
  view_.forward = tiles_.data();
  view_.transposed = tiles_.data() + static_cast<std::size_t>(view_.shape.forwardTiles()) * 32;
  stream_.wait();  // what was copied ends here
}

void CudaTrainer::startOccupancy() {
  const OccupancyMask& mask = cells_.mask();
  const std::vector<std::uint32_t>& region = cells_.region();
  const std::vector<std::uint8_t>& bytes = mask.fine().bits;
  const auto coarse = static_cast<std::size_t>(mask.coarseResolution());
  const std::size_t blocks = coarse * coarse * coarse;
  bits_.reserve(bytes.size() / sizeof(std::uint32_t));
  NPR_CUDA_CHECK(
      cudaMemcpyAsync(bits_.data(), bytes.data(), bytes.size(), cudaMemcpyHostToDevice, stream_));
  distance_.upload(mask.distances(), blocks, stream_);
  distance_2_.reserve(blocks);
  region_.upload(region, stream_);
  density_.clear(region.size(), stream_);
  seen_.reserve(region.size() / kOccupancyFraction + 1);
  highest_.reserve(kCellsPerRound);
  mean_.reserve(kCellsPerRound);
  occupancy_.seed = plan_.seed;
  occupancy_.cells = config_.occupancy_resolution;
  occupancy_.region = region_.data();
  occupancy_.region_count = static_cast<int>(region.size());
  occupancy_.density = density_.data();
  occupancy_.seen = seen_.data();
  occupancy_.bits = bits_.data();
  occupancy_.distance = distance_.data();
  occupancy_.distance_2 = distance_2_.data();
  occupancy_.coarse = mask.coarseResolution();
  view_.occupancy = mask.view();
  view_.occupancy.bits = reinterpret_cast<const std::uint8_t*>(bits_.data());
  view_.occupancy.distance = distance_.data();
}

double CudaTrainer::step(double progress) {
  processor_->enter();
  if (steps_ >= kOccupancyStart && steps_ % kOccupancyInterval == 0) {
    occupancy_.step = steps_;
    updateOccupancy(view_, occupancy_, stream_);
    addWork(0, static_cast<double>(occupancy_.region_count) / kOccupancyFraction, 0);
  }
  task_.step = steps_;
  task_.learning_rate =
      static_cast<float>(plan_.learning_rate *
                         learningRateFraction(steps_, progress, plan_.final_learning_rate_factor));
  task_.push_empty = steps_ >= kOccupancyStart || plan_.region.resolution != 0;
  marchTrainingRays(view_, task_, stream_);
  evaluateTrainingSamples(view_, task_, stream_);
  compositeTrainingRays(view_, task_, stream_);
  learnFromSamples(view_, task_, stream_);
  updateParameters(task_, stream_);
  finishTrainingStep(task_, stream_);
  ++steps_;
  if (steps_ == 1 || steps_ % kStepsPerWait == 0) takeSums();
  return loss_;
}

void CudaTrainer::takeSums() {
  TrainingClock* clock = pinned_clock_.data();
  NPR_CUDA_CHECK(
      cudaMemcpyAsync(clock, clock_.data(), sizeof *clock, cudaMemcpyDeviceToHost, stream_));
  constexpr std::size_t kFirst = offsetof(TrainingClock, mean_losses);
  NPR_CUDA_CHECK(cudaMemsetAsync(reinterpret_cast<char*>(clock_.data()) + kFirst, 0,
                                 sizeof *clock - kFirst, stream_));
  stream_.wait();
  if (clock->steps == 0) return;
  loss_ = clock->mean_losses / clock->steps;
  addWork(static_cast<double>(clock->all_rays), static_cast<double>(clock->all_marched),
          static_cast<double>(clock->all_learned));
}

/// A way back costs as much as the way there for what goes in, and again for the weights; samples
/// that go back are evaluated again.
void CudaTrainer::addWork(double rays, double samples, double learned) {
  const double evaluations = samples + learned;
  const bool coloured = rays > 0;
  const double flops = costs_.flops_per_sample + (coloured ? costs_.flops_per_colour : 0.0);
  CostCounters* spent = processor_->trainingCosts();
  spent->rays += static_cast<std::uint64_t>(rays);
  spent->samples += static_cast<std::uint64_t>(evaluations);
  spent->colour_samples += static_cast<std::uint64_t>(coloured ? evaluations : 0);
  spent->gathers += costs_.gathers_per_sample * (evaluations + learned);
  spent->flops += flops * (evaluations + 2 * learned);
}

OccupancyGrid CudaTrainer::freezeOccupancy(const CancellationToken& cancellation,
                                           std::vector<float>* cell_opacity) {
  const std::vector<std::uint32_t>& cells = cells_.region();
  const int n = config_.occupancy_resolution;
  const float cell_size = 1.0f / static_cast<float>(n);
  cell_opacity->assign(static_cast<std::size_t>(n) * n * n, 0.0f);
  OccupancyGrid grid{n, std::vector<std::uint8_t>(cell_opacity->size() / 8, 0)};
  std::vector<float> highest(kCellsPerRound), mean(kCellsPerRound);
  for (std::size_t first = 0; first < cells.size(); first += kCellsPerRound) {
    cancellation.check();
    const std::size_t count = std::min<std::size_t>(kCellsPerRound, cells.size() - first);
    CellDensities densities;
    densities.cells = region_.data() + first;
    densities.count = static_cast<int>(count);
    densities.resolution = n;
    densities.highest = highest_.data();
    densities.mean = mean_.data();
    evaluateCells(view_, densities, stream_);
    const std::size_t bytes = count * sizeof(float);
    NPR_CUDA_CHECK(
        cudaMemcpyAsync(highest.data(), highest_.data(), bytes, cudaMemcpyDeviceToHost, stream_));
    NPR_CUDA_CHECK(
        cudaMemcpyAsync(mean.data(), mean_.data(), bytes, cudaMemcpyDeviceToHost, stream_));
    stream_.wait();
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t cell = cells[first + i];
      (*cell_opacity)[cell] = 1.0f - std::exp(-mean[i] * cell_size);
      if (highest[i] * config_.step > kFrozenThickness) {
        grid.bits[cell >> 3] |= static_cast<std::uint8_t>(1u << (cell & 7));
      }
    }
  }
  constexpr int kPoints = kFrozenPointsPerAxis * kFrozenPointsPerAxis * kFrozenPointsPerAxis;
  addWork(0, static_cast<double>(cells.size()) * kPoints, 0);
  return dilated(grid);
}

Field CudaTrainer::snapshot(const CancellationToken& cancellation) {
  processor_->enter();
  cancellation.check();
  takeSums();
  Field field;
  field.config = config_;
  field.box = box_;
  field.grid.resize(std::size_t{task_.table.quads} * 4);
  std::vector<float> padded(std::size_t{task_.weights.quads} * 4);
  NPR_CUDA_CHECK(cudaMemcpyAsync(field.grid.data(), halves_.data(),
                                 field.grid.size() * sizeof field.grid[0], cudaMemcpyDeviceToHost,
                                 stream_));
  NPR_CUDA_CHECK(cudaMemcpyAsync(padded.data(), weights_.values.data(),
                                 padded.size() * sizeof padded[0], cudaMemcpyDeviceToHost,
                                 stream_));
  stream_.wait();
  compactWeights(config_, padded, &field.density_weights, &field.colour_weights);
  std::vector<float> cell_opacity;
  field.occupancy = freezeOccupancy(cancellation, &cell_opacity);
  const OccupiedExtent extent = measureOccupiedVolume(field, cell_opacity);
  field.metadata.centre = extent.centre;
  field.metadata.diameter = extent.diameter;
  field.metadata.seed = plan_.seed;
  field.metadata.training_steps = static_cast<std::uint64_t>(steps_);
  return field;
}

}  // namespace nerf_pose_refiner
