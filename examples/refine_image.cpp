// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Finds an object in one image, near a rough pose, and writes the image with the object drawn in.
//
//   refine_image kiosk.safetensors photo.png overlay.png FX FY CX CY  X Y Z QX QY QZ QW
//
// The pose is the object's in the camera's optical frame [m]; the first pixel's centre is (0, 0).
#include <nerf_pose_refiner/backend.h>
#include <nerf_pose_refiner/object.h>
#include <nerf_pose_refiner/observation.h>
#include <nerf_pose_refiner/overlay.h>
#include <nerf_pose_refiner/refiner.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

#include "numbers.h"
#include "opencv_images.h"

using namespace nerf_pose_refiner;

int main(int argc, char** argv) try {
  if (argc != 15) {
    std::fprintf(stderr, "Usage: %s MODEL IMAGE OVERLAY FX FY CX CY X Y Z QX QY QZ QW\n", argv[0]);
    return 2;
  }
  double number[11];
  for (int i = 0; i < 11; ++i) number[i] = numberOf(argv[4 + i]);

  Camera camera;
  camera.fx = number[0];
  camera.fy = number[1];
  camera.cx = number[2];
  camera.cy = number[3];
  PosePrior prior;
  prior.T_C_O = poseOf(number + 4);

  const std::shared_ptr<Backend> backend = makeBackend("auto");
  const Object object = loadObject(argv[1]);
  Refiner refiner(backend, object);
  const Observation observation = observeMat(cv::imread(argv[2], cv::IMREAD_COLOR), camera);
  const RefineResult found = refiner.refine(observation, prior);
  if (!found.trusted) {
    std::fprintf(stderr, "not found: %s\n", found.message.c_str());
    return 1;
  }
  const Eigen::Quaterniond q(found.T_C_O.R);
  std::printf("position %.4f %.4f %.4f, quaternion xyzw %.4f %.4f %.4f %.4f\n", found.T_C_O.t.x(),
              found.T_C_O.t.y(), found.T_C_O.t.z(), q.x(), q.y(), q.z(), q.w());
  std::printf("score %.2f, standard deviation along the view %.4f, %.0f ms\n", found.score,
              std::sqrt(found.covariance(2, 2)), 1e3 * found.seconds);
  Overlay overlay(backend, object);
  if (!cv::imwrite(argv[3], bgrImage(overlay.draw(observation, found.T_C_O)))) {
    throw std::runtime_error(std::string("cannot write ") + argv[3]);
  }
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
