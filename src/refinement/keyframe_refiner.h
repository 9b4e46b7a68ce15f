// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "refinement/depth_fusion.h"
#include "refinement/depth_search.h"
#include "refinement/field_refiner.h"
#include "refinement/keyframe_search.h"
#include "refinement/look_alike_watch.h"
#include "refinement/rolled_scores.h"
#include "refinement/side_views.h"
#include "views/keyframe_renderer.h"

namespace nerf_pose_refiner {

/// The factor by which what is seen otherwise than by keyframes changes the odds that a pose, T_O_C
/// [model units], is right.
using PoseOdds = std::function<double(const Pose&)>;

/// Finds an object in images by keyframes: in those of a sequence each time near a pose that is
/// nearly right, while new keyframes are rendered beside that. Where images come so slowly that
/// there is time for it, keyframes are rendered where the object was found, too, and it is aligned
/// anew.
///
/// Not thread-safe. What its backend made may be used by others meanwhile, but only in turns with
/// its renderings (@see SharedBackend).
class KeyframeRefiner {
 public:
  /// @param backend lives longer. @throws std::invalid_argument for settings that are out of range.
  KeyframeRefiner(Backend* backend, std::shared_ptr<const LoadedField> field,
                  const KeyframeSearchSettings& settings);

  // Grey images are compared with grey keyframes, which are made where the first one comes.

  /// From a prior that is nearly right.
  /// @throws std::invalid_argument for an observation or a prior that makes no sense.
  Refinement follow(const TimedObservation& image, const Prior& prior,
                    const CancellationToken& cancellation = {});

  /// From a wide prior; waits for keyframes where there are none. @throws as `follow`.
  /// @param candidates poses within the prior that were found otherwise: they join its hypotheses
  /// [model units], best first.
  Refinement find(const TimedObservation& image, const Prior& prior,
                  const CancellationToken& cancellation = {},
                  const std::vector<Pose>& candidates_T_O_C = {});

  /// The same where an object was lost and another image comes soon: from fewer starts, others in
  /// each image, and no keyframe is rendered unless those that there are, or a small view where
  /// none of them reaches, lead to a pose that may be right.
  Refinement findAgain(const TimedObservation& image, const Prior& prior,
                       const CancellationToken& cancellation = {});

  /// From poses that were found otherwise and are nearly right if one is; renders keyframes there.
  /// @param rough_T_O_C of one place in the image, one at least. @param odds also of the poses that
  /// alignment leads to; nothing: all alike. @param least_probability a pose that is less likely
  /// right once it is aligned is given up, @see kHopelessProbability. @throws as `follow`.
  Refinement settle(const TimedObservation& image, const std::vector<Pose>& rough_T_O_C,
                    const PoseOdds& odds, const CancellationToken& cancellation = {},
                    double least_probability = 0);

  /// Judges poses by these scores, in place of the object's own.
  void use(const KeyframeScores& scores);

  /// Watches over what the object may be taken for, in place of its own LookAlikes.
  void use(const LookAlikes& look_alikes);

  /// Renders now what the first `find` would have to wait for. @throws Cancelled.
  void prepare(const CancellationToken& cancellation) { search_->prepare(cancellation); }

  /// Waits until nothing is rendered any more, so that the field is free for others until an image
  /// is followed.
  void waitForRenderings(const CancellationToken& cancellation);

 private:
  /// Where the object is expected, and what speaks for that beside the image.
  struct Expectation {
    Prior prior;
    double odds = 1;          // of a pose within the prior
    bool is_search = true;    // it is looked for; false: it is followed from image to image
    bool is_settled = false;  // keyframes are rendered where it is found
  };
  static Expectation expectedAnywhere(const Pose& T_O_C);

  Refinement refine(const TimedObservation& image, const Expectation& expected,
                    const std::function<HypothesisTable()>& search,
                    const CancellationToken& cancellation);
  /// How a wide prior is searched.
  struct WideSearch {
    std::vector<Pose> candidates_T_O_C;
    WideStarts starts;
    bool is_glance;  // keyframes are rendered only where those that there are give some hope
  };

  Refinement find(const TimedObservation& image, const Prior& prior, const WideSearch& how,
                  const CancellationToken& cancellation);
  HypothesisTable foundWidely(const Observation& observation, const Prior& prior,
                              const WideSearch& how, const CancellationToken& cancellation);
  HypothesisTable foundFrom(const Observation& observation, const Prior& prior,
                            const WideSearch& how, const CancellationToken& cancellation);
  HypothesisTable foundFurther(const Observation& observation, const Prior& prior,
                               const WideSearch& how, const HypothesisTable& before,
                               const CancellationToken& cancellation);
  bool mayBeRight(const Hypothesis& found) const;
  Refinement refineByDepth(const TimedObservation& image, const Expectation& expected,
                           const std::function<std::vector<DepthFit>()>& search);
  Refinement findByDepth(const TimedObservation& image, const Expectation& hint,
                         const CancellationToken& cancellation);
  Refinement followByDepth(const TimedObservation& image, const Expectation& near,
                           const CancellationToken& cancellation);
  Refinement concludeByDepth(const DepthImage& depth, const std::vector<DepthFit>& fits,
                             const Expectation& expected);
  void considerDepth(const TimedObservation& image, Refinement* found);
  std::optional<Observation> withoutOccluders(const Observation& observation, const Prior& near);
  void startFromDepth(const TimedObservation& image, const Expectation& expected,
                      const CancellationToken& cancellation, Refinement* found);
  void lookPastOccluders(const TimedObservation& image, const Expectation& expected,
                         const CancellationToken& cancellation, Refinement* found);
  std::optional<double> sinceLast_s(std::int64_t stamp_ns) const;
  Vector6 motionTo(std::int64_t stamp_ns, const Pose& T_O_C) const;
  Vector6 motionBefore(std::int64_t stamp_ns) const;
  void remember(std::int64_t stamp_ns, const Pose& T_O_C);
  void begin();
  void noteKind(const Observation& observation);
  void adaptTo(const Observation& observation);
  void takeRenewal(std::int64_t stamp_ns, const CancellationToken& cancellation);
  void makeAt(const Camera& camera, const std::vector<Pose>& poses_T_O_C,
              const CancellationToken& cancellation);
  void renewFor(const View& view, std::int64_t stamp_ns);
  HypothesisTable withoutMistake(const Observation& observation, const HypothesisTable& found,
                                 const Prior& prior, const CancellationToken& cancellation);
  HypothesisTable followed(const TimedObservation& image, const Prior& prior,
                           const CancellationToken& cancellation);
  HypothesisTable corrected(const Observation& observation, const HypothesisTable& found,
                            const Pose& motion, const CancellationToken& cancellation);
  std::shared_ptr<const KeyframePoints> keyframeBeside(const Pose& T_O_C);
  bool isUnhurried(const TimedObservation& image) const;
  HypothesisTable alignedInOwnPlace(const Observation& observation, const HypothesisTable& found,
                                    const CancellationToken& cancellation);
  HypothesisTable watched(const TimedObservation& image, HypothesisTable found, const Prior& prior,
                          const CancellationToken& cancellation);
  bool isSure(const HypothesisTable& found, double odds) const;
  void holdTrack(const Refinement& found);
  void holdTrack(const Refinement& found, double by_image);
  Refinement conclude(const HypothesisTable& found, const Prior& prior) const;
  void judge(const TimedObservation& image, const Expectation& expected,
             const CancellationToken& cancellation, Refinement* found);
  bool isClear(const Hypothesis& found) const;
  bool isClear(const HypothesisTable& found) const {
    return !found.empty() && isClear(found.front());
  }
  std::optional<double> rolledScore(const TimedObservation& image, const Hypothesis& best,
                                    const Expectation& expected,
                                    const CancellationToken& cancellation);
  double probabilityByImage(const Refinement& found) const;
  void rate(Refinement* found) const;

  Backend* backend_;
  std::shared_ptr<const LoadedField> field_;
  KeyframeSearchSettings settings_;
  KeyframeScores scores_;
  std::optional<KeyframeSearch> search_;
  std::optional<KeyframeRenderer> renderer_;
  LookAlikes look_alikes_;
  std::optional<LookAlikeWatch> watch_;  // nothing: the object is not taken for itself
  std::optional<Pose> sure_;             // of the last image that showed the object for certain
  bool was_sure_ = true;                 // that image is the last one
  std::optional<RolledScores> rolled_;
  bool is_turned_ = false;  // @see Refinement::is_turned
  double track_odds_ = 1;   // that what is followed is there, beside the image
  DepthFusion depth_;
  std::optional<DepthSearch> depth_search_;  // nothing: no image had depth alone yet
  std::optional<SideViews> side_views_;
  std::int64_t due_ns_ = 0;  // stamp from which on the keyframe under way is used
  std::optional<std::pair<std::int64_t, Pose>> last_;  // stamp and pose that were found last
  /// What was looked at last, whatever was found.
  struct LastImage {
    std::int64_t stamp_ns;
    double seconds;  // that it took
  };
  std::optional<LastImage> last_image_;
  bool by_depth_ = false;  // the last image was one of depth alone
  int again_ = 0;          // round of starts of the last glance at where it was lost
  Vector6 last_motion_ = Vector6::Zero();  // towards it, as motionTo says
};

}  // namespace nerf_pose_refiner
