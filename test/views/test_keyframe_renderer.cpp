// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe_renderer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <stdexcept>
#include <thread>
#include <vector>

#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/gated_field.h"

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {320, 240, 400, 400, 159.5, 119.5};

class KeyframeRendererTest : public testing::Test {
 protected:
  std::shared_ptr<GatedField> field_ =
      std::make_shared<GatedField>(makeAnalyticScene(1, cpuProcessor(1)));
  View view_ = {kCamera, cameraAround(*field_, 0.6, 0.5)};
  KeyframeRenderer renderer_{field_, KeyframeSettings()};
};

TEST_F(KeyframeRendererTest, RendersBesideItsCaller) {
  EXPECT_FALSE(renderer_.busy());
  EXPECT_EQ(renderer_.take(), nullptr);
  field_->close();
  renderer_.request(view_);
  field_->waitForArrivals(1);
  EXPECT_TRUE(renderer_.busy());
  EXPECT_EQ(renderer_.take(), nullptr);  // not done, and nobody waits
  field_->open();
  const auto keyframe = renderer_.wait({});
  ASSERT_NE(keyframe, nullptr);
  EXPECT_EQ(keyframe->T_O_C.t, view_.T_O_C.t);
  EXPECT_FALSE(renderer_.busy());
}

TEST_F(KeyframeRendererTest, AWaitCanBeCancelled) {
  field_->close();
  renderer_.request(view_);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(renderer_.wait(cancellation), Cancelled);
  EXPECT_TRUE(renderer_.busy());  // the rendering goes on
  field_->open();
  EXPECT_NE(renderer_.wait({}), nullptr);
}

TEST_F(KeyframeRendererTest, TellsOfAKeyframeBeforeItIsTaken) {
  std::atomic<bool> fails{false};
  std::shared_ptr<const KeyframePoints> told;
  std::thread::id teller;
  KeyframeRenderer renderer(field_, KeyframeSettings(), [&](const auto& keyframe) {
    if (fails) throw std::runtime_error("no memory");
    told = keyframe;
    teller = std::this_thread::get_id();
  });
  renderer.request(view_);
  const auto keyframe = renderer.wait({});
  EXPECT_EQ(told, keyframe);
  EXPECT_NE(teller, std::this_thread::get_id());
  fails = true;
  renderer.request(view_);
  EXPECT_THROW(renderer.wait({}), std::runtime_error);
  EXPECT_FALSE(renderer.busy());
  EXPECT_EQ(renderer.take(), nullptr);
}

TEST_F(KeyframeRendererTest, HandsOverErrors) {
  View behind = view_;
  behind.T_O_C.t += 10 * view_.T_O_C.R.col(2);
  renderer_.request(behind);
  EXPECT_THROW(renderer_.wait({}), std::invalid_argument);
  EXPECT_FALSE(renderer_.busy());
  renderer_.request(view_);
  EXPECT_NE(renderer_.wait({}), nullptr);
}

TEST_F(KeyframeRendererTest, DoesOtherWorkInSteps) {
  int steps = 0;
  renderer_.doAside([&steps](const CancellationToken&) { return ++steps < 5; });
  renderer_.waitForAside({});
  EXPECT_FALSE(renderer_.isAsideBusy());
  EXPECT_EQ(steps, 5);
}

TEST_F(KeyframeRendererTest, OtherWorkWaitsForKeyframes) {
  field_->close();
  renderer_.request(view_);
  field_->waitForArrivals(1);
  std::shared_ptr<const KeyframePoints> before;
  renderer_.doAside([&](const CancellationToken&) {
    before = renderer_.take();
    return false;
  });
  EXPECT_TRUE(renderer_.isAsideBusy());
  EXPECT_THROW(
      {
        CancellationToken cancelled;
        cancelled.requestCancel();
        renderer_.waitForAside(cancelled);
      },
      Cancelled);
  field_->open();
  renderer_.waitForAside({});
  EXPECT_NE(before, nullptr);
}

TEST_F(KeyframeRendererTest, OtherWorkCanBeGivenUp) {
  std::atomic<int> steps{0};
  renderer_.doAside([&](const CancellationToken&) {
    ++steps;
    return true;  // for ever
  });
  renderer_.endAside();
  EXPECT_FALSE(renderer_.isAsideBusy());
  const int done = steps;
  renderer_.request(view_);
  EXPECT_NE(renderer_.wait({}), nullptr);
  EXPECT_EQ(steps, done);
}

TEST_F(KeyframeRendererTest, OtherWorkPauses) {
  std::atomic<int> steps{0};
  std::atomic<bool> may_end{false};
  renderer_.doAside([&](const CancellationToken&) {
    ++steps;
    return !may_end;
  });
  renderer_.pauseAside();
  const int done = steps;
  may_end = true;
  renderer_.request(view_);
  EXPECT_NE(renderer_.wait({}), nullptr);
  EXPECT_TRUE(renderer_.isAsideBusy());
  EXPECT_EQ(steps, done);
  renderer_.waitForAside({});
  EXPECT_EQ(steps, done + 1);
}

/// The next keyframe is asked for before the first one is done, so that nothing but urgency lets
/// other work in between.
TEST_F(KeyframeRendererTest, UrgentWorkTakesTurnsWithKeyframes) {
  for (const bool is_urgent : {false, true}) {
    std::atomic<int> steps{0};
    std::vector<int> steps_before;  // each keyframe
    std::promise<void> both;
    KeyframeRenderer* self = nullptr;
    KeyframeRenderer renderer(field_, KeyframeSettings(), [&](const auto&) {
      steps_before.push_back(steps);
      if (steps_before.size() == 1) {
        self->request(view_);
      } else {
        both.set_value();
      }
    });
    self = &renderer;
    field_->close();
    const int arrived = field_->arrived();
    renderer.request(view_);
    field_->waitForArrivals(arrived + 1);
    renderer.doAside([&](const CancellationToken&) {
      ++steps;
      return false;
    });
    renderer.goOnAside(is_urgent);
    field_->open();
    both.get_future().wait();
    EXPECT_EQ(steps_before, std::vector<int>({0, is_urgent ? 1 : 0}));
  }
}

TEST_F(KeyframeRendererTest, UrgentWorkDoesNotKeepKeyframesFromBeingRendered) {
  renderer_.doAside([](const CancellationToken&) { return true; });  // for ever
  renderer_.goOnAside(true);
  for (int i = 0; i < 2; ++i) {
    renderer_.request(view_);
    EXPECT_NE(renderer_.wait({}), nullptr);
  }
  renderer_.endAside();
}

TEST_F(KeyframeRendererTest, HandsOverErrorsOfOtherWork) {
  renderer_.doAside([](const CancellationToken&) -> bool { throw std::runtime_error("no"); });
  EXPECT_THROW(renderer_.waitForAside({}), std::runtime_error);
  EXPECT_NO_THROW(renderer_.waitForAside({}));
}

TEST_F(KeyframeRendererTest, EndsWhileItRenders) {
  field_->close();
  renderer_.request(view_);
  field_->waitForArrivals(1);  // the destructor cancels
}

}  // namespace
}  // namespace nerf_pose_refiner
