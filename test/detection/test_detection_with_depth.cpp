// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "detection/object_detector.h"
#include "support/depth_scene.h"
#include "support/noting_backend.h"

// Where detection looks for a plain object that a depth camera sees.

namespace nerf_pose_refiner {
namespace {

class DetectionWithDepth : public DepthScene, public testing::Test {
 protected:
  DetectionWithDepth() {
    DetectionSettings settings;
    settings.model.plain_landmarks = 1 << 30;
    settings.model.landmarks.views = settings.model.templates.views = 8;
    detector_ = std::make_unique<ObjectDetector>(
        &backend_of_scene_, field_, detectionModelFor(*field_, settings.model, "", {}), settings);
  }

  /// @param factor by which depth is wrong.
  const std::vector<NotingBackend::Asked>& lookedAt(double factor) {
    Observation observation = imageAt(truth_);
    ImageOf<float> metres = metresAt(truth_, kColour);
    for (float& value : metres.values) value *= static_cast<float>(factor);
    observation.depth = depthImage(std::move(metres), kColour);
    observation.image = Image(kColour.width, kColour.height, 3, 0.5f);  // landmarks find nothing
    backend_of_scene_.asked.clear();
    detector_->detect(observation, {}, {});
    return backend_of_scene_.asked;
  }

  NotingBackend backend_of_scene_{field_};
  std::unique_ptr<ObjectDetector> detector_;
};

TEST_F(DetectionWithDepth, LooksAtWhatIsAsFarAwayThenAtAll) {
  const std::vector<NotingBackend::Asked>& asked = lookedAt(1);
  ASSERT_GT(asked.size(), 2u);
  EXPECT_EQ(asked.back().width, kColour.width);
  EXPECT_GT(asked.back().distances.size(), 4u);
  const double distance = (truth_.t - object().centre).norm() / object().diameter;
  bool is_alone = false;
  for (std::size_t i = 0; i + 1 < asked.size(); ++i) {
    ASSERT_EQ(asked[i].distances.size(), 1u);
    const double ratio = asked[i].distances.front() / distance;
    is_alone = is_alone || (ratio > 0.9 && ratio < 1.1 && asked[i].width < kColour.width);
  }
  EXPECT_TRUE(is_alone) << "without the wall";
}

TEST_F(DetectionWithDepth, LooksAtAllWhereDepthSaysNothing) {
  for (const double factor : {0.0, 1000.0}) {
    const std::vector<NotingBackend::Asked>& asked = lookedAt(factor);
    ASSERT_EQ(asked.size(), 1u) << factor;
    EXPECT_EQ(asked.front().width, kColour.width);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
