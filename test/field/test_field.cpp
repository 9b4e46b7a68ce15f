// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/field.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <stdexcept>

#include "support/small_field.h"

namespace nerf_pose_refiner {
namespace {

struct ExpectedLevel {
  int resolution;
  std::uint32_t entries;
  std::uint32_t offset;
  bool hashed;
};

void expectLevels(const FieldConfig& config, const std::vector<ExpectedLevel>& expected) {
  const std::vector<GridLevel> levels = gridLevels(config);
  ASSERT_EQ(levels.size(), expected.size());
  for (std::size_t l = 0; l < levels.size(); ++l) {
    EXPECT_EQ(levels[l].resolution, expected[l].resolution) << "level " << l;
    EXPECT_EQ(levels[l].entries, expected[l].entries) << "level " << l;
    EXPECT_EQ(levels[l].offset, expected[l].offset) << "level " << l;
    EXPECT_EQ(levels[l].hashed, expected[l].hashed) << "level " << l;
  }
}

TEST(FieldConfig, LevelsOfTheCpuProfile) {
  // growth 32^(1/7) = 1.64067; 17^3 = 4913, 27^3 = 19683, 44^3 = 85184, 72^3 > 2^17 = 131072
  expectLevels(FieldConfig::named("cpu"), {{16, 4920, 0, false},
                                           {26, 19688, 4920, false},
                                           {43, 85184, 24608, false},
                                           {71, 131072, 109792, true},
                                           {116, 131072, 240864, true},
                                           {190, 131072, 371936, true},
                                           {312, 131072, 503008, true},
                                           {512, 131072, 634080, true}});
}

TEST(FieldConfig, LevelsOfThePaperProfile) {
  // growth 128^(1/15) = 1.3819; 59^3 = 205379 fits 2^19 = 524288, 82^3 does not
  expectLevels(FieldConfig::named("paper"), {{16, 4920, 0, false},
                                             {22, 12168, 4920, false},
                                             {31, 32768, 17088, false},
                                             {42, 79512, 49856, false},
                                             {58, 205384, 129368, false},
                                             {81, 524288, 334752, true},
                                             {111, 524288, 859040, true},
                                             {154, 524288, 1383328, true},
                                             {213, 524288, 1907616, true},
                                             {294, 524288, 2431904, true},
                                             {406, 524288, 2956192, true},
                                             {562, 524288, 3480480, true},
                                             {776, 524288, 4004768, true},
                                             {1072, 524288, 4529056, true},
                                             {1482, 524288, 5053344, true},
                                             {2048, 524288, 5577632, true}});
}

TEST(FieldConfig, ALevelThatFillsItsTableExactlyIsDense) {
  FieldConfig config;
  config.levels = 1;
  config.log2_table_size = 9;
  config.base_resolution = 7;  // 8^3 = 2^9 vertices
  expectLevels(config, {{7, 512, 0, false}});
  config.base_resolution = 8;
  expectLevels(config, {{8, 512, 0, true}});
}

TEST(FieldConfig, WeightCountsByHand) {
  // cpu: 32 x 32 + 32 x 16; (16 + 15) x 32 + 32 x 3
  EXPECT_EQ(densityWeightCount(FieldConfig::named("cpu")), 1536u);
  EXPECT_EQ(colourWeightCount(FieldConfig::named("cpu")), 1088u);
  // paper: 32 x 64 + 64 x 16; 31 x 64 + 64 x 64 + 64 x 3
  EXPECT_EQ(densityWeightCount(FieldConfig::named("paper")), 3072u);
  EXPECT_EQ(colourWeightCount(FieldConfig::named("paper")), 6272u);
}

TEST(FieldConfig, EveryProfileIsValidAndKnowsItsName) {
  for (const std::string& name : FieldConfig::profileNames()) {
    EXPECT_NO_THROW(FieldConfig::named(name).validate());
    EXPECT_EQ(FieldConfig::named(name).profile, name);
  }
}

TEST(FieldConfig, UnknownProfileListsTheKnownOnes) {
  try {
    FieldConfig::named("Paper");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "no field profile is called 'Paper'; there are cpu, gpu, paper");
  }
}

void expectRefused(const std::function<void(FieldConfig*)>& change, const std::string& name) {
  FieldConfig config;
  change(&config);
  try {
    config.validate();
    FAIL() << name;
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("FieldConfig::" + name + " is "), std::string::npos)
        << error.what();
  }
}

TEST(FieldConfig, RefusesWhatIsOutOfRange) {
  expectRefused([](FieldConfig* c) { c->levels = 0; }, "levels");
  expectRefused([](FieldConfig* c) { c->features = 3; }, "features");
  expectRefused([](FieldConfig* c) { c->log2_table_size = 25; }, "log2_table_size");
  expectRefused([](FieldConfig* c) { c->base_resolution = 0; }, "base_resolution");
  expectRefused([](FieldConfig* c) { c->finest_resolution = 15; }, "finest_resolution");
  expectRefused([](FieldConfig* c) { c->density_width = 0; }, "density_width");
  expectRefused([](FieldConfig* c) { c->density_hidden_layers = 0; }, "density_hidden_layers");
  expectRefused([](FieldConfig* c) { c->geometry_features = -1; }, "geometry_features");
  expectRefused([](FieldConfig* c) { c->colour_width = 257; }, "colour_width");
  expectRefused([](FieldConfig* c) { c->colour_hidden_layers = 9; }, "colour_hidden_layers");
  expectRefused([](FieldConfig* c) { c->sh_degree = 5; }, "sh_degree");
  expectRefused([](FieldConfig* c) { c->step = 0; }, "step");
  expectRefused([](FieldConfig* c) { c->step = 9e-4f; }, "step");  // a ray would hardly end
  expectRefused([](FieldConfig* c) { c->step = std::numeric_limits<float>::quiet_NaN(); }, "step");
  expectRefused([](FieldConfig* c) { c->cone_angle = -0.1f; }, "cone_angle");
  expectRefused([](FieldConfig* c) { c->occupancy_resolution = 100; }, "occupancy_resolution");
}

TEST(Box, RaysThatMeetIt) {
  const Box box{{-1, -2, -3}, {1, 2, 3}};
  EXPECT_TRUE(box.meets({0, 0, -10}, {0, 0, 1}));
  EXPECT_FALSE(box.meets({0, 0, -10}, {0, 0, -1}));  // it lies behind
  EXPECT_TRUE(box.meets({0, 0, 0}, {0, 0, -5}));     // from inside
  EXPECT_FALSE(box.meets({1.5, 0, -10}, {0, 0, 1}));
  EXPECT_FALSE(box.meets({1.5, 0, -10}, {0.1, 0, 1}));
  EXPECT_TRUE(box.meets({1.5, 0, -10}, {-0.1, 0, 1}));  // x is 0.8 to 0.2 between the z faces
  EXPECT_FALSE(box.meets({-3, -2.5, 0}, {1, 0.1, 0}));  // leaves x before it enters y
  EXPECT_TRUE(box.meets({-3, -2.5, 0}, {1, 0.3, 0}));   // enters y after 1.7, leaves x after 4
}

TEST(OccupancyGrid, BitsAreInXFastestOrder) {
  OccupancyGrid grid;
  EXPECT_TRUE(grid.occupied(5, 6, 7));
  grid.resolution = 8;
  grid.bits.assign(64, 0);
  grid.bits[8 + 3] = 1 << 2;  // z = 1, y = 3, x = 2
  EXPECT_TRUE(grid.occupied(2, 3, 1));
  EXPECT_FALSE(grid.occupied(3, 3, 1));
  EXPECT_FALSE(grid.occupied(2, 1, 3));
}

TEST(Field, CubeSurroundsTheBox) {
  Field field;
  field.box.min = {-1, 0, 2};
  field.box.max = {1, 1, 5};
  EXPECT_TRUE(field.cubeCentre().isApprox(Eigen::Vector3d(0, 0.5, 3.5)));
  EXPECT_EQ(field.cubeSide(), 3);
}

void expectRefused(const std::function<void(Field*)>& change, const std::string& text) {
  Field field = smallField();
  change(&field);
  try {
    field.validate();
    FAIL() << text;
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
  }
}

TEST(Field, RefusesWhatDoesNotFit) {
  EXPECT_NO_THROW(smallField().validate());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  expectRefused([](Field* f) { f->grid.pop_back(); }, "Field::grid holds");
  expectRefused([](Field* f) { f->grid[5] = 0x7c00; }, "Field::grid holds a value that is not");
  expectRefused([](Field* f) { f->grid[5] = 0xfe00; }, "Field::grid holds a value that is not");
  expectRefused([](Field* f) { f->density_weights.push_back(0); }, "Field::density_weights holds");
  expectRefused([=](Field* f) { f->density_weights[0] = nan; }, "Field::density_weights holds a");
  expectRefused([](Field* f) { f->colour_weights.clear(); }, "Field::colour_weights holds 0");
  expectRefused([=](Field* f) { f->colour_weights[1] = nan; }, "Field::colour_weights holds a");
  expectRefused([](Field* f) { f->occupancy.resolution = 16; }, "OccupancyGrid::resolution is 16");
  expectRefused([](Field* f) { f->occupancy.bits.pop_back(); }, "Field::occupancy holds 63");
  expectRefused([](Field* f) { f->box.max.y() = f->box.min.y(); }, "Field::box is empty");
  expectRefused([=](Field* f) { f->box.min.x() = nan; }, "Field::box is empty");
  expectRefused([](Field* f) { f->metadata.metres_per_unit = -1; }, "metres_per_unit");
  expectRefused([=](Field* f) { f->metadata.diameter = nan; }, "diameter");
  expectRefused([=](Field* f) { f->metadata.centre.z() = nan; }, "centre");
  expectRefused([=](Field* f) { f->metadata.psnr_db = 1 / 0.0; }, "psnr_db");
  expectRefused([=](Field* f) { f->metadata.score.views = -1; }, "views");
  expectRefused([=](Field* f) { f->metadata.score.mean_loss = nan; }, "score");
}

TEST(Field, NoOccupancyGridMeansEverythingIsOccupied) {
  Field field = smallField();
  field.occupancy = OccupancyGrid();
  EXPECT_NO_THROW(field.validate());
}

}  // namespace
}  // namespace nerf_pose_refiner
