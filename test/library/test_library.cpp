// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The public classes, on a scene that is known exactly.
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "field/field.h"
#include "nerf_pose_refiner/overlay.h"
#include "nerf_pose_refiner/refiner.h"
#include "nerf_pose_refiner/tracker.h"
#include "support/expect_error.h"
#include "support/keyframe_scene.h"
#include "support/scene_backend.h"
#include "support/small_field.h"
#include "support/temporary_folder.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMetresPerUnit = 0.2;
constexpr std::int64_t kFrame_ns = 33000000;

class LibraryTest : public testing::Test, protected KeyframeScene {
 protected:
  /// The scene as an object in metres, with a frame U of its own.
  Object objectWith(double metres_per_unit) const {
    auto field = std::make_shared<Field>(scene_->field());
    field->metadata.name = "scene";
    field->metadata.metres_per_unit = metres_per_unit;
    field->metadata.T_O_U = T_O_U_;
    return ObjectInside::make(field);
  }

  /// The pose that users get for a camera pose [m].
  Pose inCamera(const Pose& T_O_C) const {
    Pose T_C_U = T_O_C.inverse() * T_O_U_;
    T_C_U.t *= kMetresPerUnit;
    return T_C_U;
  }

  void expectNear(const Pose& T_C_U, const Pose& truth_T_O_C) const {
    const Pose truth = inCamera(truth_T_O_C);
    EXPECT_LT(rotationDistance(T_C_U.R, truth.R), 0.5 * kDegree);
    EXPECT_LT((T_C_U.t - truth.t).norm(), 0.01 * kMetresPerUnit * object().diameter);
  }

  Pose around(int frame) const { return cameraAround(*scene_, 0.6 + 0.02 * frame, 0.5); }

  const Pose T_O_U_ = {expSO3({0, 0, 90 * kDegree}), {0.1, 0.2, 0.3}};
  const Object object_ = objectWith(kMetresPerUnit);
  const std::shared_ptr<Backend> backend_ = std::make_shared<SceneBackend>(
      std::make_shared<DescribedScene>(scene_, judged(scene_->field().metadata)));
  const Pose not_finite_ = {Eigen::Matrix3d::Identity(),
                            Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())};
};

TEST_F(LibraryTest, RefinerFindsAPoseInMetres) {
  Refiner refiner(backend_, object_);
  const PosePrior prior = {inCamera(offBy(truth_, {0.6, -0.5, 0.6}, 6)), 10 * kDegree, 0.1};
  const RefineResult found = refiner.refine(observed(imageOf(truth_)), prior);
  ASSERT_TRUE(found.found && found.trusted) << found.message;
  expectNear(found.T_C_O, truth_);
  const double deviation_m = std::sqrt(found.covariance(0, 0));
  EXPECT_GT(deviation_m, 0);
  EXPECT_LT(deviation_m, 0.01 * kMetresPerUnit);
  double weights = 0;
  for (const WeightedPose& hypothesis : found.hypotheses) weights += hypothesis.weight;
  EXPECT_NEAR(weights, 1, 1e-9);
}

TEST_F(LibraryTest, RefinerSaysWhyThereIsNoPose) {
  Refiner refiner(backend_, object_);
  Pose behind = inCamera(truth_);
  behind.t.z() *= -1;
  const RefineResult found = refiner.refine(observed(imageOf(truth_)), {behind, 0.1, 0.1});
  EXPECT_FALSE(found.found || found.trusted);
  EXPECT_EQ(found.message, "the start pose is outside the image");
  EXPECT_TRUE(found.T_C_O.t.isApprox(behind.t, 1e-12)) << "not the prior";
}

TEST_F(LibraryTest, RefinerRefusesWhatIsInvalid) {
  RefinerOptions unknown;
  unknown.preset = "none";
  expectError<std::invalid_argument>([&] { Refiner(backend_, object_, unknown); }, "none");
  expectError<std::invalid_argument>([&] { Refiner(nullptr, object_); }, "null");
  Refiner refiner(backend_, object_);
  EXPECT_THROW(refiner.refine(Observation(), {inCamera(truth_), 0.1, 0.1}), std::invalid_argument);
  EXPECT_THROW(refiner.refine(observed(imageOf(truth_)), {not_finite_, 0.1, 0.1}),
               std::invalid_argument);
  const CancellationToken cancelled;
  cancelled.requestCancel();
  EXPECT_THROW(refiner.refine(observed(imageOf(truth_)), {inCamera(truth_), 0.1, 0.1}, cancelled),
               Cancelled);
}

TEST_F(LibraryTest, TrackerFollowsTheObject) {
  Tracker tracker(backend_, object_);
  const TrackResult before = tracker.track(observed(imageOf(around(0))), kFrame_ns);
  EXPECT_EQ(before.state, TrackState::kWaiting);
  EXPECT_FALSE(before.trusted);
  tracker.setInitialPose(inCamera(offBy(around(1), {0.6, -0.5, 0.6}, 6)));
  for (int i = 1; i < 8; ++i) {
    SCOPED_TRACE(i);
    const TrackResult found = tracker.track(observed(imageOf(around(i))), (1 + i) * kFrame_ns);
    ASSERT_TRUE(found.trusted) << found.message;
    EXPECT_EQ(found.state, TrackState::kTracking);
    expectNear(found.T_C_O, around(i));
  }
  tracker.reset();
  EXPECT_FALSE(tracker.track(observed(imageOf(around(8))), 9 * kFrame_ns).trusted);
}

TEST_F(LibraryTest, TrackerRefusesWhatIsInvalid) {
  expectError<std::invalid_argument>([&] { Tracker(nullptr, object_); }, "null");
  expectError<std::invalid_argument>([&] { Tracker(backend_, objectWith(0)); }, "scale");
  Tracker tracker(backend_, object_);
  EXPECT_THROW(tracker.setInitialPose(not_finite_), std::invalid_argument);
  EXPECT_THROW(tracker.track(Observation(), kFrame_ns), std::invalid_argument);
}

TEST_F(LibraryTest, TrackerRefusesOptionsOutOfRange) {
  const auto expect_refused = [this](const char* name, const auto& change) {
    TrackerOptions options;
    change(&options);
    expectError<std::invalid_argument>([&] { Tracker(backend_, object_, options); }, name);
  };
  expect_refused("search_rotation_rad", [](auto* o) { o->search_rotation_rad = -0.1; });
  expect_refused("search_translation", [](auto* o) { o->search_translation = 0; });
  expect_refused("trust_score", [](auto* o) { o->trust_score = 7; });
  expect_refused("min_score", [](auto* o) { o->min_score = 0.95; });
  RefinerOptions untrusting;
  untrusting.trust_score = 1.1;
  expectError<std::invalid_argument>([&] { Refiner(backend_, object_, untrusting); },
                                     "trust_score");
}

TEST_F(LibraryTest, OneTokenServesAllImages) {
  Tracker tracker(backend_, object_);
  const CancellationToken token;
  EXPECT_FALSE(tracker.track(observed(imageOf(around(0))), kFrame_ns, token).processed);
  tracker.reset();
  tracker.setInitialPose(inCamera(around(1)));
  EXPECT_TRUE(tracker.track(observed(imageOf(around(1))), 2 * kFrame_ns, token).trusted);
  tracker.reset();
  EXPECT_FALSE(token.cancelRequested());
  token.requestCancel();
  tracker.setInitialPose(inCamera(around(2)));
  EXPECT_THROW(tracker.track(observed(imageOf(around(2))), 3 * kFrame_ns, token), Cancelled);
}

TEST_F(LibraryTest, AnInitialPoseEndsTheTrack) {
  Tracker tracker(backend_, object_);
  tracker.setInitialPose(inCamera(around(0)));
  ASSERT_TRUE(tracker.track(observed(imageOf(around(0))), kFrame_ns).trusted);
  Pose beside = inCamera(around(0));
  beside.t.x() += 3 * kMetresPerUnit;  // outside of the image
  tracker.setInitialPose(beside);
  EXPECT_FALSE(tracker.track(observed(imageOf(around(0))), 2 * kFrame_ns).trusted);
  EXPECT_FALSE(tracker.track(observed(imageOf(around(0))), 3 * kFrame_ns).found)
      << "the old place is forgotten";
}

TEST_F(LibraryTest, AnObjectIsSavedWithItsFrame) {
  const TemporaryFolder folder;
  const std::string path = folder.file("scene.safetensors");
  auto field = std::make_shared<Field>(smallField());
  field->metadata.metres_per_unit = kMetresPerUnit;
  field->metadata.T_O_U = T_O_U_;
  field->metadata.box = Box{{-1, -2, -3}, {1, 2, 3}};
  field->metadata.symmetries = Symmetries(
      SymmetryAxis{}, {turnAbout({Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero()}, M_PI)});
  const Object before = ObjectInside::make(field);
  saveObject(before, path);
  const Object after = loadObject(path);
  const Pose pose = {expSO3({0.1, 0.2, 0.3}), {0.4, 0.5, 0.6}};
  const Pose through_both =
      ObjectInside::frame(after).objectInCamera(ObjectInside::frame(before).cameraInModel(pose));
  EXPECT_LT(rotationDistance(through_both.R, pose.R), 1e-9);
  EXPECT_LT((through_both.t - pose.t).norm(), 1e-9);
  for (int i = 0; i < 8; ++i)
    EXPECT_LT((after.boxCorners()[i] - before.boxCorners()[i]).norm(), 1e-9);
  EXPECT_EQ(describe(after.symmetries()), describe(before.symmetries()));
  saveObject(after, path);  // the file beside it says the same
  expectError<std::runtime_error>(
      [&] { saveObject(ObjectInside::make(std::make_shared<Field>(smallField())), path); },
      "scene.yaml", "another frame");
}

TEST_F(LibraryTest, OverlayIsGreyBesideTheObjectAndColouredOnIt) {
  Overlay overlay(backend_, object_);
  const Image8 drawn = overlay.draw(observed(imageOf(truth_)), inCamera(truth_));
  ASSERT_EQ(drawn.width, kCamera.width);
  ASSERT_EQ(drawn.height, kCamera.height);
  ASSERT_EQ(drawn.channels, 3);
  const auto is_grey = [&](int x, int y) {
    return drawn.at(x, y, 0) == drawn.at(x, y, 1) && drawn.at(x, y, 1) == drawn.at(x, y, 2);
  };
  const Image alpha = observeScene(*scene_, kCamera, truth_).alpha;
  int on = 0, coloured_on = 0, beside = 0, coloured_beside = 0;
  for (int y = 0; y < kCamera.height; ++y) {
    for (int x = 0; x < kCamera.width; ++x) {
      (alpha.at(x, y, 0) > 0.5f ? on : beside) += 1;
      if (!is_grey(x, y)) (alpha.at(x, y, 0) > 0.5f ? coloured_on : coloured_beside) += 1;
    }
  }
  EXPECT_GT(coloured_on, 0.8 * on);
  EXPECT_GT(coloured_beside, 0) << "the outline";
  EXPECT_LT(coloured_beside, 0.05 * beside);
}

TEST_F(LibraryTest, OverlayRefusesWhatIsInvalid) {
  expectError<std::invalid_argument>([&] { Overlay(nullptr, object_); }, "null");
  Overlay overlay(backend_, object_);
  const Observation image = observed(imageOf(truth_));
  EXPECT_THROW(overlay.draw(Observation(), inCamera(truth_)), std::invalid_argument);
  expectError<std::invalid_argument>([&] { overlay.draw(image, not_finite_); }, "pose");
  expectError<std::invalid_argument>([&] { overlay.draw(image, inCamera(truth_), NAN); },
                                     "opacity");
}

TEST(Observe, RefusesOtherChannelsAndSizes) {
  const Image8 rgb(kCamera.width, kCamera.height, 3);
  EXPECT_EQ(observe(rgb, kCamera).background, Background::kUnknown);
  EXPECT_EQ(observe(rgb, kCamera, Image8(kCamera.width, kCamera.height, 1)).background,
            Background::kMask);
  EXPECT_THROW(observe(Image8(kCamera.width, kCamera.height, 4), kCamera), std::invalid_argument);
  EXPECT_THROW(observe(Image8(kCamera.width, 2, 3), kCamera), std::invalid_argument);
  EXPECT_THROW(observe(rgb, kCamera, Image8(3, 3, 1)), std::invalid_argument);
}

TEST(Observe, TakesAMaskOfBytesHeldElsewhere) {
  const auto bgr = std::make_shared<const Image8>(kCamera.width, kCamera.height, 3);
  const auto with = [&](const Image8& mask) {
    return observe(viewOf(*bgr), PixelFormat::kBgr, kCamera, bgr, mask);
  };
  EXPECT_EQ(with({}).background, Background::kUnknown);
  Image8 mask(kCamera.width, kCamera.height, 1);
  mask.at(2, 1, 0) = 7;
  const Observation masked = with(mask);
  EXPECT_EQ(masked.background, Background::kMask);
  EXPECT_EQ(masked.alpha.at(2, 1, 0), 1);
  EXPECT_EQ(masked.alpha.at(1, 2, 0), 0);
  expectError<std::invalid_argument>([&] { with(Image8(3, 3, 1)); }, "alpha");
  mask.values.push_back(1);
  expectError<std::invalid_argument>([&] { with(mask); }, "alpha", "values");
  expectError<std::invalid_argument>([&] { with(Image8(kCamera.width, kCamera.height, 3)); },
                                     "one channel");
}

}  // namespace
}  // namespace nerf_pose_refiner
