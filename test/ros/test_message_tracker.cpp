// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "message_tracker_fixture.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

TEST_F(MessageTrackerTest, LeavesImagesAloneUntilThereIsAPose) {
  EXPECT_FALSE(tracker_->process(frameAt(0)));
  useModel();
  EXPECT_FALSE(tracker_->process(frameAt(0.1)));
  EXPECT_TRUE(search_->priors.empty());
  ASSERT_EQ(reports_.size(), 2u);
  EXPECT_EQ(int{reports_[0].state}, int{Status::STATE_NO_MODEL});
  EXPECT_EQ(int{reports_[1].state}, int{Status::STATE_WAITING});
  EXPECT_EQ(reports_[1].object, "mug");
}

TEST_F(MessageTrackerTest, LooksForTheObjectInTheBoxesOfADetector) {
  parameters_.tracker.rules.start = TrackStart::kDetect;
  restart();
  useModel();
  CameraFrame frame = frameAt(0);
  frame.masks.boxes = {{0.5, -0.5, 2.5, 1.5}, {-10, -10, -5, -5}};
  ASSERT_TRUE(tracker_->process(frame));
  EXPECT_EQ(search_->detections, 1);
  ASSERT_EQ(search_->boxes.size(), 1u) << "the other lies beside the image";
  EXPECT_EQ(search_->boxes[0].x_min, 0.5);
  EXPECT_EQ(search_->boxes[0].y_min, -0.5);
  EXPECT_EQ(search_->boxes[0].x_max, 2.5);
  EXPECT_EQ(search_->boxes[0].y_max, 1.5);
}

TEST_F(MessageTrackerTest, RefinesInModelUnitsAndAnswersInMetres) {
  useModel();
  offer();
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result);
  ASSERT_EQ(search_->priors.size(), 1u);
  EXPECT_NEAR(search_->priors[0].T_O_C.t.z(), -4, 1e-12);  // 0.4 m
  EXPECT_EQ(search_->width, 4);
  ASSERT_TRUE(result->pose);
  EXPECT_TRUE(result->track.found);
  EXPECT_NEAR(result->pose->pose.pose.position.z, 0.1, 1e-12);  // 1 unit
  EXPECT_EQ(result->pose->header.stamp, ros::Time(1000));
  EXPECT_EQ(result->pose->header.frame_id, "camera");
  EXPECT_EQ(result->hypotheses.hypotheses.size(), 2u);
  EXPECT_EQ(result->hypotheses.object, "mug");
  EXPECT_EQ(result->hypotheses.header.stamp, ros::Time(1000));
  EXPECT_NEAR(result->hypotheses.hypotheses[1].pose.position.z, 0.1, 1e-12);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_NONE});
  EXPECT_FLOAT_EQ(result->status.score, 0.9f);
  EXPECT_FLOAT_EQ(result->status.visible_fraction, 0.75f);
  EXPECT_GT(result->status.latency_s, 0);
  EXPECT_EQ(result->status.processed, 1u);
  EXPECT_EQ(result->status.header.stamp, ros::Time(1000));
  EXPECT_EQ(int{reports_.back().state}, int{Status::STATE_REFINING}) << "said before it began";
}

TEST_F(MessageTrackerTest, SpeaksOfTheFrameThatUsersMean) {
  useModel(fieldWithFrameAt(2));
  offer();
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result && result->pose);
  EXPECT_NEAR(search_->priors.at(0).T_O_C.t.z(), -2, 1e-12);    // 0.4 m, less 2 units
  EXPECT_NEAR(result->pose->pose.pose.position.z, 0.3, 1e-12);  // 1 + 2 units
  EXPECT_NEAR(result->hypotheses.hypotheses[1].pose.position.z, 0.3, 1e-12);
}

TEST_F(MessageTrackerTest, GoesOnWhenTheFrameIsMoved) {
  useModel();
  offer();
  tracker_->process(frameAt(0));
  useModel(fieldWithFrameAt(-0.5), /*same_appearance=*/true);
  const auto result = tracker_->process(frameAt(0.1));
  ASSERT_TRUE(result && result->pose);
  EXPECT_TRUE(search_->was_tracked.at(1));
  EXPECT_NEAR(search_->priors.at(1).T_O_C.t.z(), -1, 1e-12) << "the object is where it was";
  EXPECT_NEAR(result->pose->pose.pose.position.z, 0.05, 1e-12);
}

TEST_F(MessageTrackerTest, BeginsAnewWithAnotherScale) {
  useModel();
  offer();
  tracker_->process(frameAt(0));
  auto field = fieldWithFrameAt(0);
  field->metadata.metres_per_unit = 0.2;
  useModel(field, /*same_appearance=*/true);
  EXPECT_FALSE(tracker_->process(frameAt(0.1)));
  EXPECT_EQ(int{reports_.back().state}, int{Status::STATE_WAITING});
}

TEST_F(MessageTrackerTest, TracksFromTheLastPoseInANarrowSearch) {
  useModel();
  offer();
  tracker_->process(frameAt(0));
  tracker_->process(frameAt(0.1));
  ASSERT_EQ(search_->priors.size(), 2u);
  EXPECT_EQ(search_->was_tracked, (std::vector<bool>{false, true}));
  EXPECT_NEAR(search_->priors[1].T_O_C.t.z(), -1, 1e-12);
  EXPECT_NEAR(search_->priors[0].rotation_rad, 15 * M_PI / 180, 1e-12);
  EXPECT_NEAR(search_->priors[0].translation, 0.15, 1e-12);
  EXPECT_NEAR(search_->priors[1].rotation_rad, 5 * M_PI / 180, 1e-12);
  EXPECT_NEAR(search_->priors[1].translation, 0.05, 1e-12);
}

TEST_F(MessageTrackerTest, SearchesAsWideAsTheInitialPoseSays) {
  useModel();
  TimedPose start;
  start.frame_id = "camera";
  start.covariance = covarianceOf(0.25, 0.025);
  tracker_->tracker().offer(start);
  tracker_->process(frameAt(0));
  EXPECT_NEAR(search_->priors.at(0).rotation_rad, 0.5, 1e-12);
  EXPECT_NEAR(search_->priors.at(0).translation, 0.25, 1e-12);  // of a diameter of 0.2 m
}

TEST_F(MessageTrackerTest, KeepsPosesToItselfThatItDoesNotTrust) {
  useModel();
  offer();
  tracker_->process(frameAt(0));
  search_->score = 0.4;
  auto result = tracker_->process(frameAt(0.1));
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->pose);
  EXPECT_TRUE(result->track.found) << "but not trusted: it can be looked at";
  EXPECT_EQ(result->hypotheses.hypotheses.size(), 2u);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_LOW_SCORE});
  search_->outcome = Outcome::kNoOverlap;
  result = tracker_->process(frameAt(0.2));
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_LOST});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_NO_OVERLAP});
  EXPECT_FALSE(result->track.found) << "the prior is no result";
  EXPECT_TRUE(result->hypotheses.hypotheses.empty());
}

TEST_F(MessageTrackerTest, TellsThatAnInitialPoseIsIgnored) {
  useModel();
  offer();
  EXPECT_EQ(int{tracker_->process(frameAt(0))->status.reason}, int{Status::REASON_NONE});
  offer();
  const auto result = tracker_->process(frameAt(0.1));
  EXPECT_TRUE(result->pose);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_PRIOR_IGNORED});
  EXPECT_NE(result->status.message.find("an initial pose was ignored"), std::string::npos);
  EXPECT_EQ(int{tracker_->process(frameAt(0.2))->status.reason}, int{Status::REASON_NONE});
}

// TF1 put a slash before the names of frames, and TF2 throws at it.
// Images at 30 Hz, initial poses at 10 Hz: a detector that goes on sending what it sees.
TEST_F(MessageTrackerTest, ADetectorThatGoesOnSendingDoesNotRestartIt) {
  useModel();
  for (int i = 0; i < 60; ++i) {
    const double seconds = i / 30.0;
    setClock(seconds);
    if (i % 3 == 0) offer();
    const auto result = tracker_->process(frameAt(seconds));
    ASSERT_TRUE(result && result->pose) << "image " << i;
    EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING}) << "image " << i;
  }
  std::vector<bool> from_last(60, true);
  from_last[0] = false;
  EXPECT_EQ(search_->was_tracked, from_last);
}

TEST_F(MessageTrackerTest, TakesTheSlashOffAFrame) {
  parameters_.frames.output_frame = "base";
  restart();
  useModel();
  addTransform("base", "camera", 0, 7);
  offer("camera");
  const auto result = tracker_->process(frameAt(0, "/camera"));
  ASSERT_TRUE(result->pose) << result->status.message;
  EXPECT_NEAR(result->pose->pose.pose.position.x, 7, 1e-12);
  EXPECT_EQ(result->status.header.frame_id, "camera");
  EXPECT_TRUE(search_->was_tracked.size() == 1 && tracker_->process(frameAt(0.1, "camera")));
  EXPECT_EQ(search_->was_tracked.size(), 2u) << "it is the same camera";
}

TEST_F(MessageTrackerTest, PublishesInTheOutputFrame) {
  parameters_.frames.output_frame = "base";
  restart();
  useModel();
  addTransform("base", "camera", 0, 7);
  offer();
  auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result->pose);
  EXPECT_EQ(result->pose->header.frame_id, "base");
  EXPECT_NEAR(result->pose->pose.pose.position.x, 7, 1e-12);
  EXPECT_NEAR(result->hypotheses.hypotheses[0].pose.position.x, 7, 1e-12);
  // Where the camera is now TF does not say: the object is tracked, but cannot be placed.
  result = tracker_->process(frameAt(0.1));
  EXPECT_FALSE(result->pose);
  EXPECT_TRUE(result->hypotheses.hypotheses.empty());
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_NO_TRANSFORM});
  addTransform("base", "camera", 0.2, 8);
  EXPECT_NEAR(tracker_->process(frameAt(0.2))->pose->pose.pose.position.x, 8, 1e-12);
}

TEST_F(MessageTrackerTest, TracksThroughTheFixedFrame) {
  parameters_.frames.fixed_frame = "base";
  restart();
  useModel();
  addTransform("base", "camera", 0, 0);
  addTransform("base", "camera", 0.1, 0.3);
  offer();
  tracker_->process(frameAt(0));
  tracker_->process(frameAt(0.1));
  // The camera moved by 0.3 m to +x, so the object is 0.3 m farther to -x for it: 3 units.
  EXPECT_NEAR(search_->priors.at(1).T_O_C.t.x(), 3, 1e-9);
}

// The object is found at x in units: the model's axes are the camera's, in which
// the camera goes the other way.
TEST_F(MessageTrackerTest, LooksWhereTheMotionLeads) {
  useModel();
  offer();
  const auto find = [this](double seconds, double x) {
    search_->T_O_C.t.x() = -x;
    tracker_->process(frameAt(seconds));
    return -search_->priors.back().T_O_C.t.x();
  };
  find(0, -0.1);
  EXPECT_NEAR(find(0.2, 0.06), -0.1, 1e-9) << "how fast it is, nobody knows";
  EXPECT_NEAR(find(0.3, 0.06), 0.14, 0.002) << "0.16 in 0.2 s, so 0.08 in 0.1 s";
  EXPECT_NEAR(find(0.4, 0.1), 0.06, 0.02) << "it stood still";
  parameters_.tracker.rules.predict = false;
  tracker_->tracker().change(parameters_.tracker);
  find(0.5, 0.2);
  EXPECT_NEAR(find(0.6, 0.2), 0.2, 1e-9);
  parameters_.tracker.rules.predict = true;
  tracker_->tracker().change(parameters_.tracker);
  EXPECT_NEAR(find(0.7, 0.2), 0.2, 1e-9) << "the motion of long ago is that of another track";
}

TEST_F(MessageTrackerTest, PredictsInTheFixedFrame) {
  parameters_.frames.fixed_frame = "base";
  restart();
  useModel();
  for (const int i : {0, 1, 2}) addTransform("base", "camera", 0.1 * i, 0.3 * i);
  offer();
  for (const int i : {0, 1, 2}) {
    search_->T_O_C.t.x() = 3 * i;  // it stands still, and the camera goes to +x by 3 units
    tracker_->process(frameAt(0.1 * i));
  }
  EXPECT_NEAR(search_->priors.at(2).T_O_C.t.x(), 6, 1e-9)
      << "the camera's way does not count twice";
}

TEST_F(MessageTrackerTest, TracksIfTransformsBeginAfterAPose) {
  parameters_.frames.fixed_frame = "base";
  restart();
  useModel();
  // Nothing of the first pose's time is left when the third image comes.
  transforms_.clear();
  addTransform("base", "camera", 0, 0);
  addTransform("base", "camera", 0.1, 0);
  offer();
  tracker_->process(frameAt(0));
  tracker_->process(frameAt(0.1));
  transforms_.clear();
  addTransform("base", "camera", 0.1, 0);
  addTransform("base", "camera", 0.2, 0.3);
  const auto result = tracker_->process(frameAt(0.2));
  ASSERT_TRUE(result && result->pose);
  EXPECT_NEAR(search_->priors.at(2).T_O_C.t.x(), 3, 1e-9);
}

TEST_F(MessageTrackerTest, ChangesTheModelWhileItRefines) {
  useModel();
  offer();
  search_->waits_to_be_stopped = true;
  std::optional<FrameResult> result;
  std::thread worker([&] { result = tracker_->process(frameAt(0)); });
  while (!search_->searching) std::this_thread::yield();
  std::future<void> done = tracker_->tracker().offerModel(fieldCalled("cup"));
  worker.join();
  EXPECT_FALSE(result->pose);
  EXPECT_EQ(result->track.field->metadata.name, "mug");
  EXPECT_EQ(result->status.object, "mug");
  EXPECT_EQ(search_->object, "mug");
  tracker_->tracker().applyModels();
  done.get();
  EXPECT_EQ(search_->object, "cup");
  tracker_->tracker().reportChange({});
  EXPECT_EQ(reports_.back().object, "cup");
}

TEST_F(MessageTrackerTest, StopsARefinementOnRequest) {
  for (int request = 0; request < 4; ++request) {
    restart();
    useModel();
    tracker_->tracker().readClock();
    offer();
    search_->waits_to_be_stopped = true;
    std::optional<FrameResult> result;
    std::thread worker([&] { result = tracker_->process(frameAt(0)); });
    while (!search_->searching) std::this_thread::yield();
    if (request == 0) tracker_->tracker().reset();
    if (request == 1) tracker_->tracker().setEnabled(false);
    if (request == 2) tracker_->tracker().stop();
    setClock(request == 3 ? -100 : 0);
    tracker_->tracker().readClock();
    worker.join();
    EXPECT_FALSE(result->pose) << request;
    EXPECT_TRUE(result->hypotheses.hypotheses.empty()) << request;
    EXPECT_FALSE(result->track.found) << request << ": there is nothing to draw";
  }
}

TEST_F(MessageTrackerTest, ChangesCountFromTheNextImageOn) {
  useModel();
  offer();
  ASSERT_TRUE(tracker_->process(frameAt(0))->pose);
  PoseRefinerParameters changed = parameters_;
  changed.tracker.rules.min_score = changed.tracker.rules.trust_score =
      0.95;  // the search finds 0.9
  changed.tracker.tracking.rotation_deg = 7;
  changed.tracker.initial.refiner.seed = 5;
  changed.tracker.tracking.refiner.seed = 6;
  tracker_->tracker().change(changed.tracker);
  EXPECT_TRUE(search_->seeds.empty()) << "that is the worker's affair";
  const auto result = tracker_->process(frameAt(0.1));
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->pose) << "0.9 is not enough any more";
  EXPECT_EQ(search_->seeds, (std::vector<std::uint64_t>{5, 6}));
  EXPECT_NEAR(search_->priors.back().rotation_rad, 7 * M_PI / 180, 1e-12);
}

TEST_F(MessageTrackerTest, SaysHowFastTheObjectMoves) {
  useModel();
  offer();
  search_->covariance = 0.01 * Matrix6::Identity();
  const auto first = tracker_->process(frameAt(0));
  ASSERT_TRUE(first && first->pose);
  EXPECT_FALSE(first->twist);
  search_->T_O_C.t.z() = -1.2;  // 0.2 units are 2 cm
  const auto second = tracker_->process(frameAt(0.1));
  ASSERT_TRUE(second && second->twist);
  EXPECT_NEAR(second->twist->twist.twist.linear.z, 0.2, 0.01);  // (of poses that were fused)
  EXPECT_NEAR(second->twist->twist.twist.angular.z, 0, 1e-9);
  EXPECT_NEAR(second->twist->twist.covariance[35], 2 * second->pose->pose.covariance[35] / 0.01,
              1e-6);
  EXPECT_EQ(second->twist->header.stamp, second->pose->header.stamp);
  search_->score = 0.1;
  EXPECT_FALSE(tracker_->process(frameAt(0.2))->twist) << "not without a trusted pose";
  search_->score = 0.9;
  useModel(fieldWithFrameAt(-0.5), /*same_appearance=*/true);
  EXPECT_FALSE(tracker_->process(frameAt(0.3))->twist) << "the frame was moved, not the object";
}

TEST_F(MessageTrackerTest, AMaskIsUsedAsTheModeSays) {
  for (const auto& [mode, with_initial, with_tracked] :
       {std::make_tuple(MaskMode::kNone, false, false),
        std::make_tuple(MaskMode::kInitial, true, false),
        std::make_tuple(MaskMode::kEveryFrame, true, true)}) {
    parameters_.tracker.mask_mode = mode;
    restart();
    useModel();
    offer();
    for (const double stamp : {0.0, 0.1}) {
      CameraFrame frame = frameAt(stamp);
      frame.masks.object = frame.image;
      const auto result = tracker_->process(frame);
      ASSERT_TRUE(result && result->track.observation);
      const bool used = result->track.observation->background == Background::kMask;
      EXPECT_EQ(used, stamp == 0 ? with_initial : with_tracked);
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::Time::init();
  return RUN_ALL_TESTS();
}
