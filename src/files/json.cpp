// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/json.h"

#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

constexpr int kMaxDepth = 64;
constexpr std::size_t kMaxErrorLength = 200;  // errors quote what was read

bool checkDepth(int depth, Json::parse_event_t, Json&) {
  if (depth > kMaxDepth) {
    throw std::runtime_error("its values nest deeper than " + std::to_string(kMaxDepth) +
                             " levels");
  }
  return true;
}

}  // namespace

Json parseJson(const std::string& text) {
  // The parser takes a zero byte for the end of the text.
  if (text.find('\0') != std::string::npos) throw std::runtime_error("it holds a zero byte");
  try {
    return Json::parse(text, checkDepth);
  } catch (const Json::exception& error) {
    throw std::runtime_error(std::string(error.what()).substr(0, kMaxErrorLength));
  }
}

}  // namespace nerf_pose_refiner
