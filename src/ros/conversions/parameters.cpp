// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/parameters.h"

#include <cmath>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "dataset/dataset_limits.h"
#include "registration/registration_options.h"
#include "ros/conversions/pose_conversions.h"

namespace nerf_pose_refiner {
namespace {

[[noreturn]] void throwRange(const std::string& name, double value, const std::string& range) {
  std::ostringstream text;
  text << "parameter " << name << " is " << value << " but must be " << range;
  throw std::invalid_argument(text.str());
}

void requirePositive(const std::string& name, double value) {
  if (!(value > 0) || !std::isfinite(value)) throwRange(name, value, "> 0");
}

void requireNotNegative(const std::string& name, double value) {
  if (!(value >= 0) || !std::isfinite(value)) throwRange(name, value, ">= 0");
}

void requireWidth(const std::string& name, double value, double most) {
  if (value > 0 && value <= most) return;
  std::ostringstream range;
  range << "> 0 and at most " << most;
  throwRange(name, value, range.str());
}

/// Reads a word that stands for a value of `choices`.
template <typename T>
void getChoice(ParamReader& read, const std::string& name, const std::map<std::string, T>& choices,
               T& value) {
  std::string word;
  std::string known;
  for (const auto& choice : choices) {
    if (choice.second == value) word = choice.first;
    known += (known.empty() ? "" : ", ") + choice.first;
  }
  read.get(name, word);
  const auto found = choices.find(word);
  if (found == choices.end()) {
    throw std::invalid_argument("parameter ~" + name + " is '" + word + "' but must be one of " +
                                known);
  }
  value = found->second;
}

void readStages(ParamReader& read, std::vector<AlignStageSettings>& stages) {
  std::optional<std::vector<ParamReader>> readers = read.list("stages");
  if (!readers) return;  // the preset's stay
  stages.clear();
  for (ParamReader& reader : *readers) {
    AlignStageSettings stage;
    reader.get("object_px", stage.object_px);
    reader.get("hypotheses", stage.hypotheses);
    reader.get("iterations", stage.iterations);
    reader.get("rays_per_side", stage.rays_per_side);
    reader.get("blur_px", stage.blur_px);
    reader.get("step_scale", stage.step_scale);
    reader.rejectUnknown();
    stages.push_back(stage);
  }
}

void readDescent(ParamReader& read, OptimisationPlan& descent) {
  std::string loss = lossName(descent.loss);
  read.get("loss", loss);
  descent.loss = lossFromName(loss);
  std::string update = poseUpdateName(descent.update);
  read.get("update", update);
  descent.update = poseUpdateFromName(update);
  read.get("length_unit", descent.length_unit);
  read.get("translation_learning_rate", descent.translation_learning_rate);
  read.get("rotation_learning_rate", descent.rotation_learning_rate);
  read.get("decay", descent.schedule.decay);
  read.get("decay_updates", descent.schedule.decay_updates);
  read.get("anneal_share", descent.schedule.anneal_fraction);
  read.get("beta1", descent.beta1);
  read.get("beta2", descent.beta2);
  read.get("epsilon", descent.epsilon);
  read.get("regularisation", descent.regularisation);
  read.get("steps_per_update", descent.steps_per_update);
  read.get("samples_per_step", descent.samples_per_step);
  read.get("score_steps", descent.score_steps);
  read.get("direction_gradient", descent.direction_gradient);
}

void readInversion(ParamReader& read, InversionSettings& inversion) {
  read.get("unit", inversion.unit);
  read.get("hypotheses", inversion.hypotheses);
  read.get("first_steps", inversion.first_steps);
  read.get("rounds", inversion.rounds);
  read.get("round_steps", inversion.round_steps);
  read.get("spread_rotation_rad", inversion.spread_rotation_rad);
  read.get("spread_translation", inversion.spread_translation);
  read.get("keep_share", inversion.keep_fraction);
  read.get("keep_decay", inversion.keep_decay);
  read.get("keep_at_least", inversion.keep_at_least);
  read.get("jitter_rotation_rad", inversion.jitter_rotation_rad);
  read.get("jitter_translation", inversion.jitter_translation);
  read.get("score_pixels", inversion.score_pixels);
  readDescent(read, inversion.descent);
  read.rejectUnknown();
}

/// The part that ~refiner and ~tracker have in common.
void readSearch(ParamReader& read, SearchSettings& search) {
  const std::string preset_before = search.preset;
  read.get("preset", search.preset);
  if (search.preset != preset_before) search.refiner = RefinerSettings::named(search.preset);
  read.get("rotation_deg", search.rotation_deg);
  read.get("translation", search.translation);
  readStages(read, search.refiner.stages);
  read.get("robust_scale", search.refiner.robust_scale);
  read.get("compare_contrast", search.refiner.compare_contrast);
  read.get("fit_gain_bias", search.refiner.fit_gain_bias);
  read.get("seed", search.refiner.seed);
  ParamReader inversion = read.group("inversion");
  readInversion(inversion, search.refiner.inversion);
}

void readRegistration(ParamReader& read, RegistrationOptions& registration) {
  visitSettings(registration, [&read](const char* name, auto& value, const char*) {
    if (name == std::string("metres_per_unit")) return;  // of the object: the request says it
    read.get(name, value);
  });
  read.rejectUnknown();
}

void readLimits(ParamReader& read, DatasetLimits& limits) {
  visitLimits(&limits, [&read](const char* name, std::uint64_t& value, const char*) {
    read.get(name, value);
  });
  read.rejectUnknown();
}

void readFrames(ParamReader& read, FrameSettings& frames) {
  read.get("object_frame", frames.object_frame);
  read.get("output_frame", frames.output_frame);
  read.get("fixed_frame", frames.fixed_frame);
  for (std::string* name : {&frames.object_frame, &frames.output_frame, &frames.fixed_frame}) {
    *name = withoutSlash(*name);
  }
  read.get("publish_tf", frames.publish_tf);
  read.get("tf_timeout_s", frames.tf_timeout_s);
  read.get("tf_cache_s", frames.tf_cache_s);
}

void readDepth(ParamReader& read, DepthSettings& depth) {
  read.get("use", depth.use);
  read.get("is_rectified", depth.is_rectified);
  read.get("tolerance_s", depth.tolerance_s);
  read.get("timeout_s", depth.timeout_s);
  read.get("unit_m", depth.unit_m);
  read.get("image_transport", depth.image_transport);
  read.get("noise_m", depth.noise.constant_m);
  read.get("noise_per_m", depth.noise.quadratic_per_m);
  read.get("correlation_px", depth.noise.correlation_px);
  read.get("bias_m", depth.noise.bias_m);
  read.get("bias_fraction", depth.noise.bias_fraction);
  read.rejectUnknown();
}

void validateDepth(const DepthSettings& depth) {
  requireNotNegative("~depth/tolerance_s", depth.tolerance_s);
  requireNotNegative("~depth/timeout_s", depth.timeout_s);
  requirePositive("~depth/unit_m", depth.unit_m);
  requirePositive("~depth/noise_m", depth.noise.constant_m);
  requireNotNegative("~depth/noise_per_m", depth.noise.quadratic_per_m);
  if (!(depth.noise.correlation_px >= 1) || !std::isfinite(depth.noise.correlation_px)) {
    throwRange("~depth/correlation_px", depth.noise.correlation_px, ">= 1");
  }
  requirePositive("~depth/bias_m", depth.noise.bias_m);
  requireNotNegative("~depth/bias_fraction", depth.noise.bias_fraction);
}

void readCameras(ParamReader& read, CameraSettings& cameras) {
  read.get("topics", cameras.topics);
  read.get("are_rectified", cameras.are_rectified);
  read.get("tolerance_s", cameras.tolerance_s);
  read.get("timeout_s", cameras.timeout_s);
  read.get("wait_s", cameras.wait_s);
  read.get("position_dev_m", cameras.position_dev_m);
  read.get("rotation_dev_deg", cameras.rotation_dev_deg);
  read.rejectUnknown();
}

void readBoxes(ParamReader& read, BoxSettings& boxes) {
  read.get("use", boxes.use);
  read.get("class_id", boxes.class_id);
  read.rejectUnknown();
}

void validateBoxes(const BoxSettings& boxes) {
  if (boxes.class_id < -1) throwRange("~detections/class_id", boxes.class_id, ">= -1");
}

void readWindow(ParamReader& read, ViewWindowSettings& window) {
  read.get("views", window.views);
  read.get("apart_deg", window.apart_deg);
  read.get("position_dev_m", window.position_dev_m);
  read.get("rotation_dev_deg", window.rotation_dev_deg);
  read.get("time_dev_s", window.time_dev_s);
  read.get("renewal_s", window.renewal_s);
  read.rejectUnknown();
}

void validateCameras(const CameraSettings& cameras) {
  requireNotNegative("~cameras/tolerance_s", cameras.tolerance_s);
  requireNotNegative("~cameras/timeout_s", cameras.timeout_s);
  requireNotNegative("~cameras/wait_s", cameras.wait_s);
  requireNotNegative("~cameras/position_dev_m", cameras.position_dev_m);
  requireNotNegative("~cameras/rotation_dev_deg", cameras.rotation_dev_deg);
}

void validateWindow(const ViewWindowSettings& window, const FrameSettings& frames) {
  requireNotNegative("~window/views", window.views);
  requirePositive("~window/apart_deg", window.apart_deg);
  requireNotNegative("~window/position_dev_m", window.position_dev_m);
  requireNotNegative("~window/rotation_dev_deg", window.rotation_dev_deg);
  requireNotNegative("~window/time_dev_s", window.time_dev_s);
  requirePositive("~window/renewal_s", window.renewal_s);
  if (window.views > 0 && frames.fixed_frame.empty()) {
    throw std::invalid_argument(
        "~window/views needs ~fixed_frame: a frame in which the object stands still");
  }
}

void readOverlay(ParamReader& read, OverlaySettings& overlay) {
  read.get("width_px", overlay.width_px);
  read.get("opacity", overlay.opacity);
  read.rejectUnknown();
}

void readDiagnostics(ParamReader& read, DiagnosticSettings& diagnostics) {
  read.get("min_image_rate_hz", diagnostics.min_image_rate_hz);
  read.get("max_image_age_s", diagnostics.max_image_age_s);
  read.rejectUnknown();
}

void requireFraction(const std::string& name, double value) {
  if (!(value >= 0 && value <= 1)) throwRange(name, value, "in 0..1");
}

void validateSearch(const std::string& group, const SearchSettings& search) {
  requireWidth("~" + group + "/rotation_deg", search.rotation_deg, 180);
  requireWidth("~" + group + "/translation", search.translation, 100);  // object diameters
  search.refiner.validate();
}

void readRules(ParamReader& reader, TrackingRules& rules) {
  getChoice<bool>(reader, "mode", {{"track", false}, {"once", true}}, rules.once);
  getChoice<InitialPosePolicy>(reader, "initial_pose_policy",
                               {{"when_not_tracking", InitialPosePolicy::kWhenNotTracking},
                                {"always", InitialPosePolicy::kAlways}},
                               rules.initial_pose_policy);
  getChoice<TrackStart>(reader, "start",
                        {{"initial_pose", TrackStart::kInitialPose},
                         {"detect", TrackStart::kDetect},
                         {"both", TrackStart::kBoth}},
                        rules.start);
  reader.get("detect_rate_hz", rules.detect_rate_hz);
  reader.get("detect_share", rules.detect_share);
  reader.get("initial_pose_max_age_s", rules.initial_pose_max_age_s);
  reader.get("image_timeout_s", rules.image_timeout_s);
  reader.get("recover_s", rules.recover_s);
}

void readProcessor(ParamReader& reader, PoseRefinerParameters& p) {
  getChoice<std::string>(reader, "backend", {{"auto", "auto"}, {"cpu", "cpu"}, {"cuda", "cuda"}},
                         p.backend);
  reader.get("device", p.device);
  reader.get("threads", p.threads);
  getChoice<std::string>(reader, "instruction_set",
                         {{"auto", "auto"}, {"avx2", "avx2"}, {"baseline", "baseline"}},
                         p.instruction_set);
}

}  // namespace

std::vector<std::string> CameraSettings::names() const {
  std::istringstream words(topics);
  return {std::istream_iterator<std::string>(words), std::istream_iterator<std::string>()};
}

BackendChoice PoseRefinerParameters::backendChoice() const {
  return {backend, threads, instruction_set, device};
}

void PoseRefinerParameters::validate() const {
  const TrackingRules& rules = tracker.rules;
  requireNotNegative("~model_memory_mb", model_memory_mb);
  requireNotNegative("~threads", threads);
  requireNotNegative("~device", device);
  requireNotNegative("~mask_timeout_s", mask_timeout_s);
  validateDepth(depth);
  validateCameras(cameras);
  validateBoxes(detections);
  validateWindow(tracker.window, frames);
  requireNotNegative("~tf_timeout_s", frames.tf_timeout_s);
  requirePositive("~tf_cache_s", frames.tf_cache_s);
  requirePositive("~initial_pose_max_age_s", rules.initial_pose_max_age_s);
  requirePositive("~detect_rate_hz", rules.detect_rate_hz);
  requirePositive("~detect_share", rules.detect_share);
  requireFraction("~detect_share", rules.detect_share);
  requireNotNegative("~image_timeout_s", rules.image_timeout_s);
  requireFraction("~tracker/trust_score", rules.trust_score);
  requireFraction("~tracker/min_score", rules.min_score);
  if (rules.min_score > rules.trust_score) {
    throwRange("~tracker/min_score", rules.min_score, "at most ~tracker/trust_score");
  }
  requireNotNegative("~recover_s", rules.recover_s);
  requireNotNegative("~tracker/max_failures", rules.max_failures);
  if (overlay.width_px < 16) throwRange("~overlay/width_px", overlay.width_px, ">= 16");
  requireFraction("~overlay/opacity", overlay.opacity);
  requireNotNegative("~diagnostics/min_image_rate_hz", diagnostics.min_image_rate_hz);
  requirePositive("~diagnostics/max_image_age_s", diagnostics.max_image_age_s);
  validateSearch("refiner", tracker.initial);
  validateSearch("tracker", tracker.tracking);
  registration.validate();
}

PoseRefinerParameters readParameters(ParamReader& reader, const PoseRefinerParameters& defaults) {
  PoseRefinerParameters p = defaults;
  reader.get("object", p.object);
  reader.get("model_root", p.model_root);
  reader.get("model_memory_mb", p.model_memory_mb);
  reader.get("dataset_root", p.dataset_root);
  reader.get("image_transport", p.image_transport);
  reader.get("image_is_rectified", p.image_is_rectified);
  getChoice<MaskMode>(reader, "mask_mode",
                      {{"none", MaskMode::kNone},
                       {"initial", MaskMode::kInitial},
                       {"every_frame", MaskMode::kEveryFrame}},
                      p.tracker.mask_mode);
  reader.get("mask_timeout_s", p.mask_timeout_s);
  readProcessor(reader, p);
  readFrames(reader, p.frames);
  readRules(reader, p.tracker.rules);

  ParamReader refiner = reader.group("refiner");
  readSearch(refiner, p.tracker.initial);
  refiner.rejectUnknown();

  ParamReader tracker = reader.group("tracker");
  readSearch(tracker, p.tracker.tracking);
  tracker.get("trust_score", p.tracker.rules.trust_score);
  tracker.get("min_score", p.tracker.rules.min_score);
  tracker.get("max_failures", p.tracker.rules.max_failures);
  tracker.get("predict", p.tracker.rules.predict);
  tracker.rejectUnknown();

  ParamReader depth = reader.group("depth");
  readDepth(depth, p.depth);

  ParamReader cameras = reader.group("cameras");
  readCameras(cameras, p.cameras);

  ParamReader detections = reader.group("detections");
  readBoxes(detections, p.detections);

  ParamReader window = reader.group("window");
  readWindow(window, p.tracker.window);
  ParamReader overlay = reader.group("overlay");
  readOverlay(overlay, p.overlay);

  ParamReader diagnostics = reader.group("diagnostics");
  readDiagnostics(diagnostics, p.diagnostics);

  ParamReader registration = reader.group("register");
  readRegistration(registration, p.registration);
  p.registration.threads = p.threads;

  ParamReader dataset = reader.group("dataset");
  readLimits(dataset, p.dataset_limits);
  p.tracker.rules.cameras_change = !p.cameras.names().empty();
  p.validate();
  return p;
}

}  // namespace nerf_pose_refiner
