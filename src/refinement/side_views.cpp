// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/side_views.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "concurrency/parallel.h"
#include "concurrency/worker.h"
#include "field/object_frame.h"
#include "math/angle.h"
#include "refinement/grey_image.h"
#include "refinement/plan.h"
#include "refinement/pose_probability.h"

namespace nerf_pose_refiner {
namespace {

// Of six unknowns: one in a thousand is farther away [standard deviations].
constexpr double kMaxApart = 4.74;
constexpr double kNear_rad = 5 * kDegree, kNear = 0.05;  // where others look; [diameters]
constexpr double kMinScore = 0.35;  // of keyframes: what explains an image worse has no say
constexpr double kUnsteady = 0.3;   // of a motion, from one image to the next

bool isPast(const SideView& view) { return view.camera == 0; }

double explained(const Refinement& found) {
  return found.hypotheses.empty() ? 0 : found.hypotheses.front().score;
}

/// Takes an opinion in, unless it is too far from what is there. @return whether it did.
bool takeIn(const ViewOpinion& opinion, std::vector<ViewOpinion>* opinions, double* away) {
  *away = opinions->empty() ? 0 : apart(joined(*opinions), opinion);
  if (!(*away < kMaxApart)) return false;
  opinions->push_back(opinion);
  return true;
}

std::string contradiction(double away, const char* advice) {
  char text[120];
  std::snprintf(text, sizeof text, "it shows another pose, %.1f standard deviations away: %s", away,
                advice);
  return text;
}

}  // namespace

/// A camera's keyframes, and what renders them.
struct SideViews::Camera {
  Camera(Backend* backend, const std::shared_ptr<const LoadedField>& field,
         const KeyframeSearchSettings& settings)
      : search(backend, field, settings),
        renderer(field, settings.keyframe,
                 [this](const auto& keyframe) { search.expect(keyframe); }) {}

  /// Waits until its worker looks no more; search and renderer are the caller's then.
  void waitForWorker(const CancellationToken& cancellation) {
    if (worker.busy()) worker.wait(cancellation);
  }

  KeyframeSearch search;
  KeyframeRenderer renderer;
  Worker worker;  // looks ahead
};

/// What one of them says.
struct SideViews::Found {
  SideViewReport report;
  HypothesisTable hypotheses;  // empty: nothing
  Prior prior;
  Vector6 unsteady = Vector6::Zero();  // how far the object may have moved otherwise than expected
};

/// What was found so far.
struct SideViews::Group {
  Prior start;
  std::vector<ViewOpinion> opinions;
  double probability = 0;
};

SideViews::Ahead::Ahead(std::vector<Found> sides) : sides_(std::move(sides)) {}

SideViews::Ahead::~Ahead() {
  for (Camera* const camera : cameras_) {
    try {
      camera->waitForWorker({});
    } catch (const std::exception&) {  // the results are discarded
    }
  }
}

void SideViews::waitForRenderings(const CancellationToken& cancellation) {
  for (const auto& [number, camera] : cameras_) {
    camera->waitForWorker(cancellation);
    if (camera->renderer.busy()) camera->search.add(camera->renderer.wait(cancellation));
  }
}

/// Makes sure that there is a keyframe to align; where the nearest one is far off, asks for
/// another.
bool SideViews::haveKeyframe(const View& view, const CancellationToken& cancellation,
                             Camera* camera) const {
  if (camera->renderer.busy()) {
    const auto keyframe =
        settings_.real_time ? camera->renderer.take() : camera->renderer.wait(cancellation);
    if (keyframe) camera->search.add(keyframe);
  }
  const std::optional<ViewDistance> away = camera->search.distanceOfNearest(view.T_O_C);
  if (settings_.wantsKeyframe(away) && !camera->renderer.busy()) camera->renderer.request(view);
  if (!away) camera->search.add(camera->renderer.wait(cancellation));
  return camera->search.distanceOfNearest(view.T_O_C).has_value();
}

/// Where a side view is expected to show the object.
SideViews::Found SideViews::expected(const SideView& view, const Own& own,
                                     const Prior& start) const {
  const FieldMetadata& object = field_->field().metadata;
  Found found;
  found.prior = start;
  const Vector6 motion = (isPast(view) ? 0 : view.after_s) * own.motion_per_s;
  const Pose T_O_C = motion.isZero() ? start.T_O_C : movedBy(motion, start.T_O_C, object.centre);
  found.prior.T_O_C = T_O_C * Pose(view.T_C_V.R, view.T_C_V.t / object.metres_per_unit);
  found.unsteady = kUnsteady * motion;
  Pose T_C_V = start.T_O_C.inverse() * found.prior.T_O_C;
  T_C_V.t *= object.metres_per_unit;
  found.report.T_C_V = T_C_V;
  return found;
}

/// Whether a camera's image may show the object, and there is a keyframe to align; else says why
/// not.
bool SideViews::isReady(const SideView& view, const CancellationToken& cancellation, Camera* camera,
                        Found* found) const {
  const Observation& observation = *view.observation;
  const FieldMetadata& object = field_->field().metadata;
  const std::optional<bool> grey = isGrey(observation);
  if (grey && *grey != settings_.keyframe.grey) {
    found->report.message = "its image is grey where the others are coloured, or the reverse";
    return false;
  }
  if (!objectRegion(observation.camera, found->prior, object) ||
      !haveKeyframe({observation.camera, found->prior.T_O_C}, cancellation, camera)) {
    found->report.message = "the object is outside of its image";
    return false;
  }
  return true;
}

/// @param closely the prior is what another image shows: nothing is searched for widely.
void SideViews::look(const SideView& view, bool closely, const CancellationToken& cancellation,
                     Camera* camera, Found* found) const {
  if (!isReady(view, cancellation, camera, found)) return;
  const Observation& observation = *view.observation;
  found->hypotheses = closely ? camera->search.close(observation, found->prior.T_O_C, cancellation)
                              : camera->search.near(observation, found->prior, cancellation);
}

/// In a past view, which is looked at once.
void SideViews::lookBack(const SideView& view, KeyframeSearch* search,
                         const CancellationToken& cancellation, Found* found) {
  known_.erase(std::remove_if(known_.begin(), known_.end(),
                              [](const Known& one) { return one.observation.expired(); }),
               known_.end());
  for (const Known& one : known_) {
    if (one.observation.lock() == view.observation) {
      found->hypotheses = one.hypotheses;
      return;
    }
  }
  if (!search->distanceOfNearest(found->prior.T_O_C)) return;
  found->hypotheses = search->close(*view.observation, found->prior.T_O_C, cancellation);
  known_.push_back({view.observation, found->hypotheses});
}

/// Fills in what an image of another camera shows by itself, and what keeps it from having a say.
void SideViews::report(const SideView& view, Found* side) const {
  SideViewReport& report = side->report;
  if (!isLive(side->hypotheses)) {
    side->hypotheses.clear();
    if (report.message.empty()) report.message = "the object is not seen in its image";
    return;
  }
  const FieldMetadata& object = field_->field().metadata;
  report.score = side->hypotheses.front().score;
  side->hypotheses = nearestEquivalents(side->hypotheses, side->prior, object);
  const Pose& T_O_V = side->hypotheses.front().T_O_C;
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  const Matrix6 covariance = keyframeCovariance(side->hypotheses, side->prior, object);
  report.T_V_O = frame.objectInCamera({nearestRotation(T_O_V.R), T_O_V.t});
  report.covariance = covarianceInCamera(covariance, T_O_V, object, frame);
  if (report.score >= kMinScore) return;
  side->hypotheses.clear();
  report.message = isPast(view)
                       ? "the past image does not show the object there"
                       : "its image does not show the object as rendered: covered, perhaps";
}

/// What an image of another camera says of all cameras' motion. Of past views, without the error
/// of the present place.
ViewOpinion SideViews::opinionOf(const SideView& view, const Found& side) const {
  const FieldMetadata& object = field_->field().metadata;
  const Pose& T_O_V = side.hypotheses.front().T_O_C;
  const Matrix6 model = modelCovariance(T_O_V, object);
  Matrix6 noise = keyframeCovariance(side.hypotheses, side.prior, object);
  noise += placeCovariance(T_O_V, view.position_dev_m / object.metres_per_unit,
                           view.rotation_dev_rad, object) +
           side.unsteady * side.unsteady.transpose();
  return {cameraTwist(side.prior.T_O_C, T_O_V, object.centre), noise - model, model};
}

SideViews::Camera* SideViews::camera(int number) {
  std::shared_ptr<Camera>& camera = cameras_[number];
  if (!camera) camera = std::make_shared<Camera>(backend_, field_, settings_);
  return camera.get();
}

/// Those that images came from.
std::vector<SideViews::OfCamera> SideViews::camerasOf(const Observation& observation) {
  std::map<int, std::vector<std::size_t>> of_camera;
  for (std::size_t i = 0; i < observation.side_views.size(); ++i) {
    const int number = observation.side_views[i].camera;
    if (number != 0) of_camera[number > 0 ? number : -1 - static_cast<int>(i)].push_back(i);
  }
  std::vector<OfCamera> cameras;
  for (auto& [number, places] : of_camera) cameras.emplace_back(camera(number), std::move(places));
  return cameras;
}

std::unique_ptr<SideViews::Ahead> SideViews::lookAhead(const Observation& observation,
                                                       const Own& own,
                                                       const CancellationToken& cancellation) {
  if (!(field_->field().metadata.metres_per_unit > 0)) return nullptr;
  std::vector<Found> sides;
  for (const SideView& view : observation.side_views) {
    sides.push_back(expected(view, own, own.prior));
  }
  auto ahead = std::make_unique<Ahead>(std::move(sides));
  for (const OfCamera& one : camerasOf(observation)) {
    Camera* const camera = one.first;
    ahead->cameras_.push_back(camera);
    camera->worker.begin([this, &observation, &cancellation, one, ahead = ahead.get()] {
      for (const std::size_t i : one.second) {
        const SideView& view = observation.side_views[i];
        Found& found = ahead->sides_[i];
        if (!isReady(view, cancellation, one.first, &found)) continue;
        const Pose& T_O_V = found.prior.T_O_C;
        found.hypotheses =
            one.first->search.alignNearest(*view.observation, T_O_V, {T_O_V}, cancellation);
        if (one.first->search.isDoubtful(found.hypotheses)) found.hypotheses.clear();
      }
    });
  }
  return ahead;
}

/// Takes what was found ahead, but for what lies elsewhere than where the own image shows the
/// object.
void SideViews::takeAhead(bool own_sees, const CancellationToken& cancellation, Ahead* ahead,
                          std::vector<Found>* sides) const {
  const FieldMetadata& object = field_->field().metadata;
  for (Camera* const camera : ahead->cameras_) camera->waitForWorker(cancellation);
  for (std::size_t i = 0; i < sides->size(); ++i) {
    const HypothesisTable& found = ahead->sides_[i].hypotheses;
    Found& side = (*sides)[i];
    if (found.empty()) continue;
    const bool is_there = distanceFromPrior(found.front().T_O_C, side.prior, object) <= 1;
    if (is_there || !own_sees) side.hypotheses = found;
  }
}

/// Looks at those images of other cameras in which nothing has been found ahead, side by side where
/// they have cameras of their own.
void SideViews::lookAll(const Observation& observation, bool closely,
                        const CancellationToken& cancellation, std::vector<Found>* sides) {
  const std::vector<OfCamera> jobs = camerasOf(observation);
  parallelFor(threadCount(0), static_cast<int>(jobs.size()), [&](int job) {
    for (const std::size_t i : jobs[job].second) {
      Found& side = (*sides)[i];
      if (!side.hypotheses.empty()) continue;
      look(observation.side_views[i], closely, cancellation, jobs[job].first, &side);
    }
  });
}

/// Joins past views. They share the error of the present place, and speak of the object only where
/// a present image shows it.
void SideViews::joinPast(const Observation& observation, const std::vector<Found>& past,
                         Group* group, Refinement* found) const {
  const FieldMetadata& object = field_->field().metadata;
  std::vector<ViewOpinion> opinions;
  std::vector<std::size_t> members;
  const SideView* newest = nullptr;
  for (std::size_t i = 0; i < past.size(); ++i) {
    const SideView& view = observation.side_views[i];
    if (!isPast(view) || past[i].hypotheses.empty()) continue;
    SideViewReport& report = found->side_views[i];
    if (takeIn(opinionOf(view, past[i]), &opinions, &report.apart)) {
      members.push_back(i);
      if (newest == nullptr || view.after_s > newest->after_s) newest = &view;
    } else {
      report.message = contradiction(report.apart, "the object was moved, or the camera's place");
    }
  }
  if (members.empty()) return;
  ViewOpinion together = joined(opinions);
  together.noise += placeCovariance(found->T_O_C, newest->position_dev_m / object.metres_per_unit,
                                    newest->rotation_dev_rad, object);
  double away = 0;
  const bool seen = !group->opinions.empty();
  const bool used = seen && takeIn(together, &group->opinions, &away);
  for (const std::size_t i : members) {
    found->side_views[i].apart = away;
    found->side_views[i].used = used;
    if (used) continue;
    found->side_views[i].message =
        seen ? contradiction(away, "the object was moved since") : "no present image shows it";
  }
}

/// Joins other cameras.
void SideViews::joinCameras(const Observation& observation, const KeyframeScores& scores,
                            const std::vector<Found>& sides, Group* group,
                            Refinement* found) const {
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const SideView& view = observation.side_views[i];
    SideViewReport& report = found->side_views[i] = sides[i].report;
    if (isPast(view) || sides[i].hypotheses.empty()) continue;
    report.used = takeIn(opinionOf(view, sides[i]), &group->opinions, &report.apart);
    if (!report.used) {
      report.message = contradiction(report.apart, "check its place and stamp");
      continue;
    }
    group->probability = std::max(group->probability, scoreProbability(report.score, scores));
    if (group->opinions.size() > 1) continue;
    found->hypotheses = {sides[i].hypotheses.front()};
    found->rolled_score.reset();  // which was of the own image
    found->visible_fraction = sides[i].hypotheses.front().visible_fraction;
  }
}

/// What the observation's own image says, if anything.
SideViews::Group SideViews::begin(const Prior& prior, Refinement* found) const {
  const FieldMetadata& object = field_->field().metadata;
  Group group;
  group.start = prior;
  if (found->outcome != Outcome::kRefined || explained(*found) < kMinScore) return group;
  group.start.T_O_C = found->T_O_C;
  group.start.rotation_rad = std::min(prior.rotation_rad, kNear_rad);
  group.start.translation = std::min(prior.translation, kNear);
  const Matrix6 model = modelCovariance(found->T_O_C, object);
  group.opinions.push_back({Vector6::Zero(), found->covariance - model, model});
  group.probability = *found->found_probability;
  found->own = LonePose{found->T_O_C, found->covariance};
  return group;
}

void SideViews::join(const Observation& observation, const Own& own,
                     const CancellationToken& cancellation, Refinement* found) {
  const FieldMetadata& object = field_->field().metadata;
  found->side_views.assign(observation.side_views.size(), {});
  if (!(object.metres_per_unit > 0)) {
    for (SideViewReport& report : found->side_views) {
      report.message = "the model has no scale, so the distance of cameras means nothing to it";
    }
    return;
  }
  Group group = begin(own.prior, found);
  const bool own_sees = !group.opinions.empty();
  std::vector<Found> sides;
  for (const SideView& view : observation.side_views) {
    sides.push_back(expected(view, own, group.start));
  }
  if (own.ahead != nullptr) takeAhead(own_sees, cancellation, own.ahead, &sides);
  lookAll(observation, own_sees, cancellation, &sides);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const SideView& view = observation.side_views[i];
    if (isPast(view)) lookBack(view, own.search, cancellation, &sides[i]);
    report(view, &sides[i]);
  }
  joinCameras(observation, own.scores, sides, &group, found);
  joinPast(observation, sides, &group, found);
  if (group.opinions.size() == (own_sees ? 1 : 0)) return;
  const ViewOpinion all = joined(group.opinions);
  found->outcome = Outcome::kRefined;
  found->T_O_C = movedBy(all.twist, group.start.T_O_C, object.centre);
  found->hypotheses.front().T_O_C = found->T_O_C;
  found->covariance = all.noise + all.model;
  found->found_probability = group.probability;
}

}  // namespace nerf_pose_refiner
