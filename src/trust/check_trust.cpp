// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/check_trust.h"

#include "trust/mask_agreement.h"

namespace nerf_pose_refiner {

TrustVerdict checkTrust(const Refinement& refinement, double least_score) {
  switch (refinement.outcome) {
    case Outcome::kNoOverlap:
      return TrustVerdict::kNoOverlap;
    case Outcome::kBadSize:
      return TrustVerdict::kBadSize;
    case Outcome::kDiverged:
      return TrustVerdict::kDiverged;
    case Outcome::kCancelled:
      return TrustVerdict::kCancelled;
    case Outcome::kRefined:
      break;
  }
  const std::optional<double>& agreement = refinement.mask_agreement;
  const double found = refinement.found_probability.value_or(refinement.score);
  if (!(found >= least_score)) return TrustVerdict::kLowScore;
  if (agreement && *agreement < kMinMaskAgreement) return TrustVerdict::kBadMask;
  constexpr double kMinUnmistaken = 0.9;
  if (refinement.unmistaken.value_or(1) < kMinUnmistaken) return TrustVerdict::kMistakable;
  return refinement.score >= least_score ? TrustVerdict::kTrusted : TrustVerdict::kUncertain;
}

const char* textOf(TrustVerdict verdict) {
  switch (verdict) {
    case TrustVerdict::kTrusted:
      return "";
    case TrustVerdict::kNoOverlap:
      return "the start pose is outside the image";
    case TrustVerdict::kBadSize:
      return "the object would be far larger than the image, or only a few pixels wide: the camera "
             "is too near or too far, or its focal length is wrong";
    case TrustVerdict::kDiverged:
      return "no hypothesis survived";
    case TrustVerdict::kLowScore:
      return "the pose explains the image badly";
    case TrustVerdict::kUncertain:
      return "the image does not fix the pose well enough";
    case TrustVerdict::kMistakable:
      return "the object looks the same in another pose, as after a turn (see hypotheses)";
    case TrustVerdict::kBadMask:
      return "the mask does not show the object where the image does";
    case TrustVerdict::kCancelled:
      break;
  }
  return "the refinement was interrupted";
}

}  // namespace nerf_pose_refiner
