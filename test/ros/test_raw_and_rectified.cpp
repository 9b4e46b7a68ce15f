// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The same view through a lens that bends it and rectified, as image_proc publishes both with one
// camera_info: the poses that are found must be one.
#include <gtest/gtest.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <boost/make_shared.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "image/colour.h"
#include "nerf_pose_refiner/pose.h"
#include "refinement/field_refiner.h"
#include "ros/conversions/camera_input.h"
#include "support/analytic_scene.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kWidth = 320, kHeight = 240;

struct Lens {
  std::string model;
  std::vector<double> D;
};

/// K is of the raw image; P, of the rectified one, is what a calibration might have chosen.
sensor_msgs::CameraInfo infoOf(const Lens& lens) {
  sensor_msgs::CameraInfo info;
  info.width = kWidth;
  info.height = kHeight;
  info.distortion_model = lens.model;
  info.D = lens.D;
  info.K = {400, 0, 163, 0, 402, 117, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {390, 0, 158, 0, 0, 392, 121, 0, 0, 0, 1, 0};
  return info;
}

sensor_msgs::Image messageOf(const cv::Mat& rgb) {
  sensor_msgs::Image image;
  image.header.frame_id = "camera";
  image.header.stamp = ros::Time(1);
  image.width = static_cast<std::uint32_t>(rgb.cols);
  image.height = static_cast<std::uint32_t>(rgb.rows);
  image.encoding = "rgb8";
  image.step = 3 * image.width;
  image.data.assign(rgb.datastart, rgb.dataend);
  return image;
}

/// The scene at twice the resolution and beyond the rim of the others, without a lens.
struct WideView {
  WideView() : truth(cameraAround(*scene, 0.7, 0.5)) {
    const Observation view = observeScene(*scene, camera, truth);
    const Image8 bytes = toBytes(composite({view.image, view.alpha}, {0.4f, 0.45f, 0.5f}));
    rgb =
        cv::Mat(bytes.height, bytes.width, CV_8UC3, const_cast<std::uint8_t*>(bytes.values.data()))
            .clone();
  }

  /// What another camera sees of it: pixels (u, v) of that look along `rays` [h * w], z = 1.
  cv::Mat seenAlong(const std::vector<cv::Point2d>& rays) const {
    cv::Mat map(kHeight, kWidth, CV_32FC2), seen;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      const cv::Point2d& ray = rays[static_cast<std::size_t>(i)];
      map.at<cv::Vec2f>(i / kWidth, i % kWidth) = {
          static_cast<float>(camera.fx * ray.x + camera.cx),
          static_cast<float>(camera.fy * ray.y + camera.cy)};
    }
    cv::remap(rgb, seen, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    return seen;
  }

  std::shared_ptr<Backend> backend = makeCpuBackend();
  std::shared_ptr<const LoadedField> scene = makeAnalyticScene();
  Camera camera = {800, 600, 800, 800, 399.5, 299.5};
  Pose truth;
  cv::Mat rgb;
};

std::vector<cv::Point2d> pixels() {
  std::vector<cv::Point2d> all;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) all.emplace_back(x, y);
  }
  return all;
}

cv::Mat rawImage(const WideView& view, const sensor_msgs::CameraInfo& info) {
  const cv::Matx33d K(info.K.data());
  std::vector<cv::Point2d> rays;
  cv::undistortPoints(pixels(), rays, K, info.D, cv::noArray(), cv::noArray(),
                      {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-12});
  return view.seenAlong(rays);
}

cv::Mat rectifiedImage(const WideView& view, const sensor_msgs::CameraInfo& info) {
  std::vector<cv::Point2d> rays = pixels();
  for (cv::Point2d& p : rays) {
    p = {(p.x - info.P[2]) / info.P[0], (p.y - info.P[6]) / info.P[5]};
  }
  return view.seenAlong(rays);
}

Pose refined(const WideView& view, bool rectified, const cv::Mat& rgb,
             const sensor_msgs::CameraInfo& info) {
  CameraInput input(rectified);
  const Observation observation =
      input.observe(boost::make_shared<const sensor_msgs::Image>(messageOf(rgb)), info);
  Prior prior;
  const Eigen::Vector3d centre = view.scene->field().metadata.centre;
  const Eigen::Matrix3d turn = expSO3({0.03, -0.04, 0.02});
  prior.T_O_C = {turn * view.truth.R, centre + turn * (view.truth.t - centre)};
  prior.rotation_rad = 0.1;
  prior.translation = 0.05;
  RefinerSettings settings = RefinerSettings::named("track");
  settings.stages.back().rays_per_side = 2;
  FieldRefiner refiner(view.backend, settings);
  const Refinement result = refiner.refine(*view.scene, observation, prior);
  EXPECT_EQ(result.outcome, Outcome::kRefined);
  return result.T_O_C.inverse();
}

class RawAndRectified : public testing::TestWithParam<Lens> {};

TEST_P(RawAndRectified, GiveOnePose) {
  const WideView view;
  const sensor_msgs::CameraInfo info = infoOf(GetParam());
  const Pose raw = refined(view, false, rawImage(view, info), info);
  const Pose rectified = refined(view, true, rectifiedImage(view, info), info);
  const Pose truth = view.truth.inverse();
  const double distance = truth.t.norm();
  EXPECT_LT(rotationDistance(raw.R, rectified.R) * 180 / M_PI, 0.1);
  EXPECT_LT((raw.t - rectified.t).norm(), 0.002 * distance);
  EXPECT_LT(rotationDistance(raw.R, truth.R) * 180 / M_PI, 0.3) << "and it is the right one";
  EXPECT_LT((raw.t - truth.t).norm(), 0.005 * distance);
}

INSTANTIATE_TEST_SUITE_P(Lenses, RawAndRectified,
                         testing::Values(Lens{"plumb_bob", {-0.3, 0.1, 0.001, -0.002, 0}},
                                         Lens{"rational_polynomial",
                                              {-0.2, 0.05, 0.001, 0.001, 0.01, 0.1, 0.02, 0}}),
                         [](const auto& lens) { return lens.param.model; });

}  // namespace
}  // namespace nerf_pose_refiner
