// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "recorded_depth.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>

#include "evaluation/clutter.h"
#include "image/io.h"

namespace nerf_pose_refiner {
namespace {

/// The object on a table, in which its axis z stands upright.
TriangleMesh onTable(TriangleMesh mesh) {
  constexpr double kHalfSide_m = 0.5;
  double z = 1e9;
  for (const Eigen::Vector3d& p : mesh.points) z = std::min(z, p.z());
  const int first = static_cast<int>(mesh.points.size());
  for (const double x : {-kHalfSide_m, kHalfSide_m}) {
    for (const double y : {-kHalfSide_m, kHalfSide_m}) mesh.points.emplace_back(x, y, z);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first + 1, first + 2, first + 3});
  return mesh;
}

}  // namespace

void RecordedDepthOptions::addTo(CLI::App* app) {
  app->add_option("--fault", fault, "of the depth")
      ->check(CLI::IsMember({"none", "zero", "millimetres", "scale", "late", "other"}));
  app->add_option("--noise-m", sensor.noise_m, "of a pixel at 0.6 m");
  app->add_option("--holes", sensor.holes, "fraction of the image");
  app->add_option("--bias-px", sensor.bias_px, "of disparity");
  app->add_option("--cover", cover, "fraction of the object behind a card");
  app->add_flag("--table", table, "the object stands on a table, where seen from above");
  app->add_option("--shown", shown,
                  "a mesh that depth shows in the object's place: no pose is right then");
}

RecordedDepth::RecordedDepth(const RecordedDepthOptions& options, const std::string& folder,
                             const FieldMetadata& object)
    : options_(options),
      sequence_(readSequence(folder)),
      mesh_(readMesh(options.shown.empty() ? folder + "/object.obj" : options.shown)),
      on_table_(onTable(mesh_)),
      object_(object),
      unit_m_(object.metres_per_unit > 0 ? object.metres_per_unit : 1) {}

double RecordedDepth::diameter_m() const { return unit_m_ * object_.diameter; }

Eigen::Vector3d RecordedDepth::centreInCamera(std::size_t i) const {
  return sequence_.frames[i].T_C_O * (unit_m_ * object_.centre);
}

/// Seen from below, there is no table.
const TriangleMesh& RecordedDepth::meshAt(const Pose& T_D_O) const {
  constexpr double kLowest = 0.2;  // sine of the elevation
  const Eigen::Vector3d eye = T_D_O.inverse().t;
  return options_.table && eye.z() > kLowest * eye.norm() ? on_table_ : mesh_;
}

/// A card before one side of the object, of the part of its width that is to be covered.
DepthSurroundings RecordedDepth::surroundings(std::size_t i, const Camera& camera,
                                              const Pose& T_C_D) const {
  DepthSurroundings around;
  const Eigen::Vector3d centre_D = T_C_D.inverse() * centreInCamera(i);
  around.wall_m = std::max(around.wall_m, centre_D.z() + 2 * diameter_m());
  if (!(options_.cover > 0)) return around;
  around.card_m = centre_D.z() - 0.6 * diameter_m();
  const Eigen::Vector2d at = camera.project(centre_D);
  const double half_px = 0.5 * diameter_m() * camera.fx / centre_D.z();
  const int left = static_cast<int>(at.x() - half_px);
  around.card = {left, static_cast<int>(at.y() - half_px),
                 static_cast<int>(2 * options_.cover * half_px), static_cast<int>(2 * half_px)};
  return around;
}

std::shared_ptr<const DepthImage> RecordedDepth::depthOf(std::size_t i) const {
  constexpr std::size_t kLate = 2;
  const std::string& fault = options_.fault;
  const Pose T_C_D(Eigen::Matrix3d::Identity(), {options_.beside_m, 0, 0});
  const std::size_t shown = fault == "late" && i >= kLate ? i - kLate
                            : fault == "other"            ? (i + 97) % sequence_.frames.size()
                                                          : i;
  const Camera& camera = sequence_.camera;
  std::mt19937_64 random(1000 + shown);
  const Pose T_D_O = T_C_D.inverse() * sequence_.frames[shown].T_C_O;
  ImageOf<float> metres =
      stereoDepth(trueDepth(meshAt(T_D_O), T_D_O, camera, surroundings(shown, camera, T_C_D)),
                  camera, options_.sensor, &random);
  const double scale = fault == "zero"          ? 0
                       : fault == "millimetres" ? 1000
                       : fault == "scale"       ? 1.1
                                                : 1;
  for (float& value : metres.values) value *= static_cast<float>(scale);
  return depthImage(std::move(metres), camera, T_C_D);
}

Observation RecordedDepth::coloursOf(std::size_t i) const {
  Image8 image = readImage(sequence_.frames[i].file);
  if (options_.cover > 0) {
    const PixelWindow card = surroundings(i, sequence_.camera, {}).card;
    const Image colours = clutter(image.width, image.height, 3);
    for (int y = std::max(0, card.y); y < std::min(image.height, card.y + card.height); ++y) {
      for (int x = std::max(0, card.x); x < std::min(image.width, card.x + card.width); ++x) {
        for (int c = 0; c < 3; ++c) {
          image.at(x, y, c) = static_cast<std::uint8_t>(255 * colours.at(x, y, c));
        }
      }
    }
  }
  return observe(std::move(image), sequence_.camera);
}

}  // namespace nerf_pose_refiner
