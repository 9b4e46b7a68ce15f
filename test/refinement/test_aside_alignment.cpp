// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/aside_alignment.h"

#include <gtest/gtest.h>

#include <functional>
#include <future>
#include <stdexcept>

#include "backend/make_backend.h"
#include "support/keyframe_scene.h"

namespace nerf_pose_refiner {
namespace {

class AsideAlignmentOfScene : public testing::Test, protected KeyframeScene {
 protected:
  using Keyframe = std::shared_ptr<const KeyframePoints>;

  Keyframe keyframe(const Pose& T_O_C) const {
    return std::make_shared<const KeyframePoints>(keyframeAt(T_O_C));
  }

  Hypothesis alignedDirectly(const Keyframe& keyframe, const Pose& start) const {
    const auto aligner = makeCpuKeyframeAligner(1);
    aligner->observe(image_, frameWindowFor(*keyframe, kCamera, start));
    return aligner->align({{aligner->add(keyframe), start}}, {}, {}).front();
  }

  Observation image_ = observed(imageOf(truth_));
  Pose start_ = offBy(truth_, {0.5, -0.5, 0.5}, 3);
};

TEST_F(AsideAlignmentOfScene, EndsWhereADirectOneEnds) {
  AsideAlignment aside(makeCpuKeyframeAligner(1), {});
  for (const Keyframe& one : {keyframe(truth_), keyframe(offBy(truth_, {0, 1, 0}, 6))}) {
    Observation gone = image_;
    aside.begin(gone, one, start_);
    gone = Observation();
    const Hypothesis found = aside.wait({});
    const Hypothesis directly = alignedDirectly(one, start_);
    EXPECT_EQ(found.T_O_C.R, directly.T_O_C.R);
    EXPECT_EQ(found.score, directly.score);
  }
}

TEST_F(AsideAlignmentOfScene, IsBusyUntilItsResultIsTaken) {
  AsideAlignment aside(makeCpuKeyframeAligner(1), {});
  EXPECT_FALSE(aside.busy());
  EXPECT_FALSE(aside.take());
  aside.begin(image_, keyframe(truth_), start_);
  EXPECT_TRUE(aside.busy());
  while (!aside.take()) EXPECT_TRUE(aside.busy());
  EXPECT_FALSE(aside.busy());
  EXPECT_FALSE(aside.take());
}

/// Ends when it is told to.
class ScriptedAligner final : public KeyframeAligner {
 public:
  using End = std::function<std::vector<Hypothesis>()>;
  explicit ScriptedAligner(End end) : end_(std::move(end)) {}

  int add(std::shared_ptr<const KeyframePoints>) override { return 0; }
  void remove(int) override {}
  void observe(const Observation&, const FrameWindow&) override {}
  std::vector<Hypothesis> align(const std::vector<KeyframeStart>&, const KeyframeAlignmentSettings&,
                                const CancellationToken&) override {
    return end_();
  }

 private:
  End end_;
};

TEST_F(AsideAlignmentOfScene, ItsCallerMayStopWaiting) {
  std::promise<void> goes_on;
  AsideAlignment aside(std::make_unique<ScriptedAligner>([&] {
                         goes_on.get_future().wait();
                         return std::vector<Hypothesis>(1);
                       }),
                       {});
  aside.begin(image_, keyframe(truth_), start_);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(aside.wait(cancellation), Cancelled);
  EXPECT_FALSE(aside.take());
  EXPECT_TRUE(aside.busy());
  goes_on.set_value();
  aside.wait({});
  EXPECT_FALSE(aside.busy());
}

TEST_F(AsideAlignmentOfScene, WhatItThrowsComesToItsCaller) {
  AsideAlignment aside(std::make_unique<ScriptedAligner>([]() -> std::vector<Hypothesis> {
                         throw std::runtime_error("the processor is lost");
                       }),
                       {});
  for (int i = 0; i < 2; ++i) {
    aside.begin(image_, keyframe(truth_), start_);
    EXPECT_THROW(aside.wait({}), std::runtime_error);
    EXPECT_FALSE(aside.busy());
  }
}

TEST_F(AsideAlignmentOfScene, CanBeGivenUp) {
  for (int i = 0; i < 20; ++i) {
    AsideAlignment aside(makeCpuKeyframeAligner(1), {});
    aside.begin(image_, keyframe(truth_), start_);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
