// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "align.h"
#include "backend/common/plain_pose.h"
#include "backend/common/scratch_pool.h"
#include "backend/make_backend.h"
#include "cuda_field.h"
#include "device_memory.h"
#include "hypotheses.h"
#include "image_level.h"
#include "optimise.h"
#include "render.h"
#include "unknown_background.h"

namespace nerf_pose_refiner {

/// An image on the device, and where it is copied from.
struct StagedImage {
  PinnedBuffer<float> staged;
  DeviceBuffer<float> image;
};

/// A level of an observation on the device.
struct CudaLevel {
  CudaCamera camera = {};
  double blur_px = 0;
  DeviceBuffer<float4> image;    ///< [h][w]: RGB, premultiplied by alpha, and alpha; not blurred
  DeviceBuffer<float> weight;    ///< [h][w]
  DeviceBuffer<float4> blurred;  ///< [h][w][2], @see image.h
};

/// Memory of an observation, used again by the next one.
struct CudaLevels {
  std::vector<CudaLevel> levels;  ///< the first `count` of them
  std::size_t count = 0;
};

/// An observation on a device; its memory goes back to the backend.
class CudaObservation final : public LoadedObservation {
 public:
  CudaObservation(std::shared_ptr<ScratchPool<CudaLevels>> pool, int device)
      : pool_(std::move(pool)), lease_(pool_->borrow()), device_(device) {}

  Background background = Background::kUnknown;
  Eigen::Vector3f background_colour = Eigen::Vector3f::Zero();  ///< 0 if there is an alpha

  CudaLevels* levels() { return lease_.get(); }
  int device() const { return device_; }
  /// @throws std::invalid_argument if there is no such level.
  const CudaLevel& level(int index) const;

 private:
  std::shared_ptr<ScratchPool<CudaLevels>> pool_;
  mutable ScratchPool<CudaLevels>::Lease lease_;
  int device_;
};

/// Memory of a batch.
struct CudaBatchMemory {
  DeviceBuffer<CudaHypothesis> items, scratch;
  DeviceBuffer<int> order, count;
  DeviceBuffer<double> samples_per_ray;
};

/// Hypotheses on a device; their memory goes back to the backend.
class CudaBatch final : public HypothesisBatch {
 public:
  CudaBatch(std::shared_ptr<ScratchPool<CudaBatchMemory>> pool, int device, int capacity);

  const CudaHypotheses& view() const { return view_; }
  int device() const { return device_; }
  /// Of `descend`, as it measures them for its budget; one number on the device.
  double* samplesPerRay() { return lease_.get()->samples_per_ray.data(); }

  int bound = 0;  ///< there are no more hypotheses than so many
  int searches = 0;
  Pose prior_T_O_C;  ///< of the first search
  SamplingPlan sampling;

 private:
  std::shared_ptr<ScratchPool<CudaBatchMemory>> pool_;
  ScratchPool<CudaBatchMemory>::Lease lease_;
  int device_;
  CudaHypotheses view_;
};

/// Carries out plans on a CUDA device. One stream, which is no other's; all that a call needs for a
/// while is kept from call to call.
class CudaBackend final : public Backend {
 public:
  /// Works on choice.device; nothing else of the choice matters to it.
  explicit CudaBackend(const BackendChoice& choice);
  ~CudaBackend() override;

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
  CostCounters work() const override;

 private:
  struct Stage;

  const CudaField& own(const LoadedField& field) const;
  const CudaObservation& own(const LoadedObservation& observation) const;
  CudaBatch& own(HypothesisBatch* batch) const;
  void enter() const;  ///< makes the device the calling thread's
  void uploadObservation(const Observation& observation, const std::vector<ImageLevel>& levels,
                         CudaObservedImage* uploaded);
  void observeLevel(const CudaObservedImage& image, const ImageLevel& plan, double scale,
                    CudaLevel* level);
  RenderTask renderTask(const CudaField& field, const CudaCamera& camera, int views,
                        int rays_per_side);
  Stage prepareStage(const CudaBatch& batch, const CudaField& field,
                     const CudaObservation& observation, int level, const AlignStage& stage);
  OptimisationTask optimisationTask(CudaBatch* batch, const CudaField& field,
                                    const CudaObservation& observation, int level,
                                    const OptimisationPlan& plan, int max_rays);
  void prepareContrasts(const CudaLevel& level, Stage* stage);
  void prepareRegions(const CudaLevel& level, Stage* stage);
  void fitGainBias(const Stage& stage);
  void evaluateTrials(Stage* stage, bool only_score);
  void copyWork();  ///< enqueues its download
  void takeWork();  ///< after a wait

  int device_;
  CudaStream stream_;
  std::shared_ptr<ScratchPool<CudaLevels>> levels_;
  std::shared_ptr<ScratchPool<CudaBatchMemory>> batches_;

  // Workspaces; they grow and stay.
  StagedImage image_, alpha_, weight_;
  CudaEvent uploaded_;  ///< behind the images that were enqueued last
  DeviceBuffer<float> kernel_;
  DeviceBuffer<CudaView> views_;
  DeviceBuffer<RayHit> hits_;
  DeviceBuffer<unsigned> hit_count_;
  DeviceBuffer<float4> images_, scratch_, rays_;
  DeviceBuffer<CameraPose<double>> poses_, priors_;
  DeviceBuffer<AlignmentSearch> searches_;
  DeviceBuffer<int> active_;
  DeviceBuffer<double> partial_sums_;
  DeviceBuffer<float> window_, opacity_, inside_weight_, background_density_;
  DeviceBuffer<float4> behind_, statistics_, observed_;
  DeviceBuffer<ColourCounts> counts_;
  PinnedBuffer<int> pinned_active_;
  CudaEvent evaluated_[2];  ///< behind the evaluations that were enqueued last
  DeviceBuffer<int> live_;
  DeviceBuffer<double2> scores_;
  DeviceBuffer<DescentClock> clock_;
  DeviceBuffer<RayRecord> records_;
  DeviceBuffer<RayPoint> ray_points_;
  DeviceBuffer<GradientSums> gradient_sums_;
  DeviceBuffer<RayHit> ray_hits_;
  CudaGraph descent_graph_;
  CudaEvent stepped_[2];  ///< behind the graphs that were launched last
  DeviceBuffer<CudaWork> meter_;
  PinnedBuffer<float4> pinned_image_;
  PinnedBuffer<CudaHypothesis> pinned_hypotheses_;
  PinnedBuffer<int> pinned_count_;
  PinnedBuffer<CudaWork> pinned_work_;
  CostCounters work_;
  CostCounters training_;  ///< of the trainers
};

/// A camera as kernels see it.
CudaCamera plainCamera(const Camera& camera);

}  // namespace nerf_pose_refiner
