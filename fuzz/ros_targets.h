// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace nerf_pose_refiner {

/// What messages go through before they are used, fed with any bytes (@see MessageBytes).
void fuzzCameraMessages(const std::uint8_t* data, std::size_t size);  ///< camera_info, image, masks
void fuzzDetections(const std::uint8_t* data, std::size_t size);      ///< boxes of a 2-D detector
void fuzzInitialPose(const std::uint8_t* data, std::size_t size);
void fuzzBag(const std::uint8_t* data, std::size_t size);  ///< any messages in a bag

}  // namespace nerf_pose_refiner
