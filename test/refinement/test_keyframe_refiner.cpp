// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/keyframe_refiner.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "evaluation/clutter.h"
#include "evaluation/pose_error.h"
#include "math/angle.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/gated_field.h"
#include "support/scene_before_clutter.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::int64_t kFrame_ns = 33000000;
const Camera kCamera = {320, 240, 400, 400, 159.5, 119.5};

class KeyframeRefinerTest : public testing::Test {
 protected:
  const FieldMetadata& object() const { return field_->field().metadata; }

  // The camera goes around the object.
  Pose truthAt(int frame) const { return cameraAround(*field_, 0.5 + 0.03 * frame, 0.4); }

  Observation imageAt(const Pose& T_O_C) const {
    return sceneBeforeClutter(*scene_, kCamera, T_O_C);
  }

  Prior priorAt(const Pose& T_O_C, double deg, double fraction) const {
    Prior prior;
    prior.T_O_C = T_O_C;
    prior.rotation_rad = deg * kDegree;
    prior.translation = fraction;
    return prior;
  }

  Pose offBy(const Pose& T_O_C, double deg, double fraction) const {
    const Eigen::Vector3d direction = Eigen::Vector3d(0.6, -0.5, 0.6);
    const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(deg * kDegree * direction));
    const Eigen::Vector3d shift = fraction * object().diameter * direction;
    return {turn * T_O_C.R, object().centre + shift + turn * (T_O_C.t - object().centre)};
  }

  void expectFound(const Refinement& found, const Pose& truth, double deg) const {
    ASSERT_EQ(found.outcome, Outcome::kRefined);
    const PoseError error = poseError(found.T_O_C, truth, object().centre, kCamera);
    EXPECT_LT(error.rotation_rad / kDegree, deg);
    EXPECT_LT(error.object_offset / object().diameter, 0.01 * deg);
  }

  // What is found in a sequence.
  std::vector<Refinement> follow(KeyframeRefiner* refiner, int frames) const {
    std::vector<Refinement> found;
    Pose last = truthAt(0);
    for (int i = 0; i < frames; ++i) {
      const Observation observation = imageAt(truthAt(i));
      found.push_back(refiner->follow({observation, i * kFrame_ns}, priorAt(last, 5, 0.05)));
      last = found.back().T_O_C;
    }
    return found;
  }

  std::vector<Pose> track(KeyframeRefiner* refiner, int frames) const {
    std::vector<Pose> poses;
    for (const Refinement& found : follow(refiner, frames)) poses.push_back(found.T_O_C);
    return poses;
  }

  KeyframeSearchSettings fromFile() const {
    KeyframeSearchSettings settings;
    settings.real_time = false;
    return settings;
  }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  std::shared_ptr<GatedField> field_ = std::make_shared<GatedField>(scene_);
  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
};

TEST_F(KeyframeRefinerTest, FollowsACameraAroundTheObject) {
  renderKeyframe(*field_, {kCamera, truthAt(0)});
  const int of_keyframe = field_->arrived();  // it is rendered in strips
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  const std::vector<Pose> poses = track(&refiner, 20);
  for (int i = 0; i < 20; ++i) {
    SCOPED_TRACE(i);
    const PoseError error = poseError(poses[i], truthAt(i), object().centre, kCamera);
    EXPECT_LT(error.rotation_rad / kDegree, 0.3);
    EXPECT_LT(error.object_offset / object().diameter, 0.005);
  }
  EXPECT_GT(field_->arrived(), 3 * of_keyframe);   // renewed on the way
  EXPECT_LT(field_->arrived(), 11 * of_keyframe);  // but not for every image
}

TEST_F(KeyframeRefinerTest, SameImagesSamePoses) {
  KeyframeRefiner one(backend_.get(), field_, fromFile());
  KeyframeRefiner other(backend_.get(), field_, fromFile());
  const std::vector<Pose> a = track(&one, 12), b = track(&other, 12);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].R, b[i].R);
    EXPECT_EQ(a[i].t, b[i].t);
  }
}

// What is aligned beside tracking has its say in the same image each time.
TEST_F(KeyframeRefinerTest, SameImagesSameScores) {
  KeyframeRefiner one(backend_.get(), field_, fromFile());
  KeyframeRefiner other(backend_.get(), field_, fromFile());
  const std::vector<Refinement> a = follow(&one, 25), b = follow(&other, 25);
  for (std::size_t i = 0; i < a.size(); ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(a[i].score, b[i].score);
    EXPECT_EQ(a[i].found_probability, b[i].found_probability);
    EXPECT_EQ(a[i].rolled_score, b[i].rolled_score);
  }
  EXPECT_TRUE(a.back().rolled_score);
}

TEST_F(KeyframeRefinerTest, FindsAgainWhatComesBackAndRendersNothingBeforeThat) {
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  track(&refiner, 3);
  const Prior last = priorAt(truthAt(2), 15, 0.15);
  Observation gone = imageAt(truthAt(2));
  gone.image = clutter(kCamera.width, kCamera.height, 5);
  EXPECT_LT(refiner.findAgain({gone, 4 * kFrame_ns}, last).score, 0.1);  // makes small views
  const int before = field_->arrived();
  for (int i = 5; i < 9; ++i) {
    EXPECT_LT(refiner.findAgain({gone, i * kFrame_ns}, last).score, 0.1);
  }
  EXPECT_EQ(field_->arrived(), before);
  const Pose back = offBy(truthAt(2), 10, 0.1);
  expectFound(refiner.findAgain({imageAt(back), 9 * kFrame_ns}, last), back, 0.5);
}

TEST_F(KeyframeRefinerTest, FindsAgainWhereNoKeyframeReaches) {
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  track(&refiner, 3);
  const Pose back = offBy(truthAt(2), 40, 0.05);
  Refinement found;
  for (int i = 4; i < 12 && !(found.score > 0.9); ++i) {
    found = refiner.findAgain({imageAt(back), i * kFrame_ns}, priorAt(truthAt(2), 45, 0.1));
  }
  expectFound(found, back, 0.5);
  EXPECT_GT(found.score, 0.9);
}

TEST_F(KeyframeRefinerTest, NoImageWaitsForAKeyframeThatIsLate) {
  KeyframeRefiner refiner(backend_.get(), field_, KeyframeSearchSettings());
  const Observation first = imageAt(truthAt(0));
  refiner.follow({first, 0}, priorAt(truthAt(0), 5, 0.05));
  const int rendered = field_->arrived();
  field_->close();
  Pose last = truthAt(0);
  for (int i = 1; i < 12; ++i) {  // far enough to ask for a keyframe, which never comes
    const Observation observation = imageAt(truthAt(i));
    const Refinement found = refiner.follow({observation, i * kFrame_ns}, priorAt(last, 5, 0.05));
    expectFound(found, truthAt(i), 0.6);
    last = found.T_O_C;
  }
  EXPECT_EQ(field_->arrived(), rendered + 1);
  field_->open();
}

TEST_F(KeyframeRefinerTest, FindsAnObjectInAWidePrior) {
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  const Pose truth = truthAt(0);
  const Observation observation = imageAt(truth);
  const Refinement found =
      refiner.find({observation, 0}, priorAt(offBy(truth, 15, 0.12), 15, 0.15));
  expectFound(found, truth, 0.3);
  EXPECT_GT(found.score, 0.5);
}

TEST_F(KeyframeRefinerTest, GoesOnWithMoreStartsWhereNothingIsClear) {
  KeyframeSearchSettings once = fromFile(), further = fromFile();
  once.starts = further.starts = 1;  // the prior itself: too far off
  once.starts_further = 1;
  KeyframeRefiner without(backend_.get(), field_, once), with(backend_.get(), field_, further);
  const Observation observation = imageAt(truthAt(0));
  const Prior prior = priorAt(offBy(truthAt(0), 60, 0.3), 45, 0.3);
  EXPECT_LT(without.find({observation, 0}, prior).score, 0.5);
  expectFound(with.find({observation, 0}, prior), truthAt(0), 0.5);
}

TEST_F(KeyframeRefinerTest, SearchesMoreWidelyWhereAPoseIsDoubtful) {
  KeyframeSearchSettings narrow = fromFile(), wide = fromFile();
  narrow.wide_starts = 0;
  KeyframeRefiner with(backend_.get(), field_, wide), without(backend_.get(), field_, narrow);
  const Observation observation = imageAt(truthAt(0));
  const Prior jerk = priorAt(offBy(truthAt(0), 20, 0.19), 8, 0.08);
  expectFound(with.follow({observation, 0}, jerk), truthAt(0), 1);
  EXPECT_LT(without.follow({observation, 0}, jerk).score, 0.5);
}

/// An image in which clutter shows through the object, so that wrong poses score nearly as well.
Observation faint(const Observation& image, float share) {
  Observation observation = image;
  const Image behind = clutter(kCamera.width, kCamera.height, 7);
  for (std::size_t i = 0; i < behind.values.size(); ++i) {
    float& value = observation.image.values[i];
    value = share * value + (1 - share) * behind.values[i];
  }
  return observation;
}

TEST_F(KeyframeRefinerTest, ATrackIsBelievedThroughDoubtfulImagesForAWhile) {
  const Observation clear = imageAt(truthAt(0)), doubtful = faint(clear, 0.44f);
  const Prior near = priorAt(truthAt(0), 5, 0.05);
  KeyframeRefiner tracked(backend_.get(), field_, fromFile());
  const Refinement certain = tracked.follow({clear, 0}, near);
  ASSERT_GT(*certain.found_probability, 0.9) << "by the image alone";
  KeyframeRefiner begun(backend_.get(), field_, fromFile());
  std::vector<double> believed, alone;
  for (int i = 1; i <= 60; ++i) {
    const TimedObservation image = {doubtful, i * kFrame_ns};
    believed.push_back(*tracked.follow(image, near).found_probability);
    alone.push_back(*begun.follow(image, near).found_probability);
  }
  constexpr int kCompared = RolledScores::kRolls;  // with all wrong poses that are tried
  EXPECT_LT(alone.back(), 0.4) << "without a track";
  EXPECT_GT(believed[kCompared], 0.8);
  EXPECT_LT(believed.back(), 0.6) << "images that are alike do not keep it for ever";
  EXPECT_TRUE(std::is_sorted(believed.rbegin(), believed.rend() - kCompared));
}

TEST_F(KeyframeRefinerTest, SettlesOnTheRightOneOfRoughPoses) {
  const Pose truth = truthAt(0);
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  const Observation observation = imageAt(truth);
  const Refinement found =
      refiner.settle({observation, 0}, {cameraAround(*field_, 2, 0.4), offBy(truth, 3, 0.02)}, {});
  expectFound(found, truth, 0.5);
  EXPECT_GT(found.score, 0.9);
}

TEST_F(KeyframeRefinerTest, GivesUpPosesThatExplainTooLittle) {
  const Pose rough = truthAt(0);
  Observation empty = imageAt(rough);
  empty.image = clutter(kCamera.width, kCamera.height, 7);
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  const auto outcome = [&](double odds, double least_probability) {
    const auto always = [odds](const Pose&) { return odds; };
    return refiner.settle({empty, 0}, {rough}, always, {}, least_probability).outcome;
  };
  EXPECT_EQ(outcome(1, 0), Outcome::kRefined);
  EXPECT_EQ(outcome(1, 0.1), Outcome::kDiverged);
  EXPECT_EQ(outcome(1e6, 0.1), Outcome::kRefined) << "what speaks for it beside the image keeps it";
}

TEST_F(KeyframeRefinerTest, WhatElseIsSeenOfAPoseChangesItsOdds) {
  const Pose truth = truthAt(0);
  const Observation observation = imageAt(truth);
  const auto settledWith = [&](double odds) {
    KeyframeRefiner refiner(backend_.get(), field_, fromFile());
    return refiner.settle({observation, 0}, {truth}, [&](const Pose&) { return odds; });
  };
  const Refinement even = settledWith(1), unlikely = settledWith(1e-3);
  ASSERT_TRUE(even.found_probability && unlikely.found_probability);
  const double probability = *even.found_probability;
  EXPECT_NEAR(*unlikely.found_probability,
              probability * 1e-3 / (probability * 1e-3 + 1 - probability), 1e-9);
  EXPECT_NEAR(unlikely.score / even.score, *unlikely.found_probability / probability, 1e-9);
}

TEST_F(KeyframeRefinerTest, SaysThatTheObjectIsNotThere) {
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  Observation empty = imageAt(truthAt(0));
  empty.image = clutter(kCamera.width, kCamera.height, 7);
  const Refinement found = refiner.follow({empty, 0}, priorAt(truthAt(0), 5, 0.05));
  EXPECT_LT(found.score, 0.2);
  Pose beside = truthAt(0);
  beside.t += 5 * beside.R.col(0);
  EXPECT_EQ(refiner.follow({empty, 1}, priorAt(beside, 5, 0.05)).outcome, Outcome::kNoOverlap);
}

TEST_F(KeyframeRefinerTest, RefusesACameraThatCannotShowTheObjectAndGoesOnAfterIt) {
  const Pose truth = truthAt(0);
  const Observation usual = imageAt(truth);
  for (const double factor : {1e9, 1e200, 1e3, 1e-3, 1e-9}) {
    SCOPED_TRACE(factor);
    Observation unusual = usual;
    unusual.camera.fx *= factor;
    unusual.camera.fy *= factor;
    KeyframeRefiner refiner(backend_.get(), field_, fromFile());
    const int rendered = field_->arrived();
    // (What is smaller than a pixel overlaps none.)
    EXPECT_EQ(refiner.follow({unusual, 0}, priorAt(truth, 5, 0.05)).outcome,
              factor > 1 ? Outcome::kBadSize : Outcome::kNoOverlap);
    EXPECT_EQ(field_->arrived(), rendered);  // no keyframe of it
    expectFound(refiner.follow({usual, kFrame_ns}, priorAt(truth, 5, 0.05)), truth, 0.5);
    const Refinement between = refiner.follow({unusual, 2 * kFrame_ns}, priorAt(truth, 5, 0.05));
    EXPECT_FALSE(between.outcome == Outcome::kRefined && between.score > 0.5);
    const Refinement after =
        refiner.follow({imageAt(truthAt(6)), 3 * kFrame_ns}, priorAt(truthAt(6), 5, 0.05));
    expectFound(after, truthAt(6), 0.5);
  }
}

TEST_F(KeyframeRefinerTest, AnObjectThatComesTooNearForANewKeyframeIsNoError) {
  // Keyframes need 0.6 diameters of distance: where the motion leads nearer, the last one stays.
  const auto at = [&](double distance) {
    Pose pose = truthAt(0);
    const Eigen::Vector3d sight = (pose.t - object().centre).normalized();
    pose.t = object().centre + distance * object().diameter * sight;
    return pose;
  };
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  std::int64_t stamp_ns = 0;
  for (const double distance :
       {0.90, 0.85, 0.80, 0.75, 0.70, 0.65, 0.62, 0.61, 0.605, 0.603, 0.602}) {
    SCOPED_TRACE(distance);
    const Observation observation = imageAt(at(distance));
    const Refinement found =
        refiner.follow({observation, stamp_ns += kFrame_ns}, priorAt(at(distance), 5, 0.05));
    EXPECT_NE(found.outcome, Outcome::kBadSize);
    if (distance > 0.78) expectFound(found, at(distance), 1);
  }
}

TEST_F(KeyframeRefinerTest, APriorFarOutsideOfTheImageIsSearchedWithoutHarm) {
  KeyframeSearch search(backend_.get(), field_, fromFile());
  const Observation observation = imageAt(truthAt(0));
  for (const double away : {5.0, 1e2, 1e4}) {
    Pose beside = truthAt(0);
    beside.t += away * beside.R.col(0);
    const HypothesisTable candidates =
        search.around(observation, priorAt(beside, 15, 0.15), {}, {});
    search.add(std::make_shared<const KeyframePoints>(renderKeyframe(*field_, {kCamera, beside})));
    for (const Hypothesis& found : search.from(observation, candidates, {})) {
      EXPECT_NE(found.state, HypothesisState::kLive) << away;
    }
  }
}

TEST_F(KeyframeRefinerTest, AnObjectTooFarToBeSeenIsNotFound) {
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  const Observation observation = imageAt(truthAt(0));
  for (const double distance : {60.0, 1e3, 1e6}) {  // [diameters]
    const Prior prior = priorAt(cameraAround(*field_, 0.5, 0.4, distance), 15, 0.15);
    EXPECT_LT(refiner.find({observation, 0}, prior).score, 0.2) << distance;
    EXPECT_LT(refiner.follow({observation, 0}, prior).score, 0.2) << distance;
  }
}

// So near that a patch of the object fills the image, which something in the background may
// resemble: none of them may be believed.
TEST_F(KeyframeRefinerTest, AnObjectTooNearToBeSeenIsNotBelieved) {
  constexpr double kTrusted = 0.9, kGoesOn = 0.5;  // of a first pose, and of one that is tracked
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  const Observation observation = imageAt(truthAt(0));
  for (int side = 0; side < 6; ++side) {
    const Prior prior = priorAt(cameraAround(*field_, 0.5 + side, 0.4, 0.7), 15, 0.15);
    EXPECT_LT(refiner.find({observation, 0}, prior).score, kTrusted) << side;
    EXPECT_LT(refiner.follow({observation, 0}, prior).score, kGoesOn) << side;
  }
}

TEST_F(KeyframeRefinerTest, APriorThatIsRightIsFoundWithoutSmallViews) {
  KeyframeSearchSettings settings = fromFile();
  settings.bank.views = 12;  // none is as near as this:
  settings.reach_rotation_deg = settings.renew_rotation_deg;
  KeyframeRefiner refiner(backend_.get(), field_, settings);
  const Prior prior = priorAt(offBy(truthAt(0), 2, 0.02), 15, 0.15);
  expectFound(refiner.find({imageAt(truthAt(0)), 0}, prior), truthAt(0), 0.5);
}

TEST_F(KeyframeRefinerTest, CanBeCancelled) {
  KeyframeRefiner refiner(backend_.get(), field_, fromFile());
  const Observation observation = imageAt(truthAt(0));
  CancellationToken cancellation;
  cancellation.requestCancel();
  const Prior prior = priorAt(truthAt(0), 5, 0.05);
  EXPECT_EQ(refiner.follow({observation, 0}, prior, cancellation).outcome, Outcome::kCancelled);
  EXPECT_EQ(refiner.find({observation, 0}, prior, cancellation).outcome, Outcome::kCancelled);
  expectFound(refiner.follow({observation, 1}, prior), truthAt(0), 0.3);
}

TEST_F(KeyframeRefinerTest, RefusesSettingsOutOfRange) {
  KeyframeSearchSettings settings;
  settings.max_keyframes = 0;
  EXPECT_THROW(KeyframeRefiner(backend_.get(), field_, settings), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
