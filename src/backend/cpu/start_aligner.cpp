// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/start_aligner.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "backend/common/plain_pose.h"

namespace nerf_pose_refiner {
namespace {

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

Vec3<float> normalOf(const ChosenSurface& surface) {
  const Vec3<float> tangent[2] = {
      {surface.tangent[0].x(), surface.tangent[0].y(), surface.tangent[0].z()},
      {surface.tangent[1].x(), surface.tangent[1].y(), surface.tangent[1].z()}};
  return surfaceNormal(tangent);
}

int countOf(const KeyframeLevel& level) {
  return level.point_count + static_cast<int>(level.outline.size());
}

}  // namespace

void StartAligner::beginLevel(int index, const CameraPose<double>& pose) {
  level_ = &keyframe_->levels[index];
  grid_.begin(*level_);
  outline_.take(*level_);
  hideOccluded(pose);
  lookAround(pose);
  findLight();
  compareWhatIsSeen();
  carryGradients(pose);
}

PointTransform<float> StartAligner::transformOf(const CameraPose<double>& pose) const {
  return singleTransform(pose, plainVector(keyframe_->centre));
}

void StartAligner::hideOccluded(const CameraPose<double>& pose) {
  hidden_ = occlusion_.hidden(level_->shown, transformOf(pose),
                              {image_.K, image_.width, image_.height, level_->spacing});
  weight_ = level_->weight;
  // What is hidden is marked in the grid while weights are looked up.
  for (const std::int32_t cell : hidden_) *grid_.cell(cell) = 1;
  for (int i = 0; i < level_->chosen.size(); ++i) {
    if (*grid_.cell(level_->chosen.cell[i]) > 0) weight_[i] = 0;
  }
  for (const std::int32_t cell : hidden_) *grid_.cell(cell) = 0;
  shown_weight_ = std::accumulate(weight_.begin(), weight_.end(), 0.0);
}

// By what was sampled of the frame.
void StartAligner::findLight() {
  const KeyframeLevel& level = *level_;
  std::vector<LightSample>& samples = light_samples_;
  samples.clear();
  for (const std::int32_t i : level.light_samples) {
    const float* const frame = grid_.cell(level.shown.cell[i]);
    const float weight = frame[kLocalWeight];
    if (!(weight > 0)) continue;
    const float seen[3] = {frame[0] / weight, frame[1] / weight, frame[2] / weight};
    const float rendered[3] = {level.shown_colour[0][i], level.shown_colour[1][i],
                               level.shown_colour[2][i]};
    samples.push_back(
        {level.shown_normal[i], logBrightness(seen) - logBrightness(rendered), weight});
  }
  light_ = estimateLight(samples).change;
}

// Where a part of the object is hidden, covered or outside of the image, the keyframe's colours are
// normalised over the rest of it, too: otherwise what is left would differ in mean and spread. And
// they are in the light of the frame.
void StartAligner::compareWhatIsSeen() {
  const KeyframeLevel& level = *level_;
  for (int i = 0; i < level.shown.size(); ++i) {
    float* const sums = grid_.cell(level.shown.cell[i]);
    const float weight = sums[kLocalWeight];
    const float gain = lightGain(light_, level.shown_normal[i]);
    for (int c = 0; c < 3; ++c) {
      const float colour = gain * level.shown_colour[c][i];
      sums[c] = weight * colour;
      sums[3 + c] = weight * colour * colour;
    }
  }
  grid_.takeLocalColours(*kernels_, &rendered_local_);
  for (std::vector<float>& rendered : rendered_) rendered.resize(level.chosen.size());
  gain_.resize(level.chosen.size());
  for (int i = 0; i < level.chosen.size(); ++i) {
    const LocalColours<float> all = level.local.at(i), seen = rendered_local_.at(i);
    gain_[i] = lightGain(light_, normalOf(level.surface[i]));
    for (int c = 0; c < 3; ++c) {
      rendered_[c][i] = renormalised(level.colour[c][i], all, seen, gain_[i], c);
    }
  }
}

void StartAligner::carryGradients(const CameraPose<double>& pose) {
  const KeyframeLevel& level = *level_;
  const PointTransform<float> transform = transformOf(pose);
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
          gain_[i] * rendered_local_.inverse_deviation[c][i] / level.local.inverse_deviation[c][i];
      rendered_du_[c][i] = rescaled * gradient.u;
      rendered_dv_[c][i] = rescaled * gradient.v;
    }
  }
}

// Colours of the frame where a pose puts the keyframe's cells, and around its chosen points.
void StartAligner::lookAround(const CameraPose<double>& pose) {
  const PointColumns& shown = level_->shown;
  kernels_->sampleColours({image_, transformOf(pose)}, columnsOf(shown),
                          {shown.cell.data(), shown.size()}, grid_.cells());
  for (const std::int32_t cell : hidden_) std::fill_n(grid_.cell(cell), kCellNumbers, 0.0f);
  grid_.takeLocalColours(*kernels_, &local_);
}

KernelColours StartAligner::colours() const {
  return {{rendered_[0].data(), rendered_[1].data(), rendered_[2].data()},
          {rendered_du_[0].data(), rendered_du_[1].data(), rendered_du_[2].data()},
          {rendered_dv_[0].data(), rendered_dv_[1].data(), rendered_dv_[2].data()},
          {local_.mean[0].data(), local_.mean[1].data(), local_.mean[2].data()},
          {local_.inverse_deviation[0].data(), local_.inverse_deviation[1].data(),
           local_.inverse_deviation[2].data()},
          weight_.data(),
          brightness_.data()};
}

AlignedKeyframe StartAligner::evaluate(const CameraPose<double>& pose,
                                       const KeyframeLevelRules& rules) {
  const KeyframeLevel& points = *level_;
  const KernelView view = {image_, transformOf(pose)};
  const KernelColours compared = colours();
  AlignedKeyframe evaluated;
  evaluated.pose = pose;
  for (std::size_t t = 0; t + 1 < points.tiles.size(); ++t) {
    PointSums<float> tile = {};
    const KernelTile points_of_tile = {columnsOf(points.chosen), compared, points.tiles[t],
                                       points.tiles[t + 1]};
    kernels_->sumTile(view, points_of_tile, {rules.robust_scale, rules.observed_fraction}, &tile);
    add(tile, &evaluated.sums);
    evaluated.scatter.addTile(equationsOf(tile));
  }
  SeenPoints seen = {
      shown_weight_,         evaluated.sums.weight,  static_cast<int>(points.outline.size()), 0,
      points.outline_weight, points.outline_evidence};
  for (int t = 0; t < outline_.tiles(); ++t) {
    PointSums<float> tile = {};
    seen.outline_seen += kernels_->sumOutline(view, outline_.tile(t),
                                              {rules.robust_scale, points.outline_weight}, &tile);
    add(tile, &evaluated.sums);
    evaluated.scatter.addTile(equationsOf(tile));
  }
  evaluated.loss = keyframeLoss(evaluated.sums.cost, seen, rules.robust_scale);
  evaluated.most_weight = seen.mostWeight();
  evaluated.surface.most = seen.points;
  evaluated.outline.most = seen.mostOutlineEvidence();
  ++evaluations_;
  return evaluated;
}

// What speaks for a pose, by the colours around it.
void StartAligner::findEvidence(const KeyframeLevelRules& rules, AlignedKeyframe* aligned) {
  lookAround(aligned->pose);
  const KeyframeLevel& level = *level_;
  brightness_.resize(level.chosen.size());
  for (int i = 0; i < level.chosen.size(); ++i) {
    const float colour[3] = {level.colour[0][i], level.colour[1][i], level.colour[2][i]};
    brightness_[i] = gain_[i] * brightnessOf(colour, level.local.at(i));
  }
  const KernelView view = {image_, transformOf(aligned->pose)};
  const KernelColours compared = colours();
  const double full_chance = chanceLoss(rules.robust_scale);
  const auto add = [&](const EvidenceSums<float>& tile, EvidenceOfKind* kind) {
    kind->explained += tile.explained;
    kind->chance += tile.chance;
    aligned->tiles.addTile(tile, full_chance);
  };
  for (std::size_t t = 0; t + 1 < level.tiles.size(); ++t) {
    EvidenceSums<float> tile = {};
    kernels_->sumEvidence(view,
                          {columnsOf(level.chosen), compared, level.tiles[t], level.tiles[t + 1]},
                          {rules.robust_scale, rules.observed_fraction}, &tile);
    add(tile, &aligned->surface);
  }
  for (int t = 0; t < outline_.tiles(); ++t) {
    EvidenceSums<float> tile = {};
    kernels_->sumOutlineEvidence(view, outline_.tile(t),
                                 {rules.robust_scale, level.outline_evidence}, &tile);
    add(tile, &aligned->outline);
  }
}

AlignedKeyframe StartAligner::alignLevel(const std::vector<CameraPose<double>>& starts,
                                         const KeyframeLevelRules& rules) {
  AlignedKeyframe best;
  best.pose = starts.front();
  best.loss = HUGE_VAL;
  for (const CameraPose<double>& start : starts) {
    if (&start != &starts.front()) lookAround(start);
    const AlignedKeyframe evaluated = evaluate(start, rules);
    if (evaluated.loss < best.loss) best = evaluated;
  }
  const KeyframeObject object = {plainVector(keyframe_->centre), keyframe_->diameter, image_.K.fx};
  double damping = kFirstKeyframeDamping;
  double moved_px = 0;  // since the last look around
  for (int i = 1; i < rules.max_evaluations; ++i) {
    const KeyframeStep step = proposeKeyframeStep(best.pose, best.sums, damping, rules, object);
    if (!step.exists || step.rim_px < rules.convergence_px) break;
    moved_px += step.rim_px;
    if (moved_px > rules.look_around_px) {
      lookAround(step.pose);
      moved_px = 0;
    }
    const AlignedKeyframe trial = evaluate(step.pose, rules);
    const bool accepted = trial.loss < best.loss;
    if (accepted) best = trial;
    damping = nextDamping(damping, accepted);
  }
  return best;
}

Hypothesis StartAligner::align(const CpuFrame& frame, const KeyframePoints& keyframe,
                               const Pose& start_T_O_C, const KeyframeAlignmentSettings& settings) {
  keyframe_ = &keyframe;
  evaluations_ = 0;
  AlignedKeyframe best;
  best.pose = plainPose(start_T_O_C);
  best.loss = HUGE_VAL;
  const int first_of_frame = frameLevelFor(keyframe, frame.levels().camera(), start_T_O_C);
  const int levels = static_cast<int>(keyframe.levels.size());
  // What a coarse level found counts only where a finer one finds it better than the start, too.
  std::vector<CameraPose<double>> starts = {best.pose};
  for (int level = std::min(settings.coarsest_level, levels - 1); level >= settings.finest_level;
       --level) {
    const std::optional<KernelImage> image = frame.level(first_of_frame + level);
    // A far object has few points at coarse levels.
    const int fewest = level > settings.finest_level ? kMinCoarsePoints : kMinKeyframePoints;
    if (!image || countOf(keyframe.levels[level]) < fewest) continue;
    image_ = *image;
    beginLevel(level, starts.front());
    best = alignLevel(starts, levelRules(settings, level));
    starts = {best.pose, plainPose(start_T_O_C)};
  }
  best.evaluations = evaluations_;
  if (best.loss < HUGE_VAL) {
    findEvidence(levelRules(settings, settings.finest_level), &best);
  }
  return hypothesisOf(best, keyframe, settings);
}

}  // namespace nerf_pose_refiner
