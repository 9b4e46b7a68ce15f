// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "backend/backend.h"
#include "backend/template_matcher.h"
#include "cuda_test.h"
#include "evaluation/clutter.h"
#include "math/angle.h"
#include "math/random.h"

// Templates matched on the GPU against the CPU's, with the same images.

namespace nerf_pose_refiner {
namespace {

/// Views of drawn edges and flat places; the third shows nothing.
std::shared_ptr<const TemplateBank> drawnBank(int views, int edges) {
  TemplateBank bank;
  for (int v = 0; v < views; ++v) {
    TemplateView view;
    const auto draw = [&](int i) { return 2 * randomUniform(7, v, i) - 1; };
    const Eigen::Vector3d turn(draw(0), draw(1), draw(2));
    view.R_O_V = Eigen::AngleAxisd(3 * turn.norm(), turn.normalized()).toRotationMatrix();
    for (int e = 0; e < edges && v != 2; ++e) {
      const int i = 3 + 4 * e;
      const float normal_rad = e % 5 == 0 ? kNoNormal : static_cast<float>(kPi) * draw(i + 3);
      view.features.push_back(
          {0.45f * Eigen::Vector3f(draw(i), draw(i + 1), draw(i + 2)), normal_rad});
    }
    bank.views.push_back(view);
  }
  return std::make_shared<const TemplateBank>(bank);
}

TemplateMatchSettings quick() {
  TemplateMatchSettings settings;
  settings.scanned_px = 40;
  settings.fitted_px = 90;
  settings.rotations = 9;
  settings.fitted = 60;
  return settings;
}

class CudaTemplateMatcher : public CudaTest {
 protected:
  struct Both {
    TemplateMatches cpu, cuda;
  };

  /// Of an image of drawn structures.
  Both matchBoth(int width, int height, int seed) {
    const Image image = clutter(width, height, static_cast<std::uint64_t>(seed));
    const Camera camera = {width, height, 300, 296, 0.5 * width - 3, 0.5 * height + 1};
    if (!on_cpu_) on_cpu_ = cpu->makeTemplateMatcher(bank_, quick());
    if (!on_cuda_) on_cuda_ = cuda->makeTemplateMatcher(bank_, quick());
    const std::vector<double> distances = {1.6, 2.1, 2.8, 3.7, 5};
    return {on_cpu_->match(image, camera, distances, {}),
            on_cuda_->match(image, camera, distances, {})};
  }

  std::shared_ptr<const TemplateBank> bank_ = drawnBank(11, 128);
  std::unique_ptr<TemplateMatcher> on_cpu_, on_cuda_;
};

bool isEqual(const TemplatePose& a, const TemplatePose& b) {
  return a.view == b.view && a.level == b.level && a.pixel == b.pixel &&
         std::abs(a.rotation_rad - b.rotation_rad) < 1e-12 &&
         std::abs(a.distance - b.distance) < 1e-12 && std::abs(a.evidence - b.evidence) < 1e-12;
}

// Sines differ in their last bit, by which an edge may move by a pixel where it is at the middle
// between two.
void expectNearlyAll(const TemplateMatches& cpu, const TemplateMatches& cuda) {
  ASSERT_EQ(cpu.poses.size(), cuda.poses.size());
  ASSERT_FALSE(cpu.poses.empty());
  std::size_t equal = 0;
  for (std::size_t i = 0; i < cpu.poses.size(); ++i) equal += isEqual(cpu.poses[i], cuda.poses[i]);
  EXPECT_GE(static_cast<double>(equal), 0.98 * static_cast<double>(cpu.poses.size()));
}

TEST_F(CudaTemplateMatcher, FindsWhatTheCpuFinds) {
  const Both found = matchBoth(320, 240, 1);
  expectNearlyAll(found.cpu, found.cuda);
  EXPECT_GT(found.cuda.lookups, 0u);
}

TEST_F(CudaTemplateMatcher, TakesImagesOfOtherSizesOneAfterTheOther) {
  for (const int width : {320, 61, 501, 33, 18, 5, 2, 1}) {
    const Both found = matchBoth(width, width * 3 / 4 + 1, width);
    SCOPED_TRACE(width);
    expectNearlyAll(found.cpu, found.cuda);
  }
}

TEST_F(CudaTemplateMatcher, TakesBanksOfManyEdges) {
  bank_ = drawnBank(5, 8 * TemplateView::kRun);
  const Both found = matchBoth(160, 120, 3);
  expectNearlyAll(found.cpu, found.cuda);
}

TEST_F(CudaTemplateMatcher, IsTheSameEachTime) {
  const Both one = matchBoth(200, 150, 4), other = matchBoth(200, 150, 4);
  ASSERT_EQ(one.cuda.poses.size(), other.cuda.poses.size());
  for (std::size_t i = 0; i < one.cuda.poses.size(); ++i) {
    EXPECT_TRUE(isEqual(one.cuda.poses[i], other.cuda.poses[i])) << i;
  }
}

TEST_F(CudaTemplateMatcher, EndsWhenItIsCancelledAndGoesOnAfterIt) {
  const auto matcher = cuda->makeTemplateMatcher(bank_, quick());
  const Camera camera = {320, 240, 300, 300, 159.5, 119.5};
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(matcher->match(clutter(320, 240, 1), camera, {2, 3}, cancellation), Cancelled);
  EXPECT_FALSE(matcher->match(clutter(320, 240, 1), camera, {2, 3}, {}).poses.empty());
}

TEST_F(CudaTemplateMatcher, RefusesWhatMakesNoSense) {
  const auto matcher = cuda->makeTemplateMatcher(bank_, quick());
  const Camera camera = {320, 240, 300, 300, 159.5, 119.5};
  EXPECT_THROW(matcher->match(Image(320, 200, 3), camera, {2}, {}), std::invalid_argument);
  EXPECT_THROW(matcher->match(Image(320, 240, 1), camera, {2}, {}), std::invalid_argument);
  EXPECT_THROW(cuda->makeTemplateMatcher(std::make_shared<const TemplateBank>(), quick()),
               std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
