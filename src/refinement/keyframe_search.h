// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "refinement/field_refiner.h"
#include "refinement/keyframe_set.h"
#include "refinement/keyframe_settings.h"
#include "views/view_bank.h"

namespace nerf_pose_refiner {

/// What another keyframe says of a pose.
struct SecondOpinion {
  Pose T_O_C;                 ///< where it is aligned
  double beside_rad = 0;      ///< how far beside the pose it was rendered, @see ViewDistance
  double own_beside_rad = 0;  ///< the same of the nearest keyframe
};

/// Where a wide search begins, and how much of that goes on.
struct WideStarts {
  int count = 256;    ///< @see posesAround
  int round = 0;      ///< likewise
  int refined = 32;   ///< of them, from half the size of small views to all of it
  int finalists = 4;  ///< of those
};

/// Looks for an object in an image with the keyframes that there are. A hypothesis' loss is 1 less
/// its score; of `around` alone it is the mean over the points of its small view.
class KeyframeSearch {
 public:
  KeyframeSearch(Backend* backend, const std::shared_ptr<const LoadedField>& field,
                 const KeyframeSearchSettings& settings);

  /// Poses that score less are doubtful: `near` and `close` then look further.
  void setDoubtful(double score) { doubtful_score_ = score; }
  /// Whether what was found near a prior may well be wrong.
  bool isDoubtful(const HypothesisTable& found) const;

  void add(std::shared_ptr<const KeyframePoints> keyframe) { kept_.add(std::move(keyframe)); }

  /// @see KeyframeAligner::expect
  void expect(const std::shared_ptr<const KeyframePoints>& keyframe) { aligner_->expect(keyframe); }

  /// Renders all small views now, which `around` does on first use of each. @throws Cancelled.
  void prepare(const CancellationToken& cancellation);

  /// How far the nearest keyframe is that can be aligned from a pose; null: there is none.
  std::optional<ViewDistance> distanceOfNearest(const Pose& T_O_C);

  /// The nearest keyframe that can be aligned from a pose; null: there is none.
  std::shared_ptr<const KeyframePoints> nearestTo(const Pose& T_O_C);

  /// Aligns the nearest keyframe from a prior that is nearly right: finely, then from coarse on if
  /// what is found is doubtful, then more widely. @return best first; empty without a keyframe.
  HypothesisTable near(const Observation& observation, const Prior& prior,
                       const CancellationToken& cancellation);

  /// The same from a pose that another image shows, but never widely.
  HypothesisTable close(const Observation& observation, const Pose& T_O_C,
                        const CancellationToken& cancellation);

  /// Looks everywhere in a wide prior with small views of the object. @return poses
  /// that are nearly right, if one is; first those of the least loss, then those that score most.
  HypothesisTable around(const Observation& observation, const Prior& prior,
                         const WideStarts& starts, const CancellationToken& cancellation);

  /// Aligns the nearest keyframe from each of some poses. @return best first.
  HypothesisTable from(const Observation& observation, const HypothesisTable& poses,
                       const CancellationToken& cancellation);

  /// Where another keyframe than the nearest one ends, some degrees beside a pose that was found in
  /// the image that was looked at last. It starts from a little nearer than that pose; on a
  /// processor that aligns both at once, `near` has aligned it already, from a little nearer than
  /// its prior. Where both end apart, what they show does not stay on the object as it turns (the
  /// shading of a bottle, say), or the image does not fix the pose (an outline before something as
  /// dark).
  /// @return nothing: there is no other one in reach, it explains the image badly, or what was
  /// looked at last does not contain the object there.
  std::optional<SecondOpinion> secondOpinion(const Hypothesis& found,
                                             const CancellationToken& cancellation);

  /// Looks for a better pose beside the best one that was found: where an object is plain or partly
  /// hidden, alignment may end 10 degrees beside it.
  /// @param found best first. @return with those beside, whose places say how far the best one may
  /// be off; best first, without equal ones.
  HypothesisTable withBeside(const Observation& observation, const HypothesisTable& found,
                             const CancellationToken& cancellation);

  /// Aligns the keyframe that is nearest to a pose from starts around the same place.
  /// @return in the order of the starts; empty without a keyframe.
  HypothesisTable alignNearest(const Observation& observation, const Pose& T_O_C,
                               const std::vector<Pose>& starts_T_O_C,
                               const CancellationToken& cancellation);

 private:
  /// Of the image that was looked at last.
  struct LookedAt {
    Camera camera;
    PixelWindow pixels;
  };
  /// A keyframe some degrees beside, aligned with that image.
  struct Other {
    std::shared_ptr<const KeyframePoints> keyframe;
    Hypothesis says;
  };

  void lookAt(const Observation& observation, const FrameWindow& window);
  void lookAround(const Observation& observation, const KeyframePoints& keyframe, const Pose& T_O_C,
                  double margin);
  bool sees(const KeyframePoints& keyframe, const Pose& T_O_C) const;
  Pose nearerThan(const Pose& T_O_C) const;
  HypothesisTable alignWithOther(const KeyframeSet::Entry& nearest, const Pose& T_O_C,
                                 const CancellationToken& cancellation);
  std::optional<Other> otherFrom(const KeyframePoints& nearest, const Pose& T_O_C,
                                 const CancellationToken& cancellation);
  void loadViews(const std::vector<int>& numbers, const CancellationToken& cancellation);
  HypothesisTable alignClosely(const std::vector<KeyframeStart>& starts,
                               const CancellationToken& cancellation);
  HypothesisTable alignToFinest(const std::vector<KeyframeStart>& starts,
                                const CancellationToken& cancellation);
  HypothesisTable widely(const Prior& prior, const CancellationToken& cancellation);
  std::vector<KeyframeStart> startsOf(const std::vector<Pose>& poses, KeyframeSet* set);

  std::shared_ptr<const LoadedField> field_;
  KeyframeSearchSettings settings_;
  double doubtful_score_;
  std::unique_ptr<KeyframeAligner> aligner_;
  LookedAt looked_at_;
  std::optional<Other> other_;  // nothing: it is aligned when it is asked for
  KeyframeSet kept_;            // as large as the object is in the images
  std::shared_ptr<ViewBank> bank_;
  KeyframeSet small_;            // those of the bank that were asked for
  std::vector<char> is_loaded_;  // of the bank's views: whether it is in `small_`
};

}  // namespace nerf_pose_refiner
