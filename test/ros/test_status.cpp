// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/status.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <regex>
#include <set>
#include <string>

namespace nerf_pose_refiner {
namespace {

/// Values of the message's constants with this prefix.
std::set<int> constants(const std::string& prefix) {
  const std::string definition = ros::message_traits::definition<RefinementStatus>();
  const std::regex line("uint8 " + prefix + "\\w+ *= *(\\d+)");
  std::set<int> values;
  for (auto match = std::sregex_iterator(definition.begin(), definition.end(), line);
       match != std::sregex_iterator(); ++match) {
    values.insert(std::stoi((*match)[1]));
  }
  return values;
}

/// Messages of all values of an enum. @param last its last value.
template <typename Enum>
std::multiset<int> messagesUpTo(Enum last) {
  std::multiset<int> messages;
  for (int value = 0; value <= static_cast<int>(last); ++value) {
    messages.insert(toMessage(static_cast<Enum>(value)));
  }
  return messages;
}

TEST(Status, HasOneConstantForEachStateAndReason) {
  const auto states = messagesUpTo(TrackState::kError);
  const auto reasons = messagesUpTo(TrackReason::kDisabled);
  EXPECT_EQ(constants("STATE_").size(), 7u);
  EXPECT_EQ(constants("REASON_").size(), 24u);
  const std::set<int> state_constants = constants("STATE_"),
                      reason_constants = constants("REASON_");
  EXPECT_EQ(states, std::multiset<int>(state_constants.begin(), state_constants.end()));
  EXPECT_EQ(reasons, std::multiset<int>(reason_constants.begin(), reason_constants.end()));
}

TEST(Status, SaysTheSameAsTheTracker) {
  EXPECT_EQ(int{toMessage(TrackState::kNoModel)}, int{RefinementStatus::STATE_NO_MODEL});
  EXPECT_EQ(int{toMessage(TrackState::kTracking)}, int{RefinementStatus::STATE_TRACKING});
  EXPECT_EQ(int{toMessage(TrackState::kLost)}, int{RefinementStatus::STATE_LOST});
  EXPECT_EQ(int{toMessage(TrackReason::kCancelled)}, int{RefinementStatus::REASON_STOPPED});
  EXPECT_EQ(int{toMessage(TrackReason::kPriorTooOld)}, int{RefinementStatus::REASON_PRIOR_TOO_OLD});
  EXPECT_EQ(int{toMessage(TrackReason::kBadMask)}, int{RefinementStatus::REASON_BAD_MASK});
  EXPECT_EQ(int{toMessage(TrackReason::kInternal)}, int{RefinementStatus::REASON_INTERNAL});
  const ModelError unreadable(ModelError::Reason::kUnreadable, ""),
      no_scale(ModelError::Reason::kNoScale, "");
  EXPECT_EQ(reasonOf(unreadable), TrackReason::kModelUnreadable);
  EXPECT_EQ(reasonOf(no_scale), TrackReason::kModelNoScale);
}

TEST(Status, CarriesWhatTheTrackerSays) {
  TrackStatus status;
  status.state = TrackState::kLost;
  status.reason = TrackReason::kLowScore;
  status.message = "why";
  status.image = {"camera", 1700000003000000007};
  status.object = "mug";
  status.processed = 5;
  const RefinementStatus message = toMessage(status);
  EXPECT_EQ(int{message.state}, int{RefinementStatus::STATE_LOST});
  EXPECT_EQ(int{message.reason}, int{RefinementStatus::REASON_LOW_SCORE});
  EXPECT_EQ(message.message, "why");
  EXPECT_EQ(message.header.frame_id, "camera");
  EXPECT_EQ(message.header.stamp, ros::Time(1700000003, 7));
  EXPECT_EQ(message.object, "mug");
  EXPECT_EQ(message.processed, 5u);
}

TEST(Status, StampsGoThereAndBack) {
  const ros::Time latest(4294967295u, 999999999u);
  EXPECT_EQ(toTime(toNanoseconds(latest)), latest);
  EXPECT_EQ(toNanoseconds(ros::Time(2, 3)), 2000000003);
  std_msgs::Header header;
  header.frame_id = "/camera";
  header.stamp = ros::Time(1, 2);
  EXPECT_EQ(imageStampOf(header).camera_frame, "camera");
  EXPECT_EQ(imageStampOf(header).stamp_ns, 1000000002);
}

}  // namespace
}  // namespace nerf_pose_refiner
