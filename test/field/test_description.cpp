// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/description.h"

#include <gtest/gtest.h>

#include <cmath>

#include <nlohmann/json.hpp>

#include <stdexcept>
#include <string>

#include "support/small_field.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

Field mistakableField() {
  Field field = smallField();
  LookAlikes& known = field.metadata.look_alikes;
  known.measured = true;
  known.axis = SymmetryAxis{{0.6, 0, 0.8}, {1.0 / 3, 0, 1e-9}};
  known.motions = {{expSO3({0, 0.1, 2}), {0.25, 1.0 / 7, -1}}};
  return field;
}

TEST(Description, KeepsLookAlikes) {
  const LookAlikes before = mistakableField().metadata.look_alikes;
  const LookAlikes after = fieldFromDescription(describe(mistakableField())).metadata.look_alikes;
  EXPECT_TRUE(after.measured);
  ASSERT_TRUE(after.axis);
  EXPECT_EQ(before.axis->direction, after.axis->direction);
  EXPECT_EQ(before.axis->point, after.axis->point);
  ASSERT_EQ(after.motions.size(), 1u);
  EXPECT_EQ(before.motions[0].R, after.motions[0].R);
  EXPECT_EQ(before.motions[0].t, after.motions[0].t);
}

TEST(Description, OfBeforeThereWereLookAlikesHasNone) {
  EXPECT_FALSE(fieldFromDescription(describe(smallField())).metadata.look_alikes.measured);
}

TEST(Description, ThatNoneWereFoundIsKept) {
  Field field = smallField();
  field.metadata.look_alikes.measured = true;
  const LookAlikes after = fieldFromDescription(describe(field)).metadata.look_alikes;
  EXPECT_TRUE(after.measured);
  EXPECT_FALSE(after.any());
}

TEST(Description, ScoresOfAnotherAlignmentAreMeasuredAgain) {
  Field field = smallField();
  field.metadata.pose.keyframes.poses = 24;
  field.metadata.pose.keyframes.wrong_mean = 0.25;
  const auto posesOf = [](const Json& json) {
    return fieldFromDescription(json.dump()).metadata.pose.keyframes.poses;
  };
  Json json = Json::parse(describe(field));
  EXPECT_EQ(posesOf(json), 24);
  json["keyframe_scores"]["alignment"] = 1;
  EXPECT_EQ(posesOf(json), 0);
  json["keyframe_scores"].erase("alignment");  // as in older models
  EXPECT_EQ(posesOf(json), 0);
  json["keyframe_scores"]["alignment"] = "one";
  EXPECT_THROW(posesOf(json), std::runtime_error);
}

// Twice their variance counts.
TEST(Description, ErrorsOfOlderModelsAreMadeThoseOfKeyframes) {
  Field field = smallField();
  field.metadata.pose.depth = 0.002;
  Json json = Json::parse(describe(field));
  const auto depthOf = [](const Json& described) {
    return fieldFromDescription(described.dump()).metadata.pose.depth;
  };
  EXPECT_EQ(depthOf(json), 0.002);
  json["pose_statistics"].erase("errors_of");
  EXPECT_NEAR(depthOf(json), 0.002 * std::sqrt(2.0), 1e-9);
}

TEST(Description, TellsEqualExposuresFromThoseThatWereNotCompared) {
  Field field = smallField();
  EXPECT_FALSE(fieldFromDescription(describe(field)).metadata.exposure_spread);
  for (const double spread : {0.0, 0.125}) {
    field.metadata.exposure_spread = spread;
    EXPECT_EQ(fieldFromDescription(describe(field)).metadata.exposure_spread, spread);
  }
  Json json = Json::parse(describe(field));
  json["metadata"]["exposure_spread"] = nullptr;
  EXPECT_THROW(fieldFromDescription(json.dump()), std::runtime_error);
}

TEST(Description, RefusesLookAlikesOfAnotherForm) {
  Json json = Json::parse(describe(mistakableField()));
  json["look_alikes"]["axis"]["direction"] = {1, 0};
  EXPECT_THROW(fieldFromDescription(json.dump()), std::runtime_error);
  json["look_alikes"]["axis"] = "z";
  EXPECT_THROW(fieldFromDescription(json.dump()), std::runtime_error);
}

TEST(Description, RefusesLookAlikesThatMakeNoSense) {
  Field field = mistakableField();
  EXPECT_NO_THROW(field.validate());
  field.metadata.look_alikes.axis->direction *= 2;
  EXPECT_THROW(field.validate(), std::invalid_argument);
  field = mistakableField();
  field.metadata.look_alikes.motions[0].R(0, 0) = 3;
  EXPECT_THROW(field.validate(), std::invalid_argument);
  field = mistakableField();
  field.metadata.look_alikes.motions.resize(LookAlikes::kMaxMotions + 1);
  EXPECT_THROW(field.validate(), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
