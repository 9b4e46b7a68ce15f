// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/splat.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/keyframe_scene.h"

namespace nerf_pose_refiner {
namespace {

class Splat : public testing::Test, public KeyframeScene {
 protected:
  struct Compared {
    double mean_difference;  ///< of colours, where both show the object
    double shared;           ///< of the pixels that show it in the rendering
    double beyond;           ///< of the splat's pixels: where the rendering shows nothing
  };

  /// A splat with a rendering.
  Compared compare(const Rendering& is, const Rendering& wanted) const {
    double difference = 0;
    int both = 0, rendered = 0, shown = 0, beyond = 0;
    for (std::size_t i = 0; i < is.alpha.pixels(); ++i) {
      const bool is_shown = is.alpha.values[i] == 1;
      const bool is_rendered = wanted.alpha.values[i] > 0.95f;
      shown += is_shown;
      rendered += is_rendered;
      beyond += is_shown && wanted.alpha.values[i] < 0.5f;
      if (!is_shown || !is_rendered) continue;
      ++both;
      for (std::size_t c = 0; c < 3; ++c) {
        const float alpha = wanted.alpha.values[i];
        difference +=
            std::abs(is.colour.values[3 * i + c] - wanted.colour.values[3 * i + c] / alpha);
      }
    }
    return {difference / (3 * both), static_cast<double>(both) / rendered,
            static_cast<double>(beyond) / shown};
  }

  static View reduced(const Pose& T_O_C, double scale = 0.4) {
    return {kCamera.scaled(scale), T_O_C};
  }
  Rendering rendered(const Pose& T_O_C) const {
    return scene_->render(reduced(T_O_C), RenderOptions(), {});
  }

  KeyframePoints keyframe_ = keyframeAt(truth_);
};

TEST_F(Splat, ShowsWhatTheKeyframeWasRenderedFrom) {
  const Compared same = compare(splat(keyframe_, reduced(truth_)), rendered(truth_));
  EXPECT_LT(same.mean_difference, 0.02);
  EXPECT_GT(same.shared, 0.8);  // the rim is left out
  EXPECT_LT(same.beyond, 0.02);
}

TEST_F(Splat, ShowsWhatARenderingShowsFromBeside) {
  const Pose beside = offBy(truth_, {0.6, 0.5, -0.6}, 6);
  const Compared turned = compare(splat(keyframe_, reduced(beside)), rendered(beside));
  const Compared not_turned = compare(splat(keyframe_, reduced(truth_)), rendered(beside));
  EXPECT_LT(turned.mean_difference, 0.5 * not_turned.mean_difference);
  EXPECT_GT(turned.shared, 0.8);
  EXPECT_LT(turned.beyond, 0.5 * not_turned.beyond);
}

// Of few points: those of a level may be three pixels apart.
TEST_F(Splat, HasNoHolesInImagesOfAnySize) {
  KeyframeSettings settings;
  settings.max_shown = 500;
  const KeyframePoints sparse = keyframeAt(truth_, settings);
  ASSERT_GE(sparse.levels.front().spacing, 3);
  for (const double scale : {0.15, 0.3, 0.6, 1.0}) {
    const View view = reduced(truth_, scale);
    const Compared same = compare(splat(sparse, view), scene_->render(view, RenderOptions(), {}));
    EXPECT_GT(same.shared, 0.75) << scale;
    EXPECT_LT(same.beyond, 0.1) << scale;
  }
}

TEST_F(Splat, OfWhatIsBehindTheCameraIsEmpty) {
  const Pose turned(truth_.R * expSO3(Eigen::Vector3d(0, M_PI, 0)), truth_.t);
  const Rendering empty = splat(keyframe_, reduced(turned));
  for (const float alpha : empty.alpha.values) ASSERT_EQ(alpha, 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
