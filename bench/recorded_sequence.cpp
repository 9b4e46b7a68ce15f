// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "recorded_sequence.h"

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "image/io.h"

namespace nerf_pose_refiner {
namespace {

Pose poseFrom(const nlohmann::json& rows) {
  Pose pose;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose.R(i, j) = rows.at(i).at(j);
    pose.t[i] = rows.at(i).at(3);
  }
  pose.R = nearestRotation(pose.R);
  return pose;
}

std::string fileOf(const nlohmann::json& frame) {
  if (frame.contains("file")) return frame.at("file");
  char name[32];
  std::snprintf(name, sizeof name, "frames/frame_%03d.png", frame.at("index").get<int>());
  return name;
}

}  // namespace

RecordedSequence readSequence(const std::string& folder) {
  const std::string path = folder + "/sequence.json";
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot open " + path);
  try {
    const nlohmann::json json = nlohmann::json::parse(file);
    RecordedSequence sequence;
    sequence.camera = {json.at("width"), json.at("height"), json.at("fx"),
                       json.at("fy"),    json.at("cx"),     json.at("cy")};
    for (const nlohmann::json& frame : json.at("frames")) {
      RecordedFrame recorded;
      recorded.file = folder + "/" + fileOf(frame);
      recorded.stamp_ns = static_cast<std::int64_t>(
          1e9 * frame.value("time_s", 0.1 * frame.at("index").get<int>()));
      recorded.T_C_O = poseFrom(frame.at("T_C_O"));
      if (frame.contains("T_W_C")) recorded.T_W_C = poseFrom(frame.at("T_W_C"));
      recorded.label_visible = frame.value("label_visible", true);
      sequence.frames.push_back(recorded);
    }
    return sequence;
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
}

}  // namespace nerf_pose_refiner
