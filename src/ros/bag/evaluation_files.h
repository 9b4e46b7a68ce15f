// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "ros/bag/bag_evaluation.h"

namespace nerf_pose_refiner {

/// What a sequence came to, as JSON: counts, percentiles, recalls and recall curves; what no pose
/// makes infinite is null. Latencies stand in a group of their own: all else is the same from run
/// to run.
nlohmann::json summaryJson(const BagEvaluationResult& result, double diameter_m);

/// A row for each image. Errors of an image without a pose are empty.
/// @throws std::runtime_error naming the path and the system's reason.
void writeFramesCsv(const BagEvaluationResult& result, const std::string& path);

/// @throws std::runtime_error naming the path and the system's reason.
void writeJson(const nlohmann::json& document, const std::string& path);

/// A few lines for people.
std::string summaryText(const nlohmann::json& summary);

}  // namespace nerf_pose_refiner
