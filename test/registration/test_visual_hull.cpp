// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/visual_hull.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <memory>
#include <stdexcept>

#include "math/unsure_alpha.h"
#include "support/expect_error.h"

// Silhouettes of a ball, from cameras all around it.

namespace nerf_pose_refiner {
namespace {

constexpr int kSize = 64;        // of the images [px]
constexpr int kResolution = 32;  // of the region
constexpr double kDistance = 3;  // from the cameras to the point they look at
constexpr double kWide = 64;     // focal lengths [px]: the image is 3 units across
constexpr double kNarrow = 150;  // 1.28 units
const Eigen::Vector3d kLookAt(0.2, -0.1, 0.3);

struct Ball {
  Eigen::Vector3d centre = kLookAt;
  double radius = 0.4;
};

Pose cameraPose(int i, int count) {
  const double height = (2.0 * i + 1) / count - 1, angle = 2.399963229728653 * i;
  const double radius = std::sqrt(1 - height * height);
  const Eigen::Vector3d away(radius * std::cos(angle), radius * std::sin(angle), height);
  const Eigen::Vector3d right = (-away).cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose T_O_C;
  T_O_C.R.col(0) = right;
  T_O_C.R.col(1) = (-away).cross(right);
  T_O_C.R.col(2) = -away;
  T_O_C.t = kLookAt + kDistance * away;
  return T_O_C;
}

bool sees(const Pose& T_O_C, const Camera& camera, int x, int y, const Ball& ball) {
  const Eigen::Vector3d d = (T_O_C.R * camera.direction(x, y)).normalized();
  const Eigen::Vector3d o = T_O_C.t - ball.centre;
  const double nearest = -o.dot(d);
  return nearest > 0 && (o + nearest * d).norm() < ball.radius;
}

// @param ball_of the ball that view i shows.
Dataset datasetOf(const std::function<Ball(int)>& ball_of, double focal = kWide, int count = 24) {
  Dataset dataset;
  dataset.folder = "balls";
  dataset.has_alpha = true;
  for (int i = 0; i < count; ++i) {
    PosedView view;
    view.camera = {kSize, kSize, focal, focal, 0.5 * kSize - 0.5, 0.5 * kSize - 0.5};
    view.T_O_C = cameraPose(i, count);
    Image8 rgba(kSize, kSize, 4, 255);
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        rgba.at(x, y, 3) = sees(view.T_O_C, view.camera, x, y, ball_of(i)) ? 255 : 0;
      }
    }
    view.rgba = std::make_shared<Image8>(rgba);
    dataset.views.push_back(view);
  }
  return dataset;
}

Dataset datasetOf(const Ball& ball, double focal = kWide) {
  return datasetOf([&](int) { return ball; }, focal);
}

Hull hullOf(const Dataset& dataset) {
  return visualHull(dataset, kResolution, 0, CancellationToken());
}

// The box holds the ball and is at most `slack` wider to every side.
void expectTight(const Box& box, const Ball& ball, double slack) {
  for (int a = 0; a < 3; ++a) {
    EXPECT_LT(box.min[a], ball.centre[a] - ball.radius) << a;
    EXPECT_GT(box.min[a], ball.centre[a] - ball.radius - slack) << a;
    EXPECT_GT(box.max[a], ball.centre[a] + ball.radius) << a;
    EXPECT_LT(box.max[a], ball.centre[a] + ball.radius + slack) << a;
  }
}

// Occupied cells by the distance of their middles from the ball's surface: all that the ball
// touches, with their neighbours; none that is far away.
void expectRegionAround(const Hull& hull, const Ball& ball, double slack) {
  ASSERT_EQ(hull.region.resolution, kResolution);
  const double side = (hull.box.max - hull.box.min).maxCoeff(), cell = side / kResolution;
  const Eigen::Vector3d corner =
      0.5 * (hull.box.min + hull.box.max) - Eigen::Vector3d::Constant(0.5 * side);
  for (int z = 0; z < kResolution; ++z) {
    for (int y = 0; y < kResolution; ++y) {
      for (int x = 0; x < kResolution; ++x) {
        const Eigen::Vector3d p = corner + cell * Eigen::Vector3d(x + 0.5, y + 0.5, z + 0.5);
        const double outside = (p - ball.centre).norm() - ball.radius;
        if (outside < cell) {
          ASSERT_TRUE(hull.region.occupied(x, y, z)) << p.transpose();
        } else if (outside > slack) {
          ASSERT_FALSE(hull.region.occupied(x, y, z)) << p.transpose();
        }
      }
    }
  }
}

// Silhouettes of 40 px are out of place by 6: their common volume is less than the ball, unless
// each is taken for wider.
TEST(VisualHull, SlackOutweighsPosesThatAreNotExact) {
  const Ball ball;
  const auto shaken = [&](int i) {
    return Ball{ball.centre + 0.12 * Eigen::Vector3d(i % 3 - 1, (i / 3) % 3 - 1, 0), ball.radius};
  };
  const Dataset dataset = datasetOf(shaken, kNarrow);
  const Box strict = visualHull(dataset, kResolution, 0, CancellationToken()).box;
  const Box slack = visualHull(dataset, kResolution, 0, CancellationToken(), 0.2).box;
  EXPECT_LT(strict.max.x(), ball.centre.x() + ball.radius - 0.02);
  EXPECT_GT(slack.max.x(), ball.centre.x() + ball.radius);
  EXPECT_LT(slack.max.x(), ball.centre.x() + ball.radius + 0.25);
}

// A pixel is kDistance / focal wide at the ball, a cell of the last pass about a 64th of the box.
double slackOf(double focal, double cells) { return 2 * kDistance / focal + cells * 1.1 / 64; }

TEST(VisualHull, HoldsTheObjectTightly) {
  const Ball ball;
  const Hull hull = hullOf(datasetOf(ball));
  expectTight(hull.box, ball, slackOf(kWide, 4));
  expectRegionAround(hull, ball, slackOf(kWide, 8));
}

TEST(VisualHull, PixelsOfWhichNothingIsKnownDenyNothing) {
  const Ball ball;
  Dataset dataset = datasetOf(ball);
  Image8 rgba = *dataset.views[0].rgba;  // it takes the ball for background
  for (std::size_t i = 3; i < rgba.values.size(); i += 4) {
    rgba.values[i] = rgba.values[i] == 255 ? kPerhapsBackground : 0;
  }
  dataset.views[0].rgba = std::make_shared<Image8>(rgba);
  expectTight(hullOf(dataset).box, ball, slackOf(kWide, 4));
}

TEST(VisualHull, ImagesThatTheObjectFills) {
  Ball ball;
  ball.radius = 0.6;  // of 0.64; what lies beside the images is no object either
  const Hull hull = hullOf(datasetOf(ball, kNarrow));
  expectTight(hull.box, ball, slackOf(kNarrow, 5));
  expectRegionAround(hull, ball, slackOf(kNarrow, 10));
}

TEST(VisualHull, ImagesThatCutTheObjectOffDoNotDenyTheRest) {
  Ball ball;
  ball.centre += Eigen::Vector3d(0.3, 0, 0);  // cut off in the images from the sides
  const Hull hull = hullOf(datasetOf(ball, kNarrow));
  for (int a = 0; a < 3; ++a) {
    EXPECT_LT(hull.box.min[a], ball.centre[a] - ball.radius);
    EXPECT_GT(hull.box.max[a], ball.centre[a] + ball.radius);
  }
  EXPECT_LT((hull.box.max - hull.box.min).maxCoeff(), 2.0);
}

TEST(VisualHull, ScalesWithTheScene) {
  Dataset dataset = datasetOf(Ball());
  const Hull expected = hullOf(dataset);
  for (PosedView& view : dataset.views) view.T_O_C.t *= 0.05;
  const Hull hull = hullOf(dataset);
  EXPECT_NEAR((hull.box.min - 0.05 * expected.box.min).norm(), 0, 1e-6);
  EXPECT_NEAR((hull.box.max - 0.05 * expected.box.max).norm(), 0, 1e-6);
}

TEST(VisualHull, StaysInsideTheBoxOfTheDataset) {
  const Ball ball;
  Dataset dataset = datasetOf(ball);
  dataset.has_box = true;
  dataset.box_min = ball.centre - Eigen::Vector3d(0.7, 0.1, 0.7);  // cuts through the ball
  dataset.box_max = ball.centre + Eigen::Vector3d(0.7, 0.7, 0.7);
  const Hull hull = hullOf(dataset);
  EXPECT_NEAR(hull.box.min.y(), dataset.box_min.y(), 1e-12);
  EXPECT_LT(hull.box.min.x(), ball.centre.x() - ball.radius);
  EXPECT_GT(hull.box.min.x(), dataset.box_min.x());
}

TEST(VisualHull, OnlyTheMatterInTheBoxOfTheDatasetCounts) {
  const Ball ball;
  Dataset dataset = datasetOf(ball);
  dataset.has_box = true;
  dataset.box_min = ball.centre + Eigen::Vector3d(-0.7, 0.32, -0.7);  // a cap, 0.24 in radius
  dataset.box_max = ball.centre + Eigen::Vector3d(0.7, 0.7, 0.7);
  const Hull hull = hullOf(dataset);
  EXPECT_GT(hull.box.min.x(), ball.centre.x() - 0.24 - slackOf(kWide, 4));
  EXPECT_LT(hull.box.max.z(), ball.centre.z() + 0.24 + slackOf(kWide, 4));
}

TEST(VisualHull, RefusesABoxBesideTheObject) {
  Dataset dataset = datasetOf(Ball());
  dataset.has_box = true;
  // Flat, and half a unit above the ball; the cube around the box holds the ball.
  dataset.box_min = kLookAt + Eigen::Vector3d(-1.5, -1.5, 0.9);
  dataset.box_max = kLookAt + Eigen::Vector3d(1.5, 1.5, 1.0);
  expectError<std::runtime_error>([&] { hullOf(dataset); }, "balls", "no common volume");
}

TEST(VisualHull, RefusesViewsThatDoNotBelongTogether) {
  const auto ball_of = [](int i) {
    Ball ball;
    ball.centre.x() += i % 2 == 0 ? -0.6 : 0.6;
    return ball;
  };
  expectError<std::runtime_error>([&] { hullOf(datasetOf(ball_of)); }, "balls",
                                  "the silhouettes have no common volume");
}

TEST(VisualHull, RefusesEmptySilhouettes) {
  Ball nothing;
  nothing.radius = 0;
  expectError<std::runtime_error>([&] { hullOf(datasetOf(nothing)); }, "balls", "no common volume");
}

TEST(VisualHull, WithoutAlphaTheBoxIsTakenWhole) {
  Dataset dataset = datasetOf(Ball());
  dataset.has_alpha = false;
  dataset.has_box = true;
  dataset.box_min = {-1, -2, -3};
  dataset.box_max = {1, 2, 3};
  const Hull hull = hullOf(dataset);
  EXPECT_EQ(hull.box.min, dataset.box_min);
  EXPECT_EQ(hull.box.max, dataset.box_max);
  EXPECT_EQ(hull.region.resolution, 0);
}

TEST(VisualHull, NeedsAlphaOrABox) {
  Dataset dataset = datasetOf(Ball());
  dataset.has_alpha = false;
  expectError<std::runtime_error>([&] { hullOf(dataset); }, "balls", "mask_path", "aabb");
}

TEST(VisualHull, NeedsViews) {
  Dataset dataset;
  dataset.folder = "nothing";
  expectError<std::runtime_error>([&] { hullOf(dataset); }, "nothing: no views");
}

TEST(VisualHull, CanBeStopped) {
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(visualHull(datasetOf(Ball()), kResolution, 0, cancellation), Cancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
