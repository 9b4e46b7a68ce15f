// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tools/bag_evaluation.h"

#include <stdexcept>

#include "evaluation/start.h"
#include "field/object_frame.h"
#include "tracking/prediction.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kRadPerDegree = 0.017453292519943295769;

RefinerSettings presetWithSeed(const std::string& name, std::uint64_t seed) {
  RefinerSettings settings = RefinerSettings::named(name);
  settings.seed = seed;
  return settings;
}

void require(bool holds, const char* name, double value, const char* range) {
  if (!holds) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) + ", must be " +
                                range);
  }
}

}  // namespace

const char* outcomeText(Outcome outcome) {
  switch (outcome) {
    case Outcome::kRefined:
      return "refined";
    case Outcome::kNoOverlap:
      return "no overlap";
    case Outcome::kDiverged:
      return "diverged";
    case Outcome::kCancelled:
      break;
  }
  return "stopped";
}

void BagEvaluationSettings::validate() const {
  require(every >= 1, "every", every, "1 or more");
  require(first >= 0, "first", first, "0 or more");
  require(most >= 0, "most", most, "0 (all) or more");
  require(points >= 1, "points", points, "1 or more");
  require(start_max_age_s >= 0, "start_max_age_s", start_max_age_s, "0 or more");
  require(rules.trust_score >= 0 && rules.trust_score <= 1, "trust_score", rules.trust_score,
          "0..1");
  require(rules.min_score >= 0 && rules.min_score <= rules.trust_score, "min_score",
          rules.min_score, "0..trust_score");
  require(rules.max_failures >= 0, "max_failures", rules.max_failures, "0 or more");
}

BagEvaluation::BagEvaluation(const BagSequence& bag, std::shared_ptr<Backend> backend,
                             std::shared_ptr<const Field> field,
                             const BagEvaluationSettings& settings)
    : bag_(bag),
      settings_(settings),
      backend_(std::move(backend)),
      wide_(backend_, presetWithSeed(settings.preset, settings.seed)),
      narrow_(backend_, presetWithSeed(settings.track_preset, settings.seed)),
      input_(settings.image_is_rectified) {
  settings_.validate();
  if (!(field->metadata.metres_per_unit > 0)) {
    throw std::invalid_argument("the model '" + field->metadata.name +
                                "' does not know its scale: train it with --metres-per-unit");
  }
  field_ = backend_->load(std::move(field));
}

BagEvaluationResult BagEvaluation::run(const std::function<void(const EvaluatedFrame&)>& progress,
                                       const CancellationToken& stop) {
  const FieldMetadata& metadata = field_->field().metadata;
  const ObjectFrame frame = ObjectFrame::inMetres(metadata);
  std::vector<Eigen::Vector3d> points =
      surfacePoints(*field_, settings_.points, settings_.seed, stop);
  for (Eigen::Vector3d& point : points) point = frame.point(point);
  result_ = {};
  result_.points = static_cast<int>(points.size());
  const double unit_m = frame.lengthPerUnit();
  object_.emplace(EvaluatedObject{
      ModelPoints(std::move(points)), frame.point(metadata.centre), unit_m * metadata.diameter,
      metadata.symmetries.inFrame(metadata.T_O_U.inverse()).scaled(unit_m)});
  followed_.clear();
  failures_ = 0;
  int looked_at = 0;
  for (int i = settings_.first; i < bag_.size(); i += settings_.every) {
    if (settings_.most > 0 && looked_at++ == settings_.most) break;
    stop.check();
    const std::size_t before = result_.frames.size();
    evaluate(bag_.frame(i), stop);
    if (progress && result_.frames.size() > before) progress(result_.frames.back());
  }
  return result_;
}

void BagEvaluation::evaluate(const BagFrame& frame, const CancellationToken& stop) {
  const std_msgs::Header& header = frame.image->header;
  Pose true_T_C_U;
  std::optional<Start> start;
  const char* missing = "no true pose at the image's time";
  try {
    true_T_C_U = bag_.truth(header.frame_id, header.stamp);
    missing = "no transform to the initial pose";
    start = startOf(frame, true_T_C_U);
  } catch (const std::runtime_error&) {
    ++result_.skipped[missing];
    return;
  }
  if (!start) {
    ++result_.skipped["no initial pose"];
    return;
  }
  Observation observation;
  try {
    observation = input_.observe(*frame.image, *frame.info, {frame.mask, nullptr});
  } catch (const std::exception& e) {
    throw std::runtime_error(bag_.topics().image + ", frame " + std::to_string(frame.index) + ": " +
                             e.what());
  }
  result_.masked += observation.background == Background::kMask;

  const ObjectFrame object_frame = ObjectFrame::inMetres(field_->field().metadata);
  const Prior prior = priorFrom(*start);
  const Refinement refinement =
      (start->from_last ? narrow_ : wide_).refine(*field_, observation, prior, stop);
  stop.check();
  EvaluatedFrame evaluated;
  evaluated.index = frame.index;
  evaluated.stamp_ns = header.stamp.toNSec();
  evaluated.outcome = outcomeText(refinement.outcome);
  evaluated.from_last = start->from_last;
  evaluated.score = refinement.score;
  evaluated.latency_s = refinement.seconds;
  const Pose truth = true_T_C_U.inverse();
  const Pose start_T_C_U = object_frame.objectInCamera(prior.T_O_C);
  evaluated.start = object_->compare(start_T_C_U.inverse(), truth, observation.camera);
  if (refinement.outcome == Outcome::kRefined) {
    evaluated.T_C_U = object_frame.objectInCamera(refinement.T_O_C);
    evaluated.found = object_->compare(evaluated.T_C_U.inverse(), truth, observation.camera);
    const TrackingRules& rules = settings_.rules;
    evaluated.trusted =
        refinement.score >= (start->from_last ? rules.min_score : rules.trust_score);
  }
  remember(evaluated);
  result_.frames.push_back(evaluated);
}

std::optional<BagEvaluation::Start> BagEvaluation::startOf(const BagFrame& frame,
                                                           const Pose& true_T_C_U) {
  if (!followed_.empty()) return startFromLast(frame.image->header.stamp.toNSec());
  if (settings_.start == StartMode::kRecorded) {
    const std_msgs::Header& header = frame.image->header;
    const std::optional<Pose> recorded =
        bag_.initialPose(header.frame_id, header.stamp, settings_.start_max_age_s);
    if (!recorded) return std::nullopt;
    return Start{*recorded, false};
  }
  const StartSpread spread = {settings_.start_rotation_deg * kRadPerDegree,
                              settings_.start_translation * object_->diameter_m, true};
  const Pose wrong = perturbedStart(true_T_C_U.inverse(), spread, object_->centre_m, settings_.seed,
                                    static_cast<std::uint64_t>(frame.index));
  return Start{wrong.inverse(), false};
}

BagEvaluation::Start BagEvaluation::startFromLast(std::uint64_t stamp_ns) const {
  const EvaluatedFrame &last = followed_.back(), &before = followed_.front();
  const bool in_order = before.stamp_ns < last.stamp_ns && last.stamp_ns < stamp_ns;
  if (!in_order || failures_ > 0 || !settings_.rules.predict) return {last.T_C_U, true};
  const double time_ratio = static_cast<double>(stamp_ns - last.stamp_ns) /
                            static_cast<double>(last.stamp_ns - before.stamp_ns);
  return {last.T_C_U, true, before.T_C_U, time_ratio};
}

Prior BagEvaluation::priorFrom(const Start& start) const {
  const FieldMetadata& object = field_->field().metadata;
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  Prior prior;
  prior.T_O_C = frame.cameraInModel(start.T_C_U);
  prior.rotation_rad = kRadPerDegree * (start.from_last ? settings_.track_rotation_deg
                                                        : settings_.search_rotation_deg);
  prior.translation = start.from_last ? settings_.track_translation : settings_.search_translation;
  if (!start.T_C_U_before) return prior;
  return predictConstantVelocity(prior, frame.cameraInModel(*start.T_C_U_before), start.time_ratio,
                                 object);
}

/// The rules of following are the node's: a few untrusted images are bridged from the last trusted
/// pose, then the search starts anew.
void BagEvaluation::remember(const EvaluatedFrame& frame) {
  if (!settings_.track) return;
  if (frame.trusted) {
    if (followed_.size() == 2) followed_.erase(followed_.begin());
    followed_.push_back(frame);
    failures_ = 0;
  } else if (++failures_ > settings_.rules.max_failures) {
    followed_.clear();
  }
}

}  // namespace nerf_pose_refiner
