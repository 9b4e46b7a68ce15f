// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Depth alone in KeyframeRefiner.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "evaluation/pose_error.h"
#include "math/random.h"
#include "refinement/depth_outline.h"
#include "refinement/depth_search.h"
#include "refinement/keyframe_refiner.h"
#include "support/depth_scene.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::int64_t kDepthImage_ns = 33000000;

class DepthAloneTest : public DepthScene, public testing::Test {
 protected:
  Observation seenFrom(const Pose& T_O_C, const DepthErrors& errors = {0.001, 0, 0.2, 0}) const {
    return observe(depthImage(metresAt(T_O_C, kColour, {}, errors), kColour));
  }

  /// A rough pose as far off as a hint may be. @param seed of it.
  Prior hint(std::uint64_t seed) const {
    const auto drawn = [seed](std::uint64_t axis) { return 2 * randomUniform(7, axis, seed) - 1; };
    const Eigen::Matrix3d turn = expSO3(
        Eigen::Vector3d(kSearchRotation_rad * Eigen::Vector3d(drawn(0), drawn(1), drawn(2))));
    const Eigen::Vector3d shift =
        kSearchTranslation * object().diameter * Eigen::Vector3d(drawn(3), drawn(4), drawn(5));
    Prior prior;
    prior.T_O_C = {turn * truth_.R, object().centre + shift + turn * (truth_.t - object().centre)};
    return prior;
  }

  void expectRight(const Refinement& found, const Pose& truth) const {
    ASSERT_EQ(found.outcome, Outcome::kRefined);
    const PoseError error = poseError(found.T_O_C, truth, object().centre, kColour);
    EXPECT_LT(error.rotation_rad / kDegree, 1);
    EXPECT_LT(error.object_offset / object().diameter, 0.015);
  }
};

TEST_F(DepthAloneTest, FindsTheObjectFromHints) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    const Refinement found =
        refiner()->find({seenFrom(truth_, {0.001, 0, 0.2, 0, seed}), 0}, hint(seed));
    expectRight(found, truth_);
    EXPECT_EQ(found.depth.use, DepthUse::kUsed);
    EXPECT_GT(found.score, 0.9);
  }
}

TEST_F(DepthAloneTest, FollowsTheObject) {
  const auto follower = refiner();
  Prior prior;
  prior.T_O_C = truth_;
  prior.rotation_rad = 5 * kDegree;
  prior.translation = 0.05;
  for (int i = 0; i < 12; ++i) {
    const Pose seen(
        expSO3(Eigen::Vector3d(0, 0, 0.03 * i)) * truth_.R,
        object().centre + expSO3(Eigen::Vector3d(0, 0, 0.03 * i)) * (truth_.t - object().centre));
    const Refinement found = follower->follow({seenFrom(seen), i * kDepthImage_ns}, prior);
    SCOPED_TRACE(i);
    expectRight(found, seen);
    EXPECT_GT(found.score, 0.9);
    prior.T_O_C = found.T_O_C;
  }
}

TEST_F(DepthAloneTest, MayTakeTurnsWithColours) {
  const auto follower = refiner();
  Prior prior;
  prior.T_O_C = truth_;
  prior.rotation_rad = 5 * kDegree;
  prior.translation = 0.05;
  for (int i = 0; i < 6; ++i) {
    const Observation image = i % 2 == 0 ? imageAt(truth_) : seenFrom(truth_);
    SCOPED_TRACE(i);
    expectRight(follower->follow({image, i * kDepthImage_ns}, prior), truth_);
  }
}

TEST_F(DepthAloneTest, AWallOrNothingIsNoObject) {
  const float at_m = static_cast<float>(kUnit_m * (truth_.t - object().centre).norm());
  for (const float metres : {at_m, 2 * at_m, 0.0f}) {
    SCOPED_TRACE(metres);
    const auto wall = depthImage(ImageOf<float>(320, 240, 1, metres), kColour);
    const Refinement found = refiner()->find({observe(wall), 0}, hint(1));
    EXPECT_LT(found.score, 0.5);
    if (found.outcome != Outcome::kRefined) {
      EXPECT_FALSE(found.depth.message.empty());
    }
  }
}

TEST_F(DepthAloneTest, ACardInItsPlaceIsNotTrusted) {
  // A flat card, as large as the object, where it should be.
  const auto depth = [&] {
    ImageOf<float> metres = metresAt(truth_, kColour);
    const float card = static_cast<float>(kUnit_m * (truth_.t - object().centre).norm());
    for (float& z : metres.values) z = z < static_cast<float>(kWall_m) ? card : z;
    return depthImage(std::move(metres), kColour);
  }();
  EXPECT_LT(refiner()->find({observe(depth), 0}, hint(2)).score, 0.9);
}

TEST_F(DepthAloneTest, ABallsRotationIsNotTrusted) {
  // Of a ball in the object's place nothing says how it is turned, nor does anything else show it.
  ImageOf<float> metres(320, 240, 1, static_cast<float>(kWall_m));
  const Eigen::Vector3d middle = kUnit_m * (truth_.inverse() * object().centre);
  const double radius = 0.4 * kUnit_m * object().diameter;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      const Eigen::Vector3d ray((x - kColour.cx) / kColour.fx, (y - kColour.cy) / kColour.fy, 1);
      const double along = ray.dot(middle) / ray.squaredNorm();
      const double inside = radius * radius - (middle - along * ray).squaredNorm();
      if (inside > 0) {
        metres.at(x, y, 0) = static_cast<float>(along - std::sqrt(inside / ray.squaredNorm()));
      }
    }
  }
  EXPECT_LT(refiner()->find({observe(depthImage(std::move(metres), kColour)), 0}, hint(3)).score,
            0.5);
}

TEST_F(DepthAloneTest, AModelWithoutScaleSaysSo) {
  KeyframeSearchSettings settings;
  settings.real_time = false;
  KeyframeRefiner unscaled(backend_.get(), scene_, settings);
  const Refinement found = unscaled.find({seenFrom(truth_), 0}, hint(1));
  EXPECT_EQ(found.outcome, Outcome::kDiverged);
  EXPECT_NE(found.depth.message.find("scale"), std::string::npos);
}

TEST_F(DepthAloneTest, WithoutASurfaceNothingIsFound) {
  DepthPrior known;
  known.T_O_C = truth_;
  known.covariance.setIdentity();
  known.bias_variance = 1;
  const DepthFit fit =
      fitDepthAlone({}, *depthImage(metresAt(truth_, kColour), kColour), known, object(), truth_);
  EXPECT_EQ(fit.counts.agreeing, 0);
  EXPECT_LT(fit.evidence, 0);
}

TEST_F(DepthAloneTest, IsCancelled) {
  const CancellationToken cancellation;
  cancellation.requestCancel();
  const Refinement found = refiner()->find({seenFrom(truth_), 0}, hint(1), cancellation);
  EXPECT_EQ(found.outcome, Outcome::kCancelled);
}

TEST_F(DepthAloneTest, AnObservationOfDepthAlone) {
  EXPECT_TRUE(seenFrom(truth_).isDepthAlone());
  EXPECT_FALSE(imageAt(truth_).isDepthAlone());
  const Pose aside(Eigen::Matrix3d::Identity(), {0.02, 0, 0});
  EXPECT_THROW(observe(depthImage(metresAt(truth_, kColour), kColour, aside)),
               std::invalid_argument);
  EXPECT_THROW(observe(std::shared_ptr<const DepthImage>()), std::invalid_argument);
  Observation elsewhere = seenFrom(truth_);
  elsewhere.camera.fx += 1;
  EXPECT_THROW(elsewhere.validate(), std::invalid_argument);
  Observation masked = seenFrom(truth_);
  masked.background = Background::kMask;
  masked.alpha = Image(320, 240, 1, 1.0f);
  EXPECT_THROW(masked.validate(), std::invalid_argument);
}

TEST_F(DepthAloneTest, AnEdgeMovesAsItsPointDoes) {
  // A point of the outline 20 mm to the right of the object's centre, which is 0.5 m ahead.
  constexpr double kAhead_m = 0.5, kBeside_m = 0.02;
  const Pose ahead(Eigen::Matrix3d::Identity(),
                   object().centre - kAhead_m / kUnit_m * Eigen::Vector3d::UnitZ());
  PointColumns none;
  DepthSurface surface;
  surface.shown = &none;
  surface.tiles = 1;
  surface.outline.push_back({{kBeside_m / kUnit_m, 0, 0}, {0.01, 0, 0}});
  surface.outline_tile.push_back(0);
  ImageOf<float> metres(320, 240, 1, static_cast<float>(kWall_m));
  const double u = kColour.cx + kColour.fx * kBeside_m / kAhead_m;  // 175.5
  for (int y = 0; y < 240; ++y) {
    for (int x = 100; x < u; ++x) metres.at(x, y, 0) = static_cast<float>(kAhead_m);
  }
  const auto depth = depthImage(std::move(metres), kColour);
  DepthComparison comparison(surface, *depth, object());
  comparison.compare(ahead, 0, true);
  ASSERT_EQ(comparison.edges().size(), 1u);
  const ComparedEdge& edge = comparison.edges().front();
  EXPECT_EQ(edge.edge.kind, DepthEdge::Kind::kFound);
  EXPECT_NEAR(edge.edge.offset_px, 0, 0.51);
  // The camera moves to the right: the point to the left, by f / z. It comes closer: the point
  // goes outwards, by f x / z^2. It turns about y, around the object: the point goes back by x.
  const double per_unit = kUnit_m * kColour.fx / kAhead_m;
  EXPECT_NEAR(edge.jacobian[0], -per_unit, 1e-6);
  EXPECT_NEAR(edge.jacobian[1], 0, 1e-9);
  EXPECT_NEAR(edge.jacobian[2], per_unit * kBeside_m / kAhead_m, 1e-6);
  EXPECT_NEAR(edge.jacobian[3], 0, 1e-9);
  EXPECT_NEAR(edge.jacobian[4], -kColour.fx * kBeside_m * kBeside_m / (kAhead_m * kAhead_m), 1e-6);
  EXPECT_NEAR(edge.jacobian[5], 0, 1e-9);
}

/// A step from 0.5 m to 0.8 m between two columns of pixels.
class DepthEdgeTest : public testing::Test {
 protected:
  DepthEdge look(double u, double outside_u = 1) const {
    EdgeProfile profile;
    profile.middle = {u, 20};
    profile.outside = {outside_u, 0};
    profile.nearest_m = 0.4;
    profile.farthest_m = 0.52;
    return findDepthEdge(*depthImage(metres_, camera_), profile);
  }

  void fill(int from, int to, float metres) {
    for (int y = 0; y < 40; ++y) {
      for (int x = from; x < to; ++x) metres_.at(x, y, 0) = metres;
    }
  }

  const Camera camera_ = {60, 40, 60, 60, 29.5, 19.5};
  ImageOf<float> metres_ = [] {
    ImageOf<float> step(60, 40, 1, 0.8f);
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 30; ++x) step.at(x, y, 0) = 0.5f;
    }
    return step;
  }();
};

TEST_F(DepthEdgeTest, IsFoundBetweenTheLastPixelAndTheFirst) {
  for (const double u : {25.5, 28.5, 29.5, 32.5, 34.5}) {
    const DepthEdge edge = look(u);
    ASSERT_EQ(edge.kind, DepthEdge::Kind::kFound) << u;
    EXPECT_NEAR(edge.offset_px, 29.5 - u, 0.51) << u;
  }
  EXPECT_EQ(look(29.5, -1).kind, DepthEdge::Kind::kNone);  // the other side is nearer
}

TEST_F(DepthEdgeTest, IsNoneWhereDepthGoesOn) {
  EXPECT_EQ(look(10).kind, DepthEdge::Kind::kNone);
  EXPECT_EQ(look(45).kind, DepthEdge::Kind::kNone);  // the object is not there at all
}

TEST_F(DepthEdgeTest, IsUnknownBehindSomethingOrWithoutDepth) {
  fill(31, 34, 0.3f);
  EXPECT_EQ(look(29.5).kind, DepthEdge::Kind::kUnknown);
  fill(26, 60, 0);
  EXPECT_EQ(look(29.5).kind, DepthEdge::Kind::kUnknown);
}

TEST_F(DepthEdgeTest, AGapMakesItLessCertain) {
  const double sure = look(29.5).deviation_px;
  fill(29, 31, 0);
  const DepthEdge edge = look(29.5);
  ASSERT_EQ(edge.kind, DepthEdge::Kind::kFound);
  EXPECT_NEAR(edge.offset_px, 0, 0.51);
  EXPECT_GT(edge.deviation_px, sure);
}

}  // namespace
}  // namespace nerf_pose_refiner
