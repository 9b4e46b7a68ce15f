// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/object_tracker.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "backend/make_backend.h"
#include "support/expect_error.h"
#include "support/fake_search.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::int64_t kStart_ns = 1700000000000000000;

std::int64_t timeAt(double seconds) { return kStart_ns + std::llround(1e9 * seconds); }

/// The camera moves along x of the frame "base", where all else stands.
class MovingCamera : public Transforms {
 public:
  explicit MovingCamera(double speed_m_s) : speed_m_s_(speed_m_s) {}
  Pose inCamera(const TimedPose& estimate, const ImageStamp& image,
                const CancellationToken&) const override {
    if (estimate.frame_id != image.camera_frame) {
      throw InputError(TrackReason::kNoTransform, "only the camera's frame is known");
    }
    Pose T_C_U = estimate.T_P_U;
    T_C_U.t.x() -= speed_m_s_ * 1e-9 * static_cast<double>(image.stamp_ns - estimate.stamp_ns);
    return T_C_U;
  }
  void clear() override { ++cleared; }

  int cleared = 0;

 private:
  double speed_m_s_;
};

/// A tracker of "mug": one unit is 0.1 m.
class TrackerTest : public testing::Test {
 protected:
  TrackerTest() {
    settings_.rules.trust_score = 0.7;
    settings_.rules.min_score = 0.5;
    settings_.rules.max_failures = 1;
    restart();
  }

  void restart(TrackerConnections connections = {}) {
    auto search = std::make_unique<FakeSearch>();
    search_ = search.get();
    tracker_ =
        std::make_unique<ObjectTracker>(std::move(search), settings_, std::move(connections));
    use("mug");
  }

  void use(const std::string& name) {
    std::future<void> in_use = tracker_->offerModel(fieldCalled(name));
    tracker_->applyModels();
    in_use.get();
  }

  void offer(const std::string& frame_id = "camera") {
    TimedPose estimate;
    estimate.frame_id = frame_id;
    estimate.T_P_U.t.z() = 0.4;
    tracker_->offer(estimate);
  }

  TrackerImage image(double seconds) {
    return {{"camera", timeAt(seconds)}, [this](bool use_mask) {
              ++observed_;
              mask_used_ = use_mask;
              Observation observation;
              observation.image = Image(4, 2, 3);
              return observation;
            }};
  }

  TrackOutcome track(double seconds) { return tracker_->track(image(seconds)); }

  TrackerSettings settings_;
  std::unique_ptr<ObjectTracker> tracker_;
  FakeSearch* search_ = nullptr;
  int observed_ = 0;
  bool mask_used_ = false;
};

TEST_F(TrackerTest, LooksAtNoPixelsUntilThereIsAPose) {
  const TrackOutcome result = track(0);
  EXPECT_FALSE(result.refined);
  EXPECT_EQ(result.state, TrackState::kWaiting);
  EXPECT_EQ(observed_, 0);
  offer();
  EXPECT_TRUE(track(0.1).refined);
  EXPECT_EQ(observed_, 1);
}

TEST_F(TrackerTest, AnswersInMetres) {
  search_->covariance = (Vector6() << 4, 4, 4, 0.25, 0.25, 0.25).finished().asDiagonal();
  offer();
  const TrackOutcome result = track(0);
  ASSERT_TRUE(result.trusted && result.found);
  EXPECT_NEAR(result.T_C_O_m.t.z(), 0.1, 1e-12);  // one unit
  // The fake object's centre is its frame's origin: only the unit changes.
  EXPECT_NEAR(result.covariance(0, 0), 0.04, 1e-12);
  EXPECT_NEAR(result.covariance(5, 5), 0.25, 1e-12);
  EXPECT_EQ(result.score, 0.9);
  EXPECT_EQ(result.state, TrackState::kTracking);
  EXPECT_EQ(result.object, "mug");
  EXPECT_EQ(result.processed, 1u);
  EXPECT_EQ(result.image.stamp_ns, timeAt(0));
  ASSERT_TRUE(result.prior);
  EXPECT_NEAR(result.prior->T_O_C.t.z(), -4, 1e-12);
  EXPECT_FALSE(result.from_last);
  EXPECT_TRUE(track(0.1).from_last);
}

TEST_F(TrackerTest, ATurnThatIsCorrectedIsNoMotion) {
  for (const bool is_turned : {false, true}) {
    restart();
    search_->covariance = covarianceOf(0.01, 0.01);
    offer();
    track(0);
    track(0.03);
    search_->T_O_C.R = expSO3(Eigen::Vector3d(0, 0, 1.7));
    search_->is_turned = is_turned;
    track(0.06);
    search_->is_turned = false;
    track(0.09);
    const double turned_on = rotationDistance(search_->priors.back().T_O_C.R, search_->T_O_C.R);
    if (is_turned) {
      EXPECT_LT(turned_on, 1e-6);
    } else {
      EXPECT_GT(turned_on, 0.05) << "a jerk goes on";
    }
  }
}

TEST_F(TrackerTest, APoseThatExplainsTheImageBadlyIsFoundAndNotTrusted) {
  offer();
  track(0);
  search_->score = 0.4;
  TrackOutcome result = track(0.1);
  EXPECT_TRUE(result.found);
  EXPECT_FALSE(result.trusted);
  EXPECT_EQ(result.reason, TrackReason::kLowScore);
  EXPECT_EQ(result.state, TrackState::kTracking);
  result = track(0.2);
  EXPECT_EQ(result.state, TrackState::kLost);
}

TEST_F(TrackerTest, AMaskIsUsedAsTheModeSays) {
  settings_.mask_mode = MaskMode::kInitial;
  restart();
  offer();
  track(0);
  EXPECT_TRUE(mask_used_);
  track(0.1);
  EXPECT_FALSE(mask_used_);
}

TEST_F(TrackerTest, AnImageThatCannotBeUsedSaysWhy) {
  offer();
  TrackerImage bad = image(0);
  bad.observe = [](bool) -> Observation { throw InputError(TrackReason::kBadMask, "too small"); };
  const TrackOutcome result = tracker_->track(bad);
  EXPECT_TRUE(result.refined);
  EXPECT_FALSE(result.found);
  EXPECT_EQ(result.reason, TrackReason::kBadMask);
  EXPECT_EQ(result.message, "too small");
}

TEST_F(TrackerTest, KnowsNoFrameButTheCamerasByDefault) {
  offer("base");
  const TrackOutcome result = track(0);
  EXPECT_EQ(result.state, TrackState::kWaiting);
  EXPECT_EQ(result.reason, TrackReason::kPriorNoFrame);
  EXPECT_TRUE(search_->priors.empty());
}

TEST_F(TrackerTest, TheCamerasMotionIsNotTheObjects) {
  const auto camera = std::make_shared<MovingCamera>(0.5);
  restart({camera});
  offer();
  for (int i = 0; i < 3; ++i) {
    // The object stands still at x = 0 of the base: for the camera it goes to -x by 0.5 units.
    search_->T_O_C.t.x() = 0.5 * i;
    ASSERT_TRUE(track(0.1 * i).trusted);
  }
  EXPECT_NEAR(search_->priors.at(1).T_O_C.t.x(), 0.5, 1e-6);
  EXPECT_NEAR(search_->priors.at(2).T_O_C.t.x(), 1, 1e-6) << "not counted twice";
}

TEST_F(TrackerTest, WithoutAClockTheImagesTellTheTime) {
  const auto camera = std::make_shared<MovingCamera>(0);
  restart({camera});
  offer();
  ASSERT_TRUE(track(10).trusted);
  EXPECT_FALSE(track(9.9).refined) << "an image that came late";
  ASSERT_TRUE(track(10.1).trusted);
  const TrackOutcome result = track(5);
  EXPECT_FALSE(result.refined);
  EXPECT_EQ(result.reason, TrackReason::kClockJumped);
  EXPECT_EQ(camera->cleared, 1);
  offer();
  EXPECT_TRUE(track(5.1).trusted);
}

TEST_F(TrackerTest, SaysWhenItNeedsAnInitialPose) {
  EXPECT_TRUE(tracker_->needsInitialPose(timeAt(0)));
  offer();
  EXPECT_FALSE(tracker_->needsInitialPose(timeAt(0)));
  track(0);
  EXPECT_FALSE(tracker_->needsInitialPose(timeAt(0.1)));
  search_->score = 0;
  track(0.1);
  track(0.2);
  EXPECT_FALSE(tracker_->needsInitialPose(timeAt(0.3))) << "lost, and looked for";
  EXPECT_TRUE(tracker_->needsInitialPose(timeAt(settings_.rules.recover_s + 0.1)));
  EXPECT_FALSE(track(settings_.rules.recover_s + 0.1).refined);
}

TEST_F(TrackerTest, ATrackWithoutImagesForLongNeedsOneToo) {
  offer();
  track(0);
  EXPECT_TRUE(tracker_->needsInitialPose(timeAt(100)));
}

TEST_F(TrackerTest, AnImagesTokenIsItsCallersAgainAfterwards) {
  offer();
  const TrackerImage first = image(0);
  tracker_->track(first);
  tracker_->reset();
  tracker_->stop();
  EXPECT_FALSE(first.cancel.cancelRequested());
}

TEST_F(TrackerTest, TheTokenOfAnImageThatIsSkippedIsLeftAlone) {
  const TrackerImage skipped = image(0);
  EXPECT_FALSE(tracker_->track(skipped).refined);
  tracker_->reset();
  tracker_->setEnabled(false);
  tracker_->stop();
  EXPECT_FALSE(skipped.cancel.cancelRequested());
}

TEST_F(TrackerTest, ARefinementIsInterruptedByItsToken) {
  offer();
  TrackerImage cancelled = image(0);
  cancelled.cancel.requestCancel();
  const TrackOutcome result = tracker_->track(cancelled);
  EXPECT_FALSE(result.found);
  EXPECT_EQ(result.reason, TrackReason::kCancelled);
}

// The thread that tracks has looked for models, and waits for an image when one is offered.
TEST_F(TrackerTest, AModelThatIsOfferedBeforeAnImageCountsForIt) {
  offer();
  ASSERT_TRUE(track(0).trusted);
  tracker_->applyModels();
  std::future<void> in_use = tracker_->offerModel(fieldCalled("cup"));
  const TrackOutcome result = track(0.1);
  EXPECT_FALSE(result.refined) << "where the mug was says nothing of the cup";
  EXPECT_EQ(result.object, "cup");
  EXPECT_EQ(search_->object, "cup");
  EXPECT_EQ(search_->priors.size(), 1u) << "the mug is not looked for once more";
  EXPECT_EQ(in_use.wait_for(std::chrono::seconds(0)), std::future_status::ready);
}

// The same for one that is offered while another is taken over.
TEST_F(TrackerTest, TheLastModelThatIsOfferedBeforeAnImageCountsForIt) {
  search_->on_use = [this] { tracker_->offerModel(fieldCalled("jug")); };
  tracker_->offerModel(fieldCalled("cup"));
  EXPECT_EQ(track(0).object, "jug");
  EXPECT_EQ(search_->object, "jug");
}

TEST_F(TrackerTest, ReportsChangesOnce) {
  std::vector<TrackStatus> reports;
  TrackerConnections connections;
  connections.report = [&](const TrackStatus& status) { reports.push_back(status); };
  restart(connections);
  track(0);
  track(0.1);
  ASSERT_EQ(reports.size(), 1u);
  EXPECT_EQ(reports[0].state, TrackState::kWaiting);
  offer();
  track(0.2);
  ASSERT_EQ(reports.size(), 2u);
  EXPECT_EQ(reports[1].state, TrackState::kRefining) << "said before it began";
}

TEST(ObjectTracker, NeedsAScale) {
  auto field = std::make_shared<Field>(*fieldCalled("mug"));
  field->metadata.metres_per_unit = 0;
  const std::shared_ptr<Backend> backend = makeCpuBackend(1);
  EXPECT_THROW(ObjectTracker(backend, field, TrackerSettings()), std::invalid_argument);
}

TEST_F(TrackerTest, WithoutAPoseItDetectsWhereItIsTold) {
  settings_.rules.start = TrackStart::kBoth;
  restart();
  const TrackOutcome first = track(0);
  EXPECT_EQ(search_->detections, 1);
  EXPECT_TRUE(first.refined && first.trusted);
  EXPECT_FALSE(first.from_last);
  EXPECT_FALSE(first.prior);
  EXPECT_EQ(first.state, TrackState::kTracking);
  const TrackOutcome second = track(0.1);
  EXPECT_EQ(search_->detections, 1);
  EXPECT_TRUE(second.from_last);
}

TEST_F(TrackerTest, DetectionIsToldTheTrustScoreOfNow) {
  settings_.rules.start = TrackStart::kDetect;
  restart();
  settings_.rules.trust_score = 0.8;
  tracker_->change(settings_);
  track(0);
  EXPECT_EQ(search_->least_score, 0.8);
}

TEST_F(TrackerTest, SettingsOutOfRangeAreRefused) {
  const auto expect_refused = [](const char* name, const auto& change) {
    TrackerSettings settings;
    change(&settings);
    expectError<std::invalid_argument>(
        [&] { ObjectTracker(std::make_unique<FakeSearch>(), settings); }, name);
  };
  using Settings = TrackerSettings*;
  expect_refused("trust_score", [](Settings s) { s->rules.trust_score = 7; });
  expect_refused("min_score", [](Settings s) { s->rules.min_score = 0.95; });
  expect_refused("max_failures", [](Settings s) { s->rules.max_failures = -1; });
  expect_refused("recover_s", [](Settings s) { s->rules.recover_s = NAN; });
  expect_refused("detect_rate_hz", [](Settings s) { s->rules.detect_rate_hz = 0; });
  expect_refused("detect_share", [](Settings s) { s->rules.detect_share = 0; });
  expect_refused("detect_share", [](Settings s) { s->rules.detect_share = 1.1; });
  expect_refused("rotation_deg", [](Settings s) { s->initial.rotation_deg = 181; });
  expect_refused("translation", [](Settings s) { s->tracking.translation = -0.1; });
  expect_refused("window.views", [](Settings s) { s->window.views = -1; });
  expect_refused("window.apart_deg", [](Settings s) { s->window.apart_deg = NAN; });
}

TEST_F(TrackerTest, AnObjectThatIsNotDetectedIsWaitedFor) {
  settings_.rules.start = TrackStart::kDetect;
  settings_.rules.detect_rate_hz = 3;
  restart();
  search_->outcome = Outcome::kDiverged;
  const TrackOutcome outcome = track(0);
  EXPECT_TRUE(outcome.refined);
  EXPECT_FALSE(outcome.found || outcome.trusted);
  EXPECT_EQ(outcome.state, TrackState::kWaiting);
  EXPECT_FALSE(track(0.1).refined) << "not at every image";
}

}  // namespace
}  // namespace nerf_pose_refiner
