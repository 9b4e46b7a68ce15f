// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "backend/loaded_field.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "views/keyframe_level.h"
#include "views/keyframe_pyramid.h"

namespace nerf_pose_refiner {
namespace {

const Camera kKeyframeCamera = {320, 240, 400, 400, 159.5, 119.5};

class KeyframeOfScene : public testing::Test {
 protected:
  // Cells are pixels, unless settings say otherwise.
  static KeyframeSettings dense() {
    KeyframeSettings settings;
    settings.max_shown = 1 << 20;
    return settings;
  }

  KeyframePoints render(const KeyframeSettings& settings = dense(),
                        const Camera& camera = kKeyframeCamera) {
    return renderKeyframe(*scene_, {camera, T_O_C_}, settings);
  }

  // How far a point is from the surface of the scene's box and ball, at most a little: both are
  // described in support/analytic_scene.cpp.
  double distanceToSurface(const PointColumns& points, int i) const {
    const Eigen::Vector3d p =
        scene_->field().metadata.centre + Eigen::Vector3d(points.x[i], points.y[i], points.z[i]);
    const Eigen::Vector3d beyond = p.cwiseAbs() - Eigen::Vector3d(0.36, 0.22, 0.28);
    const double box = std::abs(beyond.maxCoeff());
    const double ball = std::abs((p - Eigen::Vector3d(0.30, 0.20, 0.24)).norm() - 0.15);
    return std::min(box, ball);
  }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  Pose T_O_C_ = cameraAround(*scene_, 0.6, 0.5);
};

TEST_F(KeyframeOfScene, NeedsAnObjectOfUsefulSizeInTheImage) {
  const FieldMetadata& object = scene_->field().metadata;
  const double distance = (T_O_C_.t - object.centre).norm();
  const auto cameraWith = [](double focal) { return Camera{320, 240, focal, focal, 159.5, 119.5}; };
  // The window is 1.2 diameters wide: 8 pixels at least, 16 times the image at most.
  const double least = 8 * distance / (1.2 * object.diameter);
  const double most = 16 * 320 * distance / (1.2 * object.diameter);
  const KeyframeSettings settings;
  int reduction = 0;
  for (const double focal : {1.01 * least, 0.99 * most}) {
    EXPECT_TRUE(fitsKeyframe({cameraWith(focal), T_O_C_}, object)) << focal;
    const Camera window = keyframeCamera(cameraWith(focal), T_O_C_, object, settings, &reduction);
    EXPECT_GT(window.width, 8);
    EXPECT_LT(window.width, 2 * settings.max_side_px);
  }
  for (const double focal : {0.99 * least, 1.01 * most, 1e-9, 1e9, 1e200, 1e308}) {
    EXPECT_FALSE(fitsKeyframe({cameraWith(focal), T_O_C_}, object)) << focal;
    EXPECT_THROW(keyframeCamera(cameraWith(focal), T_O_C_, object, settings, &reduction),
                 std::invalid_argument);
  }
  const Pose behind = {T_O_C_.R, object.centre + 3 * T_O_C_.R.col(2)};
  EXPECT_FALSE(fitsKeyframe({kKeyframeCamera, behind}, object));
}

TEST_F(KeyframeOfScene, PointsLieOnTheSurface) {
  const KeyframePoints keyframe = render();
  ASSERT_EQ(keyframe.levels.size(), 4u);
  const KeyframeLevel& level = keyframe.levels[0];
  ASSERT_GT(level.point_count, 1000);
  for (int i = 0; i < level.chosen.size(); ++i) {
    EXPECT_LT(distanceToSurface(level.chosen, i), 0.01) << i;
  }
}

TEST_F(KeyframeOfScene, NormalsLookAwayFromTheCameraAndSomePlacesTellTheLight) {
  const KeyframePoints keyframe = render();
  for (const KeyframeLevel& level : keyframe.levels) {
    ASSERT_EQ(level.shown_normal.size(), level.shown.cell.size());
    ASSERT_FALSE(level.light_samples.empty());
    EXPECT_LE(level.light_samples.size(), static_cast<std::size_t>(kMaxLightSamples));
    int known = 0;
    for (std::size_t k = 0; k < level.light_samples.size(); ++k) {
      const std::int32_t i = level.light_samples[k];
      ASSERT_TRUE(k == 0 || i > level.light_samples[k - 1]);
      ASSERT_LT(level.shown.cell[i], level.width * level.height);  // none of those that fill up
      const Vec3<float>& n = level.shown_normal[i];
      if (norm(n) == 0) continue;
      ++known;
      EXPECT_NEAR(norm(n), 1, 1e-5);
      const Eigen::Vector3d point =
          keyframe.centre + Eigen::Vector3d(level.shown.x[i], level.shown.y[i], level.shown.z[i]);
      EXPECT_GT(Eigen::Vector3d(n.x, n.y, n.z).dot(point - keyframe.T_O_C.t), 0);
    }
    EXPECT_GT(known, static_cast<int>(level.light_samples.size()) / 2);
  }
}

TEST_F(KeyframeOfScene, PointsProjectToTheirPixels) {
  const KeyframeSettings settings = dense();
  const KeyframePoints keyframe = render(settings);
  int reduction = 0;
  const FieldMetadata& object = scene_->field().metadata;
  const Camera camera = keyframeCamera(kKeyframeCamera, T_O_C_, object, settings, &reduction);
  const KeyframeLevel& level = keyframe.levels[0];
  // The level is a part of the camera's image, so all its pixels are off by the same whole numbers.
  std::set<std::pair<long, long>> offsets;
  for (int i = 0; i < level.chosen.size(); ++i) {
    const Eigen::Vector3d p_O =
        object.centre + Eigen::Vector3d(level.chosen.x[i], level.chosen.y[i], level.chosen.z[i]);
    const Eigen::Vector2d pixel = camera.project(T_O_C_.inverse() * p_O);
    const double x = pixel.x() - level.chosen.cell[i] % level.width;
    const double y = pixel.y() - level.chosen.cell[i] / level.width;
    EXPECT_NEAR(x, std::round(x), 0.05);
    EXPECT_NEAR(y, std::round(y), 0.05);
    offsets.insert({std::lround(x), std::lround(y)});
  }
  EXPECT_EQ(offsets.size(), 1u);
}

TEST_F(KeyframeOfScene, KeepsToItsBudgetAndSpreadsIt) {
  KeyframeSettings settings = dense();
  settings.max_points = 300;
  const KeyframeLevel level = render(settings).levels[0];
  EXPECT_EQ(level.point_count, 300);
  std::map<int, int> of_cell;
  for (int i = 0; i < level.chosen.size(); ++i) {
    const int x = level.chosen.cell[i] % level.width, y = level.chosen.cell[i] / level.width;
    of_cell[y / 8 * 1000 + x / 8] += level.weight[i] > 0;
  }
  int most = 0;
  for (const auto& [cell, count] : of_cell) most = std::max(most, count);
  EXPECT_GT(of_cell.size(), 100u);
  EXPECT_LE(most, 300 / 100 + 1);
}

TEST_F(KeyframeOfScene, TilesAreWholeGroupsOfOneTile) {
  for (const KeyframeLevel& level : render().levels) {
    ASSERT_EQ(level.tiles.front(), 0);
    ASSERT_EQ(level.tiles.back(), level.chosen.size());
    EXPECT_EQ(level.shown.size() % kPointGroup, 0);
    int count = 0;
    for (std::size_t t = 0; t + 1 < level.tiles.size(); ++t) {
      EXPECT_EQ(level.tiles[t] % kPointGroup, 0);
      std::set<int> tiles;
      for (int i = level.tiles[t]; i < level.tiles[t + 1]; ++i) {
        const int cell = level.chosen.cell[i];
        tiles.insert(tileOfPixel(cell, level.width));
        count += level.weight[i] > 0;
      }
      EXPECT_EQ(tiles.size(), 1u);
    }
    EXPECT_EQ(count, level.point_count);
  }
}

TEST_F(KeyframeOfScene, PointsOfPlainPlacesCountLess) {
  const KeyframeLevel level = render().levels[0];
  float least = 1, most = 0;
  for (int i = 0; i < level.chosen.size(); ++i) {
    if (level.weight[i] == 0) continue;  // it fills a group
    double variance = 0;
    for (const float inverse : level.local.at(i).inverse_deviation) {
      variance += 1.0 / (inverse * inverse) - 0.03 * 0.03;
    }
    // Half where the deviation is 0.1.
    EXPECT_NEAR(level.weight[i], std::max(0.02, variance / (variance + 0.01)), 1e-3);
    least = std::min(least, level.weight[i]);
    most = std::max(most, level.weight[i]);
  }
  EXPECT_LT(least, 0.3f);
  EXPECT_GT(most, 0.7f);
}

TEST_F(KeyframeOfScene, LeavesOutDepthJumps) {
  // The ball stands before the box: a step of some tenths of the object between two pixels.
  const KeyframeLevel level = render().levels[0];
  std::map<int, double> depths;
  for (int i = 0; i < level.shown.size(); ++i) {
    const Eigen::Vector3d p(level.shown.x[i], level.shown.y[i], level.shown.z[i]);
    depths[level.shown.cell[i]] = T_O_C_.R.col(2).dot(p);
  }
  for (const auto& [cell, depth] : depths) {
    const auto right = depths.find(cell + 1);
    if (right == depths.end() || (cell + 1) % level.width == 0) continue;
    EXPECT_LT(std::abs(right->second - depth), 0.05) << cell;
  }
}

TEST_F(KeyframeOfScene, TakesLocalColoursOfAsManyPixelsAsItMay) {
  KeyframeSettings settings;
  settings.max_shown = 1500;
  const KeyframeLevel dense = render().levels[0], sparse = render(settings).levels[0];
  EXPECT_GT(sparse.spacing, 1);
  EXPECT_LE(sparse.shown.size(), 1.1 * settings.max_shown);
  EXPECT_EQ(sparse.width, (dense.width + sparse.spacing - 1) / sparse.spacing);
  EXPECT_EQ(sparse.point_count, dense.point_count);
}

TEST_F(KeyframeOfScene, ReducesALargeImage) {
  const Camera large =
      kKeyframeCamera.resized(4 * kKeyframeCamera.width, 4 * kKeyframeCamera.height);
  const KeyframePoints keyframe = render({}, large);
  EXPECT_EQ(keyframe.reduction, 2);
  EXPECT_LE(keyframe.levels[0].width, KeyframeSettings().max_side_px);
  EXPECT_EQ(render().reduction, 1);
}

// In the last steps outlines hold the distance; from afar they only mislead.
TEST_F(KeyframeOfScene, OutlinesLeadInTheLastStepsNearTheKeyframe) {
  KeyframeSettings settings;
  const KeyframePoints near = render(settings);
  for (std::size_t i = 0; i < near.levels.size(); ++i) {
    const KeyframeLevel& level = near.levels[i];
    if (i == 0) {
      EXPECT_GT(level.outline_weight, level.outline_evidence + 1.5f);
    } else {
      EXPECT_EQ(level.outline_weight, level.outline_evidence) << "level " << i;
    }
  }
  settings.for_starts = true;
  const KeyframeLevel from_afar = render(settings).levels.front();
  EXPECT_EQ(from_afar.outline_weight, from_afar.outline_evidence);
}

TEST_F(KeyframeOfScene, SmallObjectsGetMoreRays) {
  const auto raysOf = [&](double distance, const KeyframeSettings& settings) {
    const Pose T_O_C = cameraAround(*scene_, 0.6, 0.5, distance);
    const RenderedWindow window = renderWindow(*scene_, {kKeyframeCamera, T_O_C}, settings);
    return window.rendering.alpha.width / window.camera.width;
  };
  KeyframeSettings settings;  // 1.2 diameters are 480 px / the distance in diameters
  settings.max_rays_of_side = 400;
  EXPECT_EQ(raysOf(2, settings), 1);  // 240 px
  EXPECT_EQ(raysOf(3, settings), 2);  // 160 px
  EXPECT_EQ(raysOf(8, settings), 4);  // 60 px
  settings.max_rays_of_side = 0;
  EXPECT_EQ(raysOf(8, settings), 1);
}

// It is rendered in strips.
TEST_F(KeyframeOfScene, AWindowIsAsRenderedAtOnce) {
  const RenderedWindow window = renderWindow(*scene_, {kKeyframeCamera, T_O_C_}, dense());
  const Image& alpha = window.rendering.alpha;
  ASSERT_GT(alpha.pixels(), 50000u);
  const Camera camera = window.camera.resized(alpha.width, alpha.height);
  const Rendering at_once = scene_->render({camera, T_O_C_}, RenderOptions(), {});
  const auto expectSame = [](const Image& a, const Image& b) {
    ASSERT_EQ(a.values.size(), b.values.size());
    for (std::size_t i = 0; i < a.values.size(); ++i) {
      ASSERT_NEAR(a.values[i], b.values[i], 1e-5) << i;
    }
  };
  expectSame(window.rendering.colour, at_once.colour);
  expectSame(alpha, at_once.alpha);
  expectSame(window.rendering.point, at_once.point);
}

TEST_F(KeyframeOfScene, SeveralAreAsOneByOne) {
  const Pose other = cameraAround(*scene_, 2.0, -0.3);
  const std::vector<KeyframePoints> both =
      renderKeyframes(*scene_, {{kKeyframeCamera, T_O_C_}, {kKeyframeCamera, other}}, dense());
  ASSERT_EQ(both.size(), 2u);
  const KeyframePoints first = render();
  T_O_C_ = other;
  const KeyframePoints second = render();
  for (const auto& [one, same] : {std::pair(&both[0], &first), std::pair(&both[1], &second)}) {
    EXPECT_EQ(one->T_O_C.t, same->T_O_C.t);
    ASSERT_EQ(one->levels.size(), same->levels.size());
    for (std::size_t i = 0; i < one->levels.size(); ++i) {
      const KeyframeLevel &level = one->levels[i], &expected = same->levels[i];
      EXPECT_EQ(level.width, expected.width);
      EXPECT_EQ(level.shown.cell, expected.shown.cell);
      EXPECT_EQ(level.chosen.cell, expected.chosen.cell);
      EXPECT_EQ(level.chosen.x, expected.chosen.x);
      EXPECT_EQ(level.tiles, expected.tiles);
      EXPECT_EQ(level.outline_tiles, expected.outline_tiles);
    }
  }
  // One of them cannot be made: so none is.
  EXPECT_THROW(
      renderKeyframes(*scene_, {{kKeyframeCamera, other}, {kKeyframeCamera, Pose()}}, dense()),
      std::invalid_argument);
  EXPECT_TRUE(renderKeyframes(*scene_, {}, dense()).empty());
}

TEST_F(KeyframeOfScene, RefusesWhatMakesNoSense) {
  KeyframeSettings settings;
  settings.levels = 0;
  EXPECT_THROW(render(settings), std::invalid_argument);
  settings = {};
  settings.min_alpha = 1;
  EXPECT_THROW(render(settings), std::invalid_argument);
  T_O_C_.t = scene_->field().metadata.centre;
  EXPECT_THROW(render(), std::invalid_argument);
}

TEST_F(KeyframeOfScene, PyramidsAreTheSameWithAnyNumberOfThreads) {
  for (const bool grey : {false, true}) {
    for (const int levels : {1, 4}) {
      KeyframeSettings settings;
      settings.grey = grey;
      settings.levels = levels;
      settings.rays_per_side = 2;
      const FieldMetadata& object = scene_->field().metadata;
      const std::vector<RenderedWindow> windows = {
          renderWindow(*scene_, {kKeyframeCamera, T_O_C_}, settings),
          renderWindow(*scene_, {kKeyframeCamera, cameraAround(*scene_, 0.2, 0.1)}, settings)};
      const std::vector<KeyframePyramid> alone = pyramidsOf(windows, object, settings, 1);
      const std::vector<KeyframePyramid> shared = pyramidsOf(windows, object, settings, 3);
      ASSERT_EQ(alone.size(), 2u);
      ASSERT_EQ(shared.size(), 2u);
      for (int i = 0; i < 2; ++i) {
        ASSERT_EQ(alone[i].size(), static_cast<std::size_t>(levels));
        for (int level = 0; level < levels; ++level) {
          EXPECT_EQ(shared[i][level].values, alone[i][level].values);
          EXPECT_EQ(alone[i][level].width, alone[i][0].width >> level);
        }
      }
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
