// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trial_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "geometry/matrix6.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

template <typename Value>
double medianOf(const std::vector<Trial>& trials, const Value& value) {
  std::vector<double> values;
  for (const Trial& trial : trials) values.push_back(value(trial));
  return median(values);
}

/// Of the seconds.
double quantileOf(const std::vector<Trial>& trials, double fraction) {
  std::vector<double> values;
  for (const Trial& trial : trials) values.push_back(trial.refinement.seconds);
  std::sort(values.begin(), values.end());
  const double last = static_cast<double>(values.size()) - 1;
  return values[static_cast<std::size_t>(std::lround(fraction * last))];
}

template <typename Test>
double fractionOf(const std::vector<Trial>& trials, const Test& test) {
  return static_cast<double>(std::count_if(trials.begin(), trials.end(), test)) /
         static_cast<double>(trials.size());
}

}  // namespace

void compareWithCovariance(const Pose& true_T_O_C, const Eigen::Vector3d& centre, Trial* trial) {
  const Refinement& found = trial->refinement;
  if (found.outcome != Outcome::kRefined) return;
  const Vector6 error = cameraTwist(found.T_O_C, true_T_O_C, centre);
  const Eigen::Matrix3d R_C_O = found.T_O_C.R.transpose();
  for (int i = 0; i < 6; i += 3) {
    const Eigen::Vector3d part = R_C_O * error.segment<3>(i);
    const Eigen::Matrix3d spread = R_C_O * found.covariance.block<3, 3>(i, i) * R_C_O.transpose();
    for (int k = 0; k < 3; ++k) {
      trial->error.push_back(part[k]);
      trial->deviation.push_back(std::sqrt(spread(k, k)));
    }
  }
  trial->normalised_error = squaredDistance(error, found.covariance) / 6;
}

nlohmann::json toJson(const Trial& trial) {
  const Refinement& r = trial.refinement;
  return {{"view", trial.view},
          {"start", trial.start},
          {"start_deg", trial.before.rotation_rad / kDegree},
          {"start_camera_offset", trial.before.camera_offset},
          {"start_object_offset", trial.before.object_offset},
          {"deg", trial.after.rotation_rad / kDegree},
          {"camera_offset", trial.after.camera_offset},
          {"object_offset", trial.after.object_offset},
          {"pixels", trial.after.pixels},
          {"outcome", static_cast<int>(r.outcome)},
          {"score", r.score},
          {"normalised_error_squared", trial.normalised_error},
          {"error_in_camera", trial.error},
          {"standard_deviations_in_camera", trial.deviation},
          {"visible_fraction", r.visible_fraction},
          {"seconds", r.seconds},
          {"samples", r.work.samples},
          {"gathers", r.work.gathers},
          {"flops", r.work.flops},
          {"share_of_floor", trial.fraction.of_larger}};
}

nlohmann::json summaryOf(const std::vector<Trial>& trials, const Protocol& protocol) {
  const double far = protocol.offset_bound;
  const auto turned = [](const Trial& t) { return t.after.rotation_rad / kDegree; };
  const auto moved = [&](const Trial& t) {
    return protocol.of_camera ? t.after.camera_offset : t.after.object_offset;
  };
  double mean_normalised = 0;
  for (const Trial& t : trials) mean_normalised += t.normalised_error / trials.size();
  return {
      {"trials", trials.size()},
      {"share_under_5_deg", fractionOf(trials, [&](const Trial& t) { return turned(t) < 5; })},
      {"share_under_offset", fractionOf(trials, [&](const Trial& t) { return moved(t) < far; })},
      {"offset_bound", far},
      {"share_jointly",
       fractionOf(trials, [&](const Trial& t) { return turned(t) < 5 && moved(t) < far; })},
      {"share_1_deg_fifth_of_offset",
       fractionOf(trials, [&](const Trial& t) { return turned(t) < 1 && moved(t) < far / 5; })},
      {"median_deg", medianOf(trials, turned)},
      {"median_offset", medianOf(trials, moved)},
      {"median_pixels", medianOf(trials, [](const Trial& t) { return t.after.pixels; })},
      {"mean_normalised_error_squared", mean_normalised},
      {"median_normalised_error_squared",
       medianOf(trials, [](const Trial& t) { return t.normalised_error; })},
      {"median_seconds", medianOf(trials, [](const Trial& t) { return t.refinement.seconds; })},
      {"p99_seconds", quantileOf(trials, 0.99)},
      {"median_samples",
       medianOf(trials, [](const Trial& t) { return double(t.refinement.work.samples); })},
      {"median_gathers",
       medianOf(trials, [](const Trial& t) { return t.refinement.work.gathers; })},
      {"median_flops", medianOf(trials, [](const Trial& t) { return t.refinement.work.flops; })},
      {"median_share_of_floor",
       medianOf(trials, [](const Trial& t) { return t.fraction.of_larger; })},
      {"median_share_of_floor_without_overlap",
       medianOf(trials, [](const Trial& t) { return t.fraction.of_sum; })}};
}

void printTrial(const Trial& trial, const PosedView& view, const Eigen::Vector3d& centre,
                bool with_trace) {
  const Refinement& r = trial.refinement;
  std::printf(
      "view %2d start %d: %5.1f deg %.3f u -> %6.2f deg %.4f u (object %.4f u, %.2f px)  "
      "score %.2f  %5.2f s  %5.1f M samples, %.2f G gathers, %.1f GFLOP, %.2f of the floor\n",
      trial.view, trial.start, trial.before.rotation_rad / kDegree, trial.before.camera_offset,
      trial.after.rotation_rad / kDegree, trial.after.camera_offset, trial.after.object_offset,
      trial.after.pixels, r.score, r.seconds, static_cast<double>(r.work.samples) / 1e6,
      1e-9 * r.work.gathers, 1e-9 * r.work.flops, trial.fraction.of_larger);
  if (with_trace) {
    for (const TraceEntry& t : r.trace) {
      const PoseError e = poseError(t.best_T_O_C, view.T_O_C, centre, view.camera);
      std::printf(
          "    %-8s %2d live, loss %9.6f: %6.2f deg, object %.4f u; %.2f s, %.1f M samples\n",
          t.stage.c_str(), t.live, t.best_loss, e.rotation_rad / kDegree, e.object_offset,
          t.seconds, static_cast<double>(t.work.samples) / 1e6);
    }
  }
  std::fflush(stdout);
}

}  // namespace nerf_pose_refiner
