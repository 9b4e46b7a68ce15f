// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "refinement/field_refiner.h"
#include "refinement/keyframe_search.h"
#include "refinement/view_opinion.h"
#include "views/keyframe_renderer.h"

namespace nerf_pose_refiner {

/// The further cameras of an observation, each with its keyframes, and past views of its own.
class SideViews {
  struct Camera;
  struct Found;
  struct Group;

 public:
  /// Images of further cameras that are being looked at. `waitForRenderings` and the destructor
  /// wait for them.
  class Ahead {
   public:
    explicit Ahead(std::vector<Found> sides);
    ~Ahead();
    Ahead(const Ahead&) = delete;
    Ahead& operator=(const Ahead&) = delete;

   private:
    friend class SideViews;
    std::vector<Found> sides_;      // belong to the workers until these have ended
    std::vector<Camera*> cameras_;  // whose workers look
  };

  /// What is known of the observation's own image.
  struct Own {
    Prior prior;  ///< of the search in it
    const KeyframeScores& scores;
    KeyframeSearch* search;  ///< its camera's keyframes
    /// How the object is expected to move, as the camera's twist a second (@see cameraTwist).
    Vector6 motion_per_s = Vector6::Zero();
    Ahead* ahead = nullptr;  ///< of the same observation; null: nothing has been begun
  };

  SideViews(Backend* backend, std::shared_ptr<const LoadedField> field,
            const KeyframeSearchSettings& settings)
      : backend_(backend), field_(std::move(field)), settings_(settings) {}

  /// Begins to look at the images of other cameras, where the object is expected, while the caller
  /// looks at the own image. All that is given lives longer than the result. Nothing: the model has
  /// no scale.
  std::unique_ptr<Ahead> lookAhead(const Observation& observation, const Own& own,
                                   const CancellationToken& cancellation);

  /// Joins what side views say to what the observation's own image says. Where that shows the
  /// object badly, other cameras find it from the prior.
  /// @param found of the own image, its probability by `own.scores` included.
  void join(const Observation& observation, const Own& own, const CancellationToken& cancellation,
            Refinement* found);

  /// Waits until nothing is rendered any more.
  void waitForRenderings(const CancellationToken& cancellation);

 private:
  using OfCamera = std::pair<Camera*, std::vector<std::size_t>>;  // the places of its images

  /// What was found in a past view, which does not change.
  struct Known {
    std::weak_ptr<const Observation> observation;
    HypothesisTable hypotheses;
  };

  Camera* camera(int number);
  std::vector<OfCamera> camerasOf(const Observation& observation);
  ViewOpinion opinionOf(const SideView& view, const Found& side) const;
  void report(const SideView& view, Found* side) const;
  Found expected(const SideView& view, const Own& own, const Prior& start) const;
  bool isReady(const SideView& view, const CancellationToken& cancellation, Camera* camera,
               Found* found) const;
  void look(const SideView& view, bool closely, const CancellationToken& cancellation,
            Camera* camera, Found* found) const;
  void takeAhead(bool own_sees, const CancellationToken& cancellation, Ahead* ahead,
                 std::vector<Found>* sides) const;
  void lookBack(const SideView& view, KeyframeSearch* search, const CancellationToken& cancellation,
                Found* found);
  void lookAll(const Observation& observation, bool closely, const CancellationToken& cancellation,
               std::vector<Found>* sides);
  Group begin(const Prior& prior, Refinement* found) const;
  void joinCameras(const Observation& observation, const KeyframeScores& scores,
                   const std::vector<Found>& sides, Group* group, Refinement* found) const;
  void joinPast(const Observation& observation, const std::vector<Found>& past, Group* group,
                Refinement* found) const;
  bool haveKeyframe(const View& view, const CancellationToken& cancellation, Camera* camera) const;

  Backend* backend_;
  std::shared_ptr<const LoadedField> field_;
  KeyframeSearchSettings settings_;
  std::map<int, std::shared_ptr<Camera>> cameras_;  // by SideView::camera, or -1 - place
  std::vector<Known> known_;                        // of past views that are still used
};

}  // namespace nerf_pose_refiner
