// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <vector>

#include "backend/common/self_occlusion.h"
#include "backend/cpu/frame_pyramid.h"
#include "backend/hypotheses.h"
#include "backend/keyframe_points.h"
#include "math/tile_scatter.h"

namespace nerf_pose_refiner {

/// How a pose is found by aligning a keyframe with an image.
struct KeyframeAlignmentSettings {
  int max_evaluations = 16;               ///< a level
  double robust_scale = 0.7;              ///< residuals above it are outliers [local deviations]
  double robust_growth = 1.3;             ///< of this scale, from a level to the next coarser one
  double observed_fraction = 0;           ///< of the observation in gradients, finest level
  double coarse_observed_fraction = 0.5;  ///< the same of other levels
  double max_rotation_rad = 0.08;         ///< of a step
  double max_translation = 0.08;          ///< of a step, of the object's diameter
  /// Steps are longer than Gauss-Newton's by this: robust weights and the frozen normalisation make
  /// those too short.
  double over_relaxation = 1.4;
  double convergence_px = 0.02;  ///< steps that move the object's rim by less end the finest level
  double coarse_convergence_px = 0.2;  ///< the same of other levels, in their pixels
  double look_around_px = 0.1;  ///< of the rim's motion: local colours are taken again after it
};

/// Aligns keyframes with images on the CPU. One caller at a time.
class KeyframeAligner {
 public:
  explicit KeyframeAligner(const KeyframeKernels& kernels) : kernels_(&kernels) {}

  /// Takes the part of an image that shows the object: all that follows is about it.
  /// @param T_O_C about where the object is seen from. @param margin around it, of its diameter.
  void observe(const Image8& image, const Camera& camera, const KeyframePoints& keyframe,
               const Pose& T_O_C, double margin = 0.2);

  /// The pose that explains the image best, from a start near it. Its loss is the mean over points;
  /// its score is 1 where all look as rendered and 0 where no more do than by chance; its visible
  /// fraction is the weight that robust weights leave.
  Hypothesis align(const KeyframePoints& keyframe, const Pose& start_T_O_C,
                   const KeyframeAlignmentSettings& settings = {});

 private:
  struct Evaluation {
    CameraPose<double> pose;
    PointSums<double> sums = {};
    TileScatter scatter;
    double loss = std::numeric_limits<double>::infinity();  // mean over all points
  };

  void beginLevel(const KeyframePoints& keyframe, int level, const CameraPose<double>& pose);
  Evaluation evaluate(const KeyframePoints& keyframe, int level, const CameraPose<double>& pose,
                      const KernelRules& rules);
  Evaluation alignLevel(const KeyframePoints& keyframe, int level,
                        const std::vector<CameraPose<double>>& starts,
                        const KeyframeAlignmentSettings& settings, int* evaluations);
  void carryGradients(const KeyframePoints& keyframe, int level, const CameraPose<double>& pose);
  void lookAround(const KeyframePoints& keyframe, int level, const CameraPose<double>& pose);

  const KeyframeKernels* kernels_;
  FramePyramid frame_;
  SelfOcclusion occlusion_;
  // Of the level that is being aligned:
  std::vector<std::int32_t> hidden_;  // pixels of the keyframe that the object itself hides
  std::vector<float> inverse_count_;  // of those that are left around each pixel
  std::vector<float> grid_, sums_;    // of the image's colours, in the keyframe's pixels
  std::vector<float> rendered_du_[3], rendered_dv_[3];          // of the chosen points
  std::vector<float> mean_[3], inverse_deviation_[3], weight_;  // of the chosen points
  int point_count_ = 0;                                         // of those with weight
};

}  // namespace nerf_pose_refiner
