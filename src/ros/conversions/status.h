// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RefinementStatus.h>
#include <ros/time.h>
#include <std_msgs/Header.h>

#include <cstdint>
#include <string>

#include "nerf_pose_refiner/depth.h"
#include "runtime/object_store.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {

/// RefinementStatus::STATE_* and REASON_*, one for each.
std::uint8_t toMessage(TrackState state);
std::uint8_t toMessage(TrackReason reason);

TrackReason reasonOf(const ModelError& error);

std::int64_t toNanoseconds(const ros::Time& time);
ros::Time toTime(std::int64_t stamp_ns);

/// Camera and time in the header of an image, with the frame as TF2 names it.
ImageStamp imageStampOf(const std_msgs::Header& header);
std_msgs::Header toHeader(const ImageStamp& image);

/// Fields that the tracker does not know are zero: latency, age, dropped images.
RefinementStatus toMessage(const TrackStatus& status);

/// Fills in what became of an image's depth. @param why_none why it never reached the refinement.
void depthToMessage(const DepthReport& depth, const std::string& why_none,
                    RefinementStatus* message);

}  // namespace nerf_pose_refiner
