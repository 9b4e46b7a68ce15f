// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <string>

namespace nerf_pose_refiner {

/// Expects that `action` throws exactly an `Error` whose text holds all of `parts`.
template <typename Error, typename Action, typename... Parts>
void expectError(const Action& action, const Parts&... parts) {
  try {
    action();
  } catch (const Error& error) {
    const std::string text = error.what();
    for (const std::string& part : {std::string(parts)...}) {
      EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
    }
    return;
  } catch (const std::exception& error) {
    ADD_FAILURE() << "an error of another kind: " << error.what();
    return;
  }
  ADD_FAILURE() << "no error";
}

}  // namespace nerf_pose_refiner
