// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "backend/common/plain_pose.h"
#include "backend/cost_counters.h"
#include "backend/cpu/cpu_solver.h"
#include "backend/cpu/pixel_loss.h"
#include "backend/cpu/rendered_image.h"
#include "backend/loaded_field.h"
#include "concurrency/parallel.h"
#include "math/pixel_draw.h"
#include "math/ray_budget.h"
#include "nerf_pose_refiner/cancellation_token.h"

// The paper's mode. Sums are taken over blocks of rays whose size is fixed, block after block, so
// that they are the same for any number of threads.

namespace nerf_pose_refiner {
namespace {

constexpr int kRaysPerBlock = 128;
constexpr std::uint64_t kEvaluationStream = ~std::uint64_t{0};  // steps use their own number

// Uniform over the pixels with a weight, the same for every hypothesis.
std::vector<PixelIndex> drawPixels(const ObservedLevel& level, int count, std::uint64_t seed,
                                   std::uint64_t stream) {
  const std::uint32_t pixels = static_cast<std::uint32_t>(level.weight.pixels());
  std::vector<PixelIndex> drawn(count);
  for (int i = 0; i < count; ++i) {
    const int index =
        static_cast<int>(drawPixel(seed, stream, i, pixels, level.weight.values.data()));
    drawn[i] = {index % level.camera.width, index / level.camera.width};
  }
  return drawn;
}

// Sums over rays of one hypothesis.
struct RaySums {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   // [1 / model unit]
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  // [1 / rad]
  double loss = 0;
  double weight = 0;
  CostCounters work;

  void add(const RaySums& other) {
    force += other.force;
    torque += other.torque;
    loss += other.loss;
    weight += other.weight;
    work += other.work;
  }

  // Infinite where no pixel has a weight: the worst there is.
  double meanLoss() const {
    return weight > 0 ? loss / weight : std::numeric_limits<double>::infinity();
  }
};

// What rays are cast at.
struct Target {
  const RayRenderer& scene;
  const CpuObservation& observation;
  const ObservedLevel& level;
  const OptimisationPlan& plan;
  const CancellationToken& cancellation;
};

RaySums castBlock(const Target& target, const Pose& T_O_C, const PixelIndex* pixels, int n,
                  bool with_gradient) {
  Ray rays[kRaysPerBlock];
  for (int i = 0; i < n; ++i) {
    rays[i] = rayThrough(target.level.camera, T_O_C, pixels[i].x, pixels[i].y);
  }
  RaySums sums;
  const auto compare = [&](int i, const RayResult& ray) {
    const PixelLoss pixel =
        pixelLoss(target.plan.loss, target.observation, target.level, pixels[i], ray);
    sums.loss += pixel.loss;
    sums.weight += pixel.weight;
    return pixel.gradient;
  };
  if (with_gradient) {
    RayGradient gradients[kRaysPerBlock];
    sums.work = target.scene.rayGradients({rays, n}, RenderOptions(),
                                          target.plan.direction_gradient, compare, gradients);
    for (int i = 0; i < n; ++i) {
      sums.force += Eigen::Map<const Eigen::Vector3f>(gradients[i].force).cast<double>();
      sums.torque += Eigen::Map<const Eigen::Vector3f>(gradients[i].torque).cast<double>();
    }
  } else {
    RayResult results[kRaysPerBlock];
    sums.work = target.scene.renderRays({rays, n}, RenderOptions(), results);
    for (int i = 0; i < n; ++i) compare(i, results[i]);
  }
  return sums;
}

// Casts the pixels' rays for each of the hypotheses.
std::vector<RaySums> castRays(const Target& target, const std::vector<CpuHypothesis*>& hypotheses,
                              const std::vector<PixelIndex>& pixels, bool with_gradient) {
  const int rays = static_cast<int>(pixels.size());
  const int blocks = (rays + kRaysPerBlock - 1) / kRaysPerBlock;
  const int count = static_cast<int>(hypotheses.size());
  std::vector<RaySums> block_sums(static_cast<std::size_t>(count) * blocks);
  parallelFor(target.scene.processor().threads, count * blocks, [&](int i) {
    target.cancellation.check();
    const int first = i % blocks * kRaysPerBlock;
    block_sums[i] = castBlock(target, hypotheses[i / blocks]->T_O_C, pixels.data() + first,
                              std::min(kRaysPerBlock, rays - first), with_gradient);
  });
  std::vector<RaySums> sums(count);
  for (int i = 0; i < count * blocks; ++i) sums[i / blocks].add(block_sums[i]);
  return sums;
}

// One update of Adam from the gathered forces and torques.
void updatePose(const OptimisationPlan& plan, double decay, CpuHypothesis* hypothesis) {
  DescentState& state = hypothesis->descent;
  CameraPose<double> pose = plainPose(hypothesis->T_O_C);
  const bool finite = updatePose(plan.rates(decay), plainVector(state.force / state.gathered),
                                 plainVector(state.torque / state.gathered), &state.motion, &pose);
  state.gathered = 0;
  state.force.setZero();
  state.torque.setZero();
  ++hypothesis->iterations;
  if (finite) {
    hypothesis->T_O_C = poseOf(pose);
  } else {
    hypothesis->state = HypothesisState::kNotFinite;
  }
}

// Takes one step's means, and updates the pose if there are enough of them.
void gather(const OptimisationPlan& plan, int step, int rays, const RaySums& sums,
            CpuHypothesis* hypothesis) {
  DescentState& state = hypothesis->descent;
  if (!state.started) {
    state.started = true;
    state.motion.start = plainPose(hypothesis->T_O_C);
  }
  state.force += plan.length_unit / rays * sums.force;
  state.torque += sums.torque / rays;
  if (++state.gathered < plan.steps_per_update) return;
  updatePose(plan, plan.schedule.rateFactor(step / plan.steps_per_update), hypothesis);
}

}  // namespace

void CpuSolver::optimise(int level, const OptimisationPlan& plan, const StepRange& steps,
                         const CancellationToken& cancellation) {
  const Target target = {scene_, observation_, observation_.level(level), plan, cancellation};
  std::vector<CpuHypothesis*> live = hypotheses_.live();
  const int count = static_cast<int>(live.size());
  std::vector<RaySums> scores(live.size());
  const int end = steps.first + steps.count;
  for (int step = steps.first; step < end && count > 0; ++step) {
    const int rays = raysWithinBudget(plan.samples_per_step, count, samples_per_ray_);
    const auto pixels = drawPixels(target.level, rays, plan.seed, step);
    const auto sums = castRays(target, live, pixels, true);
    const bool scored = step >= end - plan.score_steps;
    CostCounters step_costs;
    for (std::size_t i = 0; i < live.size(); ++i) {
      if (scored) scores[i].add(sums[i]);
      step_costs += sums[i].work;
      gather(plan, step, rays, sums[i], live[i]);
    }
    scene_.processor().costs += step_costs;
    samples_per_ray_ = updatedSamplesPerRay(
        samples_per_ray_, static_cast<double>(step_costs.samples) / (rays * live.size()));
  }
  for (std::size_t i = 0; i < live.size(); ++i) live[i]->loss = scores[i].meanLoss();
}

void CpuSolver::evaluate(int level, const OptimisationPlan& plan, int pixels,
                         const CancellationToken& cancellation) {
  const Target target = {scene_, observation_, observation_.level(level), plan, cancellation};
  const std::vector<CpuHypothesis*> live = hypotheses_.live();
  const auto drawn = drawPixels(target.level, pixels, plan.seed, kEvaluationStream);
  const auto sums = castRays(target, live, drawn, false);
  for (std::size_t i = 0; i < live.size(); ++i) {
    live[i]->loss = sums[i].meanLoss();
    scene_.processor().costs += sums[i].work;
  }
}

}  // namespace nerf_pose_refiner
