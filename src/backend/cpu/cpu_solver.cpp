// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_solver.h"

#include <utility>

namespace nerf_pose_refiner {

CpuSolver::CpuSolver(const RayRenderer& scene, CpuObservation observation, int capacity)
    : scene_(scene),
      observation_(std::move(observation)),
      start_(std::chrono::steady_clock::now()),
      costs_before_(scene.processor().costs) {
  hypotheses_.capacity = capacity;
}

void CpuSolver::sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) {
  hypotheses_.sample(priors_T_O_C, plan);
}

void CpuSolver::resample(const ResamplingPlan& plan) { hypotheses_.resample(plan); }

void CpuSolver::snapshot() {
  SolverSnapshot now;
  now.hypotheses = hypotheses_.bestFirst();
  now.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  now.costs = scene_.processor().costs - costs_before_;
  snapshots_.push_back(std::move(now));
}

std::vector<SolverSnapshot> CpuSolver::read() { return std::exchange(snapshots_, {}); }

}  // namespace nerf_pose_refiner
