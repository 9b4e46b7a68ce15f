// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_field.h"

#include <algorithm>

#include "math/spherical_harmonics.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kRaysPerGroup = 256;         // rendered together by a thread
constexpr int kGradientRaysPerGroup = 32;  // whose activations are kept together

RayResult resultOf(const Ray& ray, const RayBatch::Sums& sums, float cube_side) {
  RayResult result;
  for (int c = 0; c < 3; ++c) {
    result.rgb[c] = sums.rgb[c];
    result.point[c] = sums.alpha * ray.origin[c] + sums.depth * cube_side * ray.direction[c];
  }
  result.alpha = sums.alpha;
  return result;
}

}  // namespace

CubeFrame::CubeFrame(const Box& box) {
  const Eigen::Vector3d size = box.max - box.min;
  const double cube_side = size.maxCoeff();
  const Eigen::Vector3d corner =
      0.5 * (box.min + box.max) - Eigen::Vector3d::Constant(0.5 * cube_side);
  side = static_cast<float>(cube_side);
  for (int a = 0; a < 3; ++a) {
    origin[a] = static_cast<float>(corner[a]);
    box_min[a] = static_cast<float>((box.min[a] - corner[a]) / cube_side);
    box_max[a] = static_cast<float>((box.max[a] - corner[a]) / cube_side);
  }
}

CpuField::CpuField(std::shared_ptr<const Field> field, std::shared_ptr<CpuProcessor> processor)
    : RayRenderer(std::move(processor)),
      field_((field->validate(), std::move(field))),
      networks_(field_->config),
      mask_(field_->occupancy),
      cube_(field_->box),
      batches_([this] { return std::make_unique<RayBatch>(networks_, field_->config.sh_degree); }) {
  networks_.assign(field_->density_weights, field_->colour_weights);
  view_ = {this->processor().kernels, &networks_,
           KernelGrid{networks_.levels.data(), field_->grid.data(),
                      static_cast<int>(networks_.levels.size()), networks_.features}};
}

MarchSpace CubeFrame::space(float step, float cone_angle, const OccupancyMask* mask) const {
  MarchSpace space;
  std::copy(box_min, box_min + 3, space.box_min);
  std::copy(box_max, box_max + 3, space.box_max);
  space.near = 0;
  space.step = step;
  space.cone_angle = cone_angle;
  space.mask = mask;
  return space;
}

void CpuField::enter(RaySpan rays, const RenderOptions& options, RayBatch* batch) const {
  const int n = rays.size;
  RayBatch::Rays& given = batch->rays();
  given.resize(n);
  for (int r = 0; r < n; ++r) {
    float origin[3];
    cube_.toCube(rays[r].origin, origin);
    for (int a = 0; a < 3; ++a) {
      given.origin[a][r] = origin[a];
      given.direction[a][r] = rays[r].direction[a];
    }
    given.jitter[r] = 0;
  }
  const FieldConfig& config = field_->config;
  MarchSpace space =
      cube_.space(config.step * options.step_scale, config.cone_angle * options.step_scale,
                  options.use_occupancy ? &mask_ : nullptr);
  space.near = options.near / cube_.side;
  batch->begin(view_, space, n);
}

CostCounters CpuField::renderRays(RaySpan rays, const RenderOptions& options,
                                  RayResult* results) const {
  CostCounters cost;
  ScratchPool<RayBatch>::Lease lease = batches_.borrow();
  RayBatch* batch = lease.get();
  RayBatch::Sums sums[kRaysPerGroup];
  for (int first = 0; first < rays.size; first += kRaysPerGroup) {
    const int size = std::min(kRaysPerGroup, rays.size - first);
    std::fill(sums, sums + size, RayBatch::Sums{});
    enter(rays.part(first, size), options, batch);
    while (!batch->finished()) {
      batch->advance(view_, options.min_transmittance);
      batch->addColours(view_, options.min_weight, sums);
    }
    for (int r = 0; r < size; ++r) {
      results[first + r] = resultOf(rays[first + r], sums[r], cube_.side);
    }
    addWork(*batch, size, &cost);
  }
  return cost;
}

CostCounters CpuField::rayGradients(RaySpan rays, const RenderOptions& options,
                                    bool direction_gradient, const RayLoss& loss,
                                    RayGradient* gradients) const {
  CostCounters cost;
  ScratchPool<RayBatch>::Lease lease = batches_.borrow();
  RayBatch* batch = lease.get();
  RayBatch::Sums sums[kGradientRaysPerGroup];
  RayLossGradient loss_gradients[kGradientRaysPerGroup];
  int first = 0, group = kGradientRaysPerGroup;
  while (first < rays.size) {
    const int size = std::min(group, rays.size - first);
    const RaySpan part = rays.part(first, size);
    enter(part, options, batch);
    if (!batch->forward(view_, options.min_transmittance, options.min_weight, sums)) {
      group = size / 2;  // too many samples to keep: again with fewer rays
      continue;
    }
    for (int r = 0; r < size; ++r) {
      loss_gradients[r] = loss(first + r, resultOf(part[r], sums[r], cube_.side));
    }
    batch->backward(view_, loss_gradients, nullptr);
    std::fill(gradients + first, gradients + first + size, RayGradient{});
    positionGradients(part, direction_gradient, batch, gradients + first);
    addWork(*batch, size, &cost);
    addGradientWork(*batch, &cost);
    first += size;
    group = kGradientRaysPerGroup;
  }
  return cost;
}

void CpuField::positionGradients(RaySpan rays, bool direction_gradient, RayBatch* batch,
                                 RayGradient* gradients) const {
  SamplePool& pool = batch->pool();
  const int count = static_cast<int>(batch->columns().size());
  std::vector<float> gradient[3];  // with respect to positions in N
  for (std::vector<float>& axis : gradient) axis.assign(count, 0.0f);
  forEachTile(0, count, [&](int s, int n) {
    const float* const position[3] = {pool.position(0) + s, pool.position(1) + s,
                                      pool.position(2) + s};
    float* const by_position[3] = {gradient[0].data() + s, gradient[1].data() + s,
                                   gradient[2].data() + s};
    view_.kernels->encodePositionGradient(view_.grid, position,
                                          pool.encodingGradient().constPart(s, n), by_position);
  });
  for (int s = 0; s < count; ++s) {
    const RayBatch::Column& column = batch->columns()[s];
    if (column.ray < 0) continue;
    const float* d = rays[column.ray].direction;
    float force[3], lever[3];  // dL/dp and t dL/dp; t and 1 / dp scale with the cube's side
    for (int a = 0; a < 3; ++a) {
      force[a] = gradient[a][s] / cube_.side;
      lever[a] = column.sample.t * gradient[a][s];
    }
    if (direction_gradient) {
      float weight[kMaxHarmonics];
      const int degree = field_->config.sh_degree;
      const float* harmonics = pool.colourInputGradient().at(s);
      for (int k = 0; k < degree * degree; ++k) weight[k] = harmonics[k * TiledRows::kTileStride];
      sphericalHarmonicsGradient(d, degree, weight, lever);
    }
    RayGradient& of_ray = gradients[column.ray];
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      of_ray.force[a] += force[a];
      of_ray.torque[a] += d[b] * lever[c] - d[c] * lever[b];
    }
  }
}

void CpuField::addWork(const RayBatch& batch, int rays, CostCounters* work) const {
  const double densities = static_cast<double>(batch.densityEvaluations());
  const double colours = static_cast<double>(batch.colourEvaluations());
  work->rays += static_cast<std::uint64_t>(rays);
  work->samples += batch.densityEvaluations();
  work->colour_samples += batch.colourEvaluations();
  work->gathers += networks_.gathersPerSample() * densities;
  work->flops += networks_.densityFlops() * densities + networks_.colourFlops() * colours;
}

/// The way back to the positions reads the grid again and costs as much as the way there.
void CpuField::addGradientWork(const RayBatch& batch, CostCounters* work) const {
  const double columns = static_cast<double>(batch.columns().size());
  work->gathers += networks_.gathersPerSample() * columns;
  work->flops += (networks_.densityFlops() + networks_.colourFlops()) * columns;
}

}  // namespace nerf_pose_refiner
