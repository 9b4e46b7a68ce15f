// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/template_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kScoredRows = 5, kRuns = 2, kScoredColumns = kRuns * kScoreRun;
constexpr int kRowStep = kScoredColumns + 100;

/// A memory of responses, and edges whose places are drawn.
struct Drawn {
  std::vector<std::uint8_t> responses;
  std::vector<std::int32_t> offsets;

  explicit Drawn(int per_part) {
    for (std::uint64_t i = 0; i < 8 * kRowStep; ++i) {
      responses.push_back(static_cast<std::uint8_t>(randomIndex(1, 0, i, kMaxResponse + 1)));
    }
    for (int i = 0; i < kTemplateParts * per_part; ++i) {
      offsets.push_back(static_cast<std::int32_t>(randomIndex(1, 1, i, 2 * kRowStep)));
    }
  }

  std::vector<std::int16_t> scores(const TemplateKernels& kernels) const {
    std::vector<std::int16_t> scores(kScoredRows * kScoredColumns, -1);
    const int per_part = static_cast<int>(offsets.size()) / kTemplateParts;
    kernels.score({responses.data(), kRowStep, kScoredRows, kRuns}, {offsets.data(), per_part},
                  scores.data());
    return scores;
  }

  int expected(int column, int row) const {
    const std::size_t per_part = offsets.size() / kTemplateParts;
    int sum = 0, least = 1 << 20;
    for (int part = 0; part < kTemplateParts; ++part) {
      int of_part = 0;
      for (std::size_t e = 0; e < per_part; ++e) {
        of_part += responses[row * kRowStep + column + offsets[part * per_part + e]];
      }
      sum += of_part;
      least = std::min(least, of_part);
    }
    return sum - least;
  }
};

TEST(TemplateKernels, AddResponsesAndLeaveTheWorstPartOut) {
  for (const int per_part : {16, 32, 64}) {
    const Drawn drawn(per_part);
    const std::vector<std::int16_t> scores = drawn.scores(*baselineTemplateKernels());
    for (int row = 0; row < kScoredRows; ++row) {
      for (int column = 0; column < kScoredColumns; ++column) {
        ASSERT_EQ(scores[row * kScoredColumns + column], drawn.expected(column, row));
      }
    }
  }
}

TEST(TemplateKernels, HoldTheLargestSums) {
  Drawn drawn(512);
  std::fill(drawn.responses.begin(), drawn.responses.end(), kMaxResponse);
  for (const std::int16_t score : drawn.scores(*baselineTemplateKernels())) {
    ASSERT_EQ(score, 3 * 512 * kMaxResponse);
  }
}

TEST(TemplateKernels, AreTheSameForAllInstructionSets) {
  for (const int per_part : {16, 32, 64}) {
    const Drawn drawn(per_part);
    EXPECT_EQ(drawn.scores(selectTemplateKernels("auto")),
              drawn.scores(selectTemplateKernels("baseline")));
  }
  EXPECT_THROW(selectTemplateKernels("abacus"), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
