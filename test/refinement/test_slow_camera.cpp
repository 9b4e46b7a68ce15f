// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>

#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "math/angle.h"
#include "refinement/keyframe_refiner.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/gated_field.h"
#include "support/scene_before_clutter.h"

namespace nerf_pose_refiner {
namespace {

class SlowCameraTest : public testing::Test {
 protected:
  Pose aroundBy(double degrees) const {
    return cameraAround(*field_, 0.5 + degrees * kDegree, 0.4);
  }

  Observation imageAt(double degrees) const {
    return sceneBeforeClutter(*scene_, camera_, aroundBy(degrees));
  }

  Prior priorAt(double degrees) const {
    Prior prior;
    prior.T_O_C = aroundBy(degrees);
    prior.rotation_rad = 5 * kDegree;
    prior.translation = 0.05;
    return prior;
  }

  /// Follows an image, and cancels that when it asks for a rendering, which does not come.
  Outcome cancelledByRendering(KeyframeRefiner* refiner, const TimedObservation& image,
                               const Prior& prior) {
    const int rendered = field_->arrived();
    CancellationToken cancellation;
    std::atomic<bool> is_done{false};
    field_->close();
    auto canceller = std::async(std::launch::async, [&] {
      while (!is_done && field_->arrived() == rendered) std::this_thread::yield();
      cancellation.requestCancel();
    });
    const Refinement found = refiner->follow(image, prior, cancellation);
    is_done = true;
    canceller.get();
    field_->open();
    refiner->waitForRenderings({});
    return found.outcome;
  }

  const Camera camera_ = {320, 240, 400, 400, 159.5, 119.5};
  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  std::shared_ptr<GatedField> field_ = std::make_shared<GatedField>(scene_);
  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
};

// A keyframe beside tracking is requested at the end of `follow`, when cancelling comes too late.
TEST_F(SlowCameraTest, LeavesTimeForAKeyframeOfThePosesOwnPlace) {
  KeyframeSearchSettings settings;
  settings.renewal_s = 1e-3;
  const Observation first = imageAt(0), next = imageAt(10);
  for (const bool is_slow : {false, true}) {
    KeyframeRefiner refiner(backend_.get(), field_, settings);
    const double seconds = refiner.follow({first, 0}, priorAt(0)).seconds;
    refiner.waitForRenderings({});
    // The image came while the first one was worked on, or after that.
    const auto stamp_ns = static_cast<std::int64_t>(1e9 * seconds * (is_slow ? 2 : 0.5));
    EXPECT_EQ(cancelledByRendering(&refiner, {next, stamp_ns}, priorAt(7)),
              is_slow ? Outcome::kCancelled : Outcome::kRefined);
    const Refinement found = refiner.follow({next, 100 * stamp_ns}, priorAt(7));
    const PoseError error =
        poseError(found.T_O_C, aroundBy(10), field_->field().metadata.centre, camera_);
    EXPECT_LT(error.rotation_rad / kDegree, 0.2);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
