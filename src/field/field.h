// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

/// An axis-aligned box [model units].
struct Box {
  Eigen::Vector3d min = Eigen::Vector3d::Constant(-0.5);
  Eigen::Vector3d max = Eigen::Vector3d::Constant(0.5);

  /// Whether the ray from a point in a direction (of any length) meets the box.
  bool meets(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;
};

/// Shape of a hash-grid radiance field (Mueller et al. 2022) and how rays are sampled in it.
/// Lengths here are in units of the field's cube N, whose side is 1.
struct FieldConfig {
  std::string profile = "cpu";  ///< name of the profile it was made from

  int levels = 8;               ///< of the hash grid, 1..32
  int features = 4;             ///< per entry: 1, 2, 4 or 8
  int log2_table_size = 17;     ///< most entries of a level, 2^this
  int base_resolution = 16;     ///< cells along the cube at level 0
  int finest_resolution = 512;  ///< cells along the cube at the last level

  int density_width = 32;         ///< neurons of a hidden layer of the density network
  int density_hidden_layers = 1;  ///< >= 1
  int geometry_features = 15;     ///< outputs of the density network beside the density logit
  int colour_width = 32;
  int colour_hidden_layers = 1;  ///< >= 1
  int sh_degree = 4;             ///< spherical harmonics of the direction, 1..4 (degree^2 numbers)

  float step = 1.7320508f / 512;   ///< length of a sample's interval at the camera, 1e-3..1
  float cone_angle = 0;            ///< intervals grow as max(step, cone_angle * distance)
  int occupancy_resolution = 128;  ///< cells along the cube, a multiple of 8

  /// Named shapes: "cpu" (fast without a GPU), "gpu" (the same with 2^19 entries a level: finer),
  /// "paper" (16 x 2, 2^19, 16..2048, 64 wide).
  /// @throws std::invalid_argument listing the names that exist.
  static FieldConfig named(const std::string& profile);
  static std::vector<std::string> profileNames();

  /// @throws std::invalid_argument naming the field and the value that is out of range.
  void validate() const;
};

/// One level of the grid: `resolution` cells along the cube, so (resolution + 1)^3 vertices,
/// indexed densely while they fit the table, hashed otherwise.
struct GridLevel {
  int resolution = 0;
  std::uint32_t entries = 0;  ///< of the table, a multiple of 8
  std::uint32_t offset = 0;   ///< of its first entry in the whole table
  bool hashed = false;
};

/// Levels of a configuration: resolution_l = floor(base * growth^l + 0.5) with growth =
/// (finest / base)^(1 / (levels - 1)).
std::vector<GridLevel> gridLevels(const FieldConfig& config);

/// Which cells of the cube may be occupied, dilated by one cell; the rest is skipped. Bit i of
/// byte i/8 belongs to cell i = (z * n + y) * n + x.
struct OccupancyGrid {
  int resolution = 0;  ///< n cells along the cube; 0: everything is occupied
  std::vector<std::uint8_t> bits;

  bool occupied(int x, int y, int z) const {
    const std::size_t i = (static_cast<std::size_t>(z) * resolution + y) * resolution + x;
    return resolution == 0 || (bits[i >> 3] >> (i & 7) & 1) != 0;
  }
};

/// How far a rendering is from a photo where nothing is wrong: the held-out views at their true
/// poses. The tool `train` reports it; nothing else uses it yet.
struct ScoreStatistics {
  int views = 0;         ///< 0: unknown
  double mean_loss = 0;  ///< root mean square colour error where a view shows the object; its mean
  double stddev_loss = 0;
};

/// How well keyframes explain images by right and by wrong poses (@see KeyframeAligner::align).
struct KeyframeScores {
  int poses = 0;               ///< wrong ones that were judged; 0: unknown
  double wrong_mean = 0;       ///< of the best wrong pose in each image
  double wrong_deviation = 0;  ///< standard, of the same
  double right_mean = 0;       ///< of right poses in bad images
  double right_deviation = 0;  ///< standard, of the same
};

/// How well poses of views are found again, whose poses are known: what a refinement may be
/// believed. Of views before clutter, refined from a little off.
struct PoseStatistics {
  int views = 0;  ///< 0: unknown
  /// Standard deviations of the error, beyond what a refinement expects by its own account; with
  /// keyframes from beside a pose they are larger (refinement/pose_probability.h, besideFactor).
  double lateral = 0;      ///< of the object's centre, across the line of sight [diameters]
  double depth = 0;        ///< of it, along the line of sight [fraction of its distance]
  double tilt_rad = 0;     ///< about axes across the line of sight
  double roll_rad = 0;     ///< about the line of sight
  double right_score = 0;  ///< mean score of these poses
  double wrong_score = 0;  ///< mean score of poses that were refined from a wrong side
  KeyframeScores keyframes;
};

/// Motions of the object after which it may be taken for itself: it looks the same from some sides,
/// or nearly so from all. A bottle looks the same at any turn while its label is out of sight.
/// Unlike symmetries, which somebody declared, they make poses wrong.
struct LookAlikes {
  static constexpr std::size_t kMaxMotions = 16;

  bool measured = false;
  std::optional<SymmetryAxis> axis;  ///< any turn about it, in O [model units]
  std::vector<Pose> motions;         ///< others, in O [model units]

  bool any() const { return axis || !motions.empty(); }
};

/// What is known of the object beside its looks.
struct FieldMetadata {
  std::string name;
  double metres_per_unit = 0;  ///< 0: unknown
  double diameter = 0;         ///< of the object, model units: the extent of the opaque cells
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< opacity-weighted mean, model units
  double psnr_db = 0;  ///< mean over held-out views on black; 0: none were held out
  /// How much the photos' exposures differed before they were made equal: root of the mean square
  /// of the logarithm of a mean grey; 0: not enough for that. Nothing: they were not compared.
  std::optional<double> exposure_spread;
  ScoreStatistics score;
  PoseStatistics pose;
  LookAlikes look_alikes;
  std::string data_hash;  ///< of the images, poses and settings it was trained from
  std::uint64_t seed = 0;
  std::uint64_t training_steps = 0;

  // Not in the model's own file, but in the object's metadata (ObjectMetadata).
  Pose T_O_U;              ///< the frame U that users mean by the object's, in the model's [units]
  Symmetries symmetries;   ///< in O [model units]
  std::optional<Box> box;  ///< in U [model units]; nothing: that of the field counts
};

/// A learned object: parameters of a hash-grid radiance field, frozen.
///
/// Space: `box` bounds the object in model units (frame O); the cube N is the cube around the box
/// with the same centre: x_N = (x_O - cube_centre) / cube_side + 0.5. Density outside the box is 0.
/// Density is per unit of N, so that a scaled scene gives the same image. The colours are
/// sRGB-encoded; a rendering is premultiplied RGB and alpha.
///
/// Networks have no biases. Weights are row-major [outputs][inputs], layer after layer. Density:
/// encoding -> hidden (ReLU) -> 1 + geometry_features; density = exp(output 0). Colour: spherical
/// harmonics of the direction, then the geometry features -> hidden (ReLU) -> 3 logits (sigmoid).
struct Field {
  FieldConfig config;
  FieldMetadata metadata;
  Box box;
  std::vector<std::uint16_t> grid;  ///< [entry][features], IEEE half bits, levels in order
  std::vector<float> density_weights;
  std::vector<float> colour_weights;
  OccupancyGrid occupancy;

  Eigen::Vector3d cubeCentre() const { return 0.5 * (box.min + box.max); }
  double cubeSide() const { return (box.max - box.min).maxCoeff(); }

  /// @throws std::invalid_argument if sizes do not fit the configuration or a value is not finite.
  void validate() const;
};

/// Shape of a network: hidden layers of one width and an output layer, without biases.
struct NetworkShape {
  int inputs;
  int width;
  int hidden_layers;  ///< >= 1
  int outputs;
};
NetworkShape densityNetwork(const FieldConfig& config);
NetworkShape colourNetwork(const FieldConfig& config);

/// Numbers of weights of the two networks.
std::size_t densityWeightCount(const FieldConfig& config);
std::size_t colourWeightCount(const FieldConfig& config);

}  // namespace nerf_pose_refiner
