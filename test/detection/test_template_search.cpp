// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_search.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "backend/make_backend.h"
#include "evaluation/clutter.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

const Camera kSearchCamera = {320, 240, 300, 300, 159.5, 119.5};

/// Corners of a plane figure, about 1 unit across.
using Figure = std::vector<Eigen::Vector2d>;
const Figure kSquare = {{-0.35, -0.35}, {0.35, -0.35}, {0.35, 0.35}, {-0.35, 0.35}};
/// The letter L: no turn brings it onto itself.
const Figure kLetter = {{-0.3, -0.45}, {-0.1, -0.45}, {-0.1, 0.25},
                        {0.3, 0.25},   {0.3, 0.45},   {-0.3, 0.45}};

bool isInside(const Figure& figure, const Eigen::Vector2d& p) {
  bool inside = false;
  for (std::size_t i = 0; i < figure.size(); ++i) {
    const Eigen::Vector2d& a = figure[i];
    const Eigen::Vector2d& b = figure[(i + 1) % figure.size()];
    if ((a.y() > p.y()) == (b.y() > p.y())) continue;
    inside ^= p.x() < a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
  }
  return inside;
}

/// A figure in the plane z = 0 as a camera in front of it sees it, with 128 features.
std::shared_ptr<const TemplateBank> bankOf(const Figure& figure) {
  TemplateView view;
  view.R_O_V = Eigen::Matrix3d::Identity();
  double length = 0;
  for (std::size_t i = 0; i < figure.size(); ++i) {
    length += (figure[(i + 1) % figure.size()] - figure[i]).norm();
  }
  double along = 0.5 * length / 128, before = 0;
  for (std::size_t i = 0; i < figure.size(); ++i) {
    const Eigen::Vector2d side = figure[(i + 1) % figure.size()] - figure[i];
    for (; along < before + side.norm(); along += length / 128) {
      const Eigen::Vector2d p = figure[i] + (along - before) / side.norm() * side;
      const double normal = std::atan2(side.x(), -side.y());
      view.features.push_back(
          {Eigen::Vector3d(p.x(), p.y(), 0).cast<float>(), static_cast<float>(normal)});
    }
    before += side.norm();
  }
  view.features.resize(128, view.features.back());
  TemplateBank bank;
  bank.views = {view};
  return std::make_shared<const TemplateBank>(bank);
}

FieldMetadata object() {
  FieldMetadata object;
  object.diameter = 1;
  return object;
}

/// Where a figure is seen: its centre, how it is turned, and what a unit spans.
struct Place {
  Eigen::Vector2d pixel;
  double rotation_rad;
  double unit_px;
};

void draw(const Figure& figure, const Place& place, float grey, Image* image) {
  const Eigen::Rotation2Dd back(-place.rotation_rad);
  constexpr int kRays = 4;
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      int inside = 0;
      for (int ray = 0; ray < kRays * kRays; ++ray) {
        const Eigen::Vector2d sample(x + (ray % kRays + 0.5) / kRays - 0.5,
                                     y + (ray / kRays + 0.5) / kRays - 0.5);
        inside += isInside(figure, back * (sample - place.pixel) / place.unit_px);
      }
      const float fraction = static_cast<float>(inside) / (kRays * kRays);
      for (int c = 0; c < 3; ++c) {
        image->at(x, y, c) += fraction * (grey - image->at(x, y, c));
      }
    }
  }
}

TemplateSearchSettings settings() {
  TemplateSearchSettings settings;
  settings.matching.scanned_px = 48;
  settings.matching.fitted_px = 80;
  return settings;
}

/// How an image is looked through.
struct Processor {
  int threads = 2;
  std::string instruction_set = "auto";
};

TemplateFindings find(const Figure& figure, const Image& image, const Processor& processor = {}) {
  const auto backend = makeCpuBackend(processor.threads, processor.instruction_set);
  TemplateSearch search(backend.get(), bankOf(figure), object(), settings());
  const Camera camera = {
      image.width, image.height, 300, 300, 0.5 * (image.width - 1), 0.5 * (image.height - 1)};
  return search.find(image, camera, {1.5, 6}, {});
}

void expectFound(const PoseCandidate& candidate, const Place& place) {
  const Eigen::Vector3d centre_C = candidate.T_O_C.inverse() * Eigen::Vector3d::Zero();
  EXPECT_LT((kSearchCamera.project(centre_C) - place.pixel).norm(), 0.06 * place.unit_px);
  EXPECT_NEAR(kSearchCamera.fx / centre_C.z() / place.unit_px, 1, 0.1);
  const Eigen::Matrix3d R = candidate.T_O_C.R.transpose();
  const double turn = std::atan2(R(1, 0), R(0, 0)) - place.rotation_rad;
  EXPECT_LT(std::abs(std::remainder(turn, 2 * kPi)), 6 * kDegree);
}

TEST(TemplateSearch, FindsALetterAtItsPlaceRotationAndSize) {
  for (const Place& place : {Place{{160, 120}, 0, 100}, Place{{90, 70}, 130 * kDegree, 60},
                             Place{{220, 150}, -75 * kDegree, 140}}) {
    Image image(320, 240, 3, 0.5f);
    draw(kLetter, place, 0.8f, &image);
    const TemplateFindings findings = find(kLetter, image);
    ASSERT_FALSE(findings.candidates.empty());
    expectFound(findings.candidates.front(), place);
    EXPECT_EQ(findings.candidates.front().source, CandidateSource::kTemplates);
    EXPECT_GT(findings.candidates.front().evidence, 0.4);
    EXPECT_GT(findings.lookups, 0u);
  }
}

TEST(TemplateSearch, FindsASquareInClutterWhereAQuarterIsCovered) {
  const Place place = {{150, 110}, 20 * kDegree, 120};
  Image image = clutter(320, 240, 3);
  draw(kSquare, place, 0.95f, &image);
  draw(kSquare, {{150, 75}, 0, 60}, 0.1f, &image);  // over its upper side
  FieldMetadata square = object();
  square.symmetries =
      Symmetries({}, {Pose(Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                           Eigen::Vector3d::Zero())});
  const auto backend = makeCpuBackend();
  TemplateSearch search(backend.get(), bankOf(kSquare), square, settings());
  const TemplateFindings findings = search.find(image, kSearchCamera, {1.5, 6}, {});
  ASSERT_FALSE(findings.candidates.empty());
  const auto is_right = [&place](const PoseCandidate& candidate) {
    const Pose& found = candidate.T_O_C;
    const Eigen::Vector3d centre_C = found.inverse() * Eigen::Vector3d::Zero();
    const double turn = std::atan2(found.R(0, 1), found.R(0, 0)) - place.rotation_rad;
    return (kSearchCamera.project(centre_C) - place.pixel).norm() < 0.1 * place.unit_px &&
           std::abs(std::remainder(turn, kPi / 2)) < 6 * kDegree;
  };
  const auto right = std::find_if(findings.candidates.begin(), findings.candidates.end(), is_right);
  EXPECT_LT(right - findings.candidates.begin(), 10);
}

TEST(TemplateSearch, FindsTwoInstances) {
  const Place places[] = {{{90, 120}, 0.3, 90}, {{230, 120}, 2.5, 110}};
  Image image(320, 240, 3, 0.5f);
  for (const Place& place : places) draw(kLetter, place, 0.8f, &image);
  const TemplateFindings findings = find(kLetter, image);
  for (const Place& place : places) {
    const bool found = std::any_of(
        findings.candidates.begin(), findings.candidates.begin() + 10, [&](const auto& candidate) {
          const Eigen::Vector3d centre_C = candidate.T_O_C.inverse() * Eigen::Vector3d::Zero();
          return (kSearchCamera.project(centre_C) - place.pixel).norm() < 0.1 * place.unit_px;
        });
    EXPECT_TRUE(found);
  }
}

TEST(TemplateSearch, FindsNothingWhereNothingIsSeen) {
  EXPECT_TRUE(find(kLetter, Image(320, 240, 3)).candidates.empty());
  EXPECT_TRUE(find(kLetter, Image(320, 240, 3, 1.0f)).candidates.empty());
}

TEST(TemplateSearch, LooksThroughImagesThatAreSmallerThanATemplate) {
  for (const int side : {1, 2, 5, 20}) {
    EXPECT_NO_THROW(find(kLetter, clutter(side, side, 1))) << side;
  }
}

TEST(TemplateSearch, DoesNotDependOnThreadsOrInstructions) {
  Image image = clutter(160, 120, 5);
  const PoseCandidates a = find(kLetter, image, {1, "baseline"}).candidates;
  const PoseCandidates b = find(kLetter, image, {3, "auto"}).candidates;
  ASSERT_EQ(a.size(), b.size());
  ASSERT_FALSE(a.empty());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].T_O_C.t, b[i].T_O_C.t);
    EXPECT_EQ(a[i].evidence, b[i].evidence);
  }
}

TEST(TemplateSearch, EndsWhenItIsCancelled) {
  const auto backend = makeCpuBackend();
  TemplateSearch search(backend.get(), bankOf(kLetter), object(), settings());
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(search.find(Image(320, 240, 3), kSearchCamera, {1.5, 6}, cancellation), Cancelled);
}

TEST(TemplateSearch, RefusesWhatMakesNoSense) {
  const auto backend = makeCpuBackend();
  TemplateSearch search(backend.get(), bankOf(kLetter), object(), settings());
  const Image image(320, 240, 3);
  EXPECT_THROW(search.find(Image(320, 200, 3), kSearchCamera, {1.5, 6}, {}), std::invalid_argument);
  EXPECT_THROW(search.find(Image(320, 240, 1), kSearchCamera, {1.5, 6}, {}), std::invalid_argument);
  EXPECT_THROW(search.find(image, kSearchCamera, {6, 1.5}, {}), std::invalid_argument);
  EXPECT_THROW(search.find(image, kSearchCamera, {0, 1}, {}), std::invalid_argument);
  TemplateSearchSettings wrong = settings();
  wrong.matching.rotations = 0;
  EXPECT_THROW(TemplateSearch(backend.get(), bankOf(kLetter), object(), wrong),
               std::invalid_argument);
  const auto with = [&](const TemplateBank& bank) {
    TemplateSearch(backend.get(), std::make_shared<const TemplateBank>(bank), object(), settings());
  };
  EXPECT_THROW(with({}), std::invalid_argument);
  TemplateBank uneven = *bankOf(kLetter);
  uneven.views.push_back(uneven.views.front());
  EXPECT_NO_THROW(with(uneven));
  uneven.views.back().features.resize(64);
  EXPECT_THROW(with(uneven), std::invalid_argument);
  TemplateBank many = *bankOf(kLetter);
  many.views.front().features.resize(TemplateView::kMostFeatures,
                                     many.views.front().features.front());
  EXPECT_NO_THROW(with(many));
  many.views.front().features.resize(TemplateView::kMostFeatures + TemplateView::kRun,
                                     many.views.front().features.front());
  EXPECT_THROW(with(many), std::invalid_argument);
}

TEST(DistanceRange, SpansEightTimesTheSize) {
  const DistanceRange range = DistanceRange::usual({640, 480, 1280, 1280, 319.5, 239.5});
  EXPECT_DOUBLE_EQ(range.nearest, 2);
  EXPECT_DOUBLE_EQ(range.farthest, 16);
  const DistanceRange upright = DistanceRange::usual({480, 640, 1280, 1280, 239.5, 319.5});
  EXPECT_DOUBLE_EQ(upright.nearest, 2);
}

}  // namespace
}  // namespace nerf_pose_refiner
