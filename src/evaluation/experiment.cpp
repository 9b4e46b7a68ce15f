// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/experiment.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <type_traits>

#include "evaluation/trial_observation.h"
#include "field/field.h"
#include "math/loss.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

constexpr std::array<const char*, 3> kKinds = {"synthetic", "forward_facing", "masked"};
constexpr int kFolderDepth = 3;
const std::vector<std::string> kMethods = {"inerf",     "single",    "multiple",
                                           "alignment", "keyframes", "detection"};

[[noreturn]] void fail(const std::string& where, const std::string& what) {
  throw std::invalid_argument(where + ": " + what);
}

/// Takes the keys of an object out one by one; what is left is not known.
class Keys {
 public:
  Keys(const Json& json, std::string where) : where_(std::move(where)) {
    if (!json.is_object()) fail(where_, "must be an object");
    rest_ = json;
  }

  template <typename Value>
  void get(const char* key, Value* value) {
    const auto found = rest_.find(key);
    if (found == rest_.end()) return;
    if (std::is_integral<Value>::value && found->is_number()) {  // 3.7 is not 3, -1 is no seed
      const bool fits =
          std::is_signed<Value>::value ? found->is_number_integer() : found->is_number_unsigned();
      if (!fits) fail(where_ + "." + key, "must be a whole number, is " + found->dump());
    }
    try {
      *value = found->template get<Value>();
    } catch (const Json::exception& error) {
      fail(where_ + "." + key, error.what());
    }
    rest_.erase(found);
  }
  Json take(const char* key) {
    Json value;
    get(key, &value);
    return value;
  }
  void rejectUnknown() const {
    if (!rest_.empty()) fail(where_, "unknown key '" + rest_.begin().key() + "'");
  }
  void require(bool holds, const char* key, const char* range) const {
    if (!holds) fail(where_ + "." + key, std::string("must be ") + range);
  }
  /// Every name must be one of the known ones, and there must be one.
  void requireNames(const char* key, const std::vector<std::string>& names,
                    const std::vector<std::string>& known) const {
    if (names.empty()) fail(where_ + "." + key, "names nothing");
    for (const std::string& name : names) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      std::string list;
      for (const std::string& one : known) list += (list.empty() ? "" : ", ") + one;
      fail(where_ + "." + key, "there is no '" + name + "' among " + list);
    }
  }

 private:
  Json rest_;
  std::string where_;
};

SearchVariant variantFrom(const Json& json, const std::string& where) {
  SearchVariant variant;
  Keys keys(json, where);
  keys.get("label", &variant.label);
  keys.get("hypotheses", &variant.hypotheses);
  keys.get("resampling", &variant.resampling);
  keys.get("anneal_share", &variant.anneal_fraction);
  keys.get("update", &variant.update);
  keys.get("image_scale", &variant.image_scale);
  keys.get("profile", &variant.profile);
  keys.rejectUnknown();
  keys.require(variant.hypotheses == -1 || (variant.hypotheses >= 1 && variant.hypotheses <= 4096),
               "hypotheses", "1..4096");
  keys.require(variant.resampling >= -1 && variant.resampling <= 1, "resampling", "0 or 1");
  keys.require(variant.image_scale >= 0.1 && variant.image_scale <= 1, "image_scale", "0.1..1");
  keys.require(variant.anneal_fraction == -1 ||
                   (variant.anneal_fraction >= 0 && variant.anneal_fraction <= 1),
               "anneal_share", "0..1");
  if (!variant.update.empty()) {
    keys.requireNames("update", {variant.update}, {"about_camera", "about_object", "twist"});
  }
  if (!variant.profile.empty()) {
    keys.requireNames("profile", {variant.profile}, FieldConfig::profileNames());
  }
  keys.require(variant.label.find_first_of(",\"\n") == std::string::npos, "label",
               "without commas and quotes");
  return variant;
}

Experiment experimentFrom(const Json& json, const std::string& where) {
  Experiment e;
  e.losses = {"l2"};
  e.conditions = {"clean"};
  e.methods = {"inerf", "single", "multiple", "alignment"};
  std::vector<std::string> kinds(kKinds.begin(), kKinds.end()), losses;
  const std::vector<std::string> all_kinds = kinds;
  for (int i = 0; i < kLossCount; ++i) losses.push_back(lossName(static_cast<Loss>(i)));
  Keys keys(json, where);
  keys.get("name", &e.name);
  keys.get("protocol", &e.protocol);
  keys.get("methods", &e.methods);
  keys.get("losses", &e.losses);
  keys.get("conditions", &e.conditions);
  keys.get("kinds", &kinds);
  keys.get("views", &e.views);
  keys.get("starts", &e.starts);
  keys.get("traces", &e.traces);
  const Json variants = keys.take("variants");
  keys.rejectUnknown();
  keys.require(!e.name.empty() && e.name.find_first_of(",\"\n") == std::string::npos, "name",
               "a word without commas and quotes");
  keys.requireNames("protocol", {e.protocol}, {"paper", "robot", "far"});
  keys.requireNames("methods", e.methods, kMethods);
  keys.requireNames("losses", e.losses, losses);
  keys.requireNames("conditions", e.conditions, TrialObservation::conditionNames());
  keys.requireNames("kinds", kinds, all_kinds);
  keys.require(e.views >= 1 && e.views <= 10000, "views", "1..10000");
  keys.require(e.starts >= 1 && e.starts <= 1000, "starts", "1..1000");
  for (const std::string& kind : kinds) e.kinds.push_back(sceneKindFromName(kind));
  if (!variants.is_null() && !variants.is_array()) fail(where + ".variants", "must be an array");
  for (const Json& variant : variants) {
    e.variants.push_back(variantFrom(variant, where + ".variants"));
  }
  if (e.variants.empty()) e.variants.emplace_back();
  return e;
}

ExperimentPlan planFrom(const Json& json) {
  ExperimentPlan plan;
  Keys keys(json, "the plan");
  keys.get("seed", &plan.seed);
  const Json experiments = keys.take("experiments");
  keys.rejectUnknown();
  if (!experiments.is_array() || experiments.empty()) {
    fail("experiments", "must be an array of one or more");
  }
  std::set<std::string> names;
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    const std::string where = "experiments[" + std::to_string(i) + "]";
    plan.experiments.push_back(experimentFrom(experiments[i], where));
    if (!names.insert(plan.experiments.back().name).second) fail(where, "its name is taken");
  }
  return plan;
}

void collectScenes(const fs::path& folder, int depth, std::vector<Scene>* scenes) {
  const fs::path test = folder / "transforms_test.json";
  if (fs::is_regular_file(test)) {
    scenes->push_back({folder.filename().string(), test.string()});
    return;
  }
  if (depth == kFolderDepth) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) collectScenes(entry.path(), depth + 1, scenes);
  }
}

}  // namespace

const char* sceneKindName(SceneKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

SceneKind sceneKindFromName(const std::string& name) {
  const auto* found = std::find(kKinds.begin(), kKinds.end(), name);
  if (found == kKinds.end()) {
    throw std::invalid_argument("no kind of scene is called '" + name +
                                "'; there are synthetic, forward_facing, masked");
  }
  return static_cast<SceneKind>(found - kKinds.begin());
}

std::vector<Scene> findScenes(const std::string& folder) {
  std::vector<Scene> scenes;
  collectScenes(fs::canonical(folder), 0, &scenes);
  if (scenes.empty()) {
    throw std::runtime_error("'" + folder + "' holds no folder with a transforms_test.json");
  }
  std::sort(scenes.begin(), scenes.end(),
            [](const Scene& a, const Scene& b) { return a.name < b.name; });
  for (const Scene& scene : scenes) {
    if (scene.name.find_first_of(",\"\n") != std::string::npos) {
      throw std::runtime_error("the scene '" + scene.name +
                               "' has a comma, a quote or a line's end " +
                               "in its name, which tables cannot hold");
    }
  }
  for (std::size_t i = 1; i < scenes.size(); ++i) {
    if (scenes[i].name == scenes[i - 1].name) {
      throw std::runtime_error("two scenes are called '" + scenes[i].name + "': '" +
                               scenes[i - 1].test_path + "' and '" + scenes[i].test_path + "'");
    }
  }
  return scenes;
}

ExperimentPlan loadExperiments(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read '" + path + "': " + std::strerror(errno));
  try {
    return planFrom(Json::parse(file));
  } catch (const Json::exception& error) {
    throw std::runtime_error("'" + path + "': " + error.what());
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error("'" + path + "': " + error.what());
  }
}

std::vector<int> chosenViews(int views, int available) {
  const int count = std::min(views, available);
  std::vector<int> chosen;
  for (int v = 0; v < count; ++v) {
    chosen.push_back(static_cast<int>(static_cast<std::int64_t>(v) * available / count));
  }
  return chosen;
}

}  // namespace nerf_pose_refiner
