// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// What may be changed while the node runs: dynamic_reconfigure and the strict parameters agree.
#include "ros/services/reconfiguration.h"

#include <dynamic_reconfigure/ConfigDescription.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace nerf_pose_refiner {
namespace {

/// All parameters, a line each.
std::vector<std::string> linesOf(const PoseRefinerParameters& parameters) {
  ParamReader nothing(XmlRpc::XmlRpcValue(), "~");
  readParameters(nothing, parameters);
  return nothing.log();
}

class ReconfigurationTest : public testing::Test {
 protected:
  ReconfigurationTest()
      : pnh_("/reconfigured"),
        reconfiguration_(pnh_, PoseRefinerParameters(), [this](const PoseRefinerParameters& p) {
          std::lock_guard<std::mutex> lock(mutex_);
          parameters_ = p;
        }) {}

  ~ReconfigurationTest() override { ros::param::del("/reconfigured"); }

  PoseRefinerParameters parameters() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return parameters_;
  }

  /// Sets one parameter of a group. @return its value after that.
  double set(const std::string& group, const std::string& name, double value) {
    dynamic_reconfigure::Reconfigure call;
    dynamic_reconfigure::DoubleParameter parameter;
    parameter.name = name;
    parameter.value = value;
    call.request.config.doubles.push_back(parameter);
    EXPECT_TRUE(ros::service::call(pnh_.resolveName(group + "set_parameters"), call));
    for (const auto& entry : call.response.config.doubles) {
      if (entry.name == name) return entry.value;
    }
    ADD_FAILURE() << "there is no " << group << name;
    return 0;
  }

  mutable std::mutex mutex_;  ///< guards parameters_
  PoseRefinerParameters parameters_;
  ros::NodeHandle pnh_;
  Reconfiguration reconfiguration_;
};

TEST_F(ReconfigurationTest, ChangesReachTheirPlaceAndNoOther) {
  EXPECT_EQ(set("refiner/", "rotation_deg", 20), 20);
  EXPECT_EQ(set("tracker/", "min_score", 0.125), 0.125);
  EXPECT_EQ(set("tracker/", "robust_scale", 0.125), 0.125);
  EXPECT_EQ(set("overlay/", "opacity", 0.5), 0.5);
  EXPECT_EQ(set("", "image_timeout_s", 3), 3);
  PoseRefinerParameters expected;
  expected.tracker.initial.rotation_deg = 20;
  expected.tracker.rules.min_score = 0.125;
  expected.tracker.tracking.refiner.robust_scale = 0.125;
  expected.overlay.opacity = 0.5;
  expected.tracker.rules.image_timeout_s = 3;
  EXPECT_EQ(linesOf(parameters()), linesOf(expected));
}

// The servers write under the names that are read at the start, and nothing else.
TEST_F(ReconfigurationTest, WhatTheServersWriteIsReadStrictly) {
  set("refiner/", "translation", 0.25);
  ParamReader reader = ParamReader::ofNode(pnh_);
  const PoseRefinerParameters read = readParameters(reader);
  EXPECT_TRUE(reader.unknown().empty()) << reader.unknown().front();
  PoseRefinerParameters expected;
  expected.tracker.initial.translation = 0.25;
  EXPECT_EQ(linesOf(read), linesOf(expected));
}

TEST_F(ReconfigurationTest, RangesAreThoseOfTheStrictParameters) {
  EXPECT_EQ(set("refiner/", "rotation_deg", 500), 180);
  EXPECT_EQ(set("tracker/", "min_score", -1), 0);
  EXPECT_NO_THROW(parameters().validate());
}

TEST_F(ReconfigurationTest, WhatMakesNoSenseIsTakenBack) {
  const double before = parameters().tracker.initial.rotation_deg;
  EXPECT_EQ(set("refiner/", "rotation_deg", std::numeric_limits<double>::quiet_NaN()), before);
  EXPECT_EQ(parameters().tracker.initial.rotation_deg, before);
}

TEST_F(ReconfigurationTest, ARubbishChoiceIsTakenBack) {
  dynamic_reconfigure::Reconfigure call;
  dynamic_reconfigure::StrParameter policy;
  policy.name = "initial_pose_policy";
  for (const std::string value : {"always", "rubbish"}) {
    policy.value = value;
    call.request.config.strs = {policy};
    ASSERT_TRUE(ros::service::call(pnh_.resolveName("set_parameters"), call));
    ASSERT_EQ(call.response.config.strs.size(), 1u);
    EXPECT_EQ(call.response.config.strs[0].value, "always");
    EXPECT_EQ(parameters().tracker.rules.initial_pose_policy, InitialPosePolicy::kAlways);
  }
}

// Defaults live in the structs: what rqt_reconfigure shows as a default is the same, and each
// parameter has a text, a range that holds it, and a group.
TEST_F(ReconfigurationTest, DefaultsAreThoseOfTheStructs) {
  const std::vector<std::string> defaults = linesOf(PoseRefinerParameters());
  for (const std::string group : {"", "refiner/", "tracker/", "overlay/"}) {
    const auto description = ros::topic::waitForMessage<dynamic_reconfigure::ConfigDescription>(
        pnh_.resolveName(group + "parameter_descriptions"), ros::Duration(20));
    ASSERT_TRUE(description) << group;
    for (const auto& parameter : description->dflt.doubles) {
      std::ostringstream line;
      line << "~" << group << parameter.name << ": " << parameter.value;
      EXPECT_EQ(std::count(defaults.begin(), defaults.end(), line.str()), 1) << line.str();
    }
    for (const auto& parameter : description->dflt.ints) {
      const std::string line =
          "~" + group + parameter.name + ": " + std::to_string(parameter.value);
      EXPECT_EQ(std::count(defaults.begin(), defaults.end(), line), 1) << line;
    }
    for (const auto& parameter : description->dflt.bools) {
      const std::string line =
          "~" + group + parameter.name + ": " + (parameter.value ? "true" : "false");
      EXPECT_EQ(std::count(defaults.begin(), defaults.end(), line), 1) << line;
    }
    for (const auto& shown : description->groups) {
      for (const auto& parameter : shown.parameters) {
        EXPECT_FALSE(parameter.description.empty()) << group << parameter.name;
      }
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
