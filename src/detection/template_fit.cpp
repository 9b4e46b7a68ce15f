// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace nerf_pose_refiner {
namespace {

/// For each view those that see the object from nearest beside it.
std::vector<std::vector<int>> neighboursOf(const TemplateBank& bank) {
  constexpr std::size_t kNeighbours = 6;
  std::vector<std::vector<int>> neighbours;
  for (const TemplateView& view : bank.views) {
    std::vector<std::pair<double, int>> others;
    for (std::size_t i = 0; i < bank.views.size(); ++i) {
      const TemplateView& other = bank.views[i];
      if (&other == &view || other.edges.empty()) continue;
      others.emplace_back(-view.R_O_V.col(2).dot(other.R_O_V.col(2)), static_cast<int>(i));
    }
    std::sort(others.begin(), others.end());
    others.resize(std::min(kNeighbours, others.size()));
    neighbours.emplace_back();
    for (const auto& other : others) neighbours.back().push_back(other.second);
  }
  return neighbours;
}

/// The best of some poses, each moved by at most `reach` pixels along both axes.
class BestPose {
 public:
  BestPose(const TemplateLevel& level, const TemplateBank& bank, const TemplateKernels& kernels)
      : level_(level), bank_(bank), kernels_(kernels) {}

  void consider(TemplatePose pose, int reach) {
    const TemplateView& view = bank_.views[static_cast<std::size_t>(pose.view)];
    TemplateScale scale = level_.scale;
    scale.object_px = scale.camera.fx / pose.distance;
    placeEdges({&view, pose.rotation_rad}, scale, 1, level_.memory, &offsets_);
    const auto first = [reach](double middle, int size) {
      return std::clamp(static_cast<int>(std::lround(middle)) - reach, 0, size - 1);
    };
    const int left = first(pose.pixel.x(), scale.camera.width);
    const int top = first(pose.pixel.y(), scale.camera.height);
    const int columns = std::min(2 * reach + 1, scale.camera.width - left);
    const int rows = std::min(2 * reach + 1, scale.camera.height - top);
    scores_.resize(static_cast<std::size_t>(rows) * kScoreRun);
    kernels_.score({level_.memory.place(left, top), level_.memory.columns(), rows, 1},
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

TemplateFitter::TemplateFitter(const TemplateBank& bank, const TemplateKernels& kernels,
                               const TemplateSteps& steps)
    : bank_(bank), kernels_(kernels), steps_(steps), neighbours_(neighboursOf(bank)) {}

TemplatePose TemplateFitter::fit(const TemplateLevel& level, const TemplatePose& start,
                                 std::uint64_t* lookups) const {
  constexpr int kWide_px = 5, kMiddle_px = 3, kClose_px = 2;
  BestPose best(level, bank_, kernels_);
  for (const TemplatePose& pose : turnedAndMoved(start)) best.consider(pose, kWide_px);
  for (const TemplatePose& pose : fromBeside(best.best())) best.consider(pose, kMiddle_px);
  for (const TemplatePose& pose : closeTo(best.best())) best.consider(pose, kClose_px);
  *lookups += best.lookups();
  return best.best();
}

std::vector<TemplatePose> TemplateFitter::turnedAndMoved(const TemplatePose& pose) const {
  std::vector<TemplatePose> poses;
  for (const double turn : {-0.5, 0.0, 0.5}) {
    for (const double move : {-0.5, 0.0, 0.5}) {
      poses.push_back(pose);
      poses.back().rotation_rad += turn * steps_.rotation_rad;
      poses.back().distance *= std::pow(steps_.distance, move);
    }
  }
  return poses;
}

std::vector<TemplatePose> TemplateFitter::fromBeside(const TemplatePose& pose) const {
  std::vector<TemplatePose> poses;
  const auto view = static_cast<std::size_t>(pose.view);
  for (const int beside : neighbours_[view]) {
    // The rotation in the image that leaves as little as may be of the turn between the views.
    const Eigen::Matrix3d turn =
        bank_.views[view].R_O_V.transpose() * bank_.views[static_cast<std::size_t>(beside)].R_O_V;
    poses.push_back(pose);
    poses.back().view = beside;
    poses.back().rotation_rad += std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
  }
  return poses;
}

std::vector<TemplatePose> TemplateFitter::closeTo(const TemplatePose& pose) const {
  std::vector<TemplatePose> poses(4, pose);
  poses[0].rotation_rad -= 0.25 * steps_.rotation_rad;
  poses[1].rotation_rad += 0.25 * steps_.rotation_rad;
  poses[2].distance *= std::pow(steps_.distance, -0.25);
  poses[3].distance *= std::pow(steps_.distance, 0.25);
  return poses;
}

}  // namespace nerf_pose_refiner
