// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/description.h"

#include <algorithm>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "files/json.h"

namespace nerf_pose_refiner {
namespace {

/// The version of the alignment that keyframe scores are measured with: another one scores the same
/// pose differently, and they have to be measured again.
constexpr int kScoredAlignment = 6;

/// What the deviations of pose statistics are measured with.
constexpr const char* kErrorsOf = "keyframes";

using Json = nlohmann::json;

// Each list of names is written once and serves both ways.

template <typename Config, typename Visitor>
void visitConfig(Config& c, Visitor visit) {
  visit("profile", c.profile);
  visit("levels", c.levels);
  visit("features", c.features);
  visit("log2_table_size", c.log2_table_size);
  visit("base_resolution", c.base_resolution);
  visit("finest_resolution", c.finest_resolution);
  visit("density_width", c.density_width);
  visit("density_hidden_layers", c.density_hidden_layers);
  visit("geometry_features", c.geometry_features);
  visit("colour_width", c.colour_width);
  visit("colour_hidden_layers", c.colour_hidden_layers);
  visit("sh_degree", c.sh_degree);
  visit("step", c.step);
  visit("cone_angle", c.cone_angle);
  visit("occupancy_resolution", c.occupancy_resolution);
}

template <typename Metadata, typename Visitor>
void visitMetadata(Metadata& m, Visitor visit) {
  visit("name", m.name);
  visit("metres_per_unit", m.metres_per_unit);
  visit("diameter", m.diameter);
  visit("centre", m.centre);
  visit("psnr_db", m.psnr_db);
  visit("score_views", m.score.views);
  visit("score_mean_loss", m.score.mean_loss);
  visit("score_stddev_loss", m.score.stddev_loss);
  visit("data_hash", m.data_hash);
  visit("seed", m.seed);
  visit("training_steps", m.training_steps);
}

template <typename Statistics, typename Visitor>
void visitPoseStatistics(Statistics& s, Visitor visit) {
  visit("views", s.views);
  visit("lateral", s.lateral);
  visit("depth", s.depth);
  visit("tilt_rad", s.tilt_rad);
  visit("roll_rad", s.roll_rad);
  visit("right_score", s.right_score);
  visit("wrong_score", s.wrong_score);
}

template <typename Scores, typename Visitor>
void visitKeyframeScores(Scores& s, Visitor visit) {
  visit("poses", s.poses);
  visit("wrong_mean", s.wrong_mean);
  visit("wrong_deviation", s.wrong_deviation);
  visit("right_mean", s.right_mean);
  visit("right_deviation", s.right_deviation);
}

Json toJson(const LookAlikes& known) {
  const auto numbers = [](const auto& matrix) {
    return std::vector<double>(matrix.data(), matrix.data() + matrix.size());
  };
  Json json;
  json["motions"] = Json::array();
  for (const Pose& motion : known.motions) {
    json["motions"].push_back({{"R", numbers(motion.R)}, {"t", numbers(motion.t)}});
  }
  if (known.axis) {
    json["axis"] = {{"direction", numbers(known.axis->direction)},
                    {"point", numbers(known.axis->point)}};
  }
  return json;
}

template <typename Matrix>
Matrix matrixOf(const Json& json) {
  const auto numbers = json.get<std::vector<double>>();
  Matrix matrix;
  if (static_cast<Eigen::Index>(numbers.size()) != matrix.size()) {
    throw std::runtime_error("look_alikes has vectors of another size");
  }
  std::copy(numbers.begin(), numbers.end(), matrix.data());
  return matrix;
}

LookAlikes lookAlikesFrom(const Json& json) {
  LookAlikes known;
  known.measured = true;
  for (const Json& motion : json.at("motions")) {
    known.motions.emplace_back(matrixOf<Eigen::Matrix3d>(motion.at("R")),
                               matrixOf<Eigen::Vector3d>(motion.at("t")));
  }
  if (json.contains("axis")) {
    known.axis = SymmetryAxis{matrixOf<Eigen::Vector3d>(json.at("axis").at("direction")),
                              matrixOf<Eigen::Vector3d>(json.at("axis").at("point"))};
  }
  return known;
}

template <typename BoxType, typename Visitor>
void visitBox(BoxType& box, Visitor visit) {
  visit("min", box.min);
  visit("max", box.max);
}

class Writer {
 public:
  explicit Writer(Json* object) : object_(*object) {}
  template <typename T>
  void operator()(const char* key, const T& value) const {
    object_[key] = value;
  }
  void operator()(const char* key, const Eigen::Vector3d& v) const {
    object_[key] = {v.x(), v.y(), v.z()};
  }

 private:
  Json& object_;
};

class Reader {
 public:
  explicit Reader(const Json& object) : object_(object) {}
  template <typename T>
  void operator()(const char* key, T& value) const {
    const Json& json = object_.at(key);
    if (std::is_integral<T>::value && !json.is_number_integer()) {
      throw std::runtime_error(std::string(key) + " is not a whole number");
    }
    value = json.get<T>();
  }
  void operator()(const char* key, Eigen::Vector3d& v) const {
    for (int i = 0; i < 3; ++i) v[i] = object_.at(key).at(i).get<double>();
  }

 private:
  const Json& object_;
};

/// None if another alignment measured them.
KeyframeScores keyframeScoresFrom(const Json& json) {
  KeyframeScores scores;
  if (json.value("alignment", 1) == kScoredAlignment) visitKeyframeScores(scores, Reader(json));
  return scores;
}

/// Deviations of models that were measured by rendering, not with keyframes: these err more, so
/// that twice the variance counts, and more with keyframes from beside.
PoseStatistics poseStatisticsFrom(const Json& json) {
  constexpr double kOfKeyframes = 1.4142136;  // root of 2
  PoseStatistics statistics;
  visitPoseStatistics(statistics, Reader(json));
  if (json.value("errors_of", "renderings") == kErrorsOf) return statistics;
  for (double* deviation :
       {&statistics.lateral, &statistics.depth, &statistics.tilt_rad, &statistics.roll_rad}) {
    *deviation *= kOfKeyframes;
  }
  return statistics;
}

}  // namespace

std::string describe(const Field& field) {
  Json json;
  visitConfig(field.config, Writer(&json["config"]));
  visitMetadata(field.metadata, Writer(&json["metadata"]));
  if (field.metadata.exposure_spread) {
    json["metadata"]["exposure_spread"] = *field.metadata.exposure_spread;
  }
  visitPoseStatistics(field.metadata.pose, Writer(&json["pose_statistics"]));
  json["pose_statistics"]["errors_of"] = kErrorsOf;
  visitKeyframeScores(field.metadata.pose.keyframes, Writer(&json["keyframe_scores"]));
  json["keyframe_scores"]["alignment"] = kScoredAlignment;
  if (field.metadata.look_alikes.measured) {
    json["look_alikes"] = toJson(field.metadata.look_alikes);
  }
  visitBox(field.box, Writer(&json["box"]));
  json["has_occupancy"] = field.occupancy.resolution > 0;
  // A name that is no UTF-8 must not keep a model from being saved.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Field fieldFromDescription(const std::string& text) {
  Field field;
  try {
    const Json json = parseJson(text);
    visitConfig(field.config, Reader(json.at("config")));
    visitMetadata(field.metadata, Reader(json.at("metadata")));
    if (json.at("metadata").contains("exposure_spread")) {
      field.metadata.exposure_spread = json.at("metadata").at("exposure_spread").get<double>();
    }
    if (json.contains("pose_statistics")) {  // models of before do not have them
      field.metadata.pose = poseStatisticsFrom(json.at("pose_statistics"));
    }
    if (json.contains("keyframe_scores")) {
      field.metadata.pose.keyframes = keyframeScoresFrom(json.at("keyframe_scores"));
    }
    if (json.contains("look_alikes")) {
      field.metadata.look_alikes = lookAlikesFrom(json.at("look_alikes"));
    }
    visitBox(field.box, Reader(json.at("box")));
    field.config.validate();
    if (json.at("has_occupancy").get<bool>()) {
      field.occupancy.resolution = field.config.occupancy_resolution;
    }
  } catch (const Json::exception& error) {
    throw std::runtime_error(error.what());
  }
  return field;
}

}  // namespace nerf_pose_refiner
