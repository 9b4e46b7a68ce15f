// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/param_reader.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

using XmlRpc::XmlRpcValue;

XmlRpcValue sample() {
  XmlRpcValue values;
  values["publish_tf"] = false;
  values["threads"] = 3;
  values["timeout"] = 0.25;
  values["whole"] = 2;
  values["object"] = "mug";
  values["tracker"]["min_score"] = 0.75;
  values["stages"][0]["blur"] = 1.5;
  values["stages"][1]["blur"] = 0.5;
  return values;
}

template <typename Function>
std::string messageOf(const Function& function) {
  try {
    function();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing was thrown";
}

TEST(ParamReader, ReadsEachType) {
  ParamReader read(sample(), "~");
  bool publish_tf = true;
  int threads = 0;
  double timeout = 0, whole = 0;
  std::string object;
  std::uint64_t seed = 0;
  read.get("publish_tf", publish_tf);
  read.get("threads", threads);
  read.get("threads", seed);
  read.get("timeout", timeout);
  read.get("whole", whole);
  read.get("object", object);
  EXPECT_FALSE(publish_tf);
  EXPECT_EQ(threads, 3);
  EXPECT_EQ(seed, 3u);
  EXPECT_EQ(timeout, 0.25);
  EXPECT_EQ(whole, 2.0);
  EXPECT_EQ(object, "mug");
}

TEST(ParamReader, KeepsDefaultsOfWhatIsAbsent) {
  ParamReader read(XmlRpcValue(), "~");
  int threads = 5;
  read.get("threads", threads);
  EXPECT_EQ(threads, 5);
  double score = 0.5;
  read.group("tracker").get("min_score", score);
  EXPECT_EQ(score, 0.5);
  EXPECT_FALSE(read.list("stages"));
  EXPECT_TRUE(read.unknown().empty());
  EXPECT_EQ(read.log(), (std::vector<std::string>{"~threads: 5", "~tracker/min_score: 0.5"}));
}

TEST(ParamReader, RefusesWrongTypes) {
  ParamReader read(sample(), "~");
  bool flag = true;
  int number = 1;
  double real = 1;
  std::string text = "unchanged";
  EXPECT_EQ(messageOf([&] { read.get("threads", flag); }),
            "parameter ~threads must be a boolean, not a whole number");
  EXPECT_EQ(messageOf([&] { read.get("timeout", number); }),
            "parameter ~timeout must be a whole number, not a number");
  EXPECT_EQ(messageOf([&] { read.get("object", real); }),
            "parameter ~object must be a number, not a string");
  EXPECT_EQ(messageOf([&] { read.get("tracker", text); }),
            "parameter ~tracker must be a string, not a group");
  EXPECT_EQ(messageOf([&] { read.group("stages"); }),
            "parameter ~stages must be a group, not a list");
  EXPECT_EQ(messageOf([&] { read.list("tracker"); }),
            "parameter ~tracker must be a list, not a group");
  EXPECT_TRUE(flag);
  EXPECT_EQ(number, 1);
  EXPECT_EQ(real, 1.0);
  EXPECT_EQ(text, "unchanged");
}

TEST(ParamReader, RefusesNegativeSeeds) {
  XmlRpcValue values;
  values["seed"] = -1;
  ParamReader read(values, "~");
  std::uint64_t seed = 1;
  EXPECT_EQ(messageOf([&] { read.get("seed", seed); }), "parameter ~seed must be >= 0");
}

TEST(ParamReader, NamesUnknownKeysAndTheNearestKnownOne) {
  XmlRpcValue values;
  values["rotation_dge"] = 1.0;
  ParamReader read(values, "~tracker");
  double rotation = 5, translation = 0.05;
  read.get("translation", translation);
  read.get("rotation_deg", rotation);
  EXPECT_EQ(rotation, 5);
  EXPECT_EQ(messageOf([&] { read.rejectUnknown(); }),
            "unknown parameter ~tracker/rotation_dge: did you mean ~tracker/rotation_deg?");
}

TEST(ParamReader, ReadsListsOfGroups) {
  ParamReader read(sample(), "~refiner");
  std::vector<ParamReader> stages = read.list("stages").value();
  ASSERT_EQ(stages.size(), 2u);
  double blur = 0;
  stages[1].get("blur", blur);
  EXPECT_EQ(blur, 0.5);
  EXPECT_EQ(read.log().back(), "~refiner/stages[1]/blur: 0.5");
  EXPECT_EQ(messageOf([&] { stages[0].rejectUnknown(); }),
            "unknown parameter ~refiner/stages[0]/blur");
}

}  // namespace
}  // namespace nerf_pose_refiner
