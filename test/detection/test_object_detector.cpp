// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/object_detector.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "support/keyframe_scene.h"
#include "support/textured_scene.h"

namespace nerf_pose_refiner {
namespace {

LandmarkSettings fewViews() {
  LandmarkSettings settings;
  settings.views = 40;
  settings.object_px = 200;
  return settings;
}

std::shared_ptr<const LoadedField> texturedScene() {
  return std::make_shared<TexturedScene>(cpuProcessor(2));
}

/// A textured scene and its landmarks, which are made once.
class ObjectDetectorTest : public testing::Test, protected KeyframeScene {
 protected:
  ObjectDetectorTest() { scene_ = texturedScene(); }

  static void SetUpTestSuite() {
    landmarks_ = new Landmarks(makeLandmarks(*texturedScene(), fewViews(), {}));
  }
  static void TearDownTestSuite() {
    delete landmarks_;
    landmarks_ = nullptr;
  }

  ObjectDetector detectorWith(const DetectionSettings& settings) {
    return {backend_.get(), scene_, {*landmarks_}, settings};
  }

  void expectTruth(const Refinement& found, const Pose& truth) const {
    const PoseError error = poseError(found.T_O_C, truth, object().centre, kCamera);
    EXPECT_LT(error.rotation_rad / kDegree, 1);
    EXPECT_LT(error.object_offset / object().diameter, 0.01);
    EXPECT_GE(found.score, 0.9);
  }

  /// The scene at a pose over an image.
  void paste(const Pose& T_O_C, Image* image) const {
    const Observation scene = observeScene(*scene_, kCamera, T_O_C);
    for (std::size_t i = 0; i < image->values.size(); ++i) {
      image->values[i] = scene.image.values[i] + (1 - scene.alpha.values[i / 3]) * image->values[i];
    }
  }

  static Landmarks* landmarks_;
  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
  ObjectDetector detector_{backend_.get(), texturedScene(), {*landmarks_}, {}};
};

Landmarks* ObjectDetectorTest::landmarks_ = nullptr;

TEST_F(ObjectDetectorTest, FindsTheObjectWithoutAHint) {
  for (const double azimuth : {0.6, 2.2, 4.0}) {
    SCOPED_TRACE(azimuth);
    const Pose truth = cameraAround(*scene_, azimuth, 0.4);
    const Observation image = observed(imageOf(truth));
    const Detections detections = detector_.detect(image, {}, {});
    ASSERT_EQ(detections.found.size(), 1u) << detections.message;
    expectTruth(detections.found[0], truth);
    EXPECT_EQ(detections.message, "");
    EXPECT_GT(detections.seconds, 0);
  }
}

TEST_F(ObjectDetectorTest, FindsItTurnedInTheImage) {
  for (const double roll : {1.0, 3.0}) {
    SCOPED_TRACE(roll);
    const Pose truth = {truth_.R * expSO3({0, 0, roll}), truth_.t};
    const Detections detections = detector_.detect(observed(imageOf(truth)), {}, {});
    ASSERT_EQ(detections.found.size(), 1u) << detections.message;
    expectTruth(detections.found[0], truth);
  }
}

TEST_F(ObjectDetectorTest, FindsItInOtherLight) {
  const Image image = imageOf(truth_, {0.75f, 0.85f, 0.7f}, 0.05f);
  const Detections detections = detector_.detect(observed(image), {}, {});
  ASSERT_EQ(detections.found.size(), 1u) << detections.message;
  expectTruth(detections.found[0], truth_);
}

TEST_F(ObjectDetectorTest, FindsItPartlyCovered) {
  Image image = imageOf(truth_);
  for (int y = 60; y < 110; ++y) {
    for (int x = 90; x < 140; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = 0.3f;
    }
  }
  const Detections detections = detector_.detect(observed(image), {}, {});
  ASSERT_EQ(detections.found.size(), 1u) << detections.message;
  expectTruth(detections.found[0], truth_);
}

TEST_F(ObjectDetectorTest, FindsItByASingleMatchWhereTooFewAgree) {
  DetectionSettings settings;
  settings.candidates.least_landmarks = 1000;
  ObjectDetector detector = detectorWith(settings);
  const Detections detections = detector.detect(observed(imageOf(truth_)), {}, {});
  ASSERT_EQ(detections.found.size(), 1u) << detections.message;
  expectTruth(detections.found[0], truth_);
  settings.candidates.max_ratio = 0;  // none votes
  ObjectDetector without = detectorWith(settings);
  EXPECT_TRUE(without.detect(observed(imageOf(truth_)), {}, {}).found.empty());
}

TEST_F(ObjectDetectorTest, LooksAtAReducedImageFirst) {
  DetectionSettings settings;
  settings.max_instances = 1;
  settings.first_look_side_px = kCamera.width / 2;
  ObjectDetector detector = detectorWith(settings);
  const auto found = [&](const Pose& T_O_C, DetectionCues cues) {
    return detector.detect(observed(imageOf(T_O_C)), {}, {}, cues).found;
  };
  const auto near = found(truth_, DetectionCues::kFirstLook);
  ASSERT_EQ(near.size(), 1u);
  expectTruth(near[0], truth_);
  // What is too small for that is found in the whole image.
  const Pose far = cameraAround(*scene_, 0.6, 0.4, 6);
  EXPECT_TRUE(found(far, DetectionCues::kFirstLook).empty());
  ASSERT_EQ(found(far, DetectionCues::kAll).size(), 1u);
  // Of several instances it might overlook some.
  settings.max_instances = 2;
  EXPECT_EQ(detectorWith(settings)
                .detect(observed(imageOf(far)), {}, {}, DetectionCues::kFirstLook)
                .found.size(),
            1u);
  settings.max_instances = 1;
  // Where a reduced image would save nothing, the first look is one at the whole image.
  settings.first_look_side_px = kCamera.width;
  EXPECT_EQ(detectorWith(settings)
                .detect(observed(imageOf(far)), {}, {}, DetectionCues::kFirstLook)
                .found.size(),
            1u);
}

TEST_F(ObjectDetectorTest, LandmarksWeighAPoseThatWasFoundOtherwise) {
  const ImageCandidates seen = detector_.candidates(observed(imageOf(truth_)), {}, {});
  ASSERT_TRUE(seen.matched);
  const auto weighed = [&](const Pose& T_O_C, Outcome outcome) {
    Refinement pose;
    pose.outcome = outcome;
    pose.T_O_C = T_O_C;
    pose.found_probability = 0.5;
    pose.score = 0.4;
    detector_.weigh(*seen.matched, &pose);
    return pose.score;
  };
  EXPECT_NEAR(weighed(truth_, Outcome::kRefined), 0.8 * 100 / 101, 1e-6) << "as much as they may";
  const Pose elsewhere = cameraAround(*scene_, 2.5, -0.2);
  EXPECT_NEAR(weighed(elsewhere, Outcome::kRefined), 0.4, 1e-6) << "where none agree";
  EXPECT_EQ(weighed(truth_, Outcome::kDiverged), 0.4) << "there is no pose";
}

TEST_F(ObjectDetectorTest, KeepsInstancesApart) {
  const Pose left = cameraAround(*scene_, 0.6, 0.5, 5), right = cameraAround(*scene_, 2.0, 0.3, 5);
  const auto moved = [&](const Pose& pose, double across) -> Pose {
    return {pose.R, pose.t - pose.R * Eigen::Vector3d(across * object().diameter, 0, 0)};
  };
  const Pose truths[2] = {moved(left, -0.9), moved(right, 0.9)};
  Image image = clutter(kCamera.width, kCamera.height, 7);
  for (const Pose& truth : truths) paste(truth, &image);
  const Detections detections = detector_.detect(observed(image), {}, {});
  ASSERT_EQ(detections.found.size(), 2u) << detections.message;
  EXPECT_GE(detections.found[0].score, detections.found[1].score);
  for (const Pose& truth : truths) {
    const bool first = SameInstance(scene_->field())(detections.found[0].T_O_C, truth);
    expectTruth(detections.found[first ? 0 : 1], truth);
  }
  DetectionSettings one;
  one.max_instances = 1;
  EXPECT_EQ(detectorWith(one).detect(observed(image), {}, {}).found.size(), 1u);
}

TEST_F(ObjectDetectorTest, SameImageSamePoses) {
  const Observation image = observed(imageOf(truth_));
  ObjectDetector other = detectorWith({});
  const Detections a = detector_.detect(image, {}, {}), b = other.detect(image, {}, {});
  ASSERT_EQ(a.found.size(), b.found.size());
  ASSERT_FALSE(a.found.empty());
  EXPECT_EQ(a.found[0].T_O_C.R, b.found[0].T_O_C.R);
  EXPECT_EQ(a.found[0].T_O_C.t, b.found[0].T_O_C.t);
}

TEST_F(ObjectDetectorTest, LooksInBoxesUntilThereIsEnough) {
  Observation image = observed(imageOf(truth_));
  const ImageBox there = {70, 30, 250, 210};
  DetectionSettings settings;
  settings.max_instances = 1;
  ObjectDetector detector = detectorWith(settings);
  image.boxes = {there};
  const Detections one = detector.detect(image, {}, {});
  ASSERT_EQ(one.found.size(), 1u) << one.message;
  image.boxes = {there, there};
  EXPECT_EQ(detector.detect(image, {}, {}).candidates.size(), one.candidates.size());
  image.boxes = {{0, 0, 45, 45}, there};
  EXPECT_EQ(detector.detect(image, {}, {}).found.size(), 1u);
}

TEST_F(ObjectDetectorTest, LooksOnlyWhereTheObjectMayBe) {
  const Observation image = observed(imageOf(truth_));
  SearchArea there, elsewhere;
  there.box = Eigen::AlignedBox2d(Eigen::Vector2d(70, 30), Eigen::Vector2d(250, 210));
  elsewhere.box = Eigen::AlignedBox2d(Eigen::Vector2d(0, 0), Eigen::Vector2d(45, 45));
  const Detections found = detector_.detect(image, there, {});
  ASSERT_EQ(found.found.size(), 1u) << found.message;
  expectTruth(found.found[0], truth_);
  EXPECT_TRUE(detector_.detect(image, elsewhere, {}).found.empty());

  SearchArea near, far;
  near.distance = 2.3 * object().diameter;  // it is 2.5 away
  far.distance = 5 * object().diameter;
  EXPECT_EQ(detector_.detect(image, near, {}).found.size(), 1u);
  EXPECT_TRUE(detector_.detect(image, far, {}).found.empty());

  Observation masked = image;
  masked.background = Background::kMask;
  masked.alpha = Image(kCamera.width, kCamera.height, 1);  // the object is nowhere
  EXPECT_TRUE(detector_.detect(masked, {}, {}).found.empty());
}

TEST_F(ObjectDetectorTest, NoObjectNoPose) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Image image = clutter(kCamera.width, kCamera.height, seed);
    const Detections detections = detector_.detect(observed(image), {}, {});
    EXPECT_TRUE(detections.found.empty());
    EXPECT_NE(detections.message, "");
  }
}

TEST_F(ObjectDetectorTest, ImagesWithoutFeaturesGiveAReason) {
  for (const float value : {0.0f, 0.5f, 1.0f}) {  // black, grey, saturated
    const Image image(kCamera.width, kCamera.height, 3, value);
    const Detections detections = detector_.detect(observed(image), {}, {});
    EXPECT_TRUE(detections.found.empty());
    EXPECT_TRUE(detections.candidates.empty());
    EXPECT_EQ(detections.message, "the image has no features");
  }
}

TEST_F(ObjectDetectorTest, ATinyImageGivesAReason) {
  Observation tiny = observed(Image(20, 20, 3, 0.5f));
  tiny.camera = {20, 20, 30, 30, 9.5, 9.5};
  EXPECT_EQ(detector_.detect(tiny, {}, {}).message, "the image is too small");
}

TEST_F(ObjectDetectorTest, ABoxOutsideOfTheImageGivesAReason) {
  SearchArea area;
  area.box = Eigen::AlignedBox2d(Eigen::Vector2d(1000, 0), Eigen::Vector2d(1200, 100));
  const Detections detections = detector_.detect(observed(imageOf(truth_)), area, {});
  EXPECT_TRUE(detections.found.empty());
  EXPECT_EQ(detections.message, "the box leaves too little of the image");
}

TEST_F(ObjectDetectorTest, LandmarksOfAnotherObjectGiveNoWrongPose) {
  Landmarks other = *landmarks_;
  for (Landmark& landmark : other.places) {  // the same looks at other places
    const double turn = 40 * landmark.point.x();
    landmark.point = (expSO3({turn, 2 * turn, 1}) * landmark.point.cast<double>()).cast<float>();
  }
  ObjectDetector detector(backend_.get(), scene_, {other}, {});
  for (const Refinement& found : detector.detect(observed(imageOf(truth_)), {}, {}).found) {
    expectTruth(found, truth_);  // alignment may be led to it all the same
  }
}

TEST_F(ObjectDetectorTest, NoLandmarksNoPose) {
  ObjectDetector detector(backend_.get(), scene_, {}, {});
  const Detections detections = detector.detect(observed(imageOf(truth_)), {}, {});
  EXPECT_TRUE(detections.found.empty());
  EXPECT_NE(detections.message, "");
}

/// Templates find what has no landmarks.
class PlainObjectTest : public ObjectDetectorTest {
 protected:
  static DetectionModel templatesAlone(bool is_plain = true) {
    return {{},
            std::make_shared<const TemplateBank>(makeTemplateBank(*texturedScene(), {}, {})),
            is_plain};
  }

  ObjectDetector detector_{backend_.get(), scene_, templatesAlone(), {}};
};

TEST_F(PlainObjectTest, IsFoundByTemplates) {
  const Observation image = observed(imageOf(truth_));
  const Detections detections = detector_.detect(image, {}, {});
  ASSERT_EQ(detections.found.size(), 1u) << detections.message;
  expectTruth(detections.found[0], truth_);

  SearchArea elsewhere, far;
  elsewhere.box = Eigen::AlignedBox2d(Eigen::Vector2d(0, 0), Eigen::Vector2d(45, 45));
  far.distance = 6 * object().diameter;  // it is 2.5 away
  EXPECT_TRUE(detector_.detect(image, elsewhere, {}).found.empty());
  EXPECT_TRUE(detector_.detect(image, far, {}).found.empty());
  Observation masked = image;
  masked.background = Background::kMask;
  masked.alpha = Image(kCamera.width, kCamera.height, 1);  // the object is nowhere
  EXPECT_TRUE(detector_.detect(masked, {}, {}).found.empty());
}

/// Those of a textured object are for images that nothing else finds it in, and not for glances.
TEST_F(PlainObjectTest, ATexturedOneIsFoundByTemplatesWhereItsLandmarksAreNotSeen) {
  ObjectDetector textured(backend_.get(), scene_, templatesAlone(/*is_plain=*/false), {});
  const Observation image = observed(imageOf(truth_));
  const Detections detections = textured.detect(image, {}, {});
  ASSERT_EQ(detections.found.size(), 1u) << detections.message;
  expectTruth(detections.found[0], truth_);
  EXPECT_TRUE(textured.detect(image, {}, {}, DetectionCues::kLandmarks).found.empty());
}

TEST_F(PlainObjectTest, IsFoundInATallBox) {
  SearchArea area;
  area.box = Eigen::AlignedBox2d(Eigen::Vector2d(115, 0), Eigen::Vector2d(205, 240));
  const Detections detections = detector_.detect(observed(imageOf(truth_)), area, {});
  ASSERT_EQ(detections.found.size(), 1u) << detections.message;
  expectTruth(detections.found[0], truth_);
}

TEST_F(PlainObjectTest, IsFoundWhereTheMaskHasAHoleAtItsCentre) {
  Observation masked = observed(imageOf(truth_));
  masked.background = Background::kMask;
  masked.alpha = scene_->render({kCamera, truth_}, RenderOptions(), {}).alpha;
  const Eigen::Vector2d centre = kCamera.project(truth_.inverse() * object().centre);
  for (int y = -8; y <= 8; ++y) {
    for (int x = -8; x <= 8; ++x) {
      masked.alpha.at(static_cast<int>(centre.x()) + x, static_cast<int>(centre.y()) + y, 0) = 0;
    }
  }
  const SameInstance is_same(scene_->field());
  const PoseCandidates candidates = detector_.templateCandidates(masked, {}, {});
  EXPECT_TRUE(std::any_of(candidates.begin(), candidates.end(), [&](const PoseCandidate& one) {
    return is_same(one.T_O_C, truth_) &&
           (kCamera.project(one.T_O_C.inverse() * object().centre) - centre).norm() < 4;
  }));
}

TEST_F(PlainObjectTest, IsNotFoundWhereItIsNot) {
  const Image image = clutter(kCamera.width, kCamera.height, 3);
  const Detections detections = detector_.detect(observed(image), {}, {});
  EXPECT_TRUE(detections.found.empty());
  EXPECT_FALSE(detections.candidates.empty());
  EXPECT_EQ(detections.message, "no candidate explains the image well enough");
}

TEST_F(ObjectDetectorTest, EndsWhenItsTimeIsUp) {
  DetectionSettings settings;
  settings.budget_s = 1e-9;
  ObjectDetector brief = detectorWith(settings);
  const Detections detections = brief.detect(observed(imageOf(truth_)), {}, {});
  EXPECT_TRUE(detections.found.empty());
  EXPECT_EQ(detections.message, "nothing was found within the time that it may take");
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(brief.detect(observed(imageOf(truth_)), {}, cancellation), Cancelled);
  settings.budget_s = 1e3;
  EXPECT_EQ(detectorWith(settings).detect(observed(imageOf(truth_)), {}, {}).found.size(), 1u);
}

TEST_F(ObjectDetectorTest, CanBeCancelled) {
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(detector_.detect(observed(imageOf(truth_)), {}, cancellation), Cancelled);
}

TEST_F(ObjectDetectorTest, WhatMakesNoSenseIsRefused) {
  SearchArea area;
  area.distance = std::nan("");
  const Observation image = observed(imageOf(truth_));
  EXPECT_THROW(detector_.detect(image, area, {}), std::invalid_argument);
  area = {};
  area.box = Eigen::AlignedBox2d(Eigen::Vector2d(5, 5), Eigen::Vector2d(1, 1));
  EXPECT_THROW(detector_.detect(image, area, {}), std::invalid_argument);
  Observation damaged = image;
  damaged.image.values[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(detector_.detect(damaged, {}, {}), std::invalid_argument);
  DetectionSettings settings;
  settings.max_instances = 0;
  EXPECT_THROW(detectorWith(settings), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
