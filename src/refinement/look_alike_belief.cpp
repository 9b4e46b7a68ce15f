// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/look_alike_belief.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "math/angle.h"
#include "refinement/look_alike_poses.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kCells = 180;
constexpr double kCell_rad = 2 * M_PI / kCells;
constexpr double kRight_rad = 5 * kDegree;

/// -180 to 180 degrees.
double turnOfCell(int cell) { return kCell_rad * (cell <= kCells / 2 ? cell : cell - kCells); }

/// What remains of evidence: errors of the model and of its shading make small differences, which
/// do not add up from image to image; and no image says all.
double soberly(double log_odds) {
  constexpr double kDeadZone = 3, kMax = 30;
  const double size = std::abs(log_odds);
  if (size <= kDeadZone) return 0;
  return std::copysign(std::min(size - kDeadZone * kDeadZone / size, kMax), log_odds);
}

/// Evidence at a turn between those that were tried.
double interpolated(const std::vector<double>& evidence, double turn_rad) {
  const std::vector<double>& turns = triedTurns_rad();
  const auto above = std::upper_bound(turns.begin() + 1, turns.end() - 1, turn_rad);
  const auto i = static_cast<std::size_t>(above - turns.begin());
  const double share = (turn_rad - turns[i - 1]) / (turns[i] - turns[i - 1]);
  return (1 - share) * soberly(evidence[i - 1]) + share * soberly(evidence[i]);
}

}  // namespace

LookAlikeBelief::LookAlikeBelief(const LookAlikes& look_alikes,
                                 const std::function<double(const Pose&)>& odds)
    : look_alikes_(look_alikes), turns_(1, 1.0) {
  if (look_alikes_.axis) {
    turns_.resize(kCells);
    for (int i = 0; i < kCells; ++i) {
      turns_[i] = odds(turnAbout(*look_alikes_.axis, turnOfCell(i)));
    }
  }
  const double of_turns = std::accumulate(turns_.begin(), turns_.end(), 0.0);
  for (const Pose& motion : look_alikes_.motions) motions_.push_back(of_turns * odds(motion));
  normalise();
}

LookAlikeBelief LookAlikeBelief::known(const LookAlikes& look_alikes) {
  constexpr double kDeviation_rad = 1.5 * kDegree, kOther = 1e-3;
  return LookAlikeBelief(look_alikes, [](const Pose& motion) {
    const double angle = rotationDistance(motion.R, Eigen::Matrix3d::Identity());
    return kOther / kCells + std::exp(-0.5 * std::pow(angle / kDeviation_rad, 2));
  });
}

void LookAlikeBelief::normalise() {
  const double sum = std::accumulate(turns_.begin(), turns_.end(), 0.0) +
                     std::accumulate(motions_.begin(), motions_.end(), 0.0);
  for (double& p : turns_) p /= sum;
  for (double& p : motions_) p /= sum;
}

int LookAlikeBelief::cellOf(double turn_rad) const {
  const int cell = static_cast<int>(std::lround(turn_rad / kCell_rad)) % kCells;
  return cell < 0 ? cell + kCells : cell;
}

void LookAlikeBelief::see(const LookAlikeEvidence& evidence) {
  constexpr double kForgotten = 1e-3;  // whatever was known: the pose may be any of them
  if (look_alikes_.axis && !evidence.turns.empty()) {
    for (int i = 0; i < kCells; ++i) {
      turns_[i] = (turns_[i] + kForgotten / kCells) *
                  std::exp(-interpolated(evidence.turns, turnOfCell(i)));
    }
  }
  for (std::size_t i = 0; i < motions_.size() && i < evidence.motions.size(); ++i) {
    motions_[i] = (motions_[i] + kForgotten) * std::exp(-soberly(evidence.motions[i]));
  }
  normalise();
}

void LookAlikeBelief::spread(double deviation_rad) {
  if (turns_.size() == 1 || !(deviation_rad > 0)) return;
  // Gaussians that are narrower than a cell are made of two or three.
  const int reach =
      std::min(kCells / 2, static_cast<int>(std::ceil(3 * deviation_rad / kCell_rad)));
  std::vector<double> kernel;
  const double ratio = deviation_rad / kCell_rad;
  if (ratio < 0.7) {
    kernel = {1 - ratio * ratio, 0.5 * ratio * ratio};
  } else {
    for (int k = 0; k <= reach; ++k) kernel.push_back(std::exp(-0.5 * std::pow(k / ratio, 2)));
  }
  std::vector<double> wider(kCells, 0.0);
  for (int i = 0; i < kCells; ++i) {
    for (int k = 0; k < static_cast<int>(kernel.size()); ++k) {
      wider[(i + k) % kCells] += kernel[k] * turns_[i];
      if (k > 0) wider[(i - k + kCells) % kCells] += kernel[k] * turns_[i];
    }
  }
  const double before = std::accumulate(turns_.begin(), turns_.end(), 0.0);
  const double after = std::accumulate(wider.begin(), wider.end(), 0.0);
  for (int i = 0; i < kCells; ++i) turns_[i] = wider[i] * before / after;
}

double LookAlikeBelief::massAround(int cell, double within_rad) const {
  if (turns_.size() == 1) return turns_[0];
  const int reach = static_cast<int>(within_rad / kCell_rad);
  double mass = 0;
  for (int k = -reach; k <= reach; ++k) mass += turns_[(cell + k + kCells) % kCells];
  return mass;
}

double LookAlikeBelief::right() const { return massAround(0, kRight_rad); }

double LookAlikeBelief::turnVariance() const {
  if (turns_.size() == 1) return 0;
  double sum = 0, squares = 0;
  for (int i = 0; i < kCells; ++i) {
    sum += turns_[i];
    squares += turns_[i] * turnOfCell(i) * turnOfCell(i);
  }
  // Not less than that of a cell: a pose that is held has its own covariance.
  return sum > 0 ? std::max(0.0, squares / sum - kCell_rad * kCell_rad) : 0;
}

Pose LookAlikeBelief::better() const {
  constexpr double kMuchLikelier = 0.8, kAround_rad = 6 * kDegree, kFar_rad = 3 * kDegree;
  const auto motion = std::max_element(motions_.begin(), motions_.end());
  if (motion != motions_.end() && *motion > kMuchLikelier) {
    return look_alikes_.motions[static_cast<std::size_t>(motion - motions_.begin())];
  }
  if (turns_.size() == 1) return {};
  const int cell =
      static_cast<int>(std::max_element(turns_.begin(), turns_.end()) - turns_.begin());
  const bool is_far = std::abs(turnOfCell(cell)) > kFar_rad;
  if (!is_far || massAround(cell, kAround_rad) < kMuchLikelier) return {};
  return turnAbout(*look_alikes_.axis, turnOfCell(cell));
}

void LookAlikeBelief::moveBy(const Pose& motion) {
  constexpr double kSettled_rad = 1 * kDegree, kSameMotion_rad = 15 * kDegree;
  for (std::size_t i = 0; i < motions_.size(); ++i) {
    if (rotationDistance(look_alikes_.motions[i].R, motion.R) > kSameMotion_rad) continue;
    // What the old pose was is now another one, which is not among these: it is given up.
    const double taken = motions_[i];
    *this = known(look_alikes_);
    for (double& p : motions_) p = std::max(p, (1 - taken) / static_cast<double>(motions_.size()));
    normalise();
    return;
  }
  if (turns_.size() == 1) return;
  const Eigen::Vector3d turn = logSO3(motion.R);
  const int cell = cellOf(turn.dot(look_alikes_.axis->direction));
  std::rotate(turns_.begin(), turns_.begin() + cell, turns_.end());
  spread(kSettled_rad);
}

std::vector<LookAlikeBelief::Other> LookAlikeBelief::others() const {
  constexpr double kLikely = 0.02;
  constexpr int kSector = 10;  // cells
  std::vector<Other> likely;
  for (std::size_t i = 0; i < motions_.size(); ++i) {
    if (motions_[i] > kLikely) likely.push_back({look_alikes_.motions[i], motions_[i]});
  }
  for (int i = kSector; turns_.size() > 1 && i <= kCells - kSector; i += kSector) {
    const double mass = massAround(i, 0.5 * kSector * kCell_rad);
    if (mass > kLikely) likely.push_back({turnAbout(*look_alikes_.axis, turnOfCell(i)), mass});
  }
  std::stable_sort(likely.begin(), likely.end(),
                   [](const Other& a, const Other& b) { return a.probability > b.probability; });
  return likely;
}

}  // namespace nerf_pose_refiner
