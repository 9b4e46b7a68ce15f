// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/statistics.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

void requireValues(const std::vector<double>& values) {
  if (values.empty()) throw std::invalid_argument("statistics of no values");
  if (std::any_of(values.begin(), values.end(), [](double v) { return std::isnan(v); })) {
    throw std::invalid_argument("statistics of a value that is not a number");
  }
}

}  // namespace

double percentile(std::vector<double> values, double fraction) {
  requireValues(values);
  if (!(fraction >= 0 && fraction <= 1))
    throw std::invalid_argument("a percentile's fraction is 0..1");
  std::sort(values.begin(), values.end());
  const double position = fraction * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const double rest = position - static_cast<double>(below);
  if (rest == 0) return values[below];
  if (std::isinf(values[below + 1])) return values[below + 1];  // not infinity minus infinity
  return values[below] + rest * (values[below + 1] - values[below]);
}

double recallAt(const std::vector<double>& errors, double threshold) {
  requireValues(errors);
  const auto good =
      std::count_if(errors.begin(), errors.end(), [&](double error) { return error <= threshold; });
  return static_cast<double>(good) / static_cast<double>(errors.size());
}

std::vector<double> recallCurve(const std::vector<double>& errors,
                                const std::vector<double>& thresholds) {
  std::vector<double> recall;
  for (const double threshold : thresholds) recall.push_back(recallAt(errors, threshold));
  return recall;
}

double areaUnderRecall(const std::vector<double>& errors, double most) {
  requireValues(errors);
  if (!(most > 0)) throw std::invalid_argument("the area under a recall curve of no width");
  double sum = 0;
  for (const double error : errors) sum += std::max(0.0, 1 - error / most);
  return sum / static_cast<double>(errors.size());
}

}  // namespace nerf_pose_refiner
