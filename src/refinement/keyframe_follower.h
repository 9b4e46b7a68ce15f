// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "backend/keyframe_aligner.h"
#include "refinement/field_refiner.h"
#include "refinement/keyframe_settings.h"
#include "views/keyframe_renderer.h"

namespace nerf_pose_refiner {

/// An image of a sequence.
struct TimedObservation {
  const Observation& observation;
  std::int64_t stamp_ns = 0;  ///< when it was taken; says when a keyframe is due
};

/// Finds an object in the images of a sequence, each time near a pose that is nearly right, by
/// aligning keyframes. New ones are rendered beside that.
///
/// Not thread-safe. What its backend made may be used by others while `follow` is running, but only
/// in turns with its renderings (@see SharedBackend).
class KeyframeFollower {
 public:
  /// @throws std::invalid_argument for settings that are out of range.
  KeyframeFollower(Backend* backend, std::shared_ptr<const LoadedField> field,
                   const KeyframeSearchSettings& settings);

  /// @throws std::invalid_argument for an observation or a prior that makes no sense.
  Refinement follow(const TimedObservation& image, const Prior& prior,
                    const CancellationToken& cancellation = {});

  /// Waits until nothing is rendered any more, so that the field is free for others.
  void waitForRenderings(const CancellationToken& cancellation);

  int keyframesMade() const { return made_; }

 private:
  struct Kept {
    int number;  // of the aligner
    std::shared_ptr<const KeyframePoints> keyframe;
    std::uint64_t used = 0;  // image in which it was aligned last
  };

  void takeRenewal(std::int64_t stamp_ns, const CancellationToken& cancellation);
  void keep(std::shared_ptr<const KeyframePoints> keyframe);
  Kept* nearest(const Pose& T_O_C);
  void makeAt(const View& view, const CancellationToken& cancellation);
  void renewFor(const View& view, std::int64_t stamp_ns);
  HypothesisTable alignFrom(const Observation& observation, const Prior& prior,
                            const CancellationToken& cancellation);
  HypothesisTable searchWidely(const Prior& prior, const CancellationToken& cancellation);
  Refinement conclude(HypothesisTable found, const Prior& prior) const;

  std::shared_ptr<const LoadedField> field_;
  KeyframeSearchSettings settings_;
  std::unique_ptr<KeyframeAligner> aligner_;
  KeyframeRenderer renderer_;
  std::vector<Kept> kept_;
  std::int64_t due_ns_ = 0;  // stamp from which on the keyframe under way is used
  std::uint64_t images_ = 0;
  int made_ = 0;
  std::optional<std::pair<std::int64_t, Pose>> last_;  // stamp and pose that were found last
};

}  // namespace nerf_pose_refiner
