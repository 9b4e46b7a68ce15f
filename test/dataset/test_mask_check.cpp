// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/mask_check.h"

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

/// How masks are turned over.
struct Turning {
  bool x = false, y = false;
};

/// A bright object low on the left before a mottled background, and its mask.
PosedView someView(int shift, Turning turning) {
  auto image = std::make_shared<Image8>(64, 48, 4, 255);
  const auto onObject = [shift](int x, int y) {
    return x >= 5 && x < 25 && y >= 20 + shift && y < 44;
  };
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const int background = 60 + (x * 7 + y * 13 + shift * 5) % 20;
      for (int c = 0; c < 3; ++c) {
        image->at(x, y, c) = static_cast<std::uint8_t>(onObject(x, y) ? 220 : background);
      }
      const bool inside = onObject(turning.x ? 63 - x : x, turning.y ? 47 - y : y);
      image->at(x, y, 3) = inside ? 255 : 0;
    }
  }
  PosedView view;
  view.rgba = image;
  return view;
}

std::vector<PosedView> views(int count, Turning turning) {
  std::vector<PosedView> result;
  for (int i = 0; i < count; ++i) result.push_back(someView(i, turning));
  return result;
}

TEST(MaskCheck, MasksThatFit) { EXPECT_NO_THROW(requireMasksNotMirrored(views(6, {}))); }

TEST(MaskCheck, MasksThatAreTurnedOver) {
  const auto refused = [](Turning turning, const std::string& how) {
    expectError<std::runtime_error>([&] { requireMasksNotMirrored(views(6, turning)); }, how);
  };
  refused({true, false}, "left and right exchanged");
  refused({false, true}, "upside down, mirrored");
  refused({true, true}, "half a turn");
}

TEST(MaskCheck, AFewOddOnesAreNoReason) {
  std::vector<PosedView> mixed = views(6, {});
  mixed[2] = someView(2, {true, false});
  mixed[4] = someView(4, {true, false});
  EXPECT_NO_THROW(requireMasksNotMirrored(mixed));
  EXPECT_NO_THROW(requireMasksNotMirrored(views(4, {true, false}))) << "too few to tell";
}

TEST(MaskCheck, MasksThatHaveNoRim) {
  std::vector<PosedView> whole;
  for (int i = 0; i < 6; ++i) {
    PosedView view;
    view.rgba = std::make_shared<Image8>(8, 6, 4, 255);
    whole.push_back(view);
  }
  EXPECT_NO_THROW(requireMasksNotMirrored(whole));
}

}  // namespace
}  // namespace nerf_pose_refiner
