// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_tracker.h"

#include <stdexcept>
#include <utility>

#include "field/object_frame.h"
#include "tracking/prior.h"

namespace nerf_pose_refiner {
namespace {

/// Each part is exact: only their sum is rounded.
double secondsOf(std::int64_t stamp_ns) {
  constexpr std::int64_t kSecond = 1000000000;
  return static_cast<double>(stamp_ns / kSecond) + 1e-9 * static_cast<double>(stamp_ns % kSecond);
}

}  // namespace

ObjectTracker::ObjectTracker(std::shared_ptr<Backend> backend, std::shared_ptr<const Field> object,
                             const TrackerSettings& settings, DetectionSetup detection)
    : ObjectTracker(std::make_unique<RefinerSearch>(
                        [backend = std::move(backend)] { return SearchProcessor{backend}; },
                        settings.initial.refiner, settings.tracking.refiner, std::move(detection)),
                    settings) {
  if (!(object->metadata.metres_per_unit > 0)) {
    throw std::invalid_argument(
        "the model '" + object->metadata.name +
        "' does not know its scale: learn it with one, or give metres_per_unit in "
        "the YAML file beside the model");
  }
  std::future<void> in_use = offerModel(std::move(object));
  applyModels();
  in_use.get();
}

ObjectTracker::ObjectTracker(std::unique_ptr<ObjectSearch> search, const TrackerSettings& settings,
                             TrackerConnections connections)
    : connections_(std::move(connections)),
      search_(std::move(search)),
      settings_(settings),
      state_(settings.rules) {
  settings_.validate();
  window_.configure(settings.window);
}

/// Called with mutex_ held.
std::uint32_t ObjectTracker::updateClock(std::int64_t now_ns) {
  if (state_.updateClock(now_ns)) {
    ++clock_jumps_;
    running_.requestCancel();
    connections_.transforms->clear();
  }
  return clock_jumps_;
}

std::uint32_t ObjectTracker::readClock() {
  // Read under the lock. Otherwise a thread that is delayed after reading would report a time older
  // than that of another thread, which looks like a jump of the clock.
  std::lock_guard<std::mutex> lock(mutex_);
  return connections_.clock_ns ? updateClock(connections_.clock_ns()) : clock_jumps_;
}

void ObjectTracker::imageArrived() {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.imageArrived();
}

void ObjectTracker::imageRefused(TrackReason reason, const std::string& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.imageRefused(reason, message);
}

void ObjectTracker::offer(const TimedPose& initial_pose) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.offer(initial_pose);
}

void ObjectTracker::refuseInitialPose(TrackReason reason, const std::string& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.refuseInitialPose(reason, message);
}

void ObjectTracker::modelIsLoading() {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.modelIsLoading();
}

void ObjectTracker::modelFailed(TrackReason reason, const std::string& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.modelFailed(reason, message);
}

std::future<void> ObjectTracker::offerModel(std::shared_ptr<const Field> field,
                                            bool same_appearance) {
  std::lock_guard<std::mutex> lock(mutex_);
  pending_models_.push_back({std::move(field), same_appearance, {}});
  if (!same_appearance) running_.requestCancel();
  return pending_models_.back().done.get_future();
}

void ObjectTracker::applyModels() {
  while (true) {
    PendingModel model;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (pending_models_.empty()) return;
      model = std::move(pending_models_.front());
      pending_models_.pop_front();
    }
    try {
      use(model);
      model.done.set_value();
    } catch (const std::exception& e) {
      modelFailed(TrackReason::kInternal, e.what());
      model.done.set_exception(std::current_exception());
    }
  }
}

void ObjectTracker::use(const PendingModel& model) {
  search_->use(model.field);
  std::lock_guard<std::mutex> lock(mutex_);
  const std::shared_ptr<const Field> before = std::exchange(field_, model.field);
  const FieldMetadata& object = field_->metadata;
  if (before && model.same_appearance &&
      before->metadata.metres_per_unit == object.metres_per_unit) {
    Pose T_U_V = before->metadata.T_O_U.inverse() * object.T_O_U;
    T_U_V.t *= object.metres_per_unit;
    state_.objectFrameMoved(T_U_V);
  } else {
    state_.modelIsReady();
  }
}

void ObjectTracker::reset() {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.reset();
  running_.requestCancel();
}

void ObjectTracker::setEnabled(bool enabled) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.setEnabled(enabled);
  if (!enabled) running_.requestCancel();
}

void ObjectTracker::change(const TrackerSettings& settings) {
  std::lock_guard<std::mutex> lock(mutex_);
  changed_ = settings;
}

void ObjectTracker::applyChange() {
  std::optional<TrackerSettings> changed;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    changed.swap(changed_);
    if (!changed) return;
    state_.setRules(changed->rules);
  }
  settings_ = *changed;
  window_.configure(settings_.window);
  search_->configure(settings_.initial.refiner, settings_.tracking.refiner);
}

void ObjectTracker::stop() {
  std::lock_guard<std::mutex> lock(mutex_);
  stopping_ = true;
  running_.requestCancel();
}

TrackStatus ObjectTracker::statusNow(const ImageStamp& at) const {
  std::lock_guard<std::mutex> lock(mutex_);
  TrackStatus status;
  static_cast<TrackCondition&>(status) = state_.condition();
  status.image = at;
  status.object = field_ ? field_->metadata.name : std::string();
  status.processed = processed_;
  return status;
}

void ObjectTracker::reportChange(const ImageStamp& at) {
  const TrackStatus status = statusNow(at);
  if (reported_ && *reported_ == status) return;
  reported_ = status;
  if (connections_.report) connections_.report(status);
}

/// The time at which an image arrives.
std::int64_t ObjectTracker::timeOfImage(std::int64_t stamp_ns) const {
  return connections_.clock_ns ? connections_.clock_ns() : stamp_ns;
}

bool ObjectTracker::needsInitialPose(std::int64_t stamp_ns) {
  std::lock_guard<std::mutex> lock(mutex_);
  updateClock(timeOfImage(stamp_ns));
  return state_.needsInitialPose(stamp_ns);
}

TrackOutcome ObjectTracker::track(TrackerImage image) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    image.clock_jumps = updateClock(timeOfImage(image.at.stamp_ns));
    state_.imageArrived();
  }
  return process(image);
}

/// Empty: the image arrived before time jumped back.
std::optional<ImageDecision> ObjectTracker::decide(const TrackerImage& image) {
  std::unique_lock<std::mutex> lock(mutex_);
  // Models that were offered before this point are used for this image. A model that is offered
  // later interrupts the refinement.
  while (!pending_models_.empty()) {
    lock.unlock();
    applyModels();
    lock.lock();
  }
  if (image.clock_jumps != clock_jumps_) return std::nullopt;
  const ImageDecision decision = state_.decide(image.at);
  if (decision.start || decision.detect) running_ = image.cancel;
  if (stopping_) image.cancel.requestCancel();
  if (decision.clock_jumped) connections_.transforms->clear();
  return decision;
}

TrackOutcome ObjectTracker::process(const TrackerImage& image) {
  TrackOutcome result;
  applyChange();
  const std::optional<ImageDecision> decision = decide(image);
  if (decision) reportChange(image.at);
  if (!decision || !(decision->start || decision->detect)) {
    static_cast<TrackStatus&>(result) = statusNow(image.at);
    return result;
  }
  result.refined = true;
  result.from_last = decision->start && decision->start->tracked;
  try {
    refine(image, *decision, &result);
  } catch (const InputError& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.notTrusted(decision->ticket, e.reason(), e.what());
  } catch (const std::exception& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.failed(decision->ticket, e.what());
  }
  ++processed_;
  concludeStatus(image.at, *decision, &result);
  return result;
}

/// Sets the status after an image, including what concerns this image only.
void ObjectTracker::concludeStatus(const ImageStamp& at, const ImageDecision& decision,
                                   TrackOutcome* result) {
  TrackStatus& status = *result;
  status = statusNow(at);
  reported_ = status;
  if (status.reason == TrackReason::kNone && decision.initial_pose_ignored) {
    status.reason = TrackReason::kPriorIgnored;
    status.message = "the object is tracked: an initial pose was ignored";
  }
  std::lock_guard<std::mutex> lock(mutex_);
  running_ = CancellationToken();
}

/// The prior of the search. Empty if the start pose cannot be used; the state then gives the
/// reason.
std::optional<Prior> ObjectTracker::prepare(const TrackerImage& image,
                                            const ImageDecision& decision) {
  const TimedPose& start = *decision.start;
  try {
    const Pose T_C_U = connections_.transforms->inCamera(start, image.at, image.cancel);
    const Prior prior = priorFrom(start, T_C_U, field_->metadata, settings_.search(start.tracked));
    return settings_.rules.predict ? expected(prior, T_C_U, image, decision) : prior;
  } catch (const InputError& e) {
    const bool from_outside = !start.tracked && !decision.recovering;
    const bool unknown_frame = e.reason() == TrackReason::kNoTransform && from_outside;
    std::lock_guard<std::mutex> lock(mutex_);
    state_.startRefused(decision.ticket, unknown_frame ? TrackReason::kPriorNoFrame : e.reason(),
                        e.what());
    return std::nullopt;
  }
}

/// The prior around where the object is expected.
/// @param T_C_U the start pose in the camera at its present place [m].
Prior ObjectTracker::expected(const Prior& start, const Pose& T_C_U, const TrackerImage& image,
                              const ImageDecision& decision) {
  const FieldMetadata& object = field_->metadata;
  const TimedPose& from = *decision.start;
  Eigen::Matrix3d R_now_last = T_C_U.R * from.T_P_U.R.transpose();
  if (!from.tracked) {
    motion_.reset();
    if (!from.covariance) return start;
    motion_.start(start, from.stamp_ns, object);
    R_now_last.setIdentity();  // the prior is along the present axes
  } else if (motion_.stampNs() != from.stamp_ns) {
    motion_.reset();  // it followed another track
  } else if (decision.after_failure) {
    motion_.forgetVelocity(object);  // the object may have stopped
  }
  const double since_s = secondsOf(image.at.stamp_ns) - secondsOf(from.stamp_ns);
  return motion_.predict(start, R_now_last, since_s, object);
}

void ObjectTracker::refine(const TrackerImage& image, const ImageDecision& decision,
                           TrackOutcome* result) {
  const bool tracked = result->from_last;
  if (decision.start) {
    result->prior = prepare(image, decision);
    if (!result->prior) return;
  }
  result->field = field_;
  auto own = std::make_shared<Observation>(image.observe(settings_.usesMask(tracked)));
  if (!tracked) window_.clear();
  window_.addTo(image.at.stamp_ns, own.get());
  result->observation = std::move(own);
  const Observation& observation = *result->observation;
  result->refinement = decision.detect
                           ? search_->detect(observation, settings_.rules.trust_score, image.cancel)
                           : search_->search({observation, *result->prior, tracked,
                                              image.at.stamp_ns, decision.recovering},
                                             image.cancel);
  conclude(decision, image.at.stamp_ns, result);
  if (result->trusted) {
    window_.learn(observation, image.at.stamp_ns, field_->metadata, result->refinement);
  }
}

/// Called with mutex_ held. @return false: the result is obsolete.
bool ObjectTracker::tell(const Judgement& judgement, std::uint64_t ticket, const Pose& T_C_U) {
  if (judgement.trusted()) return state_.trusted(ticket, T_C_U);
  if (!judgement.goes_on) return state_.notTrusted(ticket, judgement.reason, judgement.message);
  return state_.goesOn(ticket, T_C_U, judgement.reason, judgement.message, judgement.doubtful);
}

/// Fuses the pose found with the one expected. What lies between them counts as an error of both.
void ObjectTracker::fuse(TrackOutcome* result) {
  Refinement& found = result->refinement;
  const FieldMetadata& object = field_->metadata;
  if (!result->prior) motion_.reset();  // found in the whole image
  if (found.is_turned) motion_.reset();
  const Pose fused = motion_.fuse(found.T_O_C, found.covariance, object);
  const Vector6 away = cameraTwist(found.T_O_C, fused, object.centre);
  found.covariance += away * away.transpose();
  found.T_O_C = fused;
  if (!found.hypotheses.empty()) found.hypotheses.front().T_O_C = fused;
}

void ObjectTracker::conclude(const ImageDecision& decision, std::int64_t stamp_ns,
                             TrackOutcome* result) {
  const Refinement& refinement = result->refinement;
  const FieldMetadata& object = field_->metadata;
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  const Judgement judgement = judge(refinement, decision.confirmed, settings_.rules);
  const bool fuses = settings_.rules.predict && (judgement.trusted() || judgement.goes_on);
  if (fuses) fuse(result);
  const Pose T_C_U = frame.objectInCamera(refinement.T_O_C);
  bool up_to_date = false;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    if (decision.detect) state_.detectionTook(refinement.seconds);
    up_to_date = tell(judgement, decision.ticket, T_C_U);
  }
  if (fuses && up_to_date) motion_.accept(stamp_ns);
  result->score = refinement.score;
  result->found = up_to_date && refinement.outcome == Outcome::kRefined;
  result->trusted = result->found && judgement.trusted();
  if (!result->found) return;
  result->T_C_O_m = T_C_U;
  result->covariance = covarianceInCamera(refinement.covariance, refinement.T_O_C, object, frame);
}

}  // namespace nerf_pose_refiner
