// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/keyframe_aligner.h"

#include <algorithm>
#include <cmath>

#include "backend/common/box_sums.h"
#include "backend/common/plain_pose.h"
#include "math/alignment_sums.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kFirstDamping = 0.01;
constexpr int kMinPoints = 24;

CameraPose<float> single(const CameraPose<double>& pose) {
  CameraPose<float> single;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) single.R.m[i][j] = static_cast<float>(pose.R.m[i][j]);
  }
  single.o = {static_cast<float>(pose.o.x), static_cast<float>(pose.o.y),
              static_cast<float>(pose.o.z)};
  return single;
}

// In double: the centre of a far object is a small difference of large numbers.
PointTransform<float> transformOf(const CameraPose<double>& pose, const Eigen::Vector3d& centre) {
  const PointTransform<double> exact = pointTransform(pose, plainVector(centre));
  return {single(pose).R,
          {static_cast<float>(exact.t.x), static_cast<float>(exact.t.y),
           static_cast<float>(exact.t.z)}};
}

KernelPoints columnsOf(const PointColumns& points) {
  return {points.x.data(), points.y.data(), points.z.data()};
}

void add(const PointSums<float>& tile, PointSums<double>* sums) {
  sums->weight += tile.weight;
  sums->cost += tile.cost;
  sums->robust_weight += tile.robust_weight;
  sums->squared_residual += tile.squared_residual;
  for (int k = 0; k < 21; ++k) sums->information[k] += tile.information[k];
  for (int k = 0; k < 6; ++k) sums->gradient[k] += tile.gradient[k];
}

template <typename T>
NormalEquations6<T> equationsOf(const PointSums<T>& sums) {
  NormalEquations6<T> equations;
  std::copy(sums.information, sums.information + 21, equations.information);
  std::copy(sums.gradient, sums.gradient + 6, equations.gradient);
  return equations;
}

Eigen::Matrix<double, 6, 6> symmetric(const double lower[21]) {
  Eigen::Matrix<double, 6, 6> full;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) full(i, j) = full(j, i) = *lower++;
  }
  return full;
}

// Robust loss of colours that have nothing in common.
double chanceLoss(double robust_scale) {
  return kChanceDifference * 0.5 * robust_scale * robust_scale;
}

HypothesisState stateOf(const Pose& T_O_C, const KeyframePoints& keyframe,
                        const PointSums<double>& sums) {
  if (!T_O_C.isFinite()) return HypothesisState::kNotFinite;
  if (!((T_O_C.inverse() * keyframe.centre).z() > 0)) return HypothesisState::kBehindCamera;
  if (!(sums.weight >= kMinPoints)) return HypothesisState::kOutOfImage;
  if (!(factorise6(sums.information, 0.0).smallest_pivot > 0)) {
    return HypothesisState::kIllConditioned;
  }
  return HypothesisState::kLive;
}

}  // namespace

void KeyframeAligner::observe(const Image8& image, const Camera& camera,
                              const KeyframePoints& keyframe, const Pose& T_O_C, double margin) {
  const Eigen::Vector3d centre_C = T_O_C.inverse() * keyframe.centre;
  PixelWindow window = {0, 0, image.width, image.height};
  const double reach = (0.5 + margin) * keyframe.diameter;
  if (centre_C.z() > reach) {
    const Eigen::Vector2d low = camera.project(centre_C - Eigen::Vector3d(reach, reach, 0));
    const Eigen::Vector2d high = camera.project(centre_C + Eigen::Vector3d(reach, reach, 0));
    const auto inside = [](double u, int size) {
      return static_cast<int>(std::clamp(u, 0.0, static_cast<double>(size - 1)));
    };
    window.x = inside(low.x(), image.width);
    window.y = inside(low.y(), image.height);
    window.width = inside(high.x(), image.width) + 1 - window.x;
    window.height = inside(high.y(), image.height) + 1 - window.y;
  }
  frame_.prepare(image, camera, window, keyframe.reduction,
                 static_cast<int>(keyframe.levels.size()));
}

void KeyframeAligner::beginLevel(const KeyframePoints& keyframe, int index,
                                 const CameraPose<double>& pose) {
  const KeyframeLevel& level = keyframe.levels[index];
  const std::size_t pixels = static_cast<std::size_t>(level.width) * level.height;
  for (std::vector<float>& mean : mean_) mean.resize(level.chosen.size());
  for (std::vector<float>& inverse : inverse_deviation_) inverse.resize(level.chosen.size());
  inverse_count_ = level.inverse_count;
  weight_ = level.weight;
  point_count_ = level.point_count;
  carryGradients(keyframe, index, pose);
  const KernelImage image = frame_.level(index);
  hidden_ = occlusion_.hidden(level.shown, transformOf(pose, keyframe.centre),
                              {image.K, image.width, image.height, level.spacing});
  grid_.assign(kBoxChannels * (pixels + 1), 0.0f);
  if (hidden_.empty()) return;
  for (const std::int32_t cell : level.shown.cell) grid_[kBoxChannels * cell] = 1;
  for (const std::int32_t cell : hidden_) {
    grid_[kBoxChannels * cell] = 0;
    grid_[kBoxChannels * cell + 1] = 1;
  }
  boxSums(grid_, level.width, level.height, level.window, &sums_);
  for (int i = 0; i < level.chosen.size(); ++i) {
    const std::size_t cell = kBoxChannels * static_cast<std::size_t>(level.chosen.cell[i]);
    inverse_count_[level.chosen.cell[i]] = 1 / std::max(1.0f, std::round(sums_[cell]));
    if (grid_[cell + 1] > 0) weight_[i] = 0;
  }
  point_count_ = static_cast<int>(std::count(weight_.begin(), weight_.end(), 1.0f));
  std::fill(grid_.begin(), grid_.end(), 0.0f);
}

void KeyframeAligner::carryGradients(const KeyframePoints& keyframe, int index,
                                     const CameraPose<double>& pose) {
  const KeyframeLevel& level = keyframe.levels[index];
  const Pinhole<float> K = frame_.level(index).K;
  const PointTransform<float> transform = transformOf(pose, keyframe.centre);
  for (int c = 0; c < 3; ++c) {
    rendered_du_[c].resize(level.chosen.size());
    rendered_dv_[c].resize(level.chosen.size());
  }
  for (int i = 0; i < level.chosen.size(); ++i) {
    const ChosenSurface& surface = level.surface[i];
    const Vec3<float> q =
        inCamera(transform, Vec3<float>{level.chosen.x[i], level.chosen.y[i], level.chosen.z[i]});
    const ProjectionJacobian<float> projection = projectionJacobian(K, q);
    Vec3<float> tangent[2];
    for (int t = 0; t < 2; ++t) {
      const Eigen::Vector3f& along = surface.tangent[t];
      tangent[t] = transposedTimes(transform.R, Vec3<float>{along.x(), along.y(), along.z()});
    }
    for (int c = 0; c < 3; ++c) {
      const Pixel<float> gradient = carriedGradient(
          projection, tangent, Pixel<float>{surface.gradient[c].x(), surface.gradient[c].y()});
      rendered_du_[c][i] = gradient.u;
      rendered_dv_[c][i] = gradient.v;
    }
  }
}

void KeyframeAligner::lookAround(const KeyframePoints& keyframe, int index,
                                 const CameraPose<double>& pose) {
  const KeyframeLevel& level = keyframe.levels[index];
  kernels_->sampleColours({frame_.level(index), transformOf(pose, keyframe.centre)},
                          columnsOf(level.shown), level.shown.cell.data(), level.shown.size(),
                          grid_.data());
  for (const std::int32_t cell : hidden_) {
    std::fill_n(grid_.begin() + kBoxChannels * static_cast<std::ptrdiff_t>(cell), kBoxChannels,
                0.0f);
  }
  boxSums(grid_, level.width, level.height, level.window, &sums_);
  for (int i = 0; i < level.chosen.size(); ++i) {
    const std::size_t cell = level.chosen.cell[i];
    const LocalColours<float> local =
        localColours(sums_.data() + kBoxChannels * cell, inverse_count_[cell]);
    for (int c = 0; c < 3; ++c) {
      mean_[c][i] = local.mean[c];
      inverse_deviation_[c][i] = local.inverse_deviation[c];
    }
  }
}

KeyframeAligner::Evaluation KeyframeAligner::evaluate(const KeyframePoints& keyframe, int level,
                                                      const CameraPose<double>& pose,
                                                      const KernelRules& rules) {
  const KeyframeLevel& points = keyframe.levels[level];
  const KernelView view = {frame_.level(level), transformOf(pose, keyframe.centre)};
  const KernelColours colours = {
      {points.colour[0].data(), points.colour[1].data(), points.colour[2].data()},
      {rendered_du_[0].data(), rendered_du_[1].data(), rendered_du_[2].data()},
      {rendered_dv_[0].data(), rendered_dv_[1].data(), rendered_dv_[2].data()},
      {mean_[0].data(), mean_[1].data(), mean_[2].data()},
      {inverse_deviation_[0].data(), inverse_deviation_[1].data(), inverse_deviation_[2].data()},
      weight_.data()};
  Evaluation evaluation;
  evaluation.pose = pose;
  for (std::size_t t = 0; t + 1 < points.tiles.size(); ++t) {
    PointSums<float> tile = {};
    const KernelTile points_of_tile = {columnsOf(points.chosen), colours, points.tiles[t],
                                       points.tiles[t + 1]};
    kernels_->sumTile(view, points_of_tile, rules, &tile);
    add(tile, &evaluation.sums);
    evaluation.scatter.addTile(equationsOf(tile));
  }
  // A point that has left the image explains no more than chance does: leaving it is no gain.
  const double missing = point_count_ - evaluation.sums.weight;
  evaluation.loss =
      (evaluation.sums.cost + missing * chanceLoss(rules.robust_scale)) / std::max(1, point_count_);
  return evaluation;
}

KeyframeAligner::Evaluation KeyframeAligner::alignLevel(
    const KeyframePoints& keyframe, int level, const std::vector<CameraPose<double>>& starts,
    const KeyframeAlignmentSettings& settings, int* evaluations) {
  const Vec3<double> centre = plainVector(keyframe.centre);
  const double focal_px = frame_.level(level).K.fx;
  const double convergence_px =
      level == 0 ? settings.convergence_px : settings.coarse_convergence_px;
  const KernelRules rules = {
      static_cast<float>(settings.robust_scale * std::pow(settings.robust_growth, level)),
      static_cast<float>(level == 0 ? settings.observed_fraction
                                    : settings.coarse_observed_fraction)};
  beginLevel(keyframe, level, starts.front());
  Evaluation best;
  best.pose = starts.front();
  for (const CameraPose<double>& start : starts) {
    lookAround(keyframe, level, start);
    const Evaluation evaluation = evaluate(keyframe, level, start, rules);
    if (evaluation.loss < best.loss) best = evaluation;
    ++*evaluations;
  }
  double damping = kFirstDamping;
  double moved_px = 0;  // since the last look around
  for (int i = 1; i < settings.max_evaluations; ++i) {
    double x[6];
    if (!solve6(equationsOf(best.sums), damping, 1e-9, x)) break;
    Vec3<double> v = {x[0], x[1], x[2]}, w = {x[3], x[4], x[5]};
    const double factor =
        std::min({settings.over_relaxation, settings.max_translation * keyframe.diameter / norm(v),
                  settings.max_rotation_rad / norm(w)});
    v = factor * v;
    w = factor * w;
    const double depth = pointTransform(best.pose, centre).t.z;
    const double rim_px = (norm(v) + 0.5 * keyframe.diameter * norm(w)) * focal_px / depth;
    if (rim_px < convergence_px) break;
    const CameraPose<double> pose = moveCamera(best.pose, centre, v, w);
    moved_px += rim_px;
    if (moved_px > settings.look_around_px) {
      lookAround(keyframe, level, pose);
      moved_px = 0;
    }
    const Evaluation trial = evaluate(keyframe, level, pose, rules);
    ++*evaluations;
    if (trial.loss < best.loss) {
      best = trial;
      damping = std::max(0.2 * damping, 1e-4);
    } else {
      damping *= 10;
    }
  }
  return best;
}

Hypothesis KeyframeAligner::align(const KeyframePoints& keyframe, const Pose& start_T_O_C,
                                  const KeyframeAlignmentSettings& settings) {
  Hypothesis found;
  Evaluation best;
  best.pose = plainPose(start_T_O_C);
  // What a coarse level found counts only where a finer one finds it better than the start, too.
  std::vector<CameraPose<double>> starts = {best.pose};
  for (int level = static_cast<int>(keyframe.levels.size()) - 1; level >= 0; --level) {
    if (keyframe.levels[level].point_count < kMinPoints) continue;  // a far object's coarse ones
    best = alignLevel(keyframe, level, starts, settings, &found.iterations);
    starts = {best.pose};
    if (level > 1) starts.push_back(plainPose(start_T_O_C));
  }
  found.T_O_C = poseOf(best.pose);
  found.state = stateOf(found.T_O_C, keyframe, best.sums);
  found.loss = best.loss;
  found.information = symmetric(best.sums.information);
  found.gradient_scatter = best.scatter.correction() * symmetric(best.scatter.gradients);
  if (best.sums.weight > 0) found.visible_fraction = best.sums.robust_weight / best.sums.weight;
  if (best.sums.robust_weight > 0) {
    found.score = std::max(0.0, 1 - best.loss / chanceLoss(settings.robust_scale));
    found.residual_variance = best.sums.squared_residual / (3 * best.sums.robust_weight);
  }
  return found;
}

}  // namespace nerf_pose_refiner
