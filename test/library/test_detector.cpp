// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The public class Detector, on a scene that is known exactly.
#include "nerf_pose_refiner/detector.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

#include "detection/detection_model.h"
#include "detection/landmark_file.h"
#include "detection/template_file.h"
#include "support/expect_error.h"
#include "support/keyframe_scene.h"
#include "support/scene_backend.h"
#include "support/temporary_folder.h"
#include "support/textured_scene.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMetresPerUnit = 0.2;
const double kNaN = std::numeric_limits<double>::quiet_NaN();

/// The textured scene as an object in metres, with a frame U of its own.
std::shared_ptr<const LoadedField> describedScene() {
  const auto scene = std::make_shared<TexturedScene>(cpuProcessor(2));
  FieldMetadata object = judged(scene->field().metadata);
  object.name = "scene";
  object.metres_per_unit = kMetresPerUnit;
  object.T_O_U = {expSO3({0, 0, 90 * kDegree}), {0.1, 0.2, 0.3}};
  return std::make_shared<DescribedScene>(scene, object);
}

class DetectorTest : public testing::Test, protected KeyframeScene {
 protected:
  DetectorTest() { scene_ = described_; }

  /// Files of landmarks and templates of a few views, which a detector takes for its own.
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder();
    const auto scene = describedScene();
    LandmarkSettings few;
    few.views = 40;
    few.object_px = 200;
    saveLandmarks(makeLandmarks(*scene, few, {}), landmarkKey(scene->field(), {}),
                  landmarksBeside(model()));
    TemplateBankSettings sides;
    sides.views = 12;
    saveTemplates(makeTemplateBank(*scene, sides, {}), templateKey(scene->field(), {}),
                  templatePathOf(landmarksBeside(model())));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string model() { return folder_->file("scene.safetensors"); }

  static DetectorOptions options() {
    DetectorOptions options;
    options.landmarks_path = landmarksBeside(model());
    return options;
  }

  Detector detector(const DetectorOptions& options) const { return {backend_, known_, options}; }

  Observation image() const { return observed(imageOf(truth_)); }

  static TemporaryFolder* folder_;
  const std::shared_ptr<const LoadedField> described_ = describedScene();
  const Object known_ = ObjectInside::make(std::make_shared<const Field>(described_->field()));
  const std::shared_ptr<Backend> backend_ = std::make_shared<SceneBackend>(described_);
  Detector detector_ = detector(options());
};

TemporaryFolder* DetectorTest::folder_ = nullptr;

TEST_F(DetectorTest, FindsTheObjectInMetres) {
  const DetectionResult result = detector_.detect(image());
  ASSERT_EQ(result.detections.size(), 1u) << result.message;
  EXPECT_EQ(result.message, "");
  EXPECT_GT(result.seconds, 0);
  const Detection& found = result.detections[0];
  Pose truth = truth_.inverse() * object().T_O_U;
  truth.t *= kMetresPerUnit;
  EXPECT_LT(rotationDistance(found.T_C_O.R, truth.R), 1 * kDegree);
  EXPECT_LT((found.T_C_O.t - truth.t).norm(), 0.01 * kMetresPerUnit * object().diameter);
  EXPECT_GE(found.score, options().trust_score);
  EXPECT_GT(found.visible_fraction, 0.5);
  const double deviation_m = std::sqrt(found.covariance(0, 0));
  EXPECT_GT(deviation_m, 0);
  EXPECT_LT(deviation_m, 0.01 * kMetresPerUnit);
}

TEST_F(DetectorTest, SaysWhyItFindsNone) {
  const DetectionResult clutter_alone =
      detector_.detect(observed(clutter(kCamera.width, kCamera.height, 7)));
  EXPECT_TRUE(clutter_alone.detections.empty());
  EXPECT_NE(clutter_alone.message, "");
  Observation beside = image();
  beside.boxes = {{400, 20, 500, 120}};
  const DetectionResult outside = detector_.detect(beside);
  EXPECT_TRUE(outside.detections.empty());
  EXPECT_EQ(outside.message, "the box leaves too little of the image");
}

TEST_F(DetectorTest, HeedsHints) {
  const Eigen::Vector3d centre_C = truth_.inverse() * object().centre;
  const Eigen::Vector2d middle = kCamera.project(centre_C);
  Observation boxed = image();
  boxed.boxes = {{0, 0, 40, 40},
                 {middle.x() - 100, middle.y() - 100, middle.x() + 100, middle.y() + 100}};
  DetectionHint hint;
  hint.distance = 1.1 * kMetresPerUnit * centre_C.norm();
  const DetectionResult found = detector_.detect(boxed, hint);
  EXPECT_EQ(found.detections.size(), 1u);
  EXPECT_EQ(found.message, "");
  boxed.boxes.pop_back();
  EXPECT_TRUE(detector_.detect(boxed, hint).detections.empty());
  hint.distance = 3 * kMetresPerUnit * centre_C.norm();
  EXPECT_TRUE(detector_.detect(image(), hint).detections.empty());
}

TEST_F(DetectorTest, RefusesWhatIsInvalid) {
  expectError<std::invalid_argument>([&] { Detector(nullptr, known_); }, "null");
  const auto expect_refused = [this](const char* name, const auto& change) {
    DetectorOptions changed = options();
    change(&changed);
    expectError<std::invalid_argument>([&] { detector(changed); }, name);
  };
  expect_refused("trust_score", [](auto* o) { o->trust_score = kNaN; });
  expect_refused("trust_score", [](auto* o) { o->trust_score = 1.1; });
  expect_refused("max_instances", [](auto* o) { o->max_instances = 0; });
  expect_refused("budget_s", [](auto* o) { o->budget_s = kNaN; });

  for (const ImageBox& box : {ImageBox{0, 0, kNaN, 100}, ImageBox{100, 0, 0, 100}}) {
    Observation boxed = image();
    boxed.boxes = {box};
    expectError<std::invalid_argument>([&] { detector_.detect(boxed); }, "box");
  }
  DetectionHint hint;
  hint.distance = kNaN;
  expectError<std::invalid_argument>([&] { detector_.detect(image(), hint); }, "distance");
  expectError<std::invalid_argument>([&] { detector_.detect(Observation()); }, "must");
}

TEST_F(DetectorTest, CanBeCancelled) {
  const CancellationToken cancelled;
  cancelled.requestCancel();
  EXPECT_THROW(detector_.detect(image(), {}, cancelled), Cancelled);
  EXPECT_EQ(detector_.detect(image()).detections.size(), 1u) << "as before";
}

}  // namespace
}  // namespace nerf_pose_refiner
