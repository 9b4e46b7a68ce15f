// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evaluation/pose_error.h"
#include "evaluation/sighting.h"
#include "evaluation/trial_table.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// Lengths that errors are given in [model units].
struct TrialScale {
  double unit;  ///< of the protocol
  double diameter;
};

/// Results of trials in a folder: trials-<suffix> with a row per trial, traces-<suffix> with a row
/// per stage, and instances-<suffix> with a row per instance that an image shows and per pose that
/// is none of theirs. @see TrialTable
class TrialResults {
 public:
  /// @param folder is created if it is not there. @param backend in words, for every row.
  /// @throws as TrialTable.
  TrialResults(const std::string& folder, const std::string& suffix, std::string backend);

  bool has(const TrialKey& key) const { return trials_.has(key); }
  std::size_t size() const { return trials_.size(); }

  /// @param before, after errors of the initial and of the refined pose.
  void add(const TrialKey& key, const Refinement& refinement, const PoseError& before,
           const PoseError& after, const TrialScale& scale);

  /// The best pose after every stage. @param unit of the protocol [model units].
  void addTrace(const TrialKey& key, const Pose& initial_T_O_C, const Refinement& refinement,
                double unit, const std::function<PoseError(const Pose& T_O_C)>& error_of);

  /// What detection found in the image of a trial. @param diameter of the object [model units].
  void addSightings(const TrialKey& key, const std::vector<Sighting>& sightings, double diameter);

 private:
  std::string backend_;
  TrialTable trials_, traces_, instances_;
};

}  // namespace nerf_pose_refiner
