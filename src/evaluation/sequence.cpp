// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/sequence.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kAddFraction = 0.1;  // of the diameter: the usual bound of ADD and ADD-S

using Rule = std::function<bool(const PoseMetrics&)>;

bool within(const PoseMetrics& found, double degrees, double diameters) {
  return found.rotation_deg <= degrees && found.offset_diameters <= diameters;
}

double fraction(std::ptrdiff_t part, std::ptrdiff_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

std::vector<Recall> recalls(const std::vector<EvaluatedFrame>& frames, double diameter_m) {
  const std::vector<std::pair<std::string, Rule>> rules = {
      {"5 deg and 5 cm",
       [](const PoseMetrics& e) { return e.rotation_deg <= 5 && e.offset_m <= 0.05; }},
      {"5 deg and 5 %", [](const PoseMetrics& e) { return within(e, 5, 0.05); }},
      {"2 deg and 2 %", [](const PoseMetrics& e) { return within(e, 2, 0.02); }},
      {"ADD 10 %", [&](const PoseMetrics& e) { return e.add_m <= kAddFraction * diameter_m; }},
      {"ADD-S 10 %", [&](const PoseMetrics& e) { return e.add_s_m <= kAddFraction * diameter_m; }},
      {"5 px", [](const PoseMetrics& e) { return e.reprojection_px <= 5; }},
  };
  std::vector<Recall> result;
  for (const auto& [name, rule] : rules) {
    const auto good =
        std::count_if(frames.begin(), frames.end(),
                      [&r = rule](const EvaluatedFrame& frame) { return r(frame.found); });
    result.push_back({name, fraction(good, static_cast<std::ptrdiff_t>(frames.size()))});
  }
  return result;
}

void countTrust(const std::vector<EvaluatedFrame>& frames, SequenceSummary* summary) {
  int right = 0, both = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const EvaluatedFrame& frame = frames[i];
    const bool is_right = within(frame.found, 5, 0.05);
    right += is_right;
    both += is_right && frame.trusted;
    summary->trusted += frame.trusted;
    summary->found += std::isfinite(frame.found.rotation_deg);
    summary->losses += i > 0 && frames[i - 1].trusted && !frame.trusted;
    if (i + 1 < frames.size() && !frame.trusted) {
      summary->time_lost_s += 1e-9 * static_cast<double>(frames[i + 1].stamp_ns - frame.stamp_ns);
    }
  }
  summary->trusted_right = fraction(both, summary->trusted);
  summary->right_trusted = fraction(both, right);
}

double meanNormalisedError(const std::vector<EvaluatedFrame>& frames) {
  double sum = 0;
  int count = 0;
  for (const EvaluatedFrame& frame : frames) {
    if (!within(frame.found, 5, 0.05) || !std::isfinite(frame.normalised_error)) continue;
    sum += frame.normalised_error;
    ++count;
  }
  return count > 0 ? sum / count : PoseMetrics::kNone;
}

}  // namespace

PoseMetrics EvaluatedObject::compare(const Pose& T_U_C, const Pose& true_T_U_C,
                                     const Camera& camera) const {
  const Pose nearest = nearestEquivalent(T_U_C, true_T_U_C, symmetries_m);
  const PoseError error = poseError(nearest, true_T_U_C, centre_m, camera);
  PoseMetrics metrics;
  metrics.rotation_deg = error.rotation_rad * kDegreesPerRad;
  metrics.offset_m = error.object_offset;
  metrics.offset_diameters = error.object_offset / diameter_m;
  const Eigen::Vector3d true_C = true_T_U_C.inverse() * centre_m;
  const Eigen::Vector3d away = nearest.inverse() * centre_m - true_C;
  const double along = away.dot(true_C.normalized());
  metrics.along_m = std::abs(along);
  metrics.across_m = (away - along * true_C.normalized()).norm();
  metrics.add_m = points_m.add(nearest, true_T_U_C);
  metrics.add_s_m = points_m.addS(nearest, true_T_U_C);
  metrics.reprojection_px = points_m.reprojection(nearest, true_T_U_C, camera);
  return metrics;
}

Distribution distribution(const std::vector<double>& values) {
  return {percentile(values, 0.5),  percentile(values, 0.75), percentile(values, 0.9),
          percentile(values, 0.95), percentile(values, 0.99), percentile(values, 1)};
}

std::vector<double> column(const std::vector<EvaluatedFrame>& frames, double PoseMetrics::*error) {
  std::vector<double> values;
  for (const EvaluatedFrame& frame : frames) values.push_back(frame.found.*error);
  return values;
}

SequenceSummary summarise(const std::vector<EvaluatedFrame>& frames, double diameter_m) {
  if (frames.empty()) throw std::invalid_argument("no image was evaluated");
  SequenceSummary summary;
  summary.frames = static_cast<int>(frames.size());
  summary.duration_s = 1e-9 * static_cast<double>(frames.back().stamp_ns - frames.front().stamp_ns);
  countTrust(frames, &summary);
  const auto spread = [&](double PoseMetrics::*error) {
    return distribution(column(frames, error));
  };
  summary.rotation_deg = spread(&PoseMetrics::rotation_deg);
  summary.offset_m = spread(&PoseMetrics::offset_m);
  summary.offset_diameters = spread(&PoseMetrics::offset_diameters);
  summary.along_m = spread(&PoseMetrics::along_m);
  summary.across_m = spread(&PoseMetrics::across_m);
  summary.normalised_error = meanNormalisedError(frames);
  summary.add_m = spread(&PoseMetrics::add_m);
  summary.add_s_m = spread(&PoseMetrics::add_s_m);
  summary.reprojection_px = spread(&PoseMetrics::reprojection_px);
  std::vector<double> latencies;
  for (const EvaluatedFrame& frame : frames) latencies.push_back(frame.latency_s);
  summary.latency_s = distribution(latencies);
  summary.recalls = recalls(frames, diameter_m);
  const double most = kAddFraction * diameter_m;
  summary.add_area = areaUnderRecall(column(frames, &PoseMetrics::add_m), most);
  summary.add_s_area = areaUnderRecall(column(frames, &PoseMetrics::add_s_m), most);
  return summary;
}

}  // namespace nerf_pose_refiner
