// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/point_pose.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kSeed = 1;
constexpr int kMin = 4;  // three points have up to four poses

/// Points and pixels as OpenCV takes them.
struct Correspondences {
  Correspondences(const std::vector<PointMatch>& matches, const int* numbers, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const PointMatch& match = matches[static_cast<std::size_t>(numbers[i])];
      points.emplace_back(match.point.x(), match.point.y(), match.point.z());
      pixels.emplace_back(match.pixel.x(), match.pixel.y());
    }
  }

  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
};

cv::Matx33d matrixOf(const Camera& camera) {
  return {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
}

Pose poseOf(const cv::Mat& rotation, const cv::Mat& translation) {
  const cv::Mat_<double> r(rotation), t(translation);
  return {expSO3({r(0), r(1), r(2)}), {t(0), t(1), t(2)}};
}

std::vector<Pose> posesOfThree(const Correspondences& three, const Camera& camera) {
  std::vector<cv::Mat> rotations, translations;
  cv::solveP3P(three.points, three.pixels, matrixOf(camera), cv::noArray(), rotations, translations,
               cv::SOLVEPNP_AP3P);
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    const Pose pose = poseOf(rotations[i], translations[i]);
    if (pose.isFinite()) poses.push_back(pose);
  }
  return poses;
}

// Three different ones of `count`.
std::array<int, 3> drawThree(std::uint32_t count, std::uint64_t trial) {
  const auto draw = [&](std::uint64_t k, std::uint32_t of) {
    return static_cast<int>(randomIndex(kSeed, k, trial, of));
  };
  std::array<int, 3> three = {draw(0, count), draw(1, count - 1), draw(2, count - 2)};
  if (three[1] >= three[0]) ++three[1];
  for (const int taken : {std::min(three[0], three[1]), std::max(three[0], three[1])}) {
    if (three[2] >= taken) ++three[2];
  }
  return three;
}

// So many draws find three inliers, almost certainly.
int trialsFor(double inlier_fraction) {
  constexpr double kMiss = 1e-3;
  constexpr int kMax = 500;
  const double hit = std::pow(inlier_fraction, 3);
  if (hit >= 1 - kMiss) return 1;
  return static_cast<int>(std::min<double>(kMax, std::ceil(std::log(kMiss) / std::log1p(-hit))));
}

}  // namespace

std::vector<int> inliersOf(const Pose& T_C_O, const std::vector<PointMatch>& matches,
                           const Camera& camera, double threshold_px) {
  std::vector<int> inliers;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector3d point_C = T_C_O * matches[i].point;
    if (!(point_C.z() > 0)) continue;
    if ((camera.project(point_C) - matches[i].pixel).norm() <= threshold_px) {
      inliers.push_back(static_cast<int>(i));
    }
  }
  return inliers;
}

std::optional<PointPose> poseOfMost(const std::vector<PointMatch>& matches, const Camera& camera,
                                    double threshold_px) {
  if (matches.size() < kMin) return std::nullopt;
  PointPose best;
  int trials = trialsFor(0);
  for (int trial = 0; trial < trials; ++trial) {
    const std::array<int, 3> three =
        drawThree(static_cast<std::uint32_t>(matches.size()), static_cast<std::uint64_t>(trial));
    for (const Pose& pose : posesOfThree({matches, three.data(), three.size()}, camera)) {
      std::vector<int> inliers = inliersOf(pose, matches, camera, threshold_px);
      if (inliers.size() <= best.inliers.size()) continue;
      best = {pose, std::move(inliers)};
      trials = trialsFor(static_cast<double>(best.inliers.size()) / matches.size());
    }
  }
  if (best.inliers.size() < kMin) return std::nullopt;
  return best;
}

std::optional<PointPose> refinedPose(const Pose& T_C_O, const std::vector<PointMatch>& matches,
                                     const Camera& camera, double threshold_px) {
  constexpr int kRounds = 3;
  Pose pose = T_C_O;
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<int> inliers = inliersOf(pose, matches, camera, threshold_px);
    if (inliers.size() < kMin) return std::nullopt;
    const Correspondences all(matches, inliers.data(), inliers.size());
    const Eigen::Vector3d w = logSO3(pose.R);
    cv::Mat rotation = (cv::Mat_<double>(3, 1) << w.x(), w.y(), w.z());
    cv::Mat translation = (cv::Mat_<double>(3, 1) << pose.t.x(), pose.t.y(), pose.t.z());
    cv::solvePnPRefineLM(all.points, all.pixels, matrixOf(camera), cv::noArray(), rotation,
                         translation);
    const Pose next = poseOf(rotation, translation);
    if (!next.isFinite()) return std::nullopt;
    pose = next;
  }
  PointPose refined = {pose, inliersOf(pose, matches, camera, threshold_px)};
  if (refined.inliers.size() < kMin) return std::nullopt;
  return refined;
}

std::optional<Pose> otherPoseOfPlane(const PointPose& pose,
                                     const std::vector<PointMatch>& matches) {
  constexpr double kFlat = 0.15;  // of the thickness to the lesser width
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const int i : pose.inliers) middle += matches[static_cast<std::size_t>(i)].point;
  middle /= static_cast<double>(pose.inliers.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const int i : pose.inliers) {
    const Eigen::Vector3d away = matches[static_cast<std::size_t>(i)].point - middle;
    spread += away * away.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  if (axes.eigenvalues()[0] > kFlat * kFlat * axes.eigenvalues()[1]) return std::nullopt;
  // The plane is mirrored at the plane across the line of sight through its middle; to mirror it at
  // itself changes nothing, and makes a rotation of the whole.
  const auto mirror = [](const Eigen::Vector3d& normal) -> Eigen::Matrix3d {
    return Eigen::Matrix3d::Identity() - 2 * normal * normal.transpose();
  };
  const Eigen::Vector3d middle_C = pose.T_C_O * middle;
  Pose other;
  other.R = nearestRotation(mirror(middle_C.normalized()) * pose.T_C_O.R *
                            mirror(axes.eigenvectors().col(0)));
  other.t = middle_C - other.R * middle;
  return other;
}

}  // namespace nerf_pose_refiner
