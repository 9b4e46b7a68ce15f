// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "ros_targets.h"
#include "support/replay_inputs.h"

namespace nerf_pose_refiner {
namespace {

TEST(RosFuzzCorpus, Bag) { replayInputs("bag", fuzzBag); }
TEST(RosFuzzCorpus, CameraMessages) { replayInputs("camera_messages", fuzzCameraMessages); }
TEST(RosFuzzCorpus, Detections) { replayInputs("detections", fuzzDetections); }
TEST(RosFuzzCorpus, InitialPose) { replayInputs("initial_pose", fuzzInitialPose); }

}  // namespace
}  // namespace nerf_pose_refiner
