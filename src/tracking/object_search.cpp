// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_search.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "backend/backend_lost.h"
#include "concurrency/thread_priority.h"
#include "refinement/grey_image.h"
#include "refinement/plan.h"
#include "refinement/pose_probability.h"
#include "trust/keyframe_scores.h"
#include "trust/look_alikes.h"
#include "trust/mask_agreement.h"

namespace nerf_pose_refiner {
namespace {

/// Whether a pose lies in a prior: alignment goes twice as far as its half widths.
bool isWithin(const Prior& prior, const Pose& T_O_C, const FieldMetadata& object) {
  const Vector6 away = cameraTwist(prior.T_O_C, T_O_C, object.centre).cwiseAbs();
  return away.head<3>().maxCoeff() <= 2 * prior.translation * object.diameter &&
         away.tail<3>().maxCoeff() <= 2 * prior.rotation_rad;
}

/// Where colours are needed, and there are none.
Refinement withoutColours(const std::string& message) {
  Refinement nothing;  // diverged
  nothing.depth.use = DepthUse::kRefused;
  nothing.depth.message = message;
  return nothing;
}

}  // namespace

RefinerSearch::RefinerSearch(ProcessorFactory find_processor, const RefinerSettings& initial,
                             const RefinerSettings& tracking, DetectionSetup detection)
    : find_processor_(std::move(find_processor)),
      initial_settings_(initial),
      tracking_settings_(tracking),
      keyframe_settings_(tracking.keyframes),
      detection_(std::move(detection)) {}

void RefinerSearch::use(std::shared_ptr<const Field> field) {
  if (!processor_.backend) {
    processor_ = find_processor_();
    configure(initial_settings_, tracking_settings_);
  }
  filler_.reset();
  keyframes_.reset();
  scores_.reset();
  look_alikes_.reset();
  detector_.reset();
  last_distance_.reset();
  try {
    field_ = processor_.backend->load(field);
    prepare();
  } catch (const BackendLost&) {
    replaceProcessor(field);
  }
  object_ = std::move(field);
}

/// Renders the small views at once where that takes a moment. (A CPU renders them as they are
/// needed, and models whose scores have yet to be measured wait for a search that can be
/// cancelled.)
void RefinerSearch::prepare() {
  const FieldMetadata& object = field_->field().metadata;
  const bool is_known = object.pose.keyframes.poses > 0 && object.look_alikes.measured;
  const bool is_fast = processor_.backend->info().memory_bytes > 0;
  if (!is_known || !is_fast || initial_settings_.method != Method::kKeyframes) return;
  try {
    beginKeyframes({});
    keyframes_->prepare({});
  } catch (const BackendLost&) {
    throw;
  } catch (const std::runtime_error&) {
    keyframes_.reset();  // too little memory, say: the search that needs it says so
  }
}

void RefinerSearch::configure(const RefinerSettings& initial, const RefinerSettings& tracking) {
  initial_settings_ = initial;
  tracking_settings_ = tracking;
  if (!processor_.backend) return;
  initial_.emplace(processor_.backend, initial_settings_);
  tracking_.emplace(processor_.backend, tracking_settings_);
}

/// Calls a search, again with another processor if this one is lost.
template <typename Call>
Refinement RefinerSearch::onProcessor(const Call& call, bool takes_turn,
                                      const CancellationToken& cancellation) {
  const auto in_turn = [&] {
    std::unique_ptr<ProcessorTurn> turn;
    if (takes_turn && processor_.take_turn) turn = processor_.take_turn(cancellation);
    return call();
  };
  try {
    try {
      return in_turn();
    } catch (const BackendLost&) {
      replaceProcessor(object_);
      return in_turn();
    }
  } catch (const Cancelled&) {
    Refinement nothing;
    nothing.outcome = Outcome::kCancelled;
    return nothing;
  }
}

Refinement RefinerSearch::search(const SearchRequest& request,
                                 const CancellationToken& cancellation) {
  // Following by keyframes takes a few milliseconds: a training that stopped for each image would
  // take several times as long.
  const bool takes_turn = !request.tracked || tracking_settings_.method != Method::kKeyframes;
  Refinement found =
      onProcessor([&] { return searchOnce(request, cancellation); }, takes_turn, cancellation);
  if (found.outcome == Outcome::kCancelled) found.T_O_C = request.prior.T_O_C;
  return found;
}

void RefinerSearch::replaceProcessor(const std::shared_ptr<const Field>& field) {
  SearchProcessor another = find_processor_();  // before anything is given up: it may find none
  std::shared_ptr<const LoadedField> loaded = another.backend->load(field);
  filler_.reset();
  keyframes_.reset();
  detector_.reset();
  field_ = std::move(loaded);
  processor_ = std::move(another);
  configure(initial_settings_, tracking_settings_);
}

Refinement RefinerSearch::searchOnce(const SearchRequest& request,
                                     const CancellationToken& cancellation) {
  const ViewBankFiller::Pause pause(request.tracked ? nullptr : filler_.get());
  if (request.tracked) {  // a hint may be anything: the camera in the object's centre, say
    last_distance_ = (request.prior.T_O_C.t - field_->field().metadata.centre).norm();
    detections_ = 0;
    if (detection_.is_expected && !request.observation.isDepthAlone()) {
      fillViews(request.observation);
    }
  }
  Refinement result = find(request, cancellation);
  const bool has_mask = request.observation.background == Background::kMask;
  if (has_mask && result.outcome == Outcome::kRefined) {
    if (keyframes_) keyframes_->waitForRenderings(cancellation);
    result.mask_agreement = maskAgreement(*field_, request.observation, result.T_O_C, cancellation);
  }
  return result;
}

const KeyframeScores& RefinerSearch::scores(const CancellationToken& cancellation) {
  if (!scores_) scores_ = keyframeScoresOf(processor_.backend.get(), *field_, cancellation);
  return *scores_;
}

const LookAlikes& RefinerSearch::lookAlikes(const CancellationToken& cancellation) {
  if (!look_alikes_) {
    look_alikes_ = lookAlikesOf(processor_.backend.get(), *field_, cancellation);
  }
  return *look_alikes_;
}

void RefinerSearch::beginKeyframes(const CancellationToken& cancellation) {
  // Both first: they may be cancelled, and poses are not judged without them.
  const KeyframeScores& scores = this->scores(cancellation);
  const LookAlikes& look_alikes = lookAlikes(cancellation);
  keyframes_.emplace(processor_.backend.get(), field_, keyframe_settings_);
  keyframes_->use(scores);
  keyframes_->use(look_alikes);
}

Refinement RefinerSearch::find(const SearchRequest& request,
                               const CancellationToken& cancellation) {
  const RefinerSettings& settings = request.tracked ? tracking_settings_ : initial_settings_;
  if (settings.method == Method::kKeyframes) {
    if (!keyframes_) beginKeyframes(cancellation);
    return request.tracked ? keyframes_->follow({request.observation, request.stamp_ns},
                                                request.prior, cancellation)
                           : findByKeyframes(request, cancellation);
  }
  if (request.observation.isDepthAlone()) {
    Refinement nothing =
        withoutColours("this preset compares colours; 'keyframes' takes depth alone");
    nothing.T_O_C = request.prior.T_O_C;
    return nothing;
  }
  // A rendering must end before the search begins: a processor that is not shared has no turns.
  if (keyframes_) keyframes_->waitForRenderings(cancellation);
  FieldRefiner& refiner = request.tracked ? *tracking_ : *initial_;
  Refinement found = refiner.refine(*field_, request.observation, request.prior, cancellation);
  if (request.observation.depth) {
    found.depth.use = DepthUse::kRefused;
    found.depth.message = "this preset renders the field and takes no depth; 'keyframes' does";
  }
  SideViewReport unused;
  unused.message = "this preset renders the field and takes one image; 'keyframes' takes several";
  found.side_views.assign(request.observation.side_views.size(), unused);
  return found;
}

/// Landmarks, once there are some, have their say: poses that they speak for join the search's own,
/// and what is found is the likelier the more of them agree with it. Not so where an object was
/// lost: detection hears them in other images, and this one is soon done with.
Refinement RefinerSearch::findByKeyframes(const SearchRequest& request,
                                          const CancellationToken& cancellation) {
  const TimedObservation image = {request.observation, request.stamp_ns};
  if (request.recovering) return keyframes_->findAgain(image, request.prior, cancellation);
  if (!detector_ || request.observation.isDepthAlone()) {
    return keyframes_->find(image, request.prior, cancellation);
  }
  const ImageCandidates seen = detector_->candidates(request.observation, {}, cancellation);
  Refinement found =
      keyframes_->find(image, request.prior, cancellation, posesNear(request.prior, seen.poses));
  if (found.outcome == Outcome::kCancelled) return found;
  if (seen.matched) detector_->weigh(*seen.matched, &found);
  return surer(found, request, cancellation);
}

/// Those candidates that agree with a prior.
std::vector<Pose> RefinerSearch::posesNear(const Prior& prior,
                                           const PoseCandidates& candidates) const {
  const FieldMetadata& object = field_->field().metadata;
  std::vector<Pose> near;
  for (const PoseCandidate& candidate : candidates) {
    const Pose pose = nearestEquivalent(candidate.T_O_C, prior.T_O_C, object.symmetries);
    if (isWithin(prior, pose, object)) near.push_back(pose);
  }
  return near;
}

/// What is found, or if that is not trusted what detection finds where the prior lets the object
/// be: few landmarks say little to a search, but much for a pose that they agree with.
Refinement RefinerSearch::surer(const Refinement& found, const SearchRequest& request,
                                const CancellationToken& cancellation) {
  const FieldMetadata& object = field_->field().metadata;
  const Prior& prior = request.prior;
  const double least = detection_.settings.least_score;
  if (found.outcome == Outcome::kRefined && found.score >= least) return found;
  const auto region = objectRegion(request.observation.camera, prior, object);
  if (!region) return found;
  SearchArea area;
  area.odds = kHintOdds;
  area.box = Eigen::AlignedBox2d(Eigen::Vector2d(region->x_min, region->y_min),
                                 Eigen::Vector2d(region->x_max, region->y_max));
  const double distance = (prior.T_O_C.t - object.centre).norm();
  if (prior.translation * object.diameter < (area.distance_ratio - 1) / 2 * distance) {
    area.distance = distance;
  }
  keyframes_->waitForRenderings(cancellation);
  detector_->setTrustScore(least);
  const Detections detections = detector_->detect(request.observation, area, cancellation);
  for (const Refinement& one : detections.found) {
    Refinement detected = one;
    detected.T_O_C = nearestEquivalent(one.T_O_C, prior.T_O_C, object.symmetries);
    detected.seconds = found.seconds + detections.seconds;
    if (isWithin(prior, detected.T_O_C, object)) return detected;
  }
  return found;
}

void RefinerSearch::beginDetection(const CancellationToken& cancellation) {
  const KeyframeScores& scores = this->scores(cancellation);
  const LookAlikes& look_alikes = lookAlikes(cancellation);
  const std::string path =
      detection_.landmarks_path ? detection_.landmarks_path(object_) : std::string();
  DetectionSettings settings = detection_.settings;
  settings.max_instances = 1;  // that is tracked from then on
  settings.model = settings.model.adaptedTo(processor_.backend->info());
  DetectionModel model = detectionModelFor(*field_, settings.model, path, cancellation);
  detector_ = std::make_unique<ObjectDetector>(processor_.backend.get(), field_, std::move(model),
                                               settings);
  detector_->use(scores);
  detector_->use(look_alikes);
}

/// What detection does with the next image. To look for an object by all means and at all distances
/// takes long, and what comes back meanwhile is not seen. So where it was tracked before, each
/// image has a part of that: landmarks, which take the least time, or, of a plain object, templates
/// at the distance at which it was tracked last, and at a part of all distances, in turns. What
/// such glances leave out, an image after some rounds has.
RefinerSearch::DetectionPart RefinerSearch::nextPart(const Observation& observation) {
  constexpr int kParts = 3;             // of the distances
  constexpr int kGlances = 4 * kParts;  // of a round
  constexpr int kRounds = 5;            // between two images that are looked at by all means
  constexpr double kLeastRatio = 1.05;  // where a camera leaves but one distance
  constexpr double kLeastLast = 1.4;    // about the last distance
  DetectionPart next;
  if (!last_distance_) return next;
  const int number = detections_;
  detections_ = (detections_ + 1) % (kRounds * kGlances + 1);
  if (number == kRounds * kGlances) return next;
  if (!detector_->isPlain()) {
    const bool is_first_look = number % 2 == 0, also_single = number % 8 == 7;
    next.cues = is_first_look ? DetectionCues::kFirstLook
                : also_single ? DetectionCues::kLandmarks
                              : DetectionCues::kAgreeingLandmarks;
    return next;
  }
  const bool by_landmarks = number % 2 == 0, at_last = number % 4 == 1;
  next.cues = by_landmarks ? DetectionCues::kLandmarks : DetectionCues::kTemplates;
  if (by_landmarks) return next;
  // Boxes are small, and each has its own distances: all of them take little time.
  if (!at_last && !observation.boxes.empty()) return next;
  const DistanceRange all = DistanceRange::usual(observation.camera);  // [diameters]
  const double part = std::pow(all.farthest / all.nearest, 1.0 / kParts);
  const double middle = all.nearest * std::pow(part, number / 4 % kParts + 0.5);
  const double diameter = field_->field().metadata.diameter;
  next.area.distance = at_last ? *last_distance_ : middle * diameter;
  next.area.distance_ratio = std::max(at_last ? kLeastLast : kLeastRatio, std::sqrt(part));
  return next;
}

/// Begins to render the small views of the object beside searches.
void RefinerSearch::fillViews(const Observation& observation) {
  if (filler_) return;
  ViewBankSettings bank = detection_.settings.keyframes.bank;
  bank.keyframe.grey = isGrey(observation).value_or(false);
  filler_ = std::make_unique<ViewBankFiller>(ViewBank::of(field_, bank));
}

Refinement RefinerSearch::detect(const Observation& observation, double trust_score,
                                 const CancellationToken& cancellation) {
  return onProcessor([&] { return detectOnce(observation, trust_score, cancellation); },
                     /*takes_turn=*/true, cancellation);
}

Refinement RefinerSearch::detectOnce(const Observation& observation, double trust_score,
                                     const CancellationToken& cancellation) {
  if (observation.isDepthAlone()) {
    return withoutColours("depth alone needs an initial pose: detection compares colours");
  }
  if (keyframes_) keyframes_->waitForRenderings(cancellation);
  if (!detector_) beginDetection(cancellation);
  detector_->setTrustScore(trust_score);
  const ViewBankFiller::Pause pause(filler_.get());
  const DetectionPart part = nextPart(observation);
  // Objects that are tracked meanwhile, by other threads, need their few milliseconds at once.
  const Detections detections = callInBackground(
      [&] { return detector_->detect(observation, part.area, cancellation, part.cues); });
  fillViews(observation);
  Refinement best;  // diverged
  if (!detections.found.empty()) best = detections.found.front();
  best.seconds = detections.seconds;
  return best;
}

}  // namespace nerf_pose_refiner
