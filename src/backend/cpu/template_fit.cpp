// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/template_fit.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {
namespace {

/// The best of some poses, each moved by at most `reach` pixels along both axes.
class BestPose {
 public:
  BestPose(const TemplateLevel& level, const TemplateBank& bank, const TemplateKernels& kernels)
      : level_(level), bank_(bank), kernels_(kernels) {}

  void consider(TemplatePose pose, int reach) {
    const TemplateView& view = bank_.views[static_cast<std::size_t>(pose.view)];
    const Camera& camera = level_.scale.camera;
    placeFeatures(view, TemplatePlacement::of(pose.rotation_rad, camera.fx, pose.distance), 1,
                  level_.memory.order(), &offsets_);
    const auto first = [reach](double middle, int size) {
      return std::clamp(static_cast<int>(std::lround(middle)) - reach, 0, size - 1);
    };
    const int left = first(pose.pixel.x(), camera.width);
    const int top = first(pose.pixel.y(), camera.height);
    const int columns = std::min(2 * reach + 1, camera.width - left);
    const int rows = std::min(2 * reach + 1, camera.height - top);
    scores_.resize(static_cast<std::size_t>(rows) * kScoreRun);
    kernels_.score({level_.memory.place(left, top), level_.memory.order().columns, rows, 1},
                   {offsets_.data(), static_cast<int>(offsets_.size()) / kTemplateParts},
                   scores_.data());
    lookups_ += static_cast<std::uint64_t>(rows) * columns * offsets_.size();
    int most = -1;
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns; ++x) {
        const int score = scores_[static_cast<std::size_t>(y) * kScoreRun + x];
        if (score <= most) continue;
        most = score;
        pose.pixel = {left + x, top + y};
      }
    }
    pose.evidence = meanResponse(most, static_cast<int>(offsets_.size()));
    if (pose.evidence > best_.evidence) best_ = pose;
  }

  const TemplatePose& best() const { return best_; }
  std::uint64_t lookups() const { return lookups_; }

 private:
  const TemplateLevel& level_;
  const TemplateBank& bank_;
  const TemplateKernels& kernels_;
  TemplatePose best_;
  std::uint64_t lookups_ = 0;
  std::vector<std::int32_t> offsets_;
  std::vector<std::int16_t> scores_;
};

}  // namespace

TemplatePose TemplateFitter::fit(const TemplateLevel& level, const TemplatePose& start,
                                 std::uint64_t* lookups) const {
  BestPose best(level, templates_.bank, kernels_);
  for (int i = 0; i < kTurnedAndMoved; ++i) {
    best.consider(moved(start, turnedAndMoved(i), templates_.settings), fitReach(0));
  }
  const TemplatePose turned = best.best();
  for (const ViewBeside& beside : beside_[static_cast<std::size_t>(turned.view)]) {
    TemplatePose pose = turned;
    pose.view = beside.view;
    pose.rotation_rad += beside.turn_rad;
    best.consider(pose, fitReach(1));
  }
  const TemplatePose seen = best.best();
  for (int i = 0; i < kClose; ++i) {
    best.consider(moved(seen, closeStep(i), templates_.settings), fitReach(2));
  }
  *lookups += best.lookups();
  return best.best();
}

}  // namespace nerf_pose_refiner
