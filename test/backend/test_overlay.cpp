// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/draw_overlay.h"

#include "backend/loaded_field.h"

#include <gtest/gtest.h>

#include <array>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

using Bytes = std::array<int, 3>;

Bytes pixelOf(const Image8& image, int x, int y) {
  return {image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)};
}

/// An opaque red square of 4 x 4 pixels before a pure green image of 8 x 8.
class OverlayTest : public testing::Test {
 protected:
  OverlayTest() : observed_(8, 8, 3) {
    rendering_.colour = Image(8, 8, 3);
    rendering_.alpha = Image(8, 8, 1);
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) {
        observed_.at(x, y, 1) = 1;
        if (x < 2 || x > 5 || y < 2 || y > 5) continue;
        rendering_.alpha.at(x, y, 0) = 1;
        rendering_.colour.at(x, y, 0) = 1;
      }
    }
  }

  Image observed_;
  Rendering rendering_;
};

TEST_F(OverlayTest, ShowsTheCameraInGreyAndTheRenderingInColour) {
  const Image8 overlay = drawOverlay(observed_, rendering_);
  EXPECT_EQ(pixelOf(overlay, 0, 0), (Bytes{150, 150, 150}));  // 0.587 * 255
  EXPECT_EQ(pixelOf(overlay, 3, 3), (Bytes{255, 0, 0}));
}

TEST_F(OverlayTest, DrawsTheOutlineInside) {
  const Image8 overlay = drawOverlay(observed_, rendering_);
  const Bytes green{0, 255, 0};
  for (int i = 2; i <= 5; ++i) {
    EXPECT_EQ(pixelOf(overlay, i, 2), green);
    EXPECT_EQ(pixelOf(overlay, i, 5), green);
    EXPECT_EQ(pixelOf(overlay, 2, i), green);
    EXPECT_EQ(pixelOf(overlay, 5, i), green);
  }
  EXPECT_NE(pixelOf(overlay, 1, 2), green);
  EXPECT_NE(pixelOf(overlay, 6, 5), green);
}

TEST_F(OverlayTest, LetsTheCameraThroughWhereTheRenderingIsThin) {
  rendering_.alpha.at(0, 0, 0) = 0.25f;
  rendering_.colour.at(0, 0, 0) = 0.2f;  // premultiplied
  const Image8 overlay = drawOverlay(observed_, rendering_);
  EXPECT_EQ(pixelOf(overlay, 0, 0), (Bytes{163, 112, 112}));  // 0.587 * 0.75 = 0.440, and 0.2
}

TEST_F(OverlayTest, OutlinesAnObjectThatLeavesTheImage) {
  rendering_.alpha = Image(8, 8, 1, 1.0f);
  const Image8 overlay = drawOverlay(observed_, rendering_);
  EXPECT_EQ(pixelOf(overlay, 0, 4), (Bytes{0, 255, 0}));
  EXPECT_NE(pixelOf(overlay, 4, 4), (Bytes{0, 255, 0}));
}

TEST_F(OverlayTest, RefusesImagesOfDifferentSizes) {
  EXPECT_THROW(drawOverlay(Image(8, 7, 3), rendering_), std::invalid_argument);
}

// Half of a rendering of 0.8 on grey of 0.4, where it is opaque and no outline: 0.6.
TEST(DrawOverlay, TheRenderingMayBeSeenThrough) {
  const Image observed(5, 5, 3, 0.4f);
  Rendering rendering;
  rendering.colour = Image(5, 5, 3, 0.8f);
  rendering.alpha = Image(5, 5, 1, 1.0f);
  EXPECT_EQ(drawOverlay(observed, rendering, 0.5).at(2, 2, 0), 153);
  EXPECT_EQ(drawOverlay(observed, rendering, 0.0).at(2, 2, 0), 102);
  EXPECT_EQ(drawOverlay(observed, rendering).at(2, 2, 0), 204);
  EXPECT_EQ(drawOverlay(observed, rendering, 0.0).at(0, 2, 1), 255) << "the outline stays";
}

}  // namespace
}  // namespace nerf_pose_refiner
