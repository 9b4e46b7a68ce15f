// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/experiment.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "evaluation/trial.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

class ExperimentFile : public ::testing::Test {
 protected:
  std::string write(const std::string& text) { return folder.write("plan.json", text); }
  void expectRefused(const std::string& text, const std::string& reason) {
    const std::string path = write(text);
    expectError<std::runtime_error>([&] { loadExperiments(path); }, reason);
    expectError<std::runtime_error>([&] { loadExperiments(path); }, path);
  }

  TemporaryFolder folder;
};

TEST_F(ExperimentFile, whatIsLeftOutHasDefaults) {
  const ExperimentPlan plan =
      loadExperiments(write(R"({"seed": 7, "experiments": [{"name": "a", "kinds": ["masked"]}]})"));
  EXPECT_EQ(plan.seed, 7u);
  ASSERT_EQ(plan.experiments.size(), 1u);
  const Experiment& e = plan.experiments[0];
  EXPECT_EQ(e.methods.size(), 4u);
  EXPECT_EQ(e.losses, std::vector<std::string>{"l2"});
  EXPECT_EQ(e.conditions, std::vector<std::string>{"clean"});
  EXPECT_EQ(e.kinds, std::vector<SceneKind>{SceneKind::kMasked});
  EXPECT_EQ(e.variants.size(), 1u);
  EXPECT_EQ(e.views * e.starts, 100);
}

TEST(Experiments, everyPlanOfConfigIsRead) {
  int plans = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(NPR_SOURCE_DIR) / "config")) {
    if (entry.path().extension() != ".json") continue;
    EXPECT_FALSE(loadExperiments(entry.path().string()).experiments.empty()) << entry.path();
    ++plans;
  }
  EXPECT_GE(plans, 2);
}

TEST_F(ExperimentFile, whatMakesNoSenseIsRefusedByName) {
  expectRefused("{", "parse error");
  expectRefused("{}", "experiments: must be an array of one or more");
  expectRefused(R"({"experiments": [{"name": "a", "view": 3}]})", "unknown key 'view'");
  expectRefused(R"({"experiments": [{"name": "a", "views": 0}]})", "views: must be 1..10000");
  expectRefused(R"({"experiments": [{"name": "a", "views": "many"}]})", "experiments[0].views");
  expectRefused(R"({"experiments": [{"name": "a", "views": 3.7}]})",
                "views: must be a whole number");
  expectRefused(R"({"seed": -1, "experiments": [{"name": "a"}]})", "seed: must be a whole number");
  expectRefused(R"({"experiments": [{"name": "a", "methods": ["icp"]}]})", "no 'icp'");
  expectRefused(R"({"experiments": [{"name": "a", "conditions": []}]})", "names nothing");
  expectRefused(R"({"experiments": [{"name": "a"}, {"name": "a"}]})", "its name is taken");
  expectRefused(R"({"experiments": [{"name": "a", "variants": [{"image_scale": 2}]}]})",
                "image_scale: must be 0.1..1");
}

TEST(Scenes, foldersWithTestViewsAreFoundInOrder) {
  const TemporaryFolder folder;
  for (const char* scene : {"b/mug", "a/lamp", "deep/down/here/lost/never"}) {
    folder.write(std::string(scene) + "/transforms_test.json", "{}");
  }
  const std::string top = fs::path(folder.file("x")).parent_path().string();
  const std::vector<Scene> scenes = findScenes(top);
  ASSERT_EQ(scenes.size(), 2u);
  EXPECT_EQ(scenes[0].name, "lamp");
  EXPECT_EQ(scenes[1].name, "mug");
  folder.write("c/mug/transforms_test.json", "{}");
  expectError<std::runtime_error>([&] { findScenes(top); }, "two scenes are called 'mug'");
  expectError<std::runtime_error>(
      [&] { findScenes(fs::path(folder.file("empty/x")).parent_path().string()); }, "no folder");
}

TEST(ChosenViews, areSpreadEvenly) {
  EXPECT_EQ(chosenViews(4, 10), (std::vector<int>{0, 2, 5, 7}));
  EXPECT_EQ(chosenViews(20, 3), (std::vector<int>{0, 1, 2}));
}

FieldMetadata someObject() {
  FieldMetadata object;
  object.diameter = 5;
  object.centre = {1, 2, 3};
  return object;
}

TEST(TrialProtocol, lengthsByHand) {
  const FieldMetadata object = someObject();
  const TrialProtocol synthetic("paper", SceneKind::kSynthetic, object);
  EXPECT_EQ(synthetic.unit, 1);
  EXPECT_EQ(synthetic.start.translation, 0.25);
  EXPECT_NEAR(synthetic.search_translation * object.diameter, 0.3, 1e-12);
  EXPECT_FALSE(synthetic.start.about_object);
  EXPECT_EQ(TrialProtocol("paper", SceneKind::kForwardFacing, object).start.translation, 0.15);
  const TrialProtocol masked("paper", SceneKind::kMasked, object);
  EXPECT_EQ(masked.unit, 2);  // 2.5 of them to the diameter
  EXPECT_EQ(masked.start.translation, 0.5);
  FieldMetadata in_metres = object;
  in_metres.metres_per_unit = 0.1;
  EXPECT_EQ(TrialProtocol("paper", SceneKind::kSynthetic, in_metres).unit, 2);
  const TrialProtocol robot("robot", SceneKind::kSynthetic, object);
  EXPECT_EQ(robot.start.translation, 0.75);
  EXPECT_TRUE(robot.start.about_object);
  EXPECT_EQ(robot.search_translation, 0.15);
  const TrialProtocol far("far", SceneKind::kSynthetic, object);
  EXPECT_EQ(far.start.translation, 1.5);
  EXPECT_EQ(far.search_translation, 0.3);
  EXPECT_NEAR(far.start.rotation_rad, M_PI / 4, 1e-12);
  EXPECT_EQ(far.search_rotation_rad, far.start.rotation_rad);
}

TEST(TrialSettings, variantsChangeWhatTheyName) {
  SearchVariant few;
  few.hypotheses = 16;
  const RefinerSettings alignment = trialSettings("alignment", "l2", few, 1, 3);
  const RefinerSettings preset = RefinerSettings::named("align");
  EXPECT_EQ(alignment.stages.front().hypotheses, 16);
  EXPECT_EQ(alignment.stages[1].hypotheses, preset.stages[1].hypotheses / 4);
  EXPECT_EQ(alignment.stages.back().hypotheses, 1);
  SearchVariant plain;
  plain.resampling = 0;
  const RefinerSettings multiple = trialSettings("multiple", "mape", plain, 1, 3);
  EXPECT_EQ(multiple.inversion.first_steps, 2560);
  EXPECT_EQ(multiple.inversion.rounds, 0);
  EXPECT_EQ(multiple.inversion.descent.loss, Loss::kMape);
  EXPECT_EQ(trialSettings("single", "l2", {}, 1, 3).inversion.hypotheses, 1);
  EXPECT_EQ(trialSettings("inerf", "l2", {}, 1, 3).inversion.descent.update, PoseUpdate::kTwist);
  expectError<std::invalid_argument>([] { trialSettings("icp", "l2", {}, 1, 3); }, "icp");
}

// A white square in black: its four corners, and 13 pixels around them.
TEST(InterestRegion, surroundsCorners) {
  Image image(100, 80, 3);
  for (int y = 30; y < 50; ++y) {
    for (int x = 40; x < 70; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = 1;
    }
  }
  const Image region = interestRegion(image);
  EXPECT_EQ(region.at(40, 30, 0), 1);
  EXPECT_EQ(region.at(69, 49, 0), 1);
  EXPECT_EQ(region.at(55, 40, 0), 0);
  EXPECT_EQ(region.at(5, 5, 0), 0);
  EXPECT_EQ(interestRegion(Image(20, 20, 3)).at(3, 3, 0), 1);  // no corners: everywhere
}

TEST(TrialImage, isReducedWithItsCamera) {
  Observation observation;
  observation.camera = {64, 48, 60, 60, 31.5, 23.5};
  observation.image = Image(64, 48, 3, 0.5f);
  SearchVariant half;
  half.image_scale = 0.5;
  const Observation picture = trialImage(observation, "single", half);
  EXPECT_EQ(picture.image.width, 32);
  EXPECT_EQ(picture.camera.fx, 30);
  EXPECT_TRUE(picture.weight.empty());
  EXPECT_EQ(trialImage(observation, "inerf", half).weight.width, 32);
  picture.validate();
}

}  // namespace
}  // namespace nerf_pose_refiner
