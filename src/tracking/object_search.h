// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "detection/object_detector.h"
#include "refinement/field_refiner.h"
#include "refinement/keyframe_refiner.h"
#include "views/view_bank_filler.h"

namespace nerf_pose_refiner {

/// An image, and the pose around which to search for the object.
struct SearchRequest {
  const Observation& observation;
  Prior prior;
  bool tracked = false;       ///< the prior is the pose in the image before
  std::int64_t stamp_ns = 0;  ///< time of the image
  bool recovering = false;    ///< the prior is where the object was lost
};

/// Finds the object in an image. An interface, so that tests can replace it. Not thread-safe.
class ObjectSearch {
 public:
  virtual ~ObjectSearch() = default;

  /// Sets the object to search for.
  virtual void use(std::shared_ptr<const Field> field) = 0;

  /// Replaces the settings of what renders the field. Keyframes keep those that they began with.
  virtual void configure(const RefinerSettings& initial, const RefinerSettings& tracking) = 0;

  virtual Refinement search(const SearchRequest& request,
                            const CancellationToken& cancellation) = 0;

  /// The best instance of the object in the whole image.
  /// @param trust_score a pose that is less likely right is none, 0..1.
  virtual Refinement detect(const Observation& observation, double trust_score,
                            const CancellationToken& cancellation) = 0;
};

/// The right to use a processor that several users share. Destruction gives it up.
class ProcessorTurn {
 public:
  virtual ~ProcessorTurn() = default;
};

/// The processor to search with.
struct SearchProcessor {
  std::shared_ptr<Backend> backend;
  /// Waits for a turn, or until the token is cancelled; empty: the processor has no other users.
  std::function<std::unique_ptr<ProcessorTurn>(const CancellationToken&)> take_turn = {};
};

/// Finds or creates a processor. Called by the thread that searches, because looking for a GPU
/// takes time.
using ProcessorFactory = std::function<SearchProcessor()>;

/// How objects are detected.
struct DetectionSetup {
  DetectionSettings settings;
  /// The file that keeps an object's landmarks; empty: they are made anew for each user of it.
  std::function<std::string(const std::shared_ptr<const Field>&)> landmarks_path = {};
  /// The object is looked for in whole images when it is lost: the small views that this needs are
  /// rendered as soon as it is tracked.
  bool is_expected = false;
};

/// Searches with a backend: widely around an initial pose, narrowly around the last one.
/// Trainings pause meanwhile, but not for tracking by keyframes, which takes a few milliseconds.
///
/// If the processor fails for good (BackendLost), the search asks for another one and goes on with
/// that.
class RefinerSearch : public ObjectSearch {
 public:
  /// @param find_processor called when the first object is set, and when its processor was lost;
  /// its backend may be used by several threads.
  RefinerSearch(ProcessorFactory find_processor, const RefinerSettings& initial,
                const RefinerSettings& tracking, DetectionSetup detection = {});

  /// A processor with memory of its own also renders at once what the first search begins with.
  void use(std::shared_ptr<const Field> field) override;
  void configure(const RefinerSettings& initial, const RefinerSettings& tracking) override;
  Refinement search(const SearchRequest& request, const CancellationToken& cancellation) override;
  /// The first time for an object, its landmarks may have to be made. From then on the small views
  /// of it that searches need are rendered beside them. An object that was tracked is looked for in
  /// parts, one in each image: by landmarks; a plain one also by templates at about its last
  /// distance, and at others.
  Refinement detect(const Observation& observation, double trust_score,
                    const CancellationToken& cancellation) override;

 private:
  /// What of detection is done with an image.
  struct DetectionPart {
    SearchArea area;
    DetectionCues cues = DetectionCues::kAll;
  };

  template <typename Call>
  Refinement onProcessor(const Call& call, bool takes_turn, const CancellationToken& cancellation);
  Refinement find(const SearchRequest& request, const CancellationToken& cancellation);
  const KeyframeScores& scores(const CancellationToken& cancellation);
  const LookAlikes& lookAlikes(const CancellationToken& cancellation);
  void beginKeyframes(const CancellationToken& cancellation);
  void prepare();
  void beginDetection(const CancellationToken& cancellation);
  DetectionPart nextPart(const Observation& observation);
  void fillViews(const Observation& observation);
  Refinement detectOnce(const Observation& observation, double trust_score,
                        const CancellationToken& cancellation);
  Refinement findByKeyframes(const SearchRequest& request, const CancellationToken& cancellation);
  Refinement surer(const Refinement& found, const SearchRequest& request,
                   const CancellationToken& cancellation);
  Refinement searchOnce(const SearchRequest& request, const CancellationToken& cancellation);
  void replaceProcessor(const std::shared_ptr<const Field>& field);
  std::vector<Pose> posesNear(const Prior& prior, const PoseCandidates& candidates) const;

  ProcessorFactory find_processor_;
  RefinerSettings initial_settings_;
  RefinerSettings tracking_settings_;
  const KeyframeSearchSettings keyframe_settings_;
  SearchProcessor processor_;
  std::optional<FieldRefiner> initial_;
  std::optional<FieldRefiner> tracking_;
  std::shared_ptr<const Field> object_;
  std::shared_ptr<const LoadedField> field_;  ///< of object_
  std::optional<KeyframeScores> scores_;      ///< of field_; nothing: not asked for yet
  std::optional<LookAlikes> look_alikes_;     ///< of field_; nothing: not asked for yet
  std::optional<KeyframeRefiner> keyframes_;  ///< of field_; created on first use
  DetectionSetup detection_;
  std::unique_ptr<ObjectDetector> detector_;  ///< of field_; null: not asked for yet
  std::optional<double> last_distance_;       ///< at which it was tracked [model units]
  int detections_ = 0;                        ///< since it was tracked, or since one by all means
  std::unique_ptr<ViewBankFiller> filler_;    ///< of the views that rank its candidates
};

}  // namespace nerf_pose_refiner
