// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/mask_agreement.h"

#include <gtest/gtest.h>

#include <functional>

#include "backend/loaded_field.h"
#include "support/analytic_scene.h"
#include "trust/check_trust.h"

namespace nerf_pose_refiner {
namespace {

class MaskAgreement : public testing::Test {
 protected:
  /// Of the scene's own mask, changed pixel by pixel.
  double after(const std::function<float(const Image& mask, int x, int y)>& change) const {
    const Camera camera = {160, 120, 200, 200, 79.5, 59.5};
    const Pose T_O_C = cameraAround(*scene_, 0.6, 0.5);
    Observation observation = observeScene(*scene_, camera, T_O_C);
    observation.background = Background::kMask;
    const Image mask = observation.alpha;
    for (int y = 0; y < mask.height; ++y) {
      for (int x = 0; x < mask.width; ++x) observation.alpha.at(x, y, 0) = change(mask, x, y);
    }
    return maskAgreement(*scene_, observation, T_O_C, {});
  }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene();
};

TEST_F(MaskAgreement, IsWholeForTheTrueMask) {
  EXPECT_GT(after([](const Image& mask, int x, int y) { return mask.at(x, y, 0); }), 0.9);
}

TEST_F(MaskAgreement, IsNoneForAnEmptyOne) {
  EXPECT_EQ(after([](const Image&, int, int) { return 0.0f; }), 0);
}

TEST_F(MaskAgreement, IsLowForAnInvertedOne) {
  EXPECT_LT(after([](const Image& mask, int x, int y) { return 1 - mask.at(x, y, 0); }), 0.1);
}

TEST_F(MaskAgreement, IsLowForOneBesideTheObject) {
  const auto beside = [](const Image& mask, int x, int y) {
    return x >= 60 ? mask.at(x - 60, y, 0) : 0.0f;
  };
  EXPECT_LT(after(beside), kMinMaskAgreement);
}

TEST_F(MaskAgreement, IsThePartThatAMaskLeaves) {
  int whole = 0, left = 0;
  const double agreement = after([&](const Image& mask, int x, int y) {
    const float value = mask.at(x, y, 0);
    whole += value > 0.5f;
    left += value > 0.5f && x < 80;
    return x < 80 ? value : 0;
  });
  EXPECT_NEAR(agreement, static_cast<double>(left) / whole, 0.05);
}

TEST_F(MaskAgreement, ALowOneIsNotTrusted) {
  Refinement refinement;
  refinement.outcome = Outcome::kRefined;
  refinement.score = 1;
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kTrusted);
  refinement.mask_agreement = 0.9 * kMinMaskAgreement;
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kBadMask);
  refinement.mask_agreement = 1.1 * kMinMaskAgreement;
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kTrusted);
}

}  // namespace
}  // namespace nerf_pose_refiner
