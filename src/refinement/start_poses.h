// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "field/field.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// Poses around a prior, itself first; the same for the same prior.
/// @param spread of them, in the prior's half widths. @param round searches of image after image
/// that begin elsewhere each time number themselves; all rounds have the prior itself.
std::vector<Pose> posesAround(const Prior& prior, const FieldMetadata& object, double spread,
                              int count, int round = 0);

/// Whether two poses differ by less than alignment is off.
bool areNearlyTheSame(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object);

/// The best of some results, without those whose poses are nearly the same.
/// @tparam Result has a pose T_O_C.
template <typename Result, typename IsBetter>
std::vector<Result> bestOf(std::vector<Result> results, std::size_t count,
                           const FieldMetadata& object, const IsBetter& is_better) {
  std::stable_sort(results.begin(), results.end(), is_better);
  std::vector<Result> best;
  for (const Result& one : results) {
    const bool is_known = std::any_of(best.begin(), best.end(), [&](const Result& other) {
      return areNearlyTheSame(other.T_O_C, one.T_O_C, object);
    });
    if (!is_known) best.push_back(one);
    if (best.size() == count) break;
  }
  return best;
}

}  // namespace nerf_pose_refiner
