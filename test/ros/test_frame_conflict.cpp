// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/frame_conflict.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

tf2_msgs::TFMessage transformOf(const std::string& frame) {
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  message.transforms[0].child_frame_id = frame;
  return message;
}

TEST(FrameConflict, WhatIsSentMayComeBack) {
  FrameConflict conflict;
  for (int i = 0; i < 100; ++i) {
    conflict.sending("mug");
    EXPECT_EQ(conflict.received(transformOf("mug"), ""), "");
    EXPECT_EQ(conflict.received(transformOf("gripper"), "/robot"), "");
  }
}

TEST(FrameConflict, NamesTheOtherNode) {
  FrameConflict conflict;
  EXPECT_EQ(conflict.received(transformOf("mug"), "/other"), "") << "nothing was sent here";
  std::string warning;
  for (int i = 0; i < 20 && warning.empty(); ++i) {
    conflict.sending("mug");
    conflict.received(transformOf("/mug"), "/other");
    warning = conflict.received(transformOf("mug"), "");
  }
  EXPECT_NE(warning.find("'mug' is also published by /other"), std::string::npos) << warning;
}

TEST(FrameConflict, NoticesAnotherRefinerOfTheProcess) {
  FrameConflict conflict;
  std::string warning;
  for (int i = 0; i < 20; ++i) {
    conflict.sending("mug");
    conflict.received(transformOf("mug"), "");
    warning = conflict.received(transformOf("mug"), "");
  }
  EXPECT_NE(warning.find("another refiner of this process"), std::string::npos) << warning;
}

TEST(FrameConflict, BeginsAnewWithAnotherFrame) {
  FrameConflict conflict;
  conflict.sending("mug");
  for (int i = 0; i < 20; ++i) conflict.received(transformOf("mug"), "/other");
  conflict.sending("can");
  EXPECT_EQ(conflict.received(transformOf("can"), ""), "");
}

}  // namespace
}  // namespace nerf_pose_refiner
