// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "backend/loaded_field.h"
#include "dataset/dataset.h"

namespace nerf_pose_refiner {

/// Photos of different exposure or white balance show one surface in different colours. A model
/// learned from all of them shows the average; so each photo is compared with it.

/// What makes the colours of a photo those of the model: gain * colour + bias, of each channel
/// (sRGB-encoded, 0..1). A change of exposure or white balance is a gain, but for the darkest
/// colours; the bias takes those, and stray light.
struct PhotoGain {
  Eigen::Array3d gain = Eigen::Array3d::Ones();
  Eigen::Array3d bias = Eigen::Array3d::Zero();

  Eigen::Array3d operator()(const Eigen::Array3d& colour) const { return gain * colour + bias; }
};

/// The gain of each view against a rendering of the model at its pose, at a low resolution. Robust:
/// what is wrong in the model, or moved, counts little. Views that show too little of the object
/// (or are clipped there) have none, which is the identity.
/// @param threads 0: all cores.
/// @return of all views in order, relative to the median view, whose colours stay as they are.
/// @throws Cancelled.
std::vector<PhotoGain> photoGains(const LoadedField& field, const std::vector<PosedView>& views,
                                  int threads, const CancellationToken& cancellation);

/// How much the views differ: root of the mean square of the logarithm by which a mean grey
/// changes, in the channel where that is largest. 0.03 is a tenth of an aperture stop.
double gainSpread(const std::vector<PhotoGain>& gains);

/// First `first`, then `second`.
PhotoGain combined(const PhotoGain& first, const PhotoGain& second);

/// The views with their colours changed, rounded and clipped to bytes; alpha stays.
/// @param gains one for each view. @param threads 0: all cores.
std::vector<PosedView> withGains(const std::vector<PosedView>& views,
                                 const std::vector<PhotoGain>& gains, int threads);

}  // namespace nerf_pose_refiner
