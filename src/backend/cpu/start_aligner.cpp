// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/start_aligner.h"

#include <algorithm>
#include <cmath>

#include "backend/common/box_sums.h"
#include "backend/common/plain_pose.h"
#include "math/alignment_sums.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kFirstDamping = 0.01, kMinDamping = 1e-4;
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

void StartAligner::beginLevel(int index, const CameraPose<double>& pose) {
  index_ = index;
  level_ = &keyframe_->levels[index];
  const std::size_t cells = static_cast<std::size_t>(level_->width) * level_->height;
  grid_.assign(kBoxChannels * (cells + 1), 0.0f);
  hideOccluded(pose);
  sampleFrame(pose);
  takeLocalColours(&local_);
  compareWhatIsSeen();
  carryGradients(pose);
}

void StartAligner::hideOccluded(const CameraPose<double>& pose) {
  hidden_ = occlusion_.hidden(level_->shown, transformOf(pose, keyframe_->centre),
                              {image_.K, image_.width, image_.height, level_->spacing});
  weight_ = level_->weight;
  // What is hidden is marked in the grid while weights are looked up.
  for (const std::int32_t cell : hidden_) grid_[kBoxChannels * cell] = 1;
  for (int i = 0; i < level_->chosen.size(); ++i) {
    if (grid_[kBoxChannels * static_cast<std::size_t>(level_->chosen.cell[i])] > 0) weight_[i] = 0;
  }
  for (const std::int32_t cell : hidden_) grid_[kBoxChannels * cell] = 0;
  point_count_ = static_cast<int>(std::count(weight_.begin(), weight_.end(), 1.0f));
}

// Where a part of the object is hidden, covered or outside of the image, the keyframe's colours are
// normalised over the rest of it, too: otherwise what is left would differ in mean and spread.
void StartAligner::compareWhatIsSeen() {
  const KeyframeLevel& level = *level_;
  for (int c = 0; c < 3; ++c) rendered_[c] = level.colour[c];
  rendered_local_ = level.local;
  bool all_seen = true;
  for (int i = 0; i < level.shown.size(); ++i) {
    float* const sums = grid_.data() + kBoxChannels * static_cast<std::size_t>(level.shown.cell[i]);
    const float weight = sums[kLocalWeight];
    all_seen = all_seen && weight == 1;
    for (int c = 0; c < 3; ++c) {
      const float colour = level.shown_colour[c][i];
      sums[c] = weight * colour;
      sums[3 + c] = weight * colour * colour;
    }
  }
  if (all_seen) return;
  takeLocalColours(&rendered_local_);
  for (int i = 0; i < level.chosen.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float colour =
          level.colour[c][i] / level.local.inverse_deviation[c][i] + level.local.mean[c][i];
      rendered_[c][i] =
          (colour - rendered_local_.mean[c][i]) * rendered_local_.inverse_deviation[c][i];
    }
  }
}

void StartAligner::carryGradients(const CameraPose<double>& pose) {
  const KeyframeLevel& level = *level_;
  const PointTransform<float> transform = transformOf(pose, keyframe_->centre);
  for (int c = 0; c < 3; ++c) {
    rendered_du_[c].resize(level.chosen.size());
    rendered_dv_[c].resize(level.chosen.size());
  }
  for (int i = 0; i < level.chosen.size(); ++i) {
    const ChosenSurface& surface = level.surface[i];
    const Vec3<float> q =
        inCamera(transform, Vec3<float>{level.chosen.x[i], level.chosen.y[i], level.chosen.z[i]});
    const ProjectionJacobian<float> projection = projectionJacobian(image_.K, q);
    Vec3<float> tangent[2];
    for (int t = 0; t < 2; ++t) {
      const Eigen::Vector3f& along = surface.tangent[t];
      tangent[t] = transposedTimes(transform.R, Vec3<float>{along.x(), along.y(), along.z()});
    }
    for (int c = 0; c < 3; ++c) {
      const Pixel<float> gradient = carriedGradient(
          projection, tangent, Pixel<float>{surface.gradient[c].x(), surface.gradient[c].y()});
      const float rescaled =
          rendered_local_.inverse_deviation[c][i] / level.local.inverse_deviation[c][i];
      rendered_du_[c][i] = rescaled * gradient.u;
      rendered_dv_[c][i] = rescaled * gradient.v;
    }
  }
}

// Colours of the frame where a pose puts the keyframe's cells.
void StartAligner::sampleFrame(const CameraPose<double>& pose) {
  const PointColumns& shown = level_->shown;
  kernels_->sampleColours({image_, transformOf(pose, keyframe_->centre)}, columnsOf(shown),
                          {shown.cell.data(), shown.size()}, grid_.data());
  for (const std::int32_t cell : hidden_) {
    std::fill_n(grid_.begin() + kBoxChannels * static_cast<std::ptrdiff_t>(cell), kBoxChannels,
                0.0f);
  }
}

void StartAligner::takeLocalColours(LocalColourColumns* local) {
  constexpr float kLeastWeight = 1e-3f;
  const KeyframeLevel& level = *level_;
  boxSums(grid_, level.width, level.height, level.window, &sums_);
  local->resize(level.chosen.cell.size());
  for (int i = 0; i < level.chosen.size(); ++i) {
    const float* sums =
        sums_.data() + kBoxChannels * static_cast<std::size_t>(level.chosen.cell[i]);
    const LocalColours<float> around =
        localColours(sums, 1 / std::max(sums[kLocalWeight], kLeastWeight));
    for (int c = 0; c < 3; ++c) {
      local->mean[c][i] = around.mean[c];
      local->inverse_deviation[c][i] = around.inverse_deviation[c];
    }
  }
}

void StartAligner::lookAround(const CameraPose<double>& pose) {
  sampleFrame(pose);
  takeLocalColours(&local_);
}

StartAligner::Evaluation StartAligner::evaluate(const CameraPose<double>& pose,
                                                const KernelRules& rules) {
  const KeyframeLevel& points = *level_;
  const KernelView view = {image_, transformOf(pose, keyframe_->centre)};
  const KernelColours colours = {
      {rendered_[0].data(), rendered_[1].data(), rendered_[2].data()},
      {rendered_du_[0].data(), rendered_du_[1].data(), rendered_du_[2].data()},
      {rendered_dv_[0].data(), rendered_dv_[1].data(), rendered_dv_[2].data()},
      {local_.mean[0].data(), local_.mean[1].data(), local_.mean[2].data()},
      {local_.inverse_deviation[0].data(), local_.inverse_deviation[1].data(),
       local_.inverse_deviation[2].data()},
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

StartAligner::Evaluation StartAligner::alignLevel(const std::vector<CameraPose<double>>& starts,
                                                  const KeyframeAlignmentSettings& settings) {
  const bool finest = index_ == settings.finest_level;
  const KernelRules rules = {
      static_cast<float>(settings.robust_scale * std::pow(settings.robust_growth, index_)),
      static_cast<float>(finest ? settings.observed_fraction : settings.coarse_observed_fraction)};
  Evaluation best;
  best.pose = starts.front();
  for (const CameraPose<double>& start : starts) {
    if (&start != &starts.front()) lookAround(start);
    const Evaluation evaluation = evaluate(start, rules);
    if (evaluation.loss < best.loss) best = evaluation;
    ++evaluations_;
  }
  double damping = kFirstDamping;
  double moved_px = 0;  // since the last look around
  for (int i = 1; i < settings.max_evaluations; ++i) {
    const std::optional<Step> step = proposeStep(best, damping, settings);
    if (!step ||
        step->rim_px < (finest ? settings.convergence_px : settings.coarse_convergence_px)) {
      break;
    }
    moved_px += step->rim_px;
    if (moved_px > settings.look_around_px) {
      lookAround(step->pose);
      moved_px = 0;
    }
    const Evaluation trial = evaluate(step->pose, rules);
    ++evaluations_;
    if (trial.loss < best.loss) {
      best = trial;
      damping = std::max(0.2 * damping, kMinDamping);
    } else {
      damping *= 10;
    }
  }
  return best;
}

/// Nothing where the points do not fix the pose.
std::optional<StartAligner::Step> StartAligner::proposeStep(
    const Evaluation& from, double damping, const KeyframeAlignmentSettings& settings) const {
  double x[6];
  if (!solve6(equationsOf(from.sums), damping, 1e-9, x)) return std::nullopt;
  const Vec3<double> v = {x[0], x[1], x[2]}, w = {x[3], x[4], x[5]};
  const double diameter = keyframe_->diameter;
  const double factor =
      std::min({settings.over_relaxation, settings.max_translation * diameter / norm(v),
                settings.max_rotation_rad / norm(w)});
  const Vec3<double> centre = plainVector(keyframe_->centre);
  const double depth = pointTransform(from.pose, centre).t.z;
  const double rim_px = factor * (norm(v) + 0.5 * diameter * norm(w)) * image_.K.fx / depth;
  return Step{moveCamera(from.pose, centre, factor * v, factor * w), rim_px};
}

Hypothesis StartAligner::align(const FramePyramid& frame, const KeyframePoints& keyframe,
                               const Pose& start_T_O_C, const KeyframeAlignmentSettings& settings) {
  keyframe_ = &keyframe;
  evaluations_ = 0;
  Evaluation best;
  best.pose = plainPose(start_T_O_C);
  const int first_of_frame = frameLevelFor(keyframe, frame.camera(), start_T_O_C);
  const int levels = static_cast<int>(keyframe.levels.size());
  // What a coarse level found counts only where a finer one finds it better than the start, too.
  std::vector<CameraPose<double>> starts = {best.pose};
  for (int level = std::min(settings.coarsest_level, levels - 1); level >= settings.finest_level;
       --level) {
    const std::optional<KernelImage> image = frame.level(first_of_frame + level);
    // A far object has no points at coarse levels.
    if (!image || keyframe.levels[level].point_count < kMinPoints) continue;
    image_ = *image;
    beginLevel(level, starts.front());
    best = alignLevel(starts, settings);
    starts = {best.pose};
    if (level > settings.finest_level + 1) starts.push_back(plainPose(start_T_O_C));
  }
  return hypothesisOf(best, settings);
}

Hypothesis StartAligner::hypothesisOf(const Evaluation& best,
                                      const KeyframeAlignmentSettings& settings) const {
  Hypothesis found;
  found.iterations = evaluations_;
  found.T_O_C = poseOf(best.pose);
  found.state = stateOf(found.T_O_C, *keyframe_, best.sums);
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
