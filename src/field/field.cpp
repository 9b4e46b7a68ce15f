// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

constexpr double kSqrt3 = 1.7320508075688772;
// 1733 samples on the longest ray: as many as the backends hold of one ray.
constexpr float kShortestStep = 1e-3f;

void require(bool condition, const std::string& what) {
  if (!condition) throw std::invalid_argument(what);
}

void requireInRange(const char* name, int value, int lowest, int highest) {
  require(value >= lowest && value <= highest,
          std::string("FieldConfig::") + name + " is " + std::to_string(value) + ", must be in " +
              std::to_string(lowest) + ".." + std::to_string(highest));
}

void requireSize(const char* name, std::size_t size, std::size_t expected) {
  require(size == expected, std::string("Field::") + name + " holds " + std::to_string(size) +
                                " values, its configuration asks for " + std::to_string(expected));
}

void requireFinite(const char* name, const std::vector<float>& values) {
  const bool finite =
      std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
  require(finite, std::string("Field::") + name + " holds a value that is not finite");
}

void requireLength(const char* name, double value) {
  require(std::isfinite(value) && value >= 0, std::string("FieldMetadata::") + name + " is " +
                                                  std::to_string(value) +
                                                  ", must be finite and not negative");
}

/// Exponent bits all set: infinite or not a number.
bool isFiniteHalf(std::uint16_t bits) { return (bits & 0x7c00u) != 0x7c00u; }

std::size_t weightCount(const NetworkShape& shape) {
  const std::size_t w = shape.width;
  return shape.inputs * w + (shape.hidden_layers - 1) * w * w + w * shape.outputs;
}

FieldConfig gpuConfig() {
  FieldConfig c;
  c.profile = "gpu";
  c.log2_table_size = 19;
  return c;
}

FieldConfig paperConfig() {
  FieldConfig c;
  c.profile = "paper";
  c.levels = 16;
  c.features = 2;
  c.log2_table_size = 19;
  c.finest_resolution = 2048;
  c.density_width = 64;
  c.colour_width = 64;
  c.colour_hidden_layers = 2;
  c.step = static_cast<float>(kSqrt3 / 1024);
  return c;
}

}  // namespace

bool Box::meets(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int a = 0; a < 3; ++a) {
    if (direction[a] == 0) {
      if (origin[a] < min[a] || origin[a] > max[a]) return false;
      continue;
    }
    const double t0 = (min[a] - origin[a]) / direction[a];
    const double t1 = (max[a] - origin[a]) / direction[a];
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  return enter <= leave;
}

FieldConfig FieldConfig::named(const std::string& profile) {
  if (profile == "cpu") return FieldConfig();
  if (profile == "gpu") return gpuConfig();
  if (profile == "paper") return paperConfig();
  std::string known;
  for (const std::string& name : profileNames()) known += (known.empty() ? "" : ", ") + name;
  throw std::invalid_argument("no field profile is called '" + profile + "'; there are " + known);
}

std::vector<std::string> FieldConfig::profileNames() { return {"cpu", "gpu", "paper"}; }

void FieldConfig::validate() const {
  requireInRange("levels", levels, 1, 32);
  requireInRange("features", features, 1, 8);
  require((features & (features - 1)) == 0,
          "FieldConfig::features is " + std::to_string(features) + ", must be 1, 2, 4 or 8");
  requireInRange("log2_table_size", log2_table_size, 4, 24);
  requireInRange("base_resolution", base_resolution, 1, 1 << 16);
  requireInRange("finest_resolution", finest_resolution, base_resolution, 1 << 16);
  requireInRange("density_width", density_width, 1, 256);
  requireInRange("density_hidden_layers", density_hidden_layers, 1, 8);
  requireInRange("geometry_features", geometry_features, 0, 63);
  requireInRange("colour_width", colour_width, 1, 256);
  requireInRange("colour_hidden_layers", colour_hidden_layers, 1, 8);
  requireInRange("sh_degree", sh_degree, 1, 4);
  require(step >= kShortestStep && step <= 1, "FieldConfig::step is " + std::to_string(step) +
                                                  ", must be in " + std::to_string(kShortestStep) +
                                                  "..1");
  require(cone_angle >= 0 && cone_angle < 1,
          "FieldConfig::cone_angle is " + std::to_string(cone_angle) + ", must be in [0, 1)");
  requireInRange("occupancy_resolution", occupancy_resolution, 8, 1024);
  require(occupancy_resolution % 8 == 0, "FieldConfig::occupancy_resolution is " +
                                             std::to_string(occupancy_resolution) +
                                             ", must be a multiple of 8");
}

std::vector<GridLevel> gridLevels(const FieldConfig& config) {
  const double span = static_cast<double>(config.finest_resolution) / config.base_resolution;
  const double growth = config.levels > 1 ? std::pow(span, 1.0 / (config.levels - 1)) : 1.0;
  const std::uint64_t table = std::uint64_t{1} << config.log2_table_size;

  std::vector<GridLevel> levels(config.levels);
  std::uint32_t offset = 0;
  for (int l = 0; l < config.levels; ++l) {
    const double resolution = std::floor(config.base_resolution * std::pow(growth, l) + 0.5);
    const std::uint64_t side = static_cast<std::uint64_t>(resolution) + 1;
    const std::uint64_t vertices = side * side * side;
    levels[l].resolution = static_cast<int>(resolution);
    levels[l].entries = static_cast<std::uint32_t>(std::min(table, (vertices + 7) / 8 * 8));
    levels[l].offset = offset;
    levels[l].hashed = vertices > table;
    offset += levels[l].entries;
  }
  return levels;
}

NetworkShape densityNetwork(const FieldConfig& config) {
  return {config.levels * config.features, config.density_width, config.density_hidden_layers,
          1 + config.geometry_features};
}

NetworkShape colourNetwork(const FieldConfig& config) {
  return {config.sh_degree * config.sh_degree + config.geometry_features, config.colour_width,
          config.colour_hidden_layers, 3};
}

std::size_t densityWeightCount(const FieldConfig& config) {
  return weightCount(densityNetwork(config));
}

std::size_t colourWeightCount(const FieldConfig& config) {
  return weightCount(colourNetwork(config));
}

namespace {

void validateLookAlikes(const LookAlikes& known) {
  require(known.motions.size() <= LookAlikes::kMaxMotions, "LookAlikes has too many motions");
  for (const Pose& motion : known.motions) {
    require(motion.isRigid() && motion.t.allFinite(),
            "LookAlikes::motions has one that is not rigid");
  }
  if (!known.axis) return;
  require(std::abs(known.axis->direction.norm() - 1) < 1e-6 && known.axis->point.allFinite(),
          "LookAlikes::axis is no axis");
}

}  // namespace

void Field::validate() const {
  config.validate();
  require(box.min.allFinite() && box.max.allFinite() && (box.min.array() < box.max.array()).all(),
          "Field::box is empty or not finite");
  requireLength("metres_per_unit", metadata.metres_per_unit);
  requireLength("diameter", metadata.diameter);
  require(metadata.centre.allFinite(), "FieldMetadata::centre is not finite");
  require(std::isfinite(metadata.psnr_db), "FieldMetadata::psnr_db is not finite");
  const double spread = metadata.exposure_spread.value_or(0);
  require(spread >= 0 && std::isfinite(spread), "FieldMetadata::exposure_spread is below 0");
  require(metadata.score.views >= 0, "ScoreStatistics::views is negative");
  require(std::isfinite(metadata.score.mean_loss) && std::isfinite(metadata.score.stddev_loss),
          "FieldMetadata::score is not finite");
  const PoseStatistics& pose = metadata.pose;
  require(pose.views >= 0, "PoseStatistics::views is negative");
  require(pose.keyframes.poses >= 0, "KeyframeScores::poses is negative");
  for (const double value :
       {pose.lateral, pose.depth, pose.tilt_rad, pose.roll_rad, pose.right_score, pose.wrong_score,
        pose.keyframes.wrong_mean, pose.keyframes.wrong_deviation, pose.keyframes.right_mean,
        pose.keyframes.right_deviation}) {
    require(value >= 0 && std::isfinite(value), "FieldMetadata::pose holds a value below 0");
  }
  validateLookAlikes(metadata.look_alikes);

  const GridLevel last = gridLevels(config).back();
  requireSize(
      "grid", grid.size(),
      (std::size_t{last.offset} + last.entries) * static_cast<std::size_t>(config.features));
  requireSize("density_weights", density_weights.size(), densityWeightCount(config));
  requireSize("colour_weights", colour_weights.size(), colourWeightCount(config));
  require(std::all_of(grid.begin(), grid.end(), isFiniteHalf),
          "Field::grid holds a value that is not finite");
  requireFinite("density_weights", density_weights);
  requireFinite("colour_weights", colour_weights);

  const std::size_t n = occupancy.resolution;
  require(occupancy.resolution == 0 || occupancy.resolution == config.occupancy_resolution,
          "OccupancyGrid::resolution is " + std::to_string(occupancy.resolution) +
              ", must be 0 or FieldConfig::occupancy_resolution");
  requireSize("occupancy", occupancy.bits.size(), n * n * n / 8);
}

}  // namespace nerf_pose_refiner
