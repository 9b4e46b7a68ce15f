// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/depth_layers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>

#include "backend/make_backend.h"
#include "detection/template_search.h"
#include "field/field.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kBack_m = 1.5, kObject_m = 0.6, kFront_m = 0.3;
const Camera kColour = {200, 160, 150, 150, 99.5, 79.5};

/// 0.2 m across: 50 px at 0.6 m.
FieldMetadata metricObject() {
  FieldMetadata object;
  object.diameter = 2;
  object.metres_per_unit = 0.1;
  return object;
}

/// A square in the middle before a wall, with something nearer to the left of it.
ImageOf<float> shown() {
  ImageOf<float> metres(200, 160, 1, kBack_m);
  for (int y = 60; y < 100; ++y) {
    for (int x = 80; x < 120; ++x) metres.at(x, y, 0) = kObject_m;
    for (int x = 10; x < 30; ++x) metres.at(x, y, 0) = kFront_m;
  }
  return metres;
}

Image grey() { return Image(200, 160, 3, 0.4f); }

bool isShown(const DepthLayers::Layer& layer, int x, int y) {
  const float* const pixel = layer.colours.pixel(x - layer.window.x, y - layer.window.y);
  return pixel[0] == 0.4f && pixel[1] == 0.4f && pixel[2] == 0.4f;
}

std::optional<DepthLayers::Layer> layerOf(const ImageOf<float>& metres, double distance,
                                          const Pose& T_C_D = {}) {
  const auto layers = DepthLayers::of(*depthImage(metres, kColour, T_C_D), kColour, metricObject());
  return layers ? layers->at(distance, 1.1, grey()) : std::nullopt;
}

TEST(DepthLayers, ShowWhatIsAsFarAsTheObject) {
  const auto layer = layerOf(shown(), kObject_m / 0.2);
  ASSERT_TRUE(layer);
  // The square and half an object, of 50 px, to each side: its centre may be there.
  EXPECT_NEAR(layer->window.x, 80 - 25, 1);
  EXPECT_NEAR(layer->window.y, 60 - 25, 1);
  EXPECT_NEAR(layer->window.width, 40 + 50, 2);
  EXPECT_NEAR(layer->window.height, 40 + 50, 2);
  for (int y = layer->window.y; y < layer->window.y + layer->window.height; ++y) {
    for (int x = layer->window.x; x < layer->window.x + layer->window.width; ++x) {
      ASSERT_EQ(isShown(*layer, x, y), x >= 80 && x < 120 && y >= 60 && y < 100) << x << " " << y;
    }
  }
}

TEST(DepthLayers, HaveNothingWhereNothingIs) {
  EXPECT_TRUE(layerOf(shown(), kObject_m / 0.2));
  EXPECT_TRUE(layerOf(shown(), kFront_m / 0.2));
  EXPECT_FALSE(layerOf(shown(), 1.0 / 0.2));  // between object and wall
}

// A table that rises to the back, with a card that stands on it 0.08 m below the camera's axis.
TEST(DepthLayers, DoNotShowTheTableThatAnObjectStandsOn) {
  ImageOf<float> metres(200, 160, 1, kBack_m);
  for (int y = 0; y < 160; ++y) {
    const double slope = kColour.direction(0, y).y();  // y = 0.2 - 0.2 z
    const auto table = static_cast<float>(0.2 / (slope + 0.2));
    for (int x = 0; x < 200; ++x) {
      if (slope > -0.1 && table < kBack_m) metres.at(x, y, 0) = table;
      const bool is_card = x >= 80 && x < 120 && y >= 69 && y < 99;
      if (is_card) metres.at(x, y, 0) = kObject_m;
    }
  }
  const auto layer = layerOf(metres, kObject_m / 0.2);
  ASSERT_TRUE(layer);
  const int end_x = layer->window.x + layer->window.width;
  const int end_y = layer->window.y + layer->window.height;
  ASSERT_GT(end_y, 105);
  for (int y = layer->window.y; y < end_y; ++y) {
    for (int x = layer->window.x; x < end_x; ++x) {
      if (y >= 94 && y < 101) continue;  // where the card meets the table
      ASSERT_EQ(isShown(*layer, x, y), x >= 80 && x < 120 && y >= 69 && y < 99) << x << " " << y;
    }
  }
}

TEST(DepthLayers, TakeTheFartherSideForWhatWasNotMeasured) {
  ImageOf<float> metres = shown();
  for (int y = 60; y < 100; ++y) {
    for (int x = 120; x < 140; ++x) metres.at(x, y, 0) = 0;         // a shadow beside the square
    metres.at(95, y, 0) = std::numeric_limits<float>::quiet_NaN();  // a crack in it
  }
  const auto layer = layerOf(metres, kObject_m / 0.2);
  ASSERT_TRUE(layer);
  EXPECT_FALSE(isShown(*layer, 121, 80));
  EXPECT_FALSE(isShown(*layer, 139, 80));
  EXPECT_TRUE(isShown(*layer, 95, 80));
}

TEST(DepthLayers, AreThoseOfTheColourCamera) {
  // 0.04 m are 10 px at 0.6 m: what the depth camera sees at 80 is at 90.
  const auto layer = layerOf(shown(), kObject_m / 0.2, {Eigen::Matrix3d::Identity(), {0.04, 0, 0}});
  ASSERT_TRUE(layer);
  EXPECT_FALSE(isShown(*layer, 88, 80));
  EXPECT_TRUE(isShown(*layer, 91, 80));
  EXPECT_TRUE(isShown(*layer, 128, 80));
  EXPECT_FALSE(isShown(*layer, 131, 80));
}

TEST(DepthLayers, ShowThinThingsThatTwoCamerasSeeInOtherPlaces) {
  ImageOf<float> metres(200, 160, 1, kBack_m);
  for (int y = 40; y < 120; ++y) {
    for (int x = 80; x < 84; ++x) metres.at(x, y, 0) = kObject_m;  // 10 px beside that below
  }
  const auto layer = layerOf(metres, kObject_m / 0.2, {Eigen::Matrix3d::Identity(), {0.04, 0, 0}});
  ASSERT_TRUE(layer);
  for (int x = 80; x < 105; ++x) EXPECT_EQ(isShown(*layer, x, 80), x >= 90 && x < 94) << x;
}

TEST(DepthLayers, LeaveNoGapsBetweenThePixelsOfASmallDepthImage) {
  const Camera small = {67, 53, 50, 50, 33, 26};
  ImageOf<float> metres(67, 53, 1, kBack_m);
  for (int y = 20; y < 33; ++y) {
    for (int x = 27; x < 40; ++x) metres.at(x, y, 0) = kObject_m;
  }
  const auto layers = DepthLayers::of(*depthImage(metres, small), kColour, metricObject());
  ASSERT_TRUE(layers);
  const auto layer = layers->at(kObject_m / 0.2, 1.1, grey());
  ASSERT_TRUE(layer);
  for (int y = 64; y < 96; ++y) {
    for (int x = 84; x < 116; ++x) ASSERT_TRUE(isShown(*layer, x, y)) << x << " " << y;
  }
}

TEST(DepthLayers, DoNotTakeTheUnknownForNear) {
  ImageOf<float> metres = shown();
  for (int y = 0; y < 160; ++y) {
    for (int x = 150; x < 200; ++x) metres.at(x, y, 0) = 0;
  }
  const auto layers = DepthLayers::of(*depthImage(metres, kColour), kColour, metricObject());
  ASSERT_TRUE(layers);
  const auto layer = layers->at(0.51, 1.1, grey());  // down to behind the camera
  EXPECT_FALSE(layer);
}

// A pixel of this depth camera, of which there are 300,000, is as wide as the colour image.
TEST(DepthLayers, TakeTheMiddleOfPixelsThatMakeNoSense) {
  const Camera wide = {640, 480, 0.5, 0.5, 320, 240};
  const auto layers = DepthLayers::of(*depthImage(ImageOf<float>(640, 480, 1, kObject_m), wide),
                                      kColour, metricObject());
  ASSERT_TRUE(layers);
  const auto layer = layers->at(kObject_m / 0.2, 1.1, grey());
  ASSERT_TRUE(layer);
  EXPECT_TRUE(isShown(*layer, 99, 79));
  EXPECT_FALSE(isShown(*layer, 99 + 8, 79));
}

TEST(DepthLayers, StandNumbersThatMakeNoSense) {
  Camera beyond = kColour;
  beyond.cx = 1e300;
  const Pose turned(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                    Eigen::Vector3d::Zero());
  const auto layers = DepthLayers::of(
      *depthImage(ImageOf<float>(200, 160, 1, 1e30f), beyond, turned), kColour, metricObject());
  ASSERT_TRUE(layers);
  EXPECT_FALSE(layers->at(3, 1.1, grey()));
}

TEST(DepthLayers, AreNoneOfDepthThatSaysNothing) {
  const ImageOf<float> nothing(200, 160, 1, 0);
  EXPECT_FALSE(DepthLayers::of(*depthImage(nothing, kColour), kColour, metricObject()));
  ImageOf<float> millimetres = shown();
  for (float& value : millimetres.values) value *= 1000;
  EXPECT_FALSE(layerOf(millimetres, 3));
  FieldMetadata unscaled = metricObject();
  unscaled.metres_per_unit = 0;
  EXPECT_FALSE(DepthLayers::of(*depthImage(shown(), kColour), kColour, unscaled));
}

// Half a disc, whose colour is that of what is behind it.
TEST(DepthLayers, GiveAnOutlineToWhatLooksLikeItsBackground) {
  ImageOf<float> metres(200, 160, 1, kBack_m);
  const auto isInside = [](double x, double y) { return x > 0 && x * x + y * y < 25 * 25; };
  for (int y = 0; y < 160; ++y) {
    for (int x = 0; x < 200; ++x) {
      if (isInside(x - 120, y - 70)) metres.at(x, y, 0) = kObject_m;
    }
  }
  TemplateView view;
  view.R_O_V = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 128; ++i) {  // in diameters, of 50 px
    const double along = (i + 0.5) / 64 - 1, turn = M_PI / 2 * along;
    view.features.push_back(
        i % 2 == 0 ? TemplateFeature{{0, static_cast<float>(along / 2), 0}, 0}
                   : TemplateFeature{
                         Eigen::Vector3d(std::cos(turn) / 2, std::sin(turn) / 2, 0).cast<float>(),
                         static_cast<float>(turn)});
  }
  TemplateBank bank;
  bank.views = {view};
  const auto backend = makeCpuBackend(2);
  TemplateSearchSettings settings;
  settings.matching.scanned_px = settings.matching.fitted_px = 50;
  TemplateSearch search(backend.get(), std::make_shared<const TemplateBank>(bank), metricObject(),
                        settings);
  EXPECT_TRUE(search.find(grey(), kColour, {2, 8}, {}).candidates.empty());
  const auto layers = DepthLayers::of(*depthImage(metres, kColour), kColour, metricObject());
  ASSERT_TRUE(layers);
  const TemplateFindings found = search.find(grey(), kColour, {2, 8}, {}, &*layers);
  ASSERT_FALSE(found.candidates.empty());
  const Eigen::Vector3d centre_C = found.candidates.front().T_O_C.inverse() * metricObject().centre;
  EXPECT_LT((kColour.project(centre_C) - Eigen::Vector2d(120, 70)).norm(), 3);
  EXPECT_NEAR(centre_C.z(), 6, 0.8);  // [model units]
}

}  // namespace
}  // namespace nerf_pose_refiner
