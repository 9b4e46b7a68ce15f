// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/pose_markers.h"

#include <algorithm>
#include <cstdio>

#include "ros/conversions/pose_conversions.h"

namespace nerf_pose_refiner {
namespace {

using visualization_msgs::Marker;

constexpr double kLifetime_s = 5;        // longer than a refinement from an initial pose may take
constexpr double kLineWidth = 0.006;     // in diagonals of the box
constexpr double kBestLineWidth = 0.02;  // the same

std_msgs::ColorRGBA colour(float r, float g, float b, float a) {
  std_msgs::ColorRGBA rgba;
  rgba.r = r;
  rgba.g = g;
  rgba.b = b;
  rgba.a = a;
  return rgba;
}

double diagonalOf(const BoxCorners& corners) { return (corners[7] - corners[0]).norm(); }

Marker lines(const std_msgs::Header& header, const char* ns, int id,
             const geometry_msgs::Pose& pose, double width) {
  Marker marker;
  marker.header = header;
  marker.ns = ns;
  marker.id = id;
  marker.type = Marker::LINE_LIST;
  marker.action = Marker::ADD;
  marker.pose = pose;
  marker.scale.x = width;
  marker.lifetime = ros::Duration(kLifetime_s);
  return marker;
}

/// The twelve edges: from each corner along each axis on whose lower end it is.
void addEdges(const BoxCorners& corners, Marker* marker) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    for (const std::size_t axis : {1u, 2u, 4u}) {
      if (i & axis) continue;
      marker->points.push_back(toPoint(corners[i]));
      marker->points.push_back(toPoint(corners[i | axis]));
    }
  }
}

Marker axesOf(const std_msgs::Header& header, const geometry_msgs::Pose& pose,
              const BoxCorners& corners) {
  const double diagonal = diagonalOf(corners);
  Marker marker = lines(header, "best", 1, pose, kBestLineWidth * diagonal);
  for (int axis = 0; axis < 3; ++axis) {
    marker.points.push_back(toPoint(Eigen::Vector3d::Zero()));
    marker.points.push_back(toPoint(0.5 * diagonal * Eigen::Vector3d::Unit(axis)));
    const std_msgs::ColorRGBA rgb = colour(axis == 0, axis == 1, axis == 2, 1);
    marker.colors.insert(marker.colors.end(), 2, rgb);
  }
  marker.color = colour(1, 1, 1, 1);
  return marker;
}

/// An array that deletes the markers of earlier ones.
visualization_msgs::MarkerArray newArray(const std_msgs::Header& header) {
  visualization_msgs::MarkerArray array;
  array.markers.emplace_back();
  array.markers.back().header = header;
  array.markers.back().action = Marker::DELETEALL;
  return array;
}

/// A text in a box, which faces the viewer. @param number from 1.
Marker scoreOf(const std_msgs::Header& header, int number, const ObjectDetection& detection,
               double diagonal) {
  constexpr double kTextHeight = 0.15;  // in diagonals of the box
  char text[40];
  std::snprintf(text, sizeof text, "%d: %.2f", number, static_cast<double>(detection.score));
  Marker marker;
  marker.header = header;
  marker.ns = "scores";
  marker.id = number;
  marker.type = Marker::TEXT_VIEW_FACING;
  marker.pose.position = detection.pose.pose.position;
  marker.pose.orientation.w = 1;
  marker.scale.z = kTextHeight * diagonal;
  marker.color = colour(1, 1, 1, 1);
  marker.text = text;
  return marker;
}

}  // namespace

visualization_msgs::MarkerArray hypothesisMarkers(const PoseHypothesisArray& hypotheses,
                                                  const BoxCorners& corners) {
  visualization_msgs::MarkerArray array = newArray(hypotheses.header);
  if (hypotheses.hypotheses.empty()) return array;

  const std_msgs::Header& header = hypotheses.header;
  const auto& all = hypotheses.hypotheses;
  const auto heaviest = std::max_element(
      all.begin(), all.end(), [](const auto& a, const auto& b) { return a.weight < b.weight; });
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool best = i == 0;
    Marker box = lines(header, best ? "best" : "hypotheses", static_cast<int>(i), all[i].pose,
                       (best ? kBestLineWidth : kLineWidth) * diagonalOf(corners));
    addEdges(corners, &box);
    const float alpha = heaviest->weight > 0 ? all[i].weight / heaviest->weight : 1.0f;
    box.color = best ? colour(0.1f, 1, 0.1f, 1) : colour(1, 0.6f, 0, alpha);
    array.markers.push_back(box);
  }
  array.markers.push_back(axesOf(header, all[0].pose, corners));
  return array;
}

visualization_msgs::MarkerArray detectionMarkers(const std_msgs::Header& header,
                                                 const std::vector<ObjectDetection>& detections,
                                                 const BoxCorners& corners) {
  visualization_msgs::MarkerArray array = newArray(header);
  int number = 0;
  for (const ObjectDetection& detection : detections) {
    ++number;
    Marker box = lines(header, "detections", number, detection.pose.pose,
                       kBestLineWidth * diagonalOf(corners));
    box.lifetime = ros::Duration();
    addEdges(corners, &box);
    box.color = number == 1 ? colour(0.1f, 1, 0.1f, 1) : colour(0.1f, 0.6f, 1, 1);
    array.markers.push_back(box);
    array.markers.push_back(scoreOf(header, number, detection, diagonalOf(corners)));
  }
  return array;
}

}  // namespace nerf_pose_refiner
