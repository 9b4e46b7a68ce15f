// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/evaluation_files.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "evaluation/statistics.h"
#include "tools/tool.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

constexpr int kCurvePoints = 101;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json distributionJson(const Distribution& d) {
  return {{"median", number(d.median)}, {"p75", number(d.p75)}, {"p90", number(d.p90)},
          {"p95", number(d.p95)},       {"p99", number(d.p99)}, {"max", number(d.most)}};
}

/// Recall over thresholds from 0 to `most`.
Json curveJson(const std::vector<double>& errors, double most) {
  std::vector<double> thresholds;
  for (int i = 0; i < kCurvePoints; ++i) thresholds.push_back(most * i / (kCurvePoints - 1));
  return {{"thresholds", thresholds}, {"recall", recallCurve(errors, thresholds)}};
}

Json curvesJson(const std::vector<EvaluatedFrame>& frames, double diameter_m) {
  return {{"rotation_deg", curveJson(column(frames, &PoseMetrics::rotation_deg), 10)},
          {"offset_diameters", curveJson(column(frames, &PoseMetrics::offset_diameters), 0.1)},
          {"add_m", curveJson(column(frames, &PoseMetrics::add_m), 0.1 * diameter_m)},
          {"add_s_m", curveJson(column(frames, &PoseMetrics::add_s_m), 0.1 * diameter_m)},
          {"reprojection_px", curveJson(column(frames, &PoseMetrics::reprojection_px), 10)}};
}

std::string cell(double value) {
  if (!std::isfinite(value)) return "";
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

void writeMetrics(const PoseMetrics& m, std::ofstream* file) {
  for (const double value : {m.rotation_deg, m.offset_m, m.offset_diameters, m.along_m, m.across_m,
                             m.add_m, m.add_s_m, m.reprojection_px}) {
    *file << ',' << cell(value);
  }
}

void requireWhole(std::ofstream* file, const std::string& path) {
  file->close();
  if (!*file) throw std::runtime_error("cannot write '" + path + "': " + std::strerror(errno));
}

std::string percent(const Json& fraction) {
  char text[16];
  std::snprintf(text, sizeof text, "%.1f %%", 100 * fraction.get<double>());
  return text;
}

std::string valueText(const Json& value, double factor, const char* form) {
  if (value.is_null()) return "none";
  char text[32];
  std::snprintf(text, sizeof text, form, factor * value.get<double>());
  return text;
}

}  // namespace

Json summaryJson(const BagEvaluationResult& result, double diameter_m) {
  const SequenceSummary s = summarise(result.frames, diameter_m);
  Json recalls;
  for (const Recall& recall : s.recalls) recalls[recall.rule] = recall.fraction;
  return {{"frames", s.frames},
          {"found", s.found},
          {"trusted", s.trusted},
          {"masked", result.masked},
          {"with_depth", result.with_depth},
          {"depth_refused", result.depth_refused},
          {"with_cameras", result.with_cameras},
          {"cameras_refused", result.cameras_refused},
          {"with_window", result.with_window},
          {"window_refused", result.window_refused},
          {"skipped", result.skipped},
          {"diameter_m", diameter_m},
          {"surface_points", result.points},
          {"duration_s", s.duration_s},
          {"time_lost_s", s.time_lost_s},
          {"losses", s.losses},
          {"trusted_within_5_deg_5_percent", s.trusted_right},
          {"within_5_deg_5_percent_trusted", s.right_trusted},
          {"recall", recalls},
          {"add_area", s.add_area},
          {"add_s_area", s.add_s_area},
          {"errors",
           {{"rotation_deg", distributionJson(s.rotation_deg)},
            {"offset_m", distributionJson(s.offset_m)},
            {"offset_diameters", distributionJson(s.offset_diameters)},
            {"along_m", distributionJson(s.along_m)},
            {"across_m", distributionJson(s.across_m)},
            {"add_m", distributionJson(s.add_m)},
            {"add_s_m", distributionJson(s.add_s_m)},
            {"reprojection_px", distributionJson(s.reprojection_px)}}},
          {"normalised_error", number(s.normalised_error)},
          {"latency_s", distributionJson(s.latency_s)},
          {"curves", curvesJson(result.frames, diameter_m)}};
}

void writeFramesCsv(const BagEvaluationResult& result, const std::string& path) {
  std::ofstream file(path);
  file << "frame,stamp,outcome,trusted,from_last,score";
  for (const char* when : {"start_", ""}) {
    for (const char* name : {"rotation_deg", "offset_m", "offset_diameters", "along_m", "across_m",
                             "add_m", "add_s_m", "reprojection_px"}) {
      file << ',' << when << name;
    }
  }
  file << ",along_dev_m,normalised_error,x,y,z,qx,qy,qz,qw,latency_s\n";
  for (const EvaluatedFrame& f : result.frames) {
    char stamp[40];
    std::snprintf(stamp, sizeof stamp, "%llu.%09llu",
                  static_cast<unsigned long long>(f.stamp_ns / 1000000000),
                  static_cast<unsigned long long>(f.stamp_ns % 1000000000));
    file << f.index << ',' << stamp << ',' << f.outcome << ',' << f.trusted << ',' << f.from_last
         << ',' << cell(f.score);
    writeMetrics(f.start, &file);
    writeMetrics(f.found, &file);
    file << ',' << cell(f.along_dev_m) << ',' << cell(f.normalised_error);
    const bool found = std::isfinite(f.found.rotation_deg);
    for (const double value : poseNumbers(f.T_C_U)) file << ',' << (found ? cell(value) : "");
    file << ',' << cell(f.latency_s) << '\n';
  }
  requireWhole(&file, path);
}

void writeJson(const Json& document, const std::string& path) {
  std::ofstream file(path);
  file << document.dump(2) << '\n';
  requireWhole(&file, path);
}

std::string summaryText(const Json& s) {
  const Json& errors = s["errors"];
  std::string text = std::to_string(s["frames"].get<int>()) + " images, " +
                     std::to_string(s["found"].get<int>()) + " poses, " +
                     std::to_string(s["trusted"].get<int>()) + " of them trusted\n";
  const std::string symmetries = s["settings"]["modulo_symmetries"];
  if (!symmetries.empty()) text += "errors are modulo symmetries: " + symmetries + "\n";
  for (const auto& [rule, fraction] : s["recall"].items())
    text += rule + ": " + percent(fraction) + "\n";
  text += "median error: " + valueText(errors["rotation_deg"]["median"], 1, "%.3f degrees") + ", " +
          valueText(errors["offset_m"]["median"], 1000, "%.2f mm") + ", " +
          valueText(errors["offset_diameters"]["median"], 100, "%.2f %% of the diameter") + ", " +
          valueText(errors["reprojection_px"]["median"], 1, "%.2f px") + "\n";
  text += "latency: median " + valueText(s["latency_s"]["median"], 1, "%.3f s") + ", 95 % within " +
          valueText(s["latency_s"]["p95"], 1, "%.3f s") + "\n";
  text += "time lost: " + valueText(s["time_lost_s"], 1, "%.2f") + " of " +
          valueText(s["duration_s"], 1, "%.2f s") + "\n";
  for (const auto& [reason, count] : s["skipped"].items()) {
    text += "skipped, " + reason + ": " + std::to_string(count.get<int>()) + "\n";
  }
  return text;
}

}  // namespace nerf_pose_refiner
