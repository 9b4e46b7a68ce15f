// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace nerf_pose_refiner {

/// Parses JSON from an untrusted source. Copies and comparisons of values recurse, so that
/// values which nest deeper than 64 levels are refused.
/// @throws std::runtime_error saying where it is wrong.
nlohmann::json parseJson(const std::string& text);

}  // namespace nerf_pose_refiner
