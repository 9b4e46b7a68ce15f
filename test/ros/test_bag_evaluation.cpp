// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// What evaluate_bag measures is what the node does: on the same images, without drops, both find
// the same poses, bit for bit.
#include "ros/bag/bag_evaluation.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "backend/make_backend.h"
#include "dataset/dataset.h"
#include "registration/registrar.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "ros/nodelet/message_tracker.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kImages = 5;

class SamePosesTest : public testing::Test {
 protected:
  /// A model that is made in seconds: it need not be a good one.
  static void SetUpTestSuite() {
    RegistrationOptions settings;
    settings.steps = 300;
    settings.samples_per_step = 4096;
    backend_ = makeCpuBackend();
    field_ = std::make_shared<const Field>(
        learnField(backend_.get(), loadDataset(NPR_SOURCE_DIR "/demo/data/toy_kiosk"), settings, {},
                   CancellationToken()));
  }
  static void TearDownTestSuite() {
    field_.reset();
    backend_.reset();
  }

  SamePosesTest() {
    BagTopics topics;
    topics.truth = "/ground_truth/object_pose";
    topics.initial_pose = "/initial_pose";
    bag_ = std::make_unique<BagSequence>(NPR_SOURCE_DIR "/demo/toy_kiosk.bag", topics);
    settings_.track = true;
    settings_.start = StartMode::kRecorded;
    settings_.most = kImages;
    settings_.points = 50;
    settings_.preset = "track";  // quick, and as good for a comparison
  }

  /// What the node makes of the same images.
  std::vector<std::optional<FrameResult>> trackedByTheNode() {
    PoseRefinerParameters parameters;
    parameters.tracker = settings_.tracker();
    ros::Time now;
    tf2::BufferCore transforms;
    MessageTracker node(
        parameters,
        std::make_unique<RefinerSearch>([] { return SearchProcessor{backend_}; },
                                        parameters.tracker.initial.refiner,
                                        parameters.tracker.tracking.refiner),
        &transforms, [](const RefinementStatus&) {}, [&] { return now; });
    node.tracker().offerModel(field_);
    std::vector<std::optional<FrameResult>> results;
    for (int i = 0; i < kImages; ++i) {
      const BagFrame frame = bag_->frame(i);
      const ImageStamp at = imageStampOf(frame.image->header);
      now = frame.image->header.stamp;
      node.tracker().applyModels();
      if (i == 0) {
        const Pose T_C_U = *bag_->initialPose(at.camera_frame, now, settings_.start_max_age_s);
        node.tracker().offer({T_C_U, at.camera_frame, at.stamp_ns, false, {}});
      }
      const std::uint32_t clock_jumps = node.tracker().readClock();
      EXPECT_FALSE(node.refusal(*frame.image, *frame.info));
      results.push_back(node.process({frame.image, frame.info, ros::WallTime::now(), clock_jumps}));
    }
    return results;
  }

  static std::shared_ptr<Backend> backend_;
  static std::shared_ptr<const Field> field_;
  std::unique_ptr<BagSequence> bag_;
  BagEvaluationSettings settings_;
};

std::shared_ptr<Backend> SamePosesTest::backend_;
std::shared_ptr<const Field> SamePosesTest::field_;

TEST_F(SamePosesTest, OfTheNodeAndOfEvaluateBag) {
  settings_.rules.trust_score = settings_.rules.min_score = 0;  // of a model that knows little
  const auto evaluated =
      BagEvaluation(*bag_, backend_, field_, settings_).run({}, CancellationToken()).frames;
  const auto published = trackedByTheNode();
  ASSERT_EQ(evaluated.size(), published.size());
  for (std::size_t i = 0; i < evaluated.size(); ++i) {
    ASSERT_TRUE(published[i] && published[i]->pose) << i;
    EXPECT_TRUE(evaluated[i].trusted) << i;
    EXPECT_EQ(evaluated[i].from_last, i > 0) << i;
    EXPECT_EQ(evaluated[i].T_C_U.R, published[i]->track.T_C_O_m.R) << i;
    EXPECT_EQ(evaluated[i].T_C_U.t, published[i]->track.T_C_O_m.t) << i;
    EXPECT_EQ(evaluated[i].score, published[i]->track.score) << i;
    EXPECT_EQ(toMessage(evaluated[i].T_C_U), published[i]->pose->pose.pose) << i;
  }
}

// Looked for around the initial pose, image after image, as widely as from the first one on.
TEST_F(SamePosesTest, WhileTheObjectIsLost) {
  settings_.rules.trust_score = settings_.rules.min_score = 1;  // nothing is trusted
  const auto evaluated =
      BagEvaluation(*bag_, backend_, field_, settings_).run({}, CancellationToken()).frames;
  const auto found = trackedByTheNode();
  ASSERT_EQ(evaluated.size(), found.size());
  for (std::size_t i = 0; i < evaluated.size(); ++i) {
    ASSERT_TRUE(found[i]) << i;
    EXPECT_FALSE(evaluated[i].trusted || found[i]->pose) << i;
    EXPECT_EQ(evaluated[i].outcome == "refined", found[i]->track.found) << i;
    EXPECT_EQ(evaluated[i].T_C_U.R, found[i]->track.T_C_O_m.R) << i;
    EXPECT_EQ(evaluated[i].T_C_U.t, found[i]->track.T_C_O_m.t) << i;
  }
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::Time::init();
  return RUN_ALL_TESTS();
}
