// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <string>

#include "ros/conversions/camera_input.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {
namespace {

/// Why camera_info of an image of 8 x 6 pixels is refused; empty: it is not.
std::string refusal(double fx, double fy) {
  try {
    cameraFromMessage(toMessage(Camera{8, 6, fx, fy, 3.5, 2.5}), false);
  } catch (const InputError& e) {
    EXPECT_EQ(e.reason(), TrackReason::kBadCameraInfo);
    return e.what();
  }
  return "";
}

TEST(FocalLength, IsRefusedWhereItDoesNotSuitTheImage) {
  for (const double wrong : {1e-200, 1e-6, 0.0079, 8001.0, 1e9, 1e200}) {
    for (const std::string& text :
         {refusal(wrong, wrong), refusal(10, wrong), refusal(wrong, 10)}) {
      EXPECT_NE(text.find("focal length"), std::string::npos) << wrong;
    }
  }
}

TEST(FocalLength, OfAFisheyeLensAndOfATelescopeIsTaken) {
  for (const double right : {0.0081, 1.0, 10.0, 800.0, 7999.0})
    EXPECT_EQ(refusal(right, right), "");
}

}  // namespace
}  // namespace nerf_pose_refiner
