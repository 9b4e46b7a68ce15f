// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "detection/candidate.h"
#include "detection/same_instance.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/observation.h"
#include "refinement/keyframe_set.h"
#include "refinement/keyframe_settings.h"
#include "views/view_bank.h"

namespace nerf_pose_refiner {

/// A candidate where small views of the object are aligned from it.
struct AlignedCandidate {
  PoseCandidate candidate;  ///< with the pose that alignment ends at
  double score = 0;         ///< how well that explains the image, @see KeyframeAligner::align
};

/// What is looked at, and how many candidates go on.
struct RankingLimits {
  PixelWindow window;       ///< of the image
  std::size_t all;          ///< candidates
  std::size_t of_instance;  ///< of one instance, so that the clearest does not take all places
  bool may_render = true;   ///< else candidates go without whose views are not rendered yet
};

/// Ranks candidates of all sources on common pixels: small views of the object are aligned with
/// the image from each of them. Views are rendered when they are needed first.
///
/// Not thread-safe.
class CandidateRanking {
 public:
  /// @param backend lives longer.
  CandidateRanking(Backend* backend, std::shared_ptr<const LoadedField> field,
                   const KeyframeSearchSettings& settings);

  /// @return the best ones, best first, without those that end at the same pose as a better one.
  /// @throws std::invalid_argument for an image that is smaller than four pixels, Cancelled.
  std::vector<AlignedCandidate> rank(const Observation& observation,
                                     const PoseCandidates& candidates, const RankingLimits& limits,
                                     const CancellationToken& cancellation);

 private:
  void begin();
  std::vector<AlignedCandidate> chosen(const std::vector<AlignedCandidate>& ranked,
                                       const RankingLimits& limits) const;
  const KeyframeSet::Entry* viewFor(const Pose& T_O_C, bool may_render,
                                    const CancellationToken& cancellation);

  Backend* backend_;
  std::shared_ptr<const LoadedField> field_;
  KeyframeSearchSettings settings_;
  SameInstance is_same_instance_;
  std::unique_ptr<KeyframeAligner> aligner_;
  std::shared_ptr<ViewBank> bank_;
  std::optional<KeyframeSet> views_;  // those of the bank that were needed
  std::vector<char> is_loaded_;       // of the bank's views: whether it is in `views_`
};

}  // namespace nerf_pose_refiner
