// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_trainer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "backend/common/training_setup.h"
#include "concurrency/parallel.h"
#include "field/occupied_volume.h"
#include "math/half.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSlots = kRayUnit;
constexpr int kTrainingRaysPerGroup = 64;
constexpr int kMaxRaysPerStep = 1 << 17;
constexpr int kEmptyPointsPerSlot = kEmptyPoints / kSlots;

}  // namespace

CpuTrainer::Slot::Slot(const CpuNetworks& networks) {
  for (const auto* network : {&networks.density, &networks.colour}) {
    for (const CpuLayer& layer : *network) weight_gradients.emplace_back(layer.weights.size());
  }
}

CpuTrainer::CpuTrainer(const FieldConfig& config, const Box& box, std::vector<TrainingView> views,
                       const TrainingPlan& plan, std::shared_ptr<CpuProcessor> processor)
    : config_((config.validate(), config)),
      box_(box),
      cube_(box),
      views_(viewsThatShow(box, std::move(views))),
      plan_(plan),
      processor_(std::move(processor)),
      networks_(config),
      grid_(static_cast<std::size_t>(networks_.levels.back().offset +
                                     networks_.levels.back().entries) *
            config.features),
      half_grid_(grid_.values.size()),
      occupancy_(config, plan.region, cube_.box_min, cube_.box_max, plan.seed),
      batches_([this] { return std::make_unique<RayBatch>(networks_, config_.sh_degree); }),
      rays_per_step_(firstRays(plan.samples_per_step)) {
  for (const auto* network : {&networks_.density, &networks_.colour}) {
    for (const CpuLayer& layer : *network) layers_.emplace_back(layer.weights.size());
  }
  for (int s = 0; s < kSlots; ++s) slots_.emplace_back(networks_);
  for (const TrainingView& view : views_)
    windows_.push_back(windowOf(view.camera, view.T_O_C, box_));
  initialiseParameters();
  view_ = {processor_->kernels, &networks_,
           KernelGrid{networks_.levels.data(), half_grid_.data(),
                      static_cast<int>(networks_.levels.size()), networks_.features}};
}

void CpuTrainer::initialiseParameters() {
  for (std::size_t i = 0; i < grid_.values.size(); ++i) {
    grid_.values[i] = initialFeature(plan_.seed, i);
    half_grid_[i] = floatToHalf(grid_.values[i]);
  }
  const InitialWeights weights = initialWeights(config_, plan_.seed);
  networks_.assign(weights.density, weights.colour);
  std::size_t index = 0;
  for (const auto* network : {&networks_.density, &networks_.colour}) {
    for (const CpuLayer& layer : *network) layers_[index++].values = layer.weights;
  }
}

float CpuTrainer::learningRate(double progress) const {
  return static_cast<float>(
      plan_.learning_rate *
      learningRateFraction(steps_, progress, plan_.final_learning_rate_factor));
}

CpuTrainer::TrainingRay CpuTrainer::drawRay(std::uint64_t index) const {
  const std::uint64_t seed = stepSeed(plan_.seed, steps_);
  const int v = drawView(seed, index, static_cast<int>(views_.size()));
  const TrainingView& view = views_[v];
  const DrawnPixel at = drawPixel(seed, index, windows_[v]);
  const Eigen::Vector3d direction = (view.T_O_C.R * view.camera.direction(at.x, at.y)).normalized();
  TrainingRay ray;
  const Eigen::Vector3f origin_O = view.T_O_C.t.cast<float>();
  cube_.toCube(origin_O.data(), ray.origin);
  for (int a = 0; a < 3; ++a) ray.direction[a] = static_cast<float>(direction[a]);
  ray.target = drawTarget(seed, index, view.rgba->pixel(at.x, at.y), plan_.random_background);
  return ray;
}

bool CpuTrainer::trainGroup(RayBatch* batch, Slot* slot, std::uint64_t first_ray, int rays) {
  TrainingRay ray[kTrainingRaysPerGroup];
  RayBatch::Sums sums[kTrainingRaysPerGroup];
  RayLossGradient gradients[kTrainingRaysPerGroup];
  batch->rays().resize(rays);
  for (int r = 0; r < rays; ++r) {
    const std::uint64_t index = first_ray + static_cast<std::uint64_t>(r);
    ray[r] = drawRay(index);
    for (int a = 0; a < 3; ++a) {
      batch->rays().origin[a][r] = ray[r].origin[a];
      batch->rays().direction[a][r] = ray[r].direction[a];
    }
    batch->rays().jitter[r] = drawJitter(stepSeed(plan_.seed, steps_), index);
  }
  batch->begin(view_, cube_.space(config_.step, config_.cone_angle, &occupancy_.mask()), rays);
  const bool complete = batch->forward(view_, kTrainingMinTransmittance, 0, sums);  // all can learn
  countForward(batch->densityEvaluations(), batch->colourEvaluations(), &slot->work);
  if (!complete) return false;
  slot->work.rays += static_cast<std::uint64_t>(rays);

  const float scale = 1.0f / (3.0f * static_cast<float>(rays_per_step_));
  for (int r = 0; r < rays; ++r) {
    const TrainingLoss loss = trainingLoss(sums[r].rgb, sums[r].alpha, ray[r].target);
    slot->loss += scale * loss.value;
    for (int c = 0; c < 3; ++c) gradients[r].rgb[c] = scale * loss.rgb[c];
    gradients[r].alpha = scale * loss.alpha;
  }
  batch->backward(view_, gradients, &slot->weight_gradients);
  slot->samples += batch->densityEvaluations();
  countBackward(batch->columns().size(), &slot->work);
  keepEncodingGradient(&batch->pool(), static_cast<int>(batch->columns().size()), slot);
  return true;
}

void CpuTrainer::countForward(std::uint64_t densities, std::uint64_t colours,
                              CostCounters* work) const {
  const double n = static_cast<double>(densities), m = static_cast<double>(colours);
  work->samples += densities;
  work->colour_samples += colours;
  work->gathers += networks_.gathersPerSample() * n;
  work->flops += networks_.densityFlops() * n + networks_.colourFlops() * m;
}

/// A layer's way back costs as much as its way there for its inputs, and again for its weights;
/// interpolation only once.
void CpuTrainer::countBackward(std::uint64_t columns, CostCounters* work) const {
  const double n = static_cast<double>(columns);
  work->gathers += networks_.gathersPerSample() * n;
  work->flops += n * (2 * (networks_.densityFlops() + networks_.colourFlops()) -
                      networks_.interpolationFlops());
}

void CpuTrainer::keepEncodingGradient(SamplePool* pool, int columns, Slot* slot) {
  const int rows = 3 + networks_.encoding_rows;
  const float* const position[3] = {pool->position(0), pool->position(1), pool->position(2)};
  forEachTile(0, columns, [&](int first, int count) {
    if (slot->used_blocks == slot->blocks.size()) slot->blocks.emplace_back();
    Block& block = slot->blocks[slot->used_blocks++];
    block.columns = count;
    block.rows.resize(static_cast<std::size_t>(rows) * count);
    const float* gradient = pool->encodingGradient().at(first);
    for (int r = 0; r < rows; ++r) {
      const float* from = r < 3 ? position[r] + first : gradient + (r - 3) * TiledRows::kTileStride;
      std::copy(from, from + count, block.rows.data() + static_cast<std::size_t>(r) * count);
    }
  });
}

void CpuTrainer::pushEmptySpaceDown(SamplePool* pool, Slot* slot, int slot_index) {
  const float no_harmonics[kMaxHarmonics] = {};
  for (int s = 0; s < kEmptyPointsPerSlot; ++s) {
    float p[3];
    drawEmptyPoint(plan_.seed, steps_,
                   static_cast<std::uint64_t>(slot_index * kEmptyPointsPerSlot + s), cube_, p);
    for (int a = 0; a < 3; ++a) pool->position(a)[s] = p[a];
  }
  pool->evaluateDensity(view_, 0, kEmptyPointsPerSlot);
  for (int s = 0; s < kEmptyPointsPerSlot; ++s) {
    const float p[3] = {pool->position(0)[s], pool->position(1)[s], pool->position(2)[s]};
    const float density = pool->density()[s];
    const bool push = density * config_.step > kClearThickness && !occupancy_.occupied(p);
    // The pool multiplies by the density, as the exponential's derivative.
    pool->densityGradient()[s] = push ? kEmptyPush / (kEmptyPoints * density) : 0.0f;
    for (int c = 0; c < 3; ++c) pool->rgbGradient(c)[s] = 0;
    pool->setColourInput(s, no_harmonics, s);
  }
  pool->evaluateColour(view_, kEmptyPointsPerSlot);
  pool->backward(view_, kEmptyPointsPerSlot, &slot->weight_gradients);
  countForward(kEmptyPointsPerSlot, kEmptyPointsPerSlot, &slot->work);
  countBackward(kEmptyPointsPerSlot, &slot->work);
  keepEncodingGradient(pool, kEmptyPointsPerSlot, slot);
}

void CpuTrainer::runSlot(int index, int first_ray, int rays) {
  Slot& slot = slots_[index];
  ScratchPool<RayBatch>::Lease batch = batches_.borrow();
  slot.used_blocks = 0;
  slot.loss = 0;
  slot.samples = 0;
  slot.work = CostCounters();
  for (std::vector<float>& gradient : slot.weight_gradients) {
    std::fill(gradient.begin(), gradient.end(), 0.0f);
  }
  int done = 0, group = kTrainingRaysPerGroup;
  while (done < rays) {
    const int size = std::min(group, rays - done);
    if (trainGroup(batch.get(), &slot, static_cast<std::uint64_t>(first_ray + done), size)) {
      done += size;
      group = kTrainingRaysPerGroup;
    } else {
      group = size / 2;  // too many samples to keep: again with fewer rays
    }
  }
  if (steps_ >= kOccupancyStart || plan_.region.resolution != 0)
    pushEmptySpaceDown(&batch.get()->pool(), &slot, index);
}

void CpuTrainer::updateGridLevel(int level, float learning_rate) {
  const KernelGridLevel& l = networks_.levels[level];
  const std::size_t first = static_cast<std::size_t>(l.offset) * config_.features;
  for (const Slot& slot : slots_) {
    for (std::size_t b = 0; b < slot.used_blocks; ++b) {
      const Block& block = slot.blocks[b];
      const auto row = [&block](int r) {
        return block.rows.data() + static_cast<std::size_t>(r) * block.columns;
      };
      const float* const position[3] = {row(0), row(1), row(2)};
      processor_->kernels->encodeGridGradient(
          view_.grid, level, position,
          {row(3 + level * config_.features), config_.features, block.columns, block.columns},
          grid_.gradient.data() + first);
    }
  }
  processor_->kernels->adam(
      {grid_.values.data() + first, grid_.first_moment.data() + first,
       grid_.second_moment.data() + first, grid_.gradient.data() + first, half_grid_.data() + first,
       static_cast<std::int64_t>(l.entries) * config_.features},
      {learning_rate, kTrainingBeta1, kTrainingBeta2, kTrainingEpsilon});
}

void CpuTrainer::updateNetworks(float learning_rate) {
  std::size_t index = 0;
  for (auto* network : {&networks_.density, &networks_.colour}) {
    for (CpuLayer& layer : *network) {
      Parameters& parameters = layers_[index];
      for (const Slot& slot : slots_) {
        const std::vector<float>& gradient = slot.weight_gradients[index];
        for (std::size_t i = 0; i < gradient.size(); ++i) parameters.gradient[i] += gradient[i];
      }
      processor_->kernels->adam({parameters.values.data(), parameters.first_moment.data(),
                                 parameters.second_moment.data(), parameters.gradient.data(),
                                 nullptr, static_cast<std::int64_t>(parameters.values.size())},
                                {learning_rate, kTrainingBeta1, kTrainingBeta2, kTrainingEpsilon});
      layer.setWeights(parameters.values);
      ++index;
    }
  }
}

double CpuTrainer::step(double progress) {
  if (steps_ >= kOccupancyStart && steps_ % kOccupancyInterval == 0) {
    occupancy_.update(view_, steps_, processor_->threads, &processor_->costs);
  }
  const int rays_per_slot = rays_per_step_ / kSlots;
  parallelFor(processor_->threads, kSlots,
              [&](int s) { runSlot(s, s * rays_per_slot, rays_per_slot); });
  const float learning_rate = learningRate(progress);
  parallelFor(processor_->threads, static_cast<int>(networks_.levels.size()),
              [&](int level) { updateGridLevel(level, learning_rate); });
  updateNetworks(learning_rate);
  double loss = 0;
  std::uint64_t samples = 0;
  CostCounters work;
  for (const Slot& slot : slots_) {
    loss += slot.loss;
    samples += slot.samples;
    work += slot.work;
  }
  processor_->costs += work;
  ++steps_;
  rays_per_step_ = nextRays(rays_per_step_, static_cast<double>(samples), plan_.samples_per_step,
                            kMaxRaysPerStep);
  return loss;
}

Field CpuTrainer::snapshot(const CancellationToken& cancellation) {
  Field field;
  field.config = config_;
  field.box = box_;
  field.grid = half_grid_;
  field.density_weights.resize(densityWeightCount(config_));
  field.colour_weights.resize(colourWeightCount(config_));
  gatherWeights(networks_.density, field.density_weights.data());
  gatherWeights(networks_.colour, field.colour_weights.data());
  std::vector<float> cell_opacity;
  field.occupancy =
      occupancy_.dense(view_, processor_->threads, cancellation, &cell_opacity, &processor_->costs);
  const OccupiedExtent extent = measureOccupiedVolume(field, cell_opacity);
  field.metadata.centre = extent.centre;
  field.metadata.diameter = extent.diameter;
  field.metadata.seed = plan_.seed;
  field.metadata.training_steps = static_cast<std::uint64_t>(steps_);
  return field;
}

}  // namespace nerf_pose_refiner
