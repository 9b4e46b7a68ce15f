// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/bag_evaluation.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "evaluation/start.h"
#include "field/object_frame.h"
#include "geometry/matrix6.h"
#include "math/angle.h"
#include "math/require.h"
#include "refinement/covariance.h"
#include "ros/conversions/status.h"

namespace nerf_pose_refiner {

const char* outcomeText(Outcome outcome) {
  switch (outcome) {
    case Outcome::kRefined:
      return "refined";
    case Outcome::kNoOverlap:
      return "no overlap";
    case Outcome::kBadSize:
      return "bad size";
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
  require(cameras.position_dev_m >= 0, "cameras.position_dev_m", cameras.position_dev_m,
          "0 or more");
  require(cameras.rotation_dev_deg >= 0, "cameras.rotation_dev_deg", cameras.rotation_dev_deg,
          "0 or more");
  if (window.views > 0 && !track) {
    throw std::invalid_argument("a window of past images is of an object that is tracked");
  }
  tracker().validate();
}

TrackerSettings BagEvaluationSettings::tracker() const {
  TrackerSettings settings;
  settings.initial = SearchSettings::named(preset, search_rotation_deg, search_translation);
  settings.tracking = SearchSettings::named(track_preset, track_rotation_deg, track_translation);
  settings.initial.refiner.seed = settings.tracking.refiner.seed = seed;
  settings.tracking.refiner.keyframes.real_time = false;  // images come as fast as they are read
  settings.rules = rules;
  settings.rules.once = !track;
  if (start == StartMode::kDetected) {
    constexpr double kEveryImage = 1e9;  // [Hz]
    settings.rules.start = TrackStart::kDetect;
    settings.rules.detect_rate_hz = kEveryImage;
    settings.rules.detect_share = std::numeric_limits<double>::infinity();
  }
  settings.mask_mode = MaskMode::kEveryFrame;
  settings.window = window;
  return settings;
}

BagEvaluation::BagEvaluation(const BagSequence& bag, std::shared_ptr<Backend> backend,
                             std::shared_ptr<const Field> field,
                             const BagEvaluationSettings& settings)
    : bag_(bag),
      settings_(settings),
      backend_(std::move(backend)),
      field_(std::move(field)),
      input_(settings.image_is_rectified, settings.depth),
      side_inputs_(bag.topics().cameras.size(), CameraInput(settings.cameras.are_rectified)) {
  settings_.validate();
  if (settings_.window.views > 0 && bag.topics().fixed_frame.empty()) {
    throw std::invalid_argument("a window of past images needs a fixed frame");
  }
  DetectionSetup detection;
  detection.settings.keyframes.real_time = false;
  detection.landmarks_path = [path = settings_.landmarks_path](const auto&) { return path; };
  tracker_ =
      std::make_unique<ObjectTracker>(backend_, field_, settings_.tracker(), std::move(detection));
}

BagEvaluationResult BagEvaluation::run(const std::function<void(const EvaluatedFrame&)>& progress,
                                       const CancellationToken& cancellation) {
  const FieldMetadata& metadata = field_->metadata;
  const ObjectFrame frame = ObjectFrame::inMetres(metadata);
  std::vector<Eigen::Vector3d> points =
      surfacePoints(*backend_->load(field_), settings_.points, settings_.seed, cancellation);
  for (Eigen::Vector3d& point : points) point = frame.point(point);
  result_ = {};
  result_.points = static_cast<int>(points.size());
  const double unit_m = frame.lengthPerUnit();
  object_.emplace(EvaluatedObject{
      ModelPoints(std::move(points)), frame.point(metadata.centre), unit_m * metadata.diameter,
      metadata.symmetries.inFrame(metadata.T_O_U.inverse()).scaled(unit_m)});
  tracker_->reset();
  int looked_at = 0;
  for (int i = settings_.first; i < bag_.size(); i += settings_.every) {
    if (settings_.most > 0 && looked_at++ == settings_.most) break;
    cancellation.check();
    const std::size_t before = result_.frames.size();
    evaluate(bag_.frame(i), cancellation);
    if (progress && result_.frames.size() > before) progress(result_.frames.back());
  }
  return result_;
}

void BagEvaluation::evaluate(const BagFrame& frame, const CancellationToken& cancellation) {
  const std_msgs::Header& header = frame.image->header;
  Pose true_T_C_U;
  const char* missing = "no true pose at the image's time";
  try {
    true_T_C_U = bag_.truth(header.frame_id, header.stamp);
    missing = "no transform to the initial pose";
    if (!offerStart(frame, true_T_C_U)) {
      ++result_.skipped["no initial pose"];
      return;
    }
  } catch (const std::runtime_error&) {
    ++result_.skipped[missing];
    return;
  }
  Observation observation = observe(frame);
  const bool masked = observation.background == Background::kMask;
  const auto hand_over = [&](bool) { return std::move(observation); };
  const TrackOutcome result =
      tracker_->track({imageStampOf(header), hand_over, cancellation.child()});
  cancellation.check();
  if (result.state == TrackState::kError) {
    throw std::runtime_error(bag_.topics().image + ", frame " + std::to_string(frame.index) + ": " +
                             result.message);
  }
  if (!result.refined) {
    ++result_.skipped["not newer than the image before"];
    return;
  }
  result_.masked += masked;
  count(result.refinement);
  EvaluatedFrame evaluated = compare(result, true_T_C_U);
  evaluated.index = frame.index;
  evaluated.stamp_ns = header.stamp.toNSec();
  result_.frames.push_back(evaluated);
}

/// Counts what took part in a pose, and why the rest did not.
void BagEvaluation::count(const Refinement& refinement) {
  const DepthReport& depth = refinement.depth;
  result_.with_depth += depth.use == DepthUse::kUsed;
  if (depth.use == DepthUse::kRefused) ++result_.depth_refused[depth.message];
  bool cameras = false, past = false;
  for (std::size_t i = 0; i < refinement.side_views.size(); ++i) {
    const SideViewReport& view = refinement.side_views[i];
    const bool is_past = i >= side_views_;
    cameras |= view.used && !is_past;
    past |= view.used && is_past;
    if (view.used) continue;
    ++(is_past ? result_.window_refused : result_.cameras_refused)[view.message];
  }
  result_.with_cameras += cameras;
  result_.with_window += past;
}

/// Offers the tracker an initial pose where it needs one. @return false: there is none.
bool BagEvaluation::offerStart(const BagFrame& frame, const Pose& true_T_C_U) {
  const ImageStamp at = imageStampOf(frame.image->header);
  if (!tracker_->needsInitialPose(at.stamp_ns)) return true;
  const std::optional<Pose> start_T_C_U = startOf(frame, true_T_C_U);
  if (start_T_C_U) tracker_->offer({*start_T_C_U, at.camera_frame, at.stamp_ns, false, {}});
  return start_T_C_U.has_value();
}

/// T_C_U [m] as the settings say; nothing: none was recorded.
std::optional<Pose> BagEvaluation::startOf(const BagFrame& frame, const Pose& true_T_C_U) const {
  if (settings_.start == StartMode::kRecorded) {
    const std_msgs::Header& header = frame.image->header;
    return bag_.initialPose(header.frame_id, header.stamp, settings_.start_max_age_s);
  }
  const StartSpread spread = {settings_.start_rotation_deg * kDegree,
                              settings_.start_translation * object_->diameter_m, true};
  const Pose wrong = perturbedStart(true_T_C_U.inverse(), spread, object_->centre_m, settings_.seed,
                                    static_cast<std::uint64_t>(frame.index));
  return wrong.inverse();
}

namespace {

/// Why a companion has no image.
std::string whyNone(const Companion& companion) {
  return companion.why_none.empty() ? "no image near in time" : companion.why_none;
}

}  // namespace

Observation BagEvaluation::observe(const BagFrame& frame) {
  side_views_ = 0;
  try {
    Observation observation = input_.observe(frame.image, *frame.info, {frame.mask, nullptr});
    if (observation.isDepthAlone()) return observation;
    if (frame.depth.image) {
      observation.depth =
          depthFromMessage(frame.depth.image, *frame.depth.info, frame.T_C_D, settings_.depth);
    } else if (!bag_.topics().depth.empty()) {
      ++result_.depth_refused[whyNone(frame.depth)];
    }
    if (settings_.window.views > 0) {
      observation.T_W_C =
          bag_.cameraInFixed(frame.image->header.frame_id, frame.image->header.stamp);
    }
    addSideViews(frame, &observation);
    return observation;
  } catch (const std::exception& e) {
    throw std::runtime_error(bag_.topics().image + ", frame " + std::to_string(frame.index) + ": " +
                             e.what());
  }
}

void BagEvaluation::addSideViews(const BagFrame& frame, Observation* observation) {
  for (std::size_t i = 0; i < frame.side_views.size(); ++i) {
    const BagSideView& seen = frame.side_views[i];
    if (!seen.image) {
      ++result_.cameras_refused[whyNone(seen)];
      continue;
    }
    SideView view;
    view.T_C_V = seen.T_C_V;
    view.after_s = (seen.image->header.stamp - frame.image->header.stamp).toSec();
    view.camera = static_cast<int>(i) + 1;
    view.position_dev_m = settings_.cameras.position_dev_m;
    view.rotation_dev_rad = settings_.cameras.rotation_dev_deg * kDegree;
    view.observation =
        std::make_shared<const Observation>(side_inputs_[i].observe(seen.image, *seen.info));
    observation->side_views.push_back(std::move(view));
  }
  side_views_ = observation->side_views.size();
}

/// How the error of a pose agrees with its covariance.
void BagEvaluation::compareWithCovariance(const Refinement& found, const Pose& true_T_C_U,
                                          EvaluatedFrame* evaluated) const {
  const FieldMetadata& object = field_->metadata;
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  // The covariance is along the axes of the pose that was found, so the truth is turned to it.
  const Pose truth =
      nearestEquivalent(frame.cameraInModel(true_T_C_U), found.T_O_C, object.symmetries);
  const Vector6 error = cameraTwist(found.T_O_C, truth, object.centre);
  const double normalised = squaredDistance(error, found.covariance) / 6;
  if (std::isfinite(normalised)) evaluated->normalised_error = normalised;
  const Eigen::Vector3d sight = (truth.inverse() * object.centre).normalized();
  const Matrix6 of_centre =
      covarianceInCamera(found.covariance, found.T_O_C, object.centre, object.centre);
  const double variance = sight.dot(of_centre.topLeftCorner<3, 3>() * sight);
  if (variance > 0) evaluated->along_dev_m = frame.lengthPerUnit() * std::sqrt(variance);
}

EvaluatedFrame BagEvaluation::compare(const TrackOutcome& result, const Pose& true_T_C_U) const {
  const Camera& camera = result.observation->camera;
  const Pose truth = true_T_C_U.inverse();
  EvaluatedFrame evaluated;
  evaluated.outcome = outcomeText(result.refinement.outcome);
  evaluated.from_last = result.from_last;
  evaluated.trusted = result.trusted;
  evaluated.score = result.refinement.score;
  evaluated.latency_s = result.refinement.seconds;
  if (result.prior) {
    const Pose start_T_C_U =
        ObjectFrame::inMetres(field_->metadata).objectInCamera(result.prior->T_O_C);
    evaluated.start = object_->compare(start_T_C_U.inverse(), truth, camera);
  }
  if (result.found) {
    evaluated.T_C_U = result.T_C_O_m;
    evaluated.found = object_->compare(evaluated.T_C_U.inverse(), truth, camera);
    compareWithCovariance(result.refinement, true_T_C_U, &evaluated);
  }
  return evaluated;
}

}  // namespace nerf_pose_refiner
