// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "math/descent_update.h"
#include "math/loss.h"
#include "nerf_pose_refiner/camera.h"

namespace nerf_pose_refiner {

/// A part of the observed image, resized: what one stage of a plan compares.
struct ImageLevel {
  Camera camera;       ///< of the level's image: cropped and resized from the observation's
  double blur_px = 1;  ///< sigma of the total blur of both images [px of this level]
};

/// Start poses around a prior.
struct SamplingPlan {
  int count = 64;  ///< hypotheses of a search, the first being the prior itself
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();  ///< half width per axis, uniform
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< half width per axis, model units
  bool rotate_about_object = true;  ///< false: about the camera (the paper's protocol)
  Eigen::Vector3d object_centre = Eigen::Vector3d::Zero();  ///< model units
  /// How far from the prior alignment may lead: angle, and offset of the object's centre as the
  /// camera sees it [model units]. 0: anywhere.
  double rotation_limit_rad = 0;
  double translation_limit = 0;
  std::uint64_t seed = 1;
};

/// One stage of direct alignment.
struct AlignStage {
  int rays_per_side = 1;  ///< rays_per_side^2 rays a pixel, on a regular sub-pixel lattice
  int max_iterations = 10;
  double max_rotation_rad = 0.17;  ///< bound of a step
  double max_translation = 0.1;    ///< bound of a step, in object diameters
  double robust_scale = 0.1;       ///< of the residual (colour units) beyond which it counts less
  double observed_fraction =
      0.5;                        ///< of the observation in the gradients; 0: the rendering's alone
  double alpha_weight = 1.0;      ///< of the opacity residual against the three colour residuals
  bool compare_contrast = false;  ///< unknown background: compare contrasts, not colours
  bool fit_gain_bias = false;     ///< fit the observation's gain and bias per channel
  float step_scale = 1;           ///< of the sample intervals along a ray
  float min_transmittance = 1e-2f;
  double convergence_px = 0.02;  ///< a step that moves the object's rim by less ends the stage
};

/// First-order inversion (Lin et al., section IV); the defaults are the paper's and its authors',
/// unless it is said.
///
/// Every step draws pixels, the same ones for every hypothesis, and gathers force (eq. 2) and
/// torque (eq. 3), averaged over the rays. Every `steps_per_update` steps Adam takes their mean:
/// vector moments in t(3) and so(3), second moments element by element, all in the axes of O.
/// What they move, `update` says. Lengths are measured in `length_unit`, so that a scaled scene is
/// searched in the same way.
struct OptimisationPlan {
  Loss loss = Loss::kL2;
  /// Not the paper's, which turns about the camera: turning and moving then undo each other in the
  /// image, and Adam, which takes numbers one by one, is slow along what is left.
  PoseUpdate update = PoseUpdate::kAboutObject;
  Eigen::Vector3d object_centre = Eigen::Vector3d::Zero();  ///< model units
  double length_unit = 3.03;                ///< side of the paper's unit cube [model units]
  double translation_learning_rate = 3e-3;  ///< [length_unit] an update
  double rotation_learning_rate = 5e-3;     ///< [rad] an update
  RateSchedule schedule;                    ///< of both, counted over the whole run
  double beta1 = 0.9;
  double beta2 = 0.99;
  double epsilon = 1e-8;
  /// L2, on the offset from the hypothesis' start. Its authors' 1e-4 goes with gradients
  /// summed over three colour channels; losses here are means over them.
  double regularisation = 1e-4 / 3;
  int steps_per_update = 4;         ///< gradients are accumulated over so many steps
  int samples_per_step = 1 << 18;   ///< of all hypotheses together, about
  int score_steps = 128;            ///< a hypothesis' loss is the mean of its last so many steps
  bool direction_gradient = false;  ///< also through the viewing direction
  std::uint64_t seed = 1;

  /// Of an update. @param decayed the fraction of the learning rates that is left.
  DescentRates rates(double decayed) const {
    return {update,
            {object_centre.x(), object_centre.y(), object_centre.z()},
            length_unit,
            decayed * translation_learning_rate,
            decayed * rotation_learning_rate,
            regularisation,
            {beta1, beta2, epsilon}};
  }
};

/// Steps of a run of inversion.
struct StepRange {
  int first = 0;  ///< number of the first one within the whole run
  int count = 0;
};

/// Survivors and their offspring, whose loss is infinite until it is measured.
struct ResamplingPlan {
  int keep = 8;                      ///< best hypotheses that survive
  bool redraw = true;                ///< where flagged hypotheses leave fewer than `keep`, as many
                                     ///< are redrawn around the survivors
  int offspring = 0;                 ///< batch size after the jitter; 0: the survivors alone
  double rotation_jitter_rad = 0;    ///< half width per axis, first
  double translation_jitter = 0;     ///< half width per axis, model axes, then [model units]
  bool rotate_about_object = false;  ///< false: about the camera (the paper's protocol)
  double merge_rotation_rad = 0;     ///< nearer ones are duplicates (0: none are merged)
  double merge_translation = 0;      ///< of the object's centre as the cameras see it [model units]
  Eigen::Vector3d object_centre = Eigen::Vector3d::Zero();  ///< model units
  std::uint64_t seed = 1;
};

}  // namespace nerf_pose_refiner
