// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/record3d.h"

#include "dataset/json_values.h"

namespace nerf_pose_refiner {
namespace {

std::string metadataIn(const DatasetFolder& folder) {
  return folder.hasFile("metadata") ? "metadata" : "metadata.json";
}

/// T_O_C of qx qy qz qw tx ty tz: a camera with OpenGL's axes in a world with y up.
Pose readQuaternionPose(const nlohmann::json& json, const std::string& where) {
  if (!json.is_array() || json.size() != 7) failAt(where, "a pose does not have 7 numbers");
  double n[7];
  for (std::size_t i = 0; i < 7; ++i) n[i] = finiteNumber(json[i], "a number of the pose", where);
  const Pose T_W_G(rotationOf(Eigen::Vector4d(n[3], n[0], n[1], n[2]), where), {n[4], n[5], n[6]});
  return withOpticalAxes(zUp() * T_W_G);
}

}  // namespace

bool isRecord3dFolder(const DatasetFolder& folder) {
  return folder.hasFile(metadataIn(folder)) && folder.hasFolder("rgb");
}

std::vector<FrameEntry> readRecord3dMetadata(const std::string& text, const std::string& where,
                                             const DatasetLimits& limits) {
  const nlohmann::json json = parseDatasetJson(text, where);
  FrameEntry frame;
  const std::vector<double> K = requiredNumbers(json, "K", 9, where);  // column by column
  frame.width = requiredPositive(json, "w", where);
  frame.height = requiredPositive(json, "h", where);
  frame.fl_x = K[0];
  frame.fl_y = K[4];
  frame.cx = K[6];
  frame.cy = K[7];
  if (!(K[0] > 0 && K[4] > 0)) failAt(where, "the focal lengths of K are not positive");
  const auto poses = json.find("poses");
  if (poses == json.end() || !poses->is_array() || poses->empty()) {
    failAt(where, "poses is not a list with entries");
  }
  if (poses->size() > limits.frames) {
    failAt(where, std::to_string(poses->size()) + " poses, at most " +
                      std::to_string(limits.frames) + " are read");
  }
  std::vector<FrameEntry> frames;
  for (const nlohmann::json& pose : *poses) {
    const std::string number = std::to_string(frames.size());
    frame.where = where + ", photo " + number;
    frame.image = "rgb/" + number;  // a JPEG or a PNG
    frame.T_O_C = readQuaternionPose(pose, frame.where);
    frames.push_back(frame);
  }
  return frames;
}

FrameList readRecord3dFolder(const DatasetFolder& folder, const DatasetLimits& limits) {
  const std::string name = metadataIn(folder);
  const std::string text = folder.read(name, limits.json_bytes);
  FrameList list;
  list.folder = folder.path();
  list.metres_per_unit = 1;
  list.frames = readRecord3dMetadata(text, "'" + folder.path(name) + "'", limits);
  return list;
}

}  // namespace nerf_pose_refiner
