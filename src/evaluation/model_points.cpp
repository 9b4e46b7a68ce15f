// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/model_points.h"

#include <cmath>
#include <limits>
#include <opencv2/flann.hpp>
#include <stdexcept>

namespace nerf_pose_refiner {

/// A k-d tree with exact answers; what its matrix holds must outlive it.
struct ModelPoints::Tree {
  using Index = cv::flann::GenericIndex<cv::flann::L2<double>>;

  cv::Mat coordinates;  // [n][3]
  Index index;

  explicit Tree(const std::vector<Eigen::Vector3d>& points)
      : coordinates(matrixOf(points)), index(coordinates, cvflann::KDTreeSingleIndexParams()) {}

  static cv::Mat matrixOf(const std::vector<Eigen::Vector3d>& points) {
    cv::Mat matrix(static_cast<int>(points.size()), 3, CV_64F);
    for (int i = 0; i < matrix.rows; ++i) {
      Eigen::Map<Eigen::Vector3d>(matrix.ptr<double>(i)) = points[i];
    }
    return matrix;
  }

  double meanDistance(const std::vector<Eigen::Vector3d>& queries) {
    cv::Mat nearest(static_cast<int>(queries.size()), 1, CV_32S);
    cv::Mat squares(static_cast<int>(queries.size()), 1, CV_64F);
    index.knnSearch(matrixOf(queries), nearest, squares, 1, cvflann::SearchParams());
    double sum = 0;
    for (int i = 0; i < squares.rows; ++i) sum += std::sqrt(squares.at<double>(i));
    return sum / squares.rows;
  }
};

ModelPoints::ModelPoints(std::vector<Eigen::Vector3d> points_O) : points_O_(std::move(points_O)) {
  if (points_O_.empty()) throw std::invalid_argument("ModelPoints: there are no points");
  for (const Eigen::Vector3d& point : points_O_) {
    if (!point.allFinite()) throw std::invalid_argument("ModelPoints: a point is not finite");
  }
  tree_ = std::make_unique<Tree>(points_O_);
}

ModelPoints::~ModelPoints() = default;
ModelPoints::ModelPoints(ModelPoints&&) noexcept = default;
ModelPoints& ModelPoints::operator=(ModelPoints&&) noexcept = default;

double ModelPoints::add(const Pose& T_O_C, const Pose& true_T_O_C) const {
  const Pose T_C_O = T_O_C.inverse(), true_T_C_O = true_T_O_C.inverse();
  double sum = 0;
  for (const Eigen::Vector3d& point : points_O_) sum += (T_C_O * point - true_T_C_O * point).norm();
  return sum / static_cast<double>(points_O_.size());
}

double ModelPoints::addS(const Pose& T_O_C, const Pose& true_T_O_C) const {
  // A rigid transform keeps distances: all is taken into the frame O of the pose to be judged.
  const Pose from_truth = T_O_C * true_T_O_C.inverse();
  std::vector<Eigen::Vector3d> queries;
  queries.reserve(points_O_.size());
  for (const Eigen::Vector3d& point : points_O_) queries.push_back(from_truth * point);
  return tree_->meanDistance(queries);
}

double ModelPoints::reprojection(const Pose& T_O_C, const Pose& true_T_O_C,
                                 const Camera& camera) const {
  const Pose T_C_O = T_O_C.inverse(), true_T_C_O = true_T_O_C.inverse();
  double sum = 0;
  for (const Eigen::Vector3d& point : points_O_) {
    const Eigen::Vector3d seen = T_C_O * point, truly = true_T_C_O * point;
    if (!(seen.z() > 0 && truly.z() > 0)) return std::numeric_limits<double>::infinity();
    sum += (camera.project(seen) - camera.project(truly)).norm();
  }
  return sum / static_cast<double>(points_O_.size());
}

}  // namespace nerf_pose_refiner
