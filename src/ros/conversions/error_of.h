// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <optional>
#include <string>

namespace nerf_pose_refiner {

/// Runs `function`. @return what it threw, in words; nothing if it came to its end. For the edge of
/// a ROS callback: an exception that leaves one ends the process, and with it all other nodelets.
template <typename Function>
std::optional<std::string> errorOf(const Function& function) {
  try {
    function();
  } catch (const std::exception& e) {
    return e.what();
  } catch (...) {  // XmlRpc's exceptions are not of the standard's family
    return "an exception without a text";
  }
  return std::nullopt;
}

}  // namespace nerf_pose_refiner
