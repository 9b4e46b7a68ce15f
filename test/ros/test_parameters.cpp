// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Parameters as the parameter server has them: files of config/, and every single one changed.
#include "ros/conversions/parameters.h"

#include <gtest/gtest.h>
#include <ros/ros.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "ros/capture/view_capture.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> logOf(const std::string& name) {
  ParamReader reader = ParamReader::ofNode(ros::NodeHandle(name));
  readParameters(reader);
  EXPECT_TRUE(reader.unknown().empty()) << reader.unknown().front();
  return reader.log();
}

/// What the struct holds, as a log without any parameter set.
std::vector<std::string> logOf(const PoseRefinerParameters& parameters) {
  ParamReader nothing(XmlRpc::XmlRpcValue(), "~");
  readParameters(nothing, parameters);
  return nothing.log();
}

/// The reading of parameters like the defaults but for one.
std::string errorFor(const std::function<void(XmlRpc::XmlRpcValue*)>& change) {
  XmlRpc::XmlRpcValue values;
  values["object"] = "mug";
  change(&values);
  ParamReader reader(values, "~");
  try {
    readParameters(reader);
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no error";
}

TEST(Parameters, EveryFileOfConfigIsLoadedHere) {
  for (const auto& entry : fs::directory_iterator(fs::path(NPR_SOURCE_DIR) / "config")) {
    if (entry.path().extension() == ".json") continue;  // plans of experiments, no parameters
    const std::string name = entry.path().stem().string();
    EXPECT_TRUE(ros::param::has("config/" + name)) << entry.path() << ": add it to parameters.test";
  }
}

TEST(Parameters, FilesOfConfigAreReadStrictly) {
  std::vector<std::string> names;
  ASSERT_TRUE(ros::param::getParamNames(names));
  EXPECT_FALSE(logOf("config/pose_refiner").empty());
}

/// What the parameters of capture_views come to, in a namespace where the few that have no default
/// are given.
std::vector<std::string> captureLogOf(XmlRpc::XmlRpcValue values) {
  values["name"] = "mug";
  values["dataset_root"] = "/tmp";
  values["object_reference_frame"] = "board";
  values["use_masks"] = true;
  ParamReader reader(values, "~");
  CaptureParameters::read(&reader);
  EXPECT_TRUE(reader.unknown().empty()) << reader.unknown().front();
  return reader.log();
}

TEST(Parameters, TheCapturesFileHoldsItsDefaults) {
  XmlRpc::XmlRpcValue taught;
  ASSERT_TRUE(ros::param::get("config/capture_views", taught));
  std::vector<std::string> lines = captureLogOf(taught);
  const auto is_empty_point = [](const std::string& line) {
    return line.find(": []") != std::string::npos;
  };
  lines.erase(std::remove_if(lines.begin(), lines.end(), is_empty_point), lines.end());
  EXPECT_EQ(lines, captureLogOf(XmlRpc::XmlRpcValue()));
}

TEST(Parameters, TheFileThatTeachesHoldsTheDefaults) {
  const std::vector<std::string> taught = logOf("config/pose_refiner");
  const std::vector<std::string> defaults = logOf(PoseRefinerParameters());
  ASSERT_EQ(taught.size(), defaults.size());
  for (std::size_t i = 0; i < taught.size(); ++i) EXPECT_EQ(taught[i], defaults[i]);
}

TEST(Parameters, EachOneReachesItsPlace) {
  const std::vector<std::string> changed = logOf("every_parameter");
  const std::vector<std::string> defaults = logOf(PoseRefinerParameters());
  for (const std::string& line : defaults) {
    EXPECT_EQ(std::count(changed.begin(), changed.end(), line), 0)
        << line << " is not changed by every_parameter.yaml";
  }
  // Whatever was read must be found again in the struct: no two names share a place. The stages
  // are a list, which the second reading leaves alone.
  ParamReader reader = ParamReader::ofNode(ros::NodeHandle("every_parameter"));
  const PoseRefinerParameters parameters = readParameters(reader);
  const std::vector<std::string> held = logOf(parameters);
  for (const std::string& line : changed) {
    if (line.find("/stages[") != std::string::npos) continue;
    EXPECT_EQ(std::count(held.begin(), held.end(), line), 1) << line << " was lost";
  }
}

TEST(Parameters, StagesReachTheirPlace) {
  ParamReader reader = ParamReader::ofNode(ros::NodeHandle("every_parameter"));
  const std::vector<AlignStageSettings> stages =
      readParameters(reader).tracker.initial.refiner.stages;
  ASSERT_EQ(stages.size(), 1u);
  EXPECT_EQ(stages[0].object_px, 41);
  EXPECT_EQ(stages[0].hypotheses, 42);
  EXPECT_EQ(stages[0].iterations, 43);
  EXPECT_EQ(stages[0].rays_per_side, 3);
  EXPECT_EQ(stages[0].blur_px, 1.25);
  EXPECT_EQ(stages[0].step_scale, 1.75);
}

TEST(Parameters, ThreadsAreThoseOfARegistrationToo) {
  XmlRpc::XmlRpcValue values;
  values["threads"] = 3;
  ParamReader reader(values, "~");
  EXPECT_EQ(readParameters(reader).registration.threads, 3);
}

TEST(Parameters, ChooseTheBackend) {
  for (const std::string backend : {"auto", "cpu", "cuda"}) {
    XmlRpc::XmlRpcValue values;
    values["backend"] = backend;
    values["threads"] = 3;
    values["instruction_set"] = "baseline";
    values["device"] = 2;
    ParamReader reader(values, "~");
    const BackendChoice choice = readParameters(reader).backendChoice();
    EXPECT_EQ(choice.backend, backend);
    EXPECT_EQ(choice.threads, 3);
    EXPECT_EQ(choice.instruction_set, "baseline");
    EXPECT_EQ(choice.device, 2);
  }
  EXPECT_NE(errorFor([](auto* v) { (*v)["backend"] = "gpu"; }), "no error");
}

TEST(Parameters, AWidthOfTheSearchHasBounds) {
  for (const std::string group : {"refiner", "tracker"}) {
    const auto error = [&](const std::string& name, double value) {
      return errorFor([&](auto* v) { (*v)[group][name] = value; });
    };
    EXPECT_EQ(error("rotation_deg", 180), "no error");
    EXPECT_EQ(error("translation", 100), "no error");
    EXPECT_EQ(error("rotation_deg", 180.5), "parameter ~" + group +
                                                "/rotation_deg is 180.5 but must be > 0 and at "
                                                "most 180");
    EXPECT_EQ(error("translation", 100.5), "parameter ~" + group +
                                               "/translation is 100.5 but must be > 0 and at most "
                                               "100");
    EXPECT_NE(error("translation", 0), "no error");
    EXPECT_NE(error("rotation_deg", std::numeric_limits<double>::infinity()), "no error");
    EXPECT_NE(error("rotation_deg", std::numeric_limits<double>::quiet_NaN()), "no error");
  }
}

TEST(Parameters, PresetsBringTheirStages) {
  XmlRpc::XmlRpcValue values;
  values["tracker"]["preset"] = "align";
  values["refiner"]["preset"] = "paper_single";
  ParamReader reader(values, "~");
  const PoseRefinerParameters parameters = readParameters(reader);
  EXPECT_EQ(parameters.tracker.tracking.refiner.stages.size(),
            RefinerSettings::named("align").stages.size());
  EXPECT_EQ(parameters.tracker.initial.refiner.method, Method::kInversion);
  EXPECT_EQ(parameters.tracker.initial.refiner.inversion.hypotheses, 1);
}

TEST(Parameters, MistakesAreNamed) {
  const auto expect = [](const std::string& part, const std::string& error) {
    EXPECT_NE(error.find(part), std::string::npos) << error;
  };
  EXPECT_EQ(errorFor([](auto*) {}), "no error");
  expect("~tracker/min_scroe: did you mean ~tracker/min_score?",
         errorFor([](auto* v) { (*v)["tracker"]["min_scroe"] = 0.5; }));
  expect("~refiner/rotation: did you mean",
         errorFor([](auto* v) { (*v)["refiner"]["rotation"] = 5.0; }));
  expect("~register/stpes: did you mean ~register/steps?",
         errorFor([](auto* v) { (*v)["register"]["stpes"] = 5; }));
  expect("~tracker/min_score is 1.5",
         errorFor([](auto* v) { (*v)["tracker"]["min_score"] = 1.5; }));
  expect("~refiner/rotation_deg is -1",
         errorFor([](auto* v) { (*v)["refiner"]["rotation_deg"] = -1; }));
  expect("~tf_timeout_s is -1", errorFor([](auto* v) { (*v)["tf_timeout_s"] = -1; }));
  expect("~mode is 'twice' but must be one of once, track",
         errorFor([](auto* v) { (*v)["mode"] = "twice"; }));
  expect("~initial_pose_policy", errorFor([](auto* v) { (*v)["initial_pose_policy"] = "never"; }));
  expect("~instruction_set", errorFor([](auto* v) { (*v)["instruction_set"] = "mmx"; }));
  expect("no preset 'fast'", errorFor([](auto* v) { (*v)["refiner"]["preset"] = "fast"; }));
  expect("~threads must be a whole number", errorFor([](auto* v) { (*v)["threads"] = "two"; }));
  expect("stages is empty", errorFor([](auto* v) { (*v)["tracker"]["stages"].setSize(0); }));
  expect("steps", errorFor([](auto* v) { (*v)["register"]["steps"] = 0; }));
}

TEST(Parameters, FramesLoseTheSlashOfTf1) {
  XmlRpc::XmlRpcValue values;
  values["object_frame"] = "/mug";
  values["output_frame"] = "/base";
  values["fixed_frame"] = "world";
  ParamReader reader(values, "~");
  const FrameSettings frames = readParameters(reader).frames;
  EXPECT_EQ(frames.object_frame, "mug");
  EXPECT_EQ(frames.output_frame, "base");
  EXPECT_EQ(frames.fixed_frame, "world");
}

TEST(Parameters, AStrayKeyAtTheTopIsReportedAndNoMore) {
  XmlRpc::XmlRpcValue values;
  values["publish_ft"] = false;
  ParamReader reader(values, "~");
  EXPECT_TRUE(readParameters(reader).frames.publish_tf);
  ASSERT_EQ(reader.unknown().size(), 1u);
  EXPECT_EQ(reader.unknown()[0], "unknown parameter ~publish_ft: did you mean ~publish_tf?");
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_parameters");
  const ros::NodeHandle keep_alive;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
