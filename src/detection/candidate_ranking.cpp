// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/candidate_ranking.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "field/field.h"
#include "math/angle.h"
#include "refinement/grey_image.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kAnyDistance = 1e3;  // small views are compared at the image's own levels

/// A part of an image at all levels.
FrameWindow atAllLevels(const PixelWindow& pixels) {
  FrameWindow window;
  window.pixels = pixels;
  window.finest = 0;
  window.levels = 1;
  while (window.levels < 8 && std::min(pixels.width, pixels.height) >> window.levels >= 2) {
    ++window.levels;
  }
  return window;
}

bool isSamePose(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object) {
  constexpr double kRotation = 4 * kDegree, kOffset = 0.04;  // the latter in diameters
  const Pose a = nearestEquivalent(a_T_O_C, b_T_O_C, object.symmetries);
  return rotationDistance(a.R, b_T_O_C.R) < kRotation &&
         (a.inverse() * object.centre - b_T_O_C.inverse() * object.centre).norm() <
             kOffset * object.diameter;
}

}  // namespace

CandidateRanking::CandidateRanking(Backend* backend, std::shared_ptr<const LoadedField> field,
                                   const KeyframeSearchSettings& settings)
    : backend_(backend),
      field_(std::move(field)),
      settings_(settings),
      is_same_instance_(field_->field()) {
  begin();
}

/// Without views.
void CandidateRanking::begin() {
  views_.reset();
  aligner_ = backend_->makeKeyframeAligner();
  bank_ = ViewBank::of(field_, settings_.bank);
  views_.emplace(aligner_.get(), settings_.bank.views,
                 ViewDistance{settings_.reach_rotation_deg * kDegree, kAnyDistance});
  is_loaded_.assign(static_cast<std::size_t>(settings_.bank.views), 0);
}

const KeyframeSet::Entry* CandidateRanking::viewFor(const Pose& T_O_C, bool may_render,
                                                    const CancellationToken& cancellation) {
  for (const int number : bank_->around(T_O_C, 0)) {
    if (is_loaded_[static_cast<std::size_t>(number)]) continue;
    if (!may_render && !bank_->isMade(number)) continue;
    views_->add(bank_->view(number, cancellation));
    is_loaded_[static_cast<std::size_t>(number)] = 1;
  }
  return views_->nearest(T_O_C);
}

std::vector<AlignedCandidate> CandidateRanking::rank(const Observation& observation,
                                                     const PoseCandidates& candidates,
                                                     const RankingLimits& limits,
                                                     const CancellationToken& cancellation) {
  const std::optional<bool> grey = isGrey(observation);
  if (grey && *grey != settings_.bank.keyframe.grey) {
    settings_.bank.keyframe.grey = *grey;
    begin();
  }
  std::vector<KeyframeStart> starts;
  std::vector<std::size_t> numbers;  // of their candidates
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const KeyframeSet::Entry* const view =
        viewFor(candidates[i].T_O_C, limits.may_render, cancellation);
    if (view == nullptr) continue;
    starts.push_back({view->number, candidates[i].T_O_C});
    numbers.push_back(i);
  }
  std::vector<AlignedCandidate> aligned;
  if (starts.empty()) return aligned;
  aligner_->observe(observation, atAllLevels(limits.window));
  KeyframeAlignmentSettings rules = settings_.alignment;
  rules.observed_fraction = rules.coarse_observed_fraction;
  rules.convergence_px = rules.coarse_convergence_px;
  const std::vector<Hypothesis> found = aligner_->align(starts, rules, cancellation);
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].state != HypothesisState::kLive) continue;
    aligned.push_back({candidates[numbers[i]], found[i].score});
    aligned.back().candidate.T_O_C = found[i].T_O_C;
  }
  std::stable_sort(
      aligned.begin(), aligned.end(),
      [](const AlignedCandidate& a, const AlignedCandidate& b) { return a.score > b.score; });
  return chosen(aligned, limits);
}

/// @param ranked best first.
std::vector<AlignedCandidate> CandidateRanking::chosen(const std::vector<AlignedCandidate>& ranked,
                                                       const RankingLimits& limits) const {
  std::vector<AlignedCandidate> best;
  const FieldMetadata& object = field_->field().metadata;
  for (const AlignedCandidate& one : ranked) {
    if (best.size() == limits.all) break;
    const Pose& T_O_C = one.candidate.T_O_C;
    const bool is_known = std::any_of(best.begin(), best.end(), [&](const AlignedCandidate& other) {
      return isSamePose(T_O_C, other.candidate.T_O_C, object);
    });
    const auto of_instance =
        std::count_if(best.begin(), best.end(), [&](const AlignedCandidate& other) {
          return is_same_instance_(T_O_C, other.candidate.T_O_C);
        });
    if (!is_known && static_cast<std::size_t>(of_instance) < limits.of_instance) {
      best.push_back(one);
    }
  }
  return best;
}

}  // namespace nerf_pose_refiner
