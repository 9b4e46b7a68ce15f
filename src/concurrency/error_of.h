// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <optional>
#include <string>

namespace nerf_pose_refiner {

/// Runs `function`. @return what it threw, in words; nothing if it came to its end. For the edge of
/// a callback or a thread: an exception that leaves one ends the process.
template <typename Function>
std::optional<std::string> errorOf(const Function& function) {
  try {
    function();
  } catch (const std::exception& e) {
    return e.what();
  } catch (...) {  // not of the standard's family, as XmlRpc's are not
    return "an exception without a text";
  }
  return std::nullopt;
}

}  // namespace nerf_pose_refiner
