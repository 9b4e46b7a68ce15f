// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trial_results.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

const char* nameOf(Outcome outcome) {
  switch (outcome) {
    case Outcome::kRefined:
      return "refined";
    case Outcome::kNoOverlap:
      return "no_overlap";
    case Outcome::kBadSize:
      return "bad_size";
    case Outcome::kDiverged:
      return "diverged";
    case Outcome::kCancelled:
      break;
  }
  return "stopped";
}

std::string fileIn(const std::string& folder, const std::string& name) {
  std::filesystem::create_directories(folder);
  return (std::filesystem::path(folder) / name).string();
}

}  // namespace

TrialResults::TrialResults(const std::string& folder, const std::string& suffix,
                           std::string backend)
    : backend_(std::move(backend)),
      trials_(fileIn(folder, "trials-" + suffix),
              {"start_deg", "start_units", "start_diameters", "deg", "units", "diameters", "pixels",
               "outcome", "score", "seconds", "samples", "engine"}),
      traces_(fileIn(folder, "traces-" + suffix), {"stage", "seconds", "samples", "deg", "units"}),
      instances_(fileIn(folder, "instances-" + suffix),
                 {"instance", "width", "visible", "deg", "diameters", "score"}) {
  std::replace(backend_.begin(), backend_.end(), ',', ';');  // which would end the cell
}

void TrialResults::add(const TrialKey& key, const Refinement& refinement, const PoseError& before,
                       const PoseError& after, const TrialScale& scale) {
  const bool found = refinement.outcome == Outcome::kRefined;
  const auto ifFound = [&](double value) { return found ? cellOf(value) : std::string(); };
  trials_.add(
      key,
      {{cellOf(before.rotation_rad * kDegreesPerRad), cellOf(before.camera_offset / scale.unit),
        cellOf(before.object_offset / scale.diameter), ifFound(after.rotation_rad * kDegreesPerRad),
        ifFound(after.camera_offset / scale.unit), ifFound(after.object_offset / scale.diameter),
        ifFound(after.pixels), nameOf(refinement.outcome), cellOf(refinement.score),
        cellOf(refinement.seconds), std::to_string(refinement.work.samples), backend_}});
}

void TrialResults::addTrace(const TrialKey& key, const Pose& initial_T_O_C,
                            const Refinement& refinement, double unit,
                            const std::function<PoseError(const Pose& T_O_C)>& error_of) {
  // A trace whose trial is missing was cut by an interruption: it is written again behind that.
  std::vector<std::vector<std::string>> rows;
  double seconds = 0, samples = 0;
  const auto addRow = [&](const std::string& stage, const Pose& T_O_C) {
    const PoseError error = error_of(T_O_C);
    rows.push_back({stage, cellOf(seconds), cellOf(samples),
                    cellOf(error.rotation_rad * kDegreesPerRad),
                    cellOf(error.camera_offset / unit)});
  };
  addRow("start", initial_T_O_C);
  for (const TraceEntry& entry : refinement.trace) {
    seconds += entry.seconds;
    samples += static_cast<double>(entry.work.samples);
    addRow(entry.stage, entry.best_T_O_C);
  }
  traces_.add(key, rows);
}

void TrialResults::addSightings(const TrialKey& key, const std::vector<Sighting>& sightings,
                                double diameter) {
  std::vector<std::vector<std::string>> rows;
  for (const Sighting& one : sightings) {
    const std::string none;
    rows.push_back({one.instance ? std::to_string(*one.instance) : none,
                    one.instance ? cellOf(one.width) : none,
                    one.instance ? cellOf(one.visible) : none,
                    one.error ? cellOf(one.error->rotation_rad * kDegreesPerRad) : none,
                    one.error ? cellOf(one.error->object_offset / diameter) : none,
                    one.error || !one.instance ? cellOf(one.score) : none});
  }
  instances_.add(key, rows);
}

}  // namespace nerf_pose_refiner
