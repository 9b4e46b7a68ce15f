// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/image_features.h"

namespace nerf_pose_refiner {

/// Of landmarks that are read, the file says the kind: no OpenCV is needed to read them.
FeatureKind bestFeatureKind() { return FeatureKind::kSift; }

}  // namespace nerf_pose_refiner
