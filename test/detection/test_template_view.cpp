// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "backend/loaded_field.h"
#include "detection/placed_template.h"
#include "field/field.h"
#include "math/angle.h"
#include "views/sphere_directions.h"

namespace nerf_pose_refiner {
namespace {

FieldMetadata templateObject() {
  FieldMetadata object;
  object.diameter = 2;
  object.centre = {1, 2, 3};
  return object;
}

/// A square of 40 x 40 pixels in the plane through the centre, black to the left and white to the
/// right of the middle.
struct Scene {
  View view;
  Rendering rendering;

  Scene() {
    view.camera = {80, 80, 100, 100, 39.5, 39.5};
    view.T_O_C = lookingAt(templateObject().centre, Eigen::Vector3d(0.6, 0, 0.8), 5);
    rendering.colour = Image(80, 80, 3);
    rendering.alpha = Image(80, 80, 1);
    rendering.point = Image(80, 80, 3);
    for (int y = 20; y < 60; ++y) {
      for (int x = 20; x < 60; ++x) {
        rendering.alpha.at(x, y, 0) = 1;
        const Eigen::Vector3d point_O = view.T_O_C * (5 * view.camera.direction(x, y));
        for (int c = 0; c < 3; ++c) {
          rendering.colour.at(x, y, c) = x < 40 ? 0.0f : 1.0f;
          rendering.point.at(x, y, c) = static_cast<float>(point_O[c]);
        }
      }
    }
  }
};

TEST(TemplateView, HasTheContourAndInnerEdges) {
  const Scene scene;
  const TemplateView made = makeTemplateView(scene.rendering, scene.view, templateObject(), 128);
  ASSERT_EQ(made.features.size(), 128u);
  EXPECT_EQ(made.R_O_V, scene.view.T_O_C.R);
  int inner = 0, flat = 0;
  for (const TemplateFeature& edge : made.features) {
    flat += edge.normal_rad == kNoNormal;
    if (edge.normal_rad == kNoNormal) continue;
    // Pixels times 5 / 100 units a pixel, over a diameter of 2.
    const double x = 40 * edge.point.x(), y = 40 * edge.point.y();
    EXPECT_NEAR(edge.point.z(), 0, 1e-5);
    const bool is_upright = std::abs(std::abs(x) - 19.5) < 0.01 || std::abs(x) < 0.6;
    const bool is_level = std::abs(std::abs(y) - 19.5) < 0.01;
    ASSERT_TRUE(is_upright || is_level) << x << " " << y;
    inner += std::abs(x) < 0.6 && !is_level;
    if (is_upright && is_level) continue;  // at a corner
    const double along = is_upright ? std::sin(edge.normal_rad) : std::cos(edge.normal_rad);
    EXPECT_NEAR(along, 0, 0.25);  // next to a corner the contour is round
  }
  EXPECT_GT(inner, 10);
  EXPECT_EQ(flat, 32);
}

TEST(TemplateView, HasPlacesInsideAwayFromAllEdges) {
  const Scene scene;
  for (const TemplateFeature& one :
       makeTemplateView(scene.rendering, scene.view, templateObject(), 128).features) {
    if (one.normal_rad != kNoNormal) continue;
    // Four pixels are left free, and one that smoothing reaches beside the middle.
    const double x = 40 * std::abs(one.point.x()), y = 40 * std::abs(one.point.y());
    EXPECT_TRUE(x > 4.4 && x < 15.6 && y < 15.6) << x << " " << y;
  }
}

TEST(TemplateView, OfAThinObjectHasEdgesAlone) {
  Scene scene;
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 80; ++x) {
      if (std::abs(x - 39.5) > 4) scene.rendering.alpha.at(x, y, 0) = 0;
    }
  }
  const TemplateView made = makeTemplateView(scene.rendering, scene.view, templateObject(), 128);
  ASSERT_EQ(made.features.size(), 128u);
  for (const TemplateFeature& one : made.features) EXPECT_NE(one.normal_rad, kNoNormal);
}

TEST(TemplateView, DividesFeaturesIntoPartsByTheirPlaces) {
  const Scene scene;
  const TemplateView made = makeTemplateView(scene.rendering, scene.view, templateObject(), 128);
  for (int part = 0; part < kTemplateParts; ++part) {
    Eigen::Vector3f low = made.features[32 * part].point, high = low;
    for (int i = 32 * part; i < 32 * (part + 1); ++i) {
      low = low.cwiseMin(made.features[i].point);
      high = high.cwiseMax(made.features[i].point);
    }
    EXPECT_LT((high - low).maxCoeff(), 0.75f) << part;  // of 0.98
  }
}

TEST(TemplateView, OfNothingHasNoFeatures) {
  Scene scene;
  scene.rendering.alpha = Image(80, 80, 1);
  EXPECT_TRUE(
      makeTemplateView(scene.rendering, scene.view, templateObject(), 128).features.empty());
}

TEST(TemplatePlacement, IsThePoseThatShowsTheTemplate) {
  const Scene scene;
  const TemplateView made = makeTemplateView(scene.rendering, scene.view, templateObject(), 32);
  TemplateScale scale;
  scale.camera = {400, 300, 500, 500, 199.5, 149.5};
  scale.object_px = 100;
  // In the middle, as it was rendered: from the same side, at 5 diameters.
  const Pose middle = posePlaced({&made, 0}, scale, {199.5, 149.5}, templateObject());
  EXPECT_LT(rotationDistance(middle.R, scene.view.T_O_C.R), 1e-9);
  EXPECT_NEAR((middle.t - templateObject().centre).norm(), 5 * 2, 1e-9);
  // Turned by a quarter, and beside the middle.
  const Eigen::Vector2d pixel(260, 120);
  const Pose turned = posePlaced({&made, kPi / 2}, scale, pixel, templateObject());
  EXPECT_LT((scale.camera.project(turned.inverse() * templateObject().centre) - pixel).norm(),
            1e-9);
  // What was to the right is below now.
  const Eigen::Vector3d right_O = scene.view.T_O_C.R.col(0);
  const Eigen::Vector3d seen = turned.R.transpose() * right_O;
  EXPECT_NEAR(seen.y(), 1, 0.02);
}

TEST(TemplateBankSettings, AreChecked) {
  TemplateBankSettings settings;
  EXPECT_NO_THROW(settings.validate());
  settings.features = 100;
  EXPECT_THROW(settings.validate(), std::invalid_argument);
  settings = {};
  settings.distance = 0.5;
  EXPECT_THROW(settings.validate(), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
