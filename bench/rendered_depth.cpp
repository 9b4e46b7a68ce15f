// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "rendered_depth.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

// "7", "7/1", "7//3" or "7/1/3".
int vertexOf(const std::string& corner, std::size_t points) {
  const int number = std::stoi(corner);
  return number > 0 ? number - 1 : static_cast<int>(points) + number;
}

void drawTriangle(const std::array<Eigen::Vector3d, 3>& corners_D, const Camera& camera,
                  ImageOf<float>* depth) {
  constexpr double kNear = 0.01;
  std::array<Eigen::Vector2d, 3> at;
  for (int k = 0; k < 3; ++k) {
    if (corners_D[k].z() < kNear) return;
    at[k] = camera.project(corners_D[k]);
  }
  const auto edge = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                       const Eigen::Vector2d& p) {
    return (b.x() - a.x()) * (p.y() - a.y()) - (b.y() - a.y()) * (p.x() - a.x());
  };
  const double area = edge(at[0], at[1], at[2]);
  if (area == 0) return;
  const auto [left, right] = std::minmax({at[0].x(), at[1].x(), at[2].x()});
  const auto [top, bottom] = std::minmax({at[0].y(), at[1].y(), at[2].y()});
  for (int y = std::max(0, static_cast<int>(std::ceil(top)));
       y <= std::min(camera.height - 1, static_cast<int>(std::floor(bottom))); ++y) {
    for (int x = std::max(0, static_cast<int>(std::ceil(left)));
         x <= std::min(camera.width - 1, static_cast<int>(std::floor(right))); ++x) {
      const Eigen::Vector2d p(x, y);
      double inverse = 0;
      bool inside = true;
      for (int k = 0; k < 3; ++k) {
        const double share = edge(at[(k + 1) % 3], at[(k + 2) % 3], p) / area;
        inside = inside && share >= 0;
        inverse += share / corners_D[k].z();
      }
      float& value = depth->at(x, y, 0);
      if (inside) value = std::min(value, static_cast<float>(1 / inverse));
    }
  }
}

// Means over squares of so many pixels, of numbers that are as wide apart as before.
ImageOf<float> smoothNoise(int width, int height, int window, std::mt19937_64* random) {
  std::normal_distribution<float> normal;
  ImageOf<float> drawn(width + window, height + window, 1);
  for (float& value : drawn.values) value = normal(*random);
  ImageOf<float> rows(width, height + window, 1), smooth(width, height, 1);
  for (int y = 0; y < rows.height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int k = 0; k < window; ++k) rows.at(x, y, 0) += drawn.at(x + k, y, 0);
    }
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int k = 0; k < window; ++k) smooth.at(x, y, 0) += rows.at(x, y + k, 0);
      smooth.at(x, y, 0) /= static_cast<float>(window);
    }
  }
  return smooth;
}

// At edges the nearer surface grows by a pixel, as block matching makes it. A window on a slanted
// surface sees its mean, which is that of the pixel in its middle.
ImageOf<float> fattened(const ImageOf<float>& truth, double focal_m) {
  constexpr double kEdge_px = 1;  // of disparity, from one pixel to the next
  ImageOf<float> fat = truth;
  for (int y = 0; y < truth.height; ++y) {
    for (int x = 1; x + 1 < truth.width; ++x) {
      const float here = truth.at(x, y, 0);
      const float near = std::min(truth.at(x - 1, y, 0), truth.at(x + 1, y, 0));
      if (focal_m / near - focal_m / here > kEdge_px) fat.at(x, y, 0) = near;
    }
  }
  return fat;
}

}  // namespace

TriangleMesh readMesh(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot open " + path);
  TriangleMesh mesh;
  std::string line, word;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    words >> word;
    if (word == "v") {
      Eigen::Vector3d p;
      words >> p.x() >> p.y() >> p.z();
      mesh.points.push_back(p);
    } else if (word == "f") {
      std::vector<int> corners;
      while (words >> word) corners.push_back(vertexOf(word, mesh.points.size()));
      for (std::size_t k = 2; k < corners.size(); ++k) {
        mesh.triangles.push_back({corners[0], corners[k - 1], corners[k]});
      }
    }
  }
  for (const auto& triangle : mesh.triangles) {
    for (const int corner : triangle) {
      if (corner < 0 || corner >= static_cast<int>(mesh.points.size())) {
        throw std::runtime_error(path + ": a face names a vertex that does not exist");
      }
    }
  }
  if (mesh.triangles.empty()) throw std::runtime_error(path + " has no triangles");
  return mesh;
}

ImageOf<float> trueDepth(const TriangleMesh& mesh, const Pose& T_D_O, const Camera& camera,
                         const DepthSurroundings& around) {
  ImageOf<float> depth(camera.width, camera.height, 1);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      depth.at(x, y, 0) =
          static_cast<float>(around.wall_m * (1 + 0.1 * std::sin(0.02 * x) * std::cos(0.03 * y)));
    }
  }
  for (const auto& triangle : mesh.triangles) {
    drawTriangle({T_D_O * mesh.points[triangle[0]], T_D_O * mesh.points[triangle[1]],
                  T_D_O * mesh.points[triangle[2]]},
                 camera, &depth);
  }
  if (!(around.card_m > 0)) return depth;
  const PixelWindow& card = around.card;
  for (int y = std::max(0, card.y); y < std::min(camera.height, card.y + card.height); ++y) {
    for (int x = std::max(0, card.x); x < std::min(camera.width, card.x + card.width); ++x) {
      depth.at(x, y, 0) = std::min(depth.at(x, y, 0), static_cast<float>(around.card_m));
    }
  }
  return depth;
}

ImageOf<float> stereoDepth(const ImageOf<float>& truth, const Camera& camera,
                           const StereoSensor& sensor, std::mt19937_64* random) {
  constexpr int kWindow = 5, kPatch = 15;
  const double focal_m = camera.fx * sensor.baseline_m;  // disparity times depth [px m]
  const double noise_px = sensor.noise_m * focal_m / (0.6 * 0.6);
  const ImageOf<float> noise = smoothNoise(camera.width, camera.height, kWindow, random);
  const ImageOf<float> holes = smoothNoise(camera.width, camera.height, kPatch, random);
  std::vector<float> sorted = holes.values;
  const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(
                                       sensor.holes * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), at, sorted.end());
  const float hole = sensor.holes > 0 ? *at : -HUGE_VALF;
  const ImageOf<float> fat = fattened(truth, focal_m);
  ImageOf<float> measured(camera.width, camera.height, 1);
  for (int y = 0; y < camera.height; ++y) {
    // The second camera stands to the right: it sees what no nearer thing hides from there, and a
    // thing hides what lies left of it.
    double leftmost = HUGE_VAL;  // where, in the second image, something nearer begins
    for (int x = camera.width - 1; x >= 0; --x) {
      const double true_px = focal_m / fat.at(x, y, 0), there = x - true_px;
      const bool shadowed = there >= leftmost;
      leftmost = std::min(leftmost, there);
      if (shadowed || holes.at(x, y, 0) < hole) continue;
      double disparity = true_px + sensor.bias_px + noise_px * noise.at(x, y, 0);
      disparity = sensor.step_px * std::round(disparity / sensor.step_px);
      if (disparity > 1) measured.at(x, y, 0) = static_cast<float>(focal_m / disparity);
    }
  }
  return measured;
}

}  // namespace nerf_pose_refiner
