// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/colmap_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "dataset/json_values.h"

namespace nerf_pose_refiner {
namespace {

constexpr auto kPolynomial = Distortion::Model::kPolynomial;
constexpr auto kFisheye = Distortion::Model::kFisheye;

constexpr ColmapLens kLenses[] = {
    {0, "SIMPLE_PINHOLE", 1, 0, kPolynomial}, {1, "PINHOLE", 2, 0, kPolynomial},
    {2, "SIMPLE_RADIAL", 1, 1, kPolynomial},  {3, "RADIAL", 1, 2, kPolynomial},
    {4, "OPENCV", 2, 4, kPolynomial},         {5, "OPENCV_FISHEYE", 2, 4, kFisheye},
    {6, "FULL_OPENCV", 2, 8, kPolynomial},    {8, "SIMPLE_RADIAL_FISHEYE", 1, 1, kFisheye},
    {9, "RADIAL_FISHEYE", 1, 2, kFisheye},    {14, "SIMPLE_FISHEYE", 1, 0, kFisheye},
    {15, "FISHEYE", 2, 0, kFisheye},
};

/// Those that are named in the message for a model that is not read, by their ids.
constexpr std::array<const char*, 18> kNames = {"SIMPLE_PINHOLE",
                                                "PINHOLE",
                                                "SIMPLE_RADIAL",
                                                "RADIAL",
                                                "OPENCV",
                                                "OPENCV_FISHEYE",
                                                "FULL_OPENCV",
                                                "FOV",
                                                "SIMPLE_RADIAL_FISHEYE",
                                                "RADIAL_FISHEYE",
                                                "THIN_PRISM_FISHEYE",
                                                "RAD_TAN_THIN_PRISM_FISHEYE",
                                                "SIMPLE_DIVISION",
                                                "DIVISION",
                                                "SIMPLE_FISHEYE",
                                                "FISHEYE",
                                                "EUCM",
                                                "EQUIRECTANGULAR"};

[[noreturn]] void failUnsupported(const std::string& name) {
  throw std::runtime_error("the camera model " + name +
                           " is not supported: undistort the photos with colmap image_undistorter");
}

void requirePositive(const char* name, double value) {
  if (!(std::isfinite(value) && value > 0)) {
    throw std::runtime_error(std::string("a camera's ") + name + " is " + std::to_string(value) +
                             ", must be positive");
  }
}

}  // namespace

const ColmapLens& colmapLens(int id) {
  for (const ColmapLens& lens : kLenses) {
    if (lens.id == id) return lens;
  }
  const bool known = id >= 0 && id < static_cast<int>(kNames.size());
  failUnsupported(known ? kNames[static_cast<std::size_t>(id)] : "of number " + std::to_string(id));
}

const ColmapLens& colmapLens(const std::string& name) {
  for (const ColmapLens& lens : kLenses) {
    if (lens.name == name) return lens;
  }
  failUnsupported(name.substr(0, 100));
}

ColmapCamera colmapCamera(const ColmapLens& lens, double width, double height,
                          const std::vector<double>& parameters) {
  if (parameters.size() != lens.parameters()) {
    throw std::runtime_error(std::string("a camera of the model ") + lens.name + " has " +
                             std::to_string(parameters.size()) + " parameters, must have " +
                             std::to_string(lens.parameters()));
  }
  const auto finite = [](double p) { return std::isfinite(p); };
  if (!std::all_of(parameters.begin(), parameters.end(), finite)) {
    throw std::runtime_error("a camera's parameter is not a finite number");
  }
  ColmapCamera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = parameters[0];
  camera.fy = parameters[lens.focal_lengths - 1];
  camera.cx = parameters[lens.focal_lengths];
  camera.cy = parameters[lens.focal_lengths + 1];
  requirePositive("width", width);
  requirePositive("height", height);
  requirePositive("focal length", camera.fx);
  requirePositive("focal length", camera.fy);
  Distortion& distortion = camera.distortion;
  distortion.model = lens.distortion;
  distortion.coefficients.assign(parameters.end() - static_cast<std::ptrdiff_t>(lens.coefficients),
                                 parameters.end());
  distortion.coefficients.resize(std::max<std::size_t>(4, lens.coefficients), 0.0);
  if (distortion.isZero()) distortion.coefficients.clear();
  return camera;
}

Pose colmapPose(const std::vector<double>& numbers) {
  const Eigen::Vector3d t(numbers.at(4), numbers.at(5), numbers.at(6));
  if (!t.allFinite()) throw std::runtime_error("a translation is not finite");
  const Eigen::Vector4d wxyz(numbers[0], numbers[1], numbers[2], numbers[3]);
  return {rotationOf(wxyz, "a photo's pose"), t};
}

void checkColmapPoint(const ScenePoint& point) {
  if (!point.position_O.allFinite() || !std::isfinite(point.error_px)) {
    throw std::runtime_error("a point is not finite");
  }
}

}  // namespace nerf_pose_refiner
