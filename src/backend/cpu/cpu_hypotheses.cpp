// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_hypotheses.h"

#include <algorithm>
#include <limits>

#include "backend/common/plain_pose.h"
#include "backend/common/solver_rules.h"
#include "math/resampling_count.h"

namespace nerf_pose_refiner {
namespace {

bool isLive(const Hypothesis& h) { return h.state == HypothesisState::kLive; }

bool isBefore(const Hypothesis& a, const Hypothesis& b) {
  return isBetter(a.state, a.loss, b.state, b.loss);
}

Pose poseAround(const Pose& pose, const PoseSpread& spread, std::uint64_t seed, int index) {
  return poseOf(drawnAround(plainPose(pose), spread, seed, static_cast<std::uint64_t>(index)));
}

// The best, without the flagged ones and duplicates of better ones.
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
  const int count = resampledCount(plan.keep, plan.offspring, survivors, static_cast<int>(flagged));
  for (CpuHypothesis& h : next) h.descent = DescentState();
  for (int i = survivors; i < count; ++i) {
    CpuHypothesis child;
    child.search = next.front().search;
    child.loss = std::numeric_limits<double>::infinity();
    child.T_O_C = poseAround(next[i % survivors].T_O_C, spreadOf(plan), plan.seed, i);
    next.push_back(child);
  }
  return next;
}

}  // namespace

void CpuHypotheses::sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) {
  requireCapacity(priors_T_O_C.size(), plan, capacity);
  searches = static_cast<int>(priors_T_O_C.size());
  prior_T_O_C = priors_T_O_C.front();
  sampling = plan;
  items.clear();
  for (int search = 0; search < searches; ++search) {
    const Pose& prior = priors_T_O_C[search];
    for (int i = 0; i < plan.count; ++i) {
      CpuHypothesis h;
      h.search = search;
      h.T_O_C = i == 0 ? prior : poseAround(prior, spreadOf(plan), plan.seed, i);
      items.push_back(h);
    }
  }
}

void CpuHypotheses::resample(const ResamplingPlan& plan) {
  requireCapacity(plan, capacity, searches);
  std::vector<CpuHypothesis> all;
  all.swap(items);
  for (auto first = all.begin(); first != all.end();) {
    const auto last = std::find_if(first, all.end(),
                                   [&](const Hypothesis& h) { return h.search != first->search; });
    const std::vector<CpuHypothesis> next = resampledFrom({first, last}, plan);
    items.insert(items.end(), next.begin(), next.end());
    first = last;
  }
}

std::vector<CpuHypothesis*> CpuHypotheses::live() {
  std::vector<CpuHypothesis*> found;
  for (CpuHypothesis& h : items) {
    if (isLive(h)) found.push_back(&h);
  }
  return found;
}

HypothesisTable CpuHypotheses::bestFirst() const {
  HypothesisTable table(items.begin(), items.end());
  sortBestFirst(&table);
  return table;
}

}  // namespace nerf_pose_refiner
