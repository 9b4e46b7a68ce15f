// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/hypotheses.h"
#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// How poses are found by aligning keyframes with an image.
struct KeyframeAlignmentSettings {
  int finest_level = 0;                   ///< of the keyframe, at which alignment ends
  int coarsest_level = 100;               ///< at which it begins; most: the coarsest there is
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

/// The part of an image that alignment looks at.
struct FrameWindow {
  PixelWindow pixels;  ///< of the image; what lies outside of it is left out
  int finest = 0;      ///< levels are 2^finest, 2^(finest + 1), ... pixels of the image a pixel
  int levels = 4;      ///< how many
};

/// A pose to start from, and the keyframe to align.
struct KeyframeStart {
  int keyframe = 0;  ///< as KeyframeAligner::add said
  Pose T_O_C;        ///< [model units]
};

/// Aligns keyframes with images. One caller at a time, but for `expect`; it may be used beside all
/// else that its backend made, so that tracking never waits for a rendering.
class KeyframeAligner {
 public:
  virtual ~KeyframeAligner() = default;

  /// Takes a keyframe into the processor's memory. @return its number.
  virtual int add(std::shared_ptr<const KeyframePoints> keyframe) = 0;
  /// Does what can be done before a keyframe is added, so that this takes no time then. Any thread
  /// may call it, at any time; one keyframe at a time is expected.
  virtual void expect(const std::shared_ptr<const KeyframePoints>& /*keyframe*/) {}
  /// Gives its memory back.
  virtual void remove(int keyframe) = 0;

  /// Takes a part of an image: all that follows is about it. Pixels of weight 0 show nothing.
  /// @throws std::invalid_argument for an image that is smaller than two pixels of the coarsest
  /// level.
  virtual void observe(const Observation& observation, const FrameWindow& window) = 0;

  /// The poses that explain the image best, each from its start alone: as many hypotheses, in their
  /// order. A hypothesis' loss is the mean over points of the finest level; its score is 1 where
  /// all look as rendered and 0 where no more do than by chance; its visible fraction is that of
  /// the tiles with anything to compare that look as rendered.
  /// @throws Cancelled.
  virtual std::vector<Hypothesis> align(const std::vector<KeyframeStart>& starts,
                                        const KeyframeAlignmentSettings& settings,
                                        const CancellationToken& cancellation) = 0;

  /// Whether a second start takes hardly longer than the first one alone.
  virtual bool alignsSideBySide() const { return false; }
};

/// The level of a frame (2^level pixels of the image a pixel) that a keyframe's finest level is
/// compared with from a pose: the one of nearest resolution. It may be below 0.
int frameLevelFor(const KeyframePoints& keyframe, const Camera& camera, const Pose& T_O_C);

/// The part of an image that shows a keyframe's object from a pose, at the levels of the keyframe.
/// @param margin around it [diameters of the object].
FrameWindow frameWindowFor(const KeyframePoints& keyframe, const Camera& camera, const Pose& T_O_C,
                           double margin = 0.2);

}  // namespace nerf_pose_refiner
