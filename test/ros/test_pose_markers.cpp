// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/pose_markers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "field/object_frame.h"

namespace nerf_pose_refiner {
namespace {

using visualization_msgs::Marker;

/// A box of 2 x 3 x 6 units of 0.1 m: its diagonal is 0.7 m.
BoxCorners someCorners() {
  Field field;
  field.box.min = {-1, 0, 2};
  field.box.max = {1, 3, 8};
  return boxCorners(field, ObjectFrame(Pose(), 0.1));
}

PoseHypothesisArray someHypotheses() {
  PoseHypothesisArray array;
  array.header.frame_id = "camera";
  array.header.stamp = ros::Time(7);
  for (const float weight : {0.5f, 0.3f, 0.2f}) {
    PoseHypothesis hypothesis;
    hypothesis.weight = weight;
    hypothesis.pose.position.x = weight;
    hypothesis.pose.orientation.w = 1;
    array.hypotheses.push_back(hypothesis);
  }
  return array;
}

TEST(HypothesisMarkers, AreWholeAndNumbered) {
  const auto array = hypothesisMarkers(someHypotheses(), someCorners());
  ASSERT_EQ(array.markers.size(), 5u);  // delete all, three boxes, the axes of the best
  EXPECT_EQ(array.markers[0].action, Marker::DELETEALL);
  std::set<std::pair<std::string, int>> names;
  for (std::size_t i = 1; i < array.markers.size(); ++i) {
    const Marker& marker = array.markers[i];
    EXPECT_EQ(marker.action, Marker::ADD);
    EXPECT_EQ(marker.header.frame_id, "camera");
    EXPECT_EQ(marker.header.stamp, ros::Time(7));
    EXPECT_GT(marker.lifetime.toSec(), 0);
    EXPECT_EQ(marker.pose.orientation.w, 1);
    EXPECT_TRUE(names.emplace(marker.ns, marker.id).second) << marker.ns << marker.id;
  }
  EXPECT_EQ(array.markers[2].pose.position.x, someHypotheses().hypotheses[1].pose.position.x);
}

TEST(HypothesisMarkers, AreAsOpaqueAsHeavyAndTheBestStandsOut) {
  const auto array = hypothesisMarkers(someHypotheses(), someCorners());
  const Marker& best = array.markers[1];
  const Marker& second = array.markers[2];
  EXPECT_EQ(best.ns, "best");
  EXPECT_EQ(second.ns, "hypotheses");
  EXPECT_EQ(best.color.a, 1);
  EXPECT_FLOAT_EQ(second.color.a, 0.6f);
  EXPECT_FLOAT_EQ(array.markers[3].color.a, 0.4f);
  EXPECT_GT(best.scale.x, second.scale.x);
  EXPECT_NE(best.color.g, second.color.g);
}

TEST(DetectionMarkers, AreBoxesWithScoresThatStay) {
  std::vector<ObjectDetection> detections(2);
  detections[0].pose.pose.position.x = 0.5;
  detections[0].pose.pose.orientation.w = 1;
  detections[0].score = 0.98f;
  const auto array = detectionMarkers(someHypotheses().header, detections, someCorners());
  ASSERT_EQ(array.markers.size(), 5u);  // delete all, a box and a text for each
  EXPECT_EQ(array.markers[0].action, Marker::DELETEALL);
  const Marker &box = array.markers[1], &text = array.markers[2];
  EXPECT_EQ(box.points.size(), 24u);
  EXPECT_EQ(box.lifetime, ros::Duration());
  EXPECT_EQ(box.header.stamp, ros::Time(7));
  EXPECT_EQ(box.pose.position.x, 0.5);
  EXPECT_EQ(text.type, Marker::TEXT_VIEW_FACING);
  EXPECT_EQ(text.text, "1: 0.98");
  EXPECT_EQ(text.pose.position.x, 0.5);
  EXPECT_EQ(array.markers[4].text, "2: 0.00");
  EXPECT_NE(array.markers[3].id, box.id);
  EXPECT_EQ(detectionMarkers(someHypotheses().header, {}, someCorners()).markers.size(), 1u);
}

TEST(HypothesisMarkers, ABoxHasTwelveEdges) {
  const auto array = hypothesisMarkers(someHypotheses(), someCorners());
  const Marker& box = array.markers[2];
  EXPECT_EQ(box.type, Marker::LINE_LIST);
  ASSERT_EQ(box.points.size(), 24u);
  double sum = 0;
  for (std::size_t i = 0; i < 24; i += 2) {
    const auto& a = box.points[i];
    const auto& b = box.points[i + 1];
    sum += std::abs(a.x - b.x) + std::abs(a.y - b.y) + std::abs(a.z - b.z);
  }
  EXPECT_NEAR(sum, 4 * (0.2 + 0.3 + 0.6), 1e-12);
}

TEST(HypothesisMarkers, NoHypothesisLeavesNothing) {
  PoseHypothesisArray none = someHypotheses();
  none.hypotheses.clear();
  const auto array = hypothesisMarkers(none, someCorners());
  ASSERT_EQ(array.markers.size(), 1u);
  EXPECT_EQ(array.markers[0].action, Marker::DELETEALL);
}

}  // namespace
}  // namespace nerf_pose_refiner
