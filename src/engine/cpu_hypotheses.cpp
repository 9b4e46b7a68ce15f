// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "cpu_engine.h"
#include "nerf_pose_refiner/maths/random.h"

namespace nerf_pose_refiner {
namespace {

// A region of poses around a pose: half widths per axis.
struct Spread {
  Eigen::Vector3d rotation_rad;
  Eigen::Vector3d translation;
  bool about_object;
  Eigen::Vector3d object_centre;
};

Eigen::Vector3d uniformInBox(const Eigen::Vector3d& half_width, std::uint64_t seed,
                             std::uint64_t stream, std::uint64_t counter) {
  Eigen::Vector3d x;
  for (int i = 0; i < 3; ++i) {
    x[i] = half_width[i] * (2.0 * randomUniform(seed, stream, counter + i) - 1.0);
  }
  return x;
}

// The index-th pose around `pose`: rotated, about the object's centre in the axes of O or about the
// camera in its own, then moved along the axes of O.
Pose drawnAround(const Pose& pose, const Spread& spread, std::uint64_t seed, std::uint64_t index) {
  const Eigen::Matrix3d turn = expSO3(uniformInBox(spread.rotation_rad, seed, index, 0));
  const Eigen::Vector3d move = uniformInBox(spread.translation, seed, index, 3);
  if (!spread.about_object) return {pose.R * turn, pose.t + move};
  const Eigen::Vector3d& c = spread.object_centre;
  return {turn * pose.R, c + turn * (pose.t - c) + move};
}

bool isLive(const Hypothesis& h) { return h.state == HypothesisState::kLive; }

bool isBetter(const Hypothesis& a, const Hypothesis& b) {
  if (isLive(a) != isLive(b)) return isLive(a);
  if (std::isnan(a.loss) || std::isnan(b.loss)) return !std::isnan(a.loss) && std::isnan(b.loss);
  return a.loss < b.loss;
}

bool isDuplicate(const Hypothesis& a, const Hypothesis& b, const SelectPlan& plan) {
  const Eigen::Vector3d moved =
      a.T_O_C.inverse() * plan.object_centre - b.T_O_C.inverse() * plan.object_centre;
  return moved.norm() < plan.merge_translation &&
         rotationDistance(a.T_O_C.R, b.T_O_C.R) < plan.merge_rotation_rad;
}

// The best, without the flagged ones and those that stand where a better one does.
std::vector<CpuHypothesis> survivorsOf(const std::vector<CpuHypothesis>& sorted,
                                       const SelectPlan& plan) {
  std::vector<CpuHypothesis> survivors;
  for (const CpuHypothesis& h : sorted) {
    if (!isLive(h) || static_cast<int>(survivors.size()) == plan.keep) break;
    const auto same = [&](const CpuHypothesis& kept) { return isDuplicate(kept, h, plan); };
    if (std::none_of(survivors.begin(), survivors.end(), same)) survivors.push_back(h);
  }
  return survivors;
}

}  // namespace

CpuBatch& cpuBatch(HypothesisBatch* batch) {
  auto* own = dynamic_cast<CpuBatch*>(batch);
  if (own == nullptr) throw std::invalid_argument("the batch is not of the CPU engine");
  return *own;
}

const CpuBatch& cpuBatch(const HypothesisBatch& batch) {
  const auto* own = dynamic_cast<const CpuBatch*>(&batch);
  if (own == nullptr) throw std::invalid_argument("the batch is not of the CPU engine");
  return *own;
}

std::unique_ptr<HypothesisBatch> CpuEngine::batch(int capacity) {
  if (capacity < 1) {
    throw std::invalid_argument("batch capacity is " + std::to_string(capacity) +
                                ", must be positive");
  }
  auto batch = std::make_unique<CpuBatch>();
  batch->capacity = capacity;
  return batch;
}

void CpuEngine::scatter(HypothesisBatch* batch, const Pose& prior_T_O_C, const ScatterPlan& plan) {
  CpuBatch& own = cpuBatch(batch);
  if (plan.count < 1 || plan.count > own.capacity) {
    throw std::invalid_argument("ScatterPlan::count is " + std::to_string(plan.count) +
                                ", the batch holds 1 to " + std::to_string(own.capacity));
  }
  const Spread spread = {plan.rotation_rad, plan.translation, plan.rotate_about_object,
                         plan.object_centre};
  own.prior_T_O_C = prior_T_O_C;
  own.scatter = plan;
  own.hypotheses.assign(plan.count, CpuHypothesis());
  own.hypotheses[0].T_O_C = prior_T_O_C;
  for (int i = 1; i < plan.count; ++i) {
    own.hypotheses[i].T_O_C = drawnAround(prior_T_O_C, spread, plan.seed, i);
  }
}

void CpuEngine::select(HypothesisBatch* batch, const SelectPlan& plan) {
  CpuBatch& own = cpuBatch(batch);
  if (plan.keep < 1 || plan.offspring > own.capacity) {
    throw std::invalid_argument("SelectPlan keeps " + std::to_string(plan.keep) + " and makes " +
                                std::to_string(plan.offspring) + " of a batch that holds " +
                                std::to_string(own.capacity));
  }
  const auto flagged = plan.redraw ? std::count_if(own.hypotheses.begin(), own.hypotheses.end(),
                                                   [](const Hypothesis& h) { return !isLive(h); })
                                   : 0;
  std::stable_sort(own.hypotheses.begin(), own.hypotheses.end(), isBetter);
  own.hypotheses = survivorsOf(own.hypotheses, plan);
  const int survivors = static_cast<int>(own.hypotheses.size());
  if (survivors == 0) return;
  const int redrawn = std::min(plan.keep, survivors + static_cast<int>(flagged));
  for (CpuHypothesis& h : own.hypotheses) h.descent = DescentState();
  const Spread spread = {Eigen::Vector3d::Constant(plan.rotation_jitter_rad),
                         Eigen::Vector3d::Constant(plan.translation_jitter),
                         plan.rotate_about_object, plan.object_centre};
  for (int i = survivors; i < std::max(plan.offspring, redrawn); ++i) {
    CpuHypothesis child;
    child.loss = std::numeric_limits<double>::infinity();
    child.T_O_C = drawnAround(own.hypotheses[i % survivors].T_O_C, spread, plan.seed, i);
    own.hypotheses.push_back(child);
  }
}

HypothesisTable CpuEngine::read(const HypothesisBatch& batch) {
  const CpuBatch& own = cpuBatch(batch);
  HypothesisTable table(own.hypotheses.begin(), own.hypotheses.end());
  std::stable_sort(table.begin(), table.end(), isBetter);
  return table;
}

}  // namespace nerf_pose_refiner
