// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "cpu_engine.h"
#include "nerf_pose_refiner/maths/pose_spread.h"
#include "plain_pose.h"

namespace nerf_pose_refiner {
namespace {

bool isLive(const Hypothesis& h) { return h.state == HypothesisState::kLive; }

bool isBefore(const Hypothesis& a, const Hypothesis& b) {
  return isBetter(a.state, a.loss, b.state, b.loss);
}

Pose poseAround(const Pose& pose, const PoseSpread& spread, std::uint64_t seed, int index) {
  return poseOf(drawnAround(plainPose(pose), spread, seed, static_cast<std::uint64_t>(index)));
}

// The best, without the flagged ones and those that stand where a better one does.
std::vector<CpuHypothesis> survivorsOf(const std::vector<CpuHypothesis>& sorted,
                                       const SelectPlan& plan) {
  std::vector<CpuHypothesis> survivors;
  for (const CpuHypothesis& h : sorted) {
    if (!isLive(h) || static_cast<int>(survivors.size()) == plan.keep) break;
    const auto same = [&](const CpuHypothesis& kept) {
      return isDuplicate(plainPose(kept.T_O_C), plainPose(h.T_O_C), plainVector(plan.object_centre),
                         plan.merge_rotation_rad, plan.merge_translation);
    };
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
  const PoseSpread spread = {plainVector(plan.rotation_rad), plainVector(plan.translation),
                             plan.rotate_about_object, plainVector(plan.object_centre)};
  own.prior_T_O_C = prior_T_O_C;
  own.scatter = plan;
  own.hypotheses.assign(plan.count, CpuHypothesis());
  own.hypotheses[0].T_O_C = prior_T_O_C;
  for (int i = 1; i < plan.count; ++i) {
    own.hypotheses[i].T_O_C = poseAround(prior_T_O_C, spread, plan.seed, i);
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
  std::stable_sort(own.hypotheses.begin(), own.hypotheses.end(), isBefore);
  own.hypotheses = survivorsOf(own.hypotheses, plan);
  const int survivors = static_cast<int>(own.hypotheses.size());
  if (survivors == 0) return;
  const int redrawn = std::min(plan.keep, survivors + static_cast<int>(flagged));
  for (CpuHypothesis& h : own.hypotheses) h.descent = DescentState();
  const double turn = plan.rotation_jitter_rad, move = plan.translation_jitter;
  const PoseSpread spread = {{turn, turn, turn},
                             {move, move, move},
                             plan.rotate_about_object,
                             plainVector(plan.object_centre)};
  for (int i = survivors; i < std::max(plan.offspring, redrawn); ++i) {
    CpuHypothesis child;
    child.loss = std::numeric_limits<double>::infinity();
    child.T_O_C = poseAround(own.hypotheses[i % survivors].T_O_C, spread, plan.seed, i);
    own.hypotheses.push_back(child);
  }
}

HypothesisTable CpuEngine::read(const HypothesisBatch& batch) {
  const CpuBatch& own = cpuBatch(batch);
  HypothesisTable table(own.hypotheses.begin(), own.hypotheses.end());
  std::stable_sort(table.begin(), table.end(), isBefore);
  return table;
}

}  // namespace nerf_pose_refiner
