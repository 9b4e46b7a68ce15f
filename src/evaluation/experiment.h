// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// What a scene's images show.
enum class SceneKind {
  kSynthetic,      ///< an object with known opacity (NeRF Synthetic); a unit is the dataset's,
                   ///< unless that is in metres: then as of kMasked
  kForwardFacing,  ///< a whole scene, seen from the front (LLFF); a unit is the dataset's
  kMasked,         ///< photos of an object with masks; its diameter counts as 2.5 units
};
const char* sceneKindName(SceneKind kind);             ///< synthetic, forward_facing, masked
SceneKind sceneKindFromName(const std::string& name);  ///< @throws std::invalid_argument

/// A scene of a data folder.
struct Scene {
  std::string name;       ///< of its folder
  std::string test_path;  ///< its transforms_test.json
};

/// All folders below `folder`, three levels deep at most, that hold a transforms_test.json, in the
/// order of their names. @throws std::runtime_error if there are none, or two of one name.
std::vector<Scene> findScenes(const std::string& folder);

/// A way to search that differs from its method's preset. Negative: as the preset says.
struct SearchVariant {
  std::string label;            ///< in tables; empty: the preset itself
  int hypotheses = -1;          ///< of the first stage; alignment keeps fewer later
  int resampling = -1;          ///< 0: none, as many steps in one go
  double anneal_fraction = -1;  ///< of inversion, @see RateSchedule
  std::string update;           ///< of inversion, @see PoseUpdate; empty: as the preset says
  double image_scale = 1;       ///< of the observed image's width and height
  std::string profile;          ///< of the field; empty: the model of the scene, whatever it has
};

/// Trials of one kind: every scene of the kinds, condition, view, start, method, loss and variant.
struct Experiment {
  std::string name;
  std::string protocol = "paper";    ///< or "robot", "far", @see TrialProtocol
  std::vector<std::string> methods;  ///< inerf, single, multiple, alignment, keyframes, detection
  std::vector<std::string> losses;   ///< of the first three; the others have their own
  std::vector<std::string> conditions;  ///< @see TrialObservation::named
  std::vector<SceneKind> kinds;         ///< of scenes
  std::vector<SearchVariant> variants;
  int views = 20;       ///< at most, evenly spread over the test views
  int starts = 5;       ///< of each view
  bool traces = false;  ///< also write how the errors fall
};

/// What is run, fixed in a file.
struct ExperimentPlan {
  std::uint64_t seed = 1;  ///< of starts, noise and searches
  std::vector<Experiment> experiments;
};

/// Reads a JSON file as config/experiments.json is. @throws std::runtime_error naming the file and
/// what is wrong in it: a key that is not known, a value of another type or out of range.
ExperimentPlan loadExperiments(const std::string& path);

/// The views that are tried: numbers of `views` of `available` ones, evenly spread.
std::vector<int> chosenViews(int views, int available);

}  // namespace nerf_pose_refiner
