// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

#include "backend/common/batch_room.h"
#include "backend/common/plain_pose.h"
#include "backend/cpu/cpu_backend.h"
#include "math/pose_spread.h"

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
                                       const ResamplingPlan& plan) {
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

// Survivors and offspring of one search.
std::vector<CpuHypothesis> resampledFrom(std::vector<CpuHypothesis> search,
                                         const ResamplingPlan& plan) {
  const auto flagged = plan.redraw ? std::count_if(search.begin(), search.end(),
                                                   [](const Hypothesis& h) { return !isLive(h); })
                                   : 0;
  std::stable_sort(search.begin(), search.end(), isBefore);
  std::vector<CpuHypothesis> next = survivorsOf(search, plan);
  const int survivors = static_cast<int>(next.size());
  if (survivors == 0) return next;
  const int redrawn = std::min(plan.keep, survivors + static_cast<int>(flagged));
  for (CpuHypothesis& h : next) h.descent = DescentState();
  const double turn = plan.rotation_jitter_rad, move = plan.translation_jitter;
  const PoseSpread spread = {{turn, turn, turn},
                             {move, move, move},
                             plan.rotate_about_object,
                             plainVector(plan.object_centre)};
  for (int i = survivors; i < std::max(plan.offspring, redrawn); ++i) {
    CpuHypothesis child;
    child.search = next.front().search;
    child.loss = std::numeric_limits<double>::infinity();
    child.T_O_C = poseAround(next[i % survivors].T_O_C, spread, plan.seed, i);
    next.push_back(child);
  }
  return next;
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

std::unique_ptr<HypothesisBatch> CpuBackend::batch(int capacity) {
  if (capacity < 1) {
    throw std::invalid_argument("batch capacity is " + std::to_string(capacity) +
                                ", must be positive");
  }
  auto batch = std::make_unique<CpuBatch>();
  batch->capacity = capacity;
  return batch;
}

void CpuBackend::sample(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
                        const SamplingPlan& plan) {
  CpuBatch& own = cpuBatch(batch);
  requireRoom(priors_T_O_C.size(), plan, own.capacity);
  const PoseSpread spread = {plainVector(plan.rotation_rad), plainVector(plan.translation),
                             plan.rotate_about_object, plainVector(plan.object_centre)};
  own.searches = static_cast<int>(priors_T_O_C.size());
  own.prior_T_O_C = priors_T_O_C.front();
  own.sampling = plan;
  own.hypotheses.clear();
  for (std::size_t search = 0; search < priors_T_O_C.size(); ++search) {
    const Pose& prior = priors_T_O_C[search];
    for (int i = 0; i < plan.count; ++i) {
      CpuHypothesis h;
      h.search = static_cast<int>(search);
      h.T_O_C = i == 0 ? prior : poseAround(prior, spread, plan.seed, i);
      own.hypotheses.push_back(h);
    }
  }
}

void CpuBackend::resample(HypothesisBatch* batch, const ResamplingPlan& plan) {
  CpuBatch& own = cpuBatch(batch);
  requireRoom(plan, own.capacity, own.searches);
  std::vector<CpuHypothesis> all;
  all.swap(own.hypotheses);
  for (auto first = all.begin(); first != all.end();) {
    const auto last = std::find_if(first, all.end(),
                                   [&](const Hypothesis& h) { return h.search != first->search; });
    const std::vector<CpuHypothesis> next = resampledFrom({first, last}, plan);
    own.hypotheses.insert(own.hypotheses.end(), next.begin(), next.end());
    first = last;
  }
}

HypothesisTable CpuBackend::read(const HypothesisBatch& batch) {
  const CpuBatch& own = cpuBatch(batch);
  HypothesisTable table(own.hypotheses.begin(), own.hypotheses.end());
  std::stable_sort(table.begin(), table.end(), isBefore);
  return table;
}

}  // namespace nerf_pose_refiner
