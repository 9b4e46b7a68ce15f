// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace nerf_pose_refiner {

/// Errors and times of many trials, summed up. An error may be infinite: nothing was found.

/// The value that `fraction` of the values lie below, between neighbours by linear interpolation
/// (the definition of numpy's default); infinite if it lies beyond the finite ones.
/// @param fraction 0..1. @throws std::invalid_argument for no values, a NaN or another fraction.
double percentile(std::vector<double> values, double fraction);

/// Fraction of the errors that are not above a threshold, 0..1. @throws std::invalid_argument for
/// no errors or a NaN.
double recallAt(const std::vector<double>& errors, double threshold);

/// The same for many thresholds: a recall curve.
std::vector<double> recallCurve(const std::vector<double>& errors,
                                const std::vector<double>& thresholds);

/// Mean of the recall over all thresholds from 0 to `most`, 0..1: the area under the curve, exactly
/// (each error adds what is left from it to `most`). Xiang et al. (PoseCNN, RSS 2018) report it.
/// @param most above 0. @throws as recallAt, and for another `most`.
double areaUnderRecall(const std::vector<double>& errors, double most);

}  // namespace nerf_pose_refiner
