// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"

namespace nerf_pose_refiner {

// Numbers of matching templates that both processors keep to.

/// Directions across an edge are told apart modulo 180 degrees, in so many bins: bin b is about
/// 180 b / 8 degrees from the axis x.
constexpr int kOrientations = 8;
/// The bin of places without an edge, behind those of orientations.
constexpr int kFlatBin = kOrientations;
constexpr int kTemplateBins = kOrientations + 1;
/// Stands for the direction across the edge of a feature that is not on one.
constexpr float kNoNormal = 100;
/// Largest response to a feature.
constexpr int kMaxResponse = 15;
/// So many responses add up in eight bits.
constexpr int kFeaturesPerSum = 16;
/// Parts of a template, the worst of which does not count: it may be covered.
constexpr int kTemplateParts = 4;

/// Positions of an image that are scanned: every second one along both axes. Of a tile of them one
/// may be a hit.
constexpr int kScanStride = 2;
constexpr int kTileColumns = 32, kTileRows = 8;
/// Features of a template that count in a scan: every second one.
constexpr int kScanFeatureStep = 2;

/// A hit is fitted in windows of so many pixels to each side: first of neighbouring rotations and
/// distances, then of neighbouring views, then of smaller steps.
NPR_HOST_DEVICE constexpr int fitReach(int round) { return round == 0 ? 5 : round == 1 ? 3 : 2; }

/// A neighbour of a template, in steps from template to template.
struct TemplateStep {
  double rotation, distance;
};

/// Those of the first round.
constexpr int kTurnedAndMoved = 9;
NPR_HOST_DEVICE constexpr TemplateStep turnedAndMoved(int i) {
  return {0.5 * (i / 3 - 1), 0.5 * (i % 3 - 1)};
}

/// Views beside a view, at most: those of the second round.
constexpr int kViewsBeside = 6;

/// Those of the last round.
constexpr int kClose = 4;
NPR_HOST_DEVICE constexpr TemplateStep closeStep(int i) {
  const double step = i % 2 == 0 ? -0.25 : 0.25;
  return i < 2 ? TemplateStep{step, 0} : TemplateStep{0, step};
}

/// The mean response over the features that count, 0..1. @param score their sum. @param features of
/// the template, those that do not count, too.
NPR_HOST_DEVICE inline double meanResponse(int score, int features) {
  constexpr double kCounting = static_cast<double>(kTemplateParts - 1) / kTemplateParts;
  return score / (kCounting * features * kMaxResponse);
}

}  // namespace nerf_pose_refiner
