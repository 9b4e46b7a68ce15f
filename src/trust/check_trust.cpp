// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/check_trust.h"

#include "trust/mask_agreement.h"

namespace nerf_pose_refiner {

TrustVerdict checkTrust(const Refinement& refinement, double least_score) {
  switch (refinement.outcome) {
    case Outcome::kNoOverlap:
      return TrustVerdict::kNoOverlap;
    case Outcome::kDiverged:
      return TrustVerdict::kDiverged;
    case Outcome::kCancelled:
      return TrustVerdict::kCancelled;
    case Outcome::kRefined:
      break;
  }
  if (!(refinement.score >= least_score)) return TrustVerdict::kLowScore;
  const std::optional<double>& agreement = refinement.mask_agreement;
  return agreement && *agreement < kLeastMaskAgreement ? TrustVerdict::kBadMask
                                                       : TrustVerdict::kTrusted;
}

}  // namespace nerf_pose_refiner
