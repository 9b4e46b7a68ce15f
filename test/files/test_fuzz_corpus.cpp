// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "support/replay_inputs.h"
#include "targets.h"

namespace nerf_pose_refiner {
namespace {

TEST(FuzzCorpus, BopScene) { replayInputs("bop_scene", fuzzBopScene); }
TEST(FuzzCorpus, ColmapBinary) { replayInputs("colmap_binary", fuzzColmapBinary); }
TEST(FuzzCorpus, ColmapText) { replayInputs("colmap_text", fuzzColmapText); }
TEST(FuzzCorpus, LandmarkFile) { replayInputs("landmark_file", fuzzLandmarkFile); }
TEST(FuzzCorpus, ModelFile) { replayInputs("model_file", fuzzModelFile); }
TEST(FuzzCorpus, ObjectMetadata) { replayInputs("object_metadata", fuzzObjectMetadata); }
TEST(FuzzCorpus, PhoneScan) { replayInputs("phone_scan", fuzzPhoneScan); }
TEST(FuzzCorpus, TransformsJson) { replayInputs("transforms_json", fuzzTransformsJson); }
TEST(FuzzCorpus, ImageSize) { replayInputs("image_size", fuzzImageSize); }

}  // namespace
}  // namespace nerf_pose_refiner
