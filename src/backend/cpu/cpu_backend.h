// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/common/descent_state.h"
#include "backend/cpu/cpu_kernels.h"
#include "backend/ray_renderer.h"

namespace nerf_pose_refiner {

/// A level of an observation as the solvers see it. A pixel explained by a rendering (premultiplied
/// colour C, alpha A) before the background B has the residual C + (1 - A) B - image.
struct ObservedLevel {
  Camera camera;
  double blur_px = 0;  ///< sigma of the total blur of both images [px of this level]
  Image image;  ///< [h][w][3], area-averaged, not blurred; premultiplied by `alpha` if there is one
  Image alpha;  ///< [h][w][1], area-averaged, for a known alpha and a mask; empty otherwise
  Image weight;   ///< [h][w][1], 0 outside of the observed image
  Image blurred;  ///< [h][w][kImageChannels]: weighted means under the blur, RGB and alpha
};

/// An observation in this process' memory.
struct CpuObservation final : LoadedObservation {
  Background background = Background::kUnknown;
  Eigen::Vector3f background_colour = Eigen::Vector3f::Zero();  ///< B; 0 if there is an alpha
  std::vector<ObservedLevel> levels;
};

/// A hypothesis with what its solver carries from call to call.
struct CpuHypothesis : Hypothesis {
  DescentState descent;  ///< fresh in a hypothesis that was just seeded
};

/// Hypotheses in this process' memory; those of a search are in no special order until `select`
/// sorts them.
struct CpuBatch final : HypothesisBatch {
  int capacity = 0;
  int searches = 0;
  Pose prior_T_O_C;       ///< that the hypotheses of the first search were scattered around
  SamplingPlan sampling;  ///< with which they were
  std::vector<CpuHypothesis> hypotheses;  ///< search after search
  double samples_per_ray = -1;            ///< as `descend` measures it for its budget; < 0: not yet
};

/// Carries out plans on the cores of this computer. The pose solvers see a field through
/// RayRenderer alone, so any scene that can be rendered takes the place of a learned one.
class CpuBackend final : public Backend {
 public:
  CpuBackend(int threads, const CpuKernels& kernels);

  std::string describe() const override;
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override;
  Rendering render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                   const RenderOptions& options, const CancellationToken& stop) override;
  std::unique_ptr<FieldTrainer> trainer(const FieldConfig& config, const Box& box,
                                        std::vector<TrainingView> views,
                                        const TrainingPlan& plan) override;
  std::shared_ptr<const LoadedObservation> observe(const Observation& observation,
                                                   const std::vector<ImageLevel>& levels) override;
  std::unique_ptr<HypothesisBatch> batch(int capacity) override;
  void sample(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
              const SamplingPlan& plan) override;
  void align(HypothesisBatch* batch, const LoadedField& field, const LoadedObservation& observation,
             int level, const AlignStage& stage, const CancellationToken& stop) override;
  void score(HypothesisBatch* batch, const LoadedField& field, const LoadedObservation& observation,
             int level, const AlignStage& stage, const CancellationToken& stop) override;
  void optimise(HypothesisBatch* batch, const LoadedField& field,
                const LoadedObservation& observation, int level, const OptimisationPlan& plan,
                int first_step, int steps, const CancellationToken& stop) override;
  void evaluate(HypothesisBatch* batch, const LoadedField& field,
                const LoadedObservation& observation, int level, const OptimisationPlan& plan,
                int pixels, const CancellationToken& stop) override;
  void resample(HypothesisBatch* batch, const ResamplingPlan& plan) override;
  HypothesisTable read(const HypothesisBatch& batch) override;
  CostCounters work() const override { return work_; }

 private:
  int threads_;
  const CpuKernels* kernels_;
  CostCounters work_;
};

/// The renderer behind a loaded field. @throws std::invalid_argument if it is another backend's.
const RayRenderer& rayRenderer(const LoadedField& field);

/// The observation as this backend made it. @throws std::invalid_argument if it is another
/// backend's.
const CpuObservation& cpuObservation(const LoadedObservation& observation);

/// A level of an observation. @throws std::invalid_argument if it is another backend's, or if there
/// is no such level.
const ObservedLevel& observedLevel(const LoadedObservation& observation, int level);

/// The batch as this backend made it. @throws std::invalid_argument if it is another backend's.
CpuBatch& cpuBatch(HypothesisBatch* batch);
const CpuBatch& cpuBatch(const HypothesisBatch& batch);

}  // namespace nerf_pose_refiner
