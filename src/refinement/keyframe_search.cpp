// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/keyframe_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "math/angle.h"
#include "refinement/pose_probability.h"
#include "refinement/start_poses.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kWindowMargin = 0.2;  // around the object [diameters]
constexpr double kAnyScale = 1e3;      // small views are compared at the image's own levels
constexpr double kMinBeside_rad = 4 * kDegree;  // nearer keyframes show the same

bool isBetter(const Hypothesis& a, const Hypothesis& b) {
  const bool a_lives = a.state == HypothesisState::kLive;
  const bool b_lives = b.state == HypothesisState::kLive;
  return a_lives != b_lives ? a_lives : a.loss < b.loss;
}

HypothesisTable bestOf(const HypothesisTable& table, std::size_t count,
                       const FieldMetadata& object) {
  return bestOf(table, count, object, isBetter);
}

bool scoresMore(const Hypothesis& a, const Hypothesis& b) {
  const bool a_lives = a.state == HypothesisState::kLive;
  const bool b_lives = b.state == HypothesisState::kLive;
  return a_lives != b_lives ? a_lives : a.score > b.score;
}

/// Half of them by loss, half by score: neither alone picks all right poses among small views. The
/// loss, a mean over a view's points, does not compare between views; the score of a plain object
/// is sometimes that of a contour in the background.
HypothesisTable bestOfBoth(const HypothesisTable& table, std::size_t count,
                           const FieldMetadata& object) {
  HypothesisTable best = bestOf(table, (count + 1) / 2, object);
  const HypothesisTable others = bestOf(table, count, object, scoresMore);
  for (const Hypothesis& one : others) {
    if (best.size() == count) break;
    const bool is_known = std::any_of(best.begin(), best.end(), [&](const Hypothesis& other) {
      return areNearlyTheSame(one.T_O_C, other.T_O_C, object);
    });
    if (!is_known) best.push_back(one);
  }
  return best;
}

/// The same with losses that compare between keyframes: the mean over a keyframe's points depends
/// on which points it has.
HypothesisTable comparable(HypothesisTable found) {
  for (Hypothesis& h : found) h.loss = 1 - h.score;
  return found;
}

/// Without what a prior does not expect. Coarse alignments end anywhere, and those far away would
/// take the place of the few that go on.
HypothesisTable withinReach(HypothesisTable found, const Prior& prior,
                            const FieldMetadata& object) {
  constexpr double kReach = 2;  // half widths: a little beyond the corners of the prior
  const auto is_beyond = [&](const Hypothesis& h) {
    return h.state == HypothesisState::kLive && distanceFromPrior(h.T_O_C, prior, object) > kReach;
  };
  found.erase(std::remove_if(found.begin(), found.end(), is_beyond), found.end());
  return found;
}

std::vector<Pose> posesOf(const HypothesisTable& table) {
  std::vector<Pose> poses;
  for (const Hypothesis& h : table) poses.push_back(h.T_O_C);
  return poses;
}

KeyframeAlignmentSettings coarse(const KeyframeAlignmentSettings& settings, int finest_level) {
  KeyframeAlignmentSettings coarse = settings;
  coarse.finest_level = finest_level;
  coarse.observed_fraction = settings.coarse_observed_fraction;
  coarse.convergence_px = settings.coarse_convergence_px;
  return coarse;
}

}  // namespace

KeyframeSearch::KeyframeSearch(Backend* backend, const std::shared_ptr<const LoadedField>& field,
                               const KeyframeSearchSettings& settings)
    : field_(field),
      settings_(settings),
      doubtful_score_(settings.doubtful_score),
      aligner_(backend->makeKeyframeAligner()),
      kept_(aligner_.get(), settings.max_keyframes,
            {settings.reach_rotation_deg * kDegree, settings.reach_distance}),
      bank_(ViewBank::of(field, settings.bank)),
      small_(aligner_.get(), settings.bank.views,
             {settings.reach_rotation_deg * kDegree, kAnyScale}),
      is_loaded_(settings.bank.views, 0) {}

void KeyframeSearch::loadViews(const std::vector<int>& numbers,
                               const CancellationToken& cancellation) {
  bank_->make(numbers, cancellation);
  for (const int number : numbers) {
    if (is_loaded_[number]) continue;
    small_.add(bank_->view(number, cancellation));
    is_loaded_[number] = 1;
  }
}

void KeyframeSearch::prepare(const CancellationToken& cancellation) {
  std::vector<int> all(is_loaded_.size());
  std::iota(all.begin(), all.end(), 0);
  loadViews(all, cancellation);
}

bool KeyframeSearch::isDoubtful(const HypothesisTable& found) const {
  return !isLive(found) || found.front().score < doubtful_score_;
}

std::optional<ViewDistance> KeyframeSearch::distanceOfNearest(const Pose& T_O_C) {
  const KeyframeSet::Entry* const nearest = kept_.nearest(T_O_C);
  if (nearest == nullptr) return std::nullopt;
  return viewDistance(*nearest->keyframe, T_O_C);
}

std::shared_ptr<const KeyframePoints> KeyframeSearch::nearestTo(const Pose& T_O_C) {
  const KeyframeSet::Entry* const nearest = kept_.nearest(T_O_C);
  return nearest == nullptr ? nullptr : nearest->keyframe;
}

void KeyframeSearch::lookAt(const Observation& observation, const FrameWindow& window) {
  other_.reset();
  aligner_->observe(observation, window);
  looked_at_ = {observation.camera, window.pixels};
}

void KeyframeSearch::lookAround(const Observation& observation, const KeyframePoints& keyframe,
                                const Pose& T_O_C, double margin) {
  lookAt(observation, frameWindowFor(keyframe, observation.camera, T_O_C, margin));
}

/// Whether what was looked at last contains the object in a pose, but for its rim.
bool KeyframeSearch::sees(const KeyframePoints& keyframe, const Pose& T_O_C) const {
  constexpr double kRim = 0.1;
  const PixelWindow object = frameWindowFor(keyframe, looked_at_.camera, T_O_C, -kRim).pixels;
  const PixelWindow& seen = looked_at_.pixels;
  return object.x >= seen.x && object.y >= seen.y &&
         object.x + object.width <= seen.x + seen.width &&
         object.y + object.height <= seen.y + seen.height;
}

std::vector<KeyframeStart> KeyframeSearch::startsOf(const std::vector<Pose>& poses,
                                                    KeyframeSet* set) {
  std::vector<KeyframeStart> starts;
  for (const Pose& pose : poses) {
    if (const KeyframeSet::Entry* nearest = set->nearest(pose)) {
      starts.push_back({nearest->number, pose});
    }
  }
  return starts;
}

HypothesisTable KeyframeSearch::near(const Observation& observation, const Prior& prior,
                                     const CancellationToken& cancellation) {
  const KeyframeSet::Entry* const nearest = kept_.nearest(prior.T_O_C);
  if (nearest == nullptr) return {};
  const KeyframePoints& keyframe = *nearest->keyframe;
  lookAround(observation, keyframe, prior.T_O_C, kWindowMargin);
  HypothesisTable found = alignWithOther(*nearest, prior.T_O_C, cancellation);
  if (!isDoubtful(found) || settings_.wide_starts == 0) return found;
  constexpr double kWideMargin = 0.5;
  lookAround(observation, keyframe, prior.T_O_C, kWideMargin);
  for (const Hypothesis& other : widely(prior, cancellation)) found.push_back(other);
  std::stable_sort(found.begin(), found.end(), isBetter);
  return found;
}

HypothesisTable KeyframeSearch::close(const Observation& observation, const Pose& T_O_C,
                                      const CancellationToken& cancellation) {
  const KeyframeSet::Entry* const nearest = kept_.nearest(T_O_C);
  if (nearest == nullptr) return {};
  lookAround(observation, *nearest->keyframe, T_O_C, kWindowMargin);
  return alignClosely({{nearest->number, T_O_C}}, cancellation);
}

/// A pose from which the object looks a little larger. Where the image does not fix its distance,
/// alignment does not return from there.
Pose KeyframeSearch::nearerThan(const Pose& T_O_C) const {
  constexpr double kLarger_px = 2, kMost = 0.1;  // the latter of the distance
  const FieldMetadata& object = field_->field().metadata;
  const Eigen::Vector3d sight = object.centre - T_O_C.t;
  const double size_px = looked_at_.camera.fx * object.diameter / sight.norm();
  return {T_O_C.R, T_O_C.t + std::min(kMost, kLarger_px / size_px) * sight};
}

/// Aligns the nearest keyframe, and at the same time the one that secondOpinion asks for if that
/// takes hardly any time: a launch of its own would. Whether coarse levels are needed, the nearest
/// one decides.
HypothesisTable KeyframeSearch::alignWithOther(const KeyframeSet::Entry& nearest, const Pose& T_O_C,
                                               const CancellationToken& cancellation) {
  const KeyframeSet::Entry* const other =
      aligner_->alignsSideBySide() ? kept_.beside(T_O_C, *nearest.keyframe, kMinBeside_rad)
                                   : nullptr;
  std::vector<KeyframeStart> starts = {{nearest.number, T_O_C}};
  if (other != nullptr) starts.push_back({other->number, nearerThan(T_O_C)});
  HypothesisTable found = alignClosely(starts, cancellation);
  if (other != nullptr) {
    other_ = Other{other->keyframe, found.back()};
    found.pop_back();
  }
  return found;
}

/// Of the keyframes some degrees beside a pose, the nearest but for the one nearest to the pose;
/// aligned from there at the finest level.
std::optional<KeyframeSearch::Other> KeyframeSearch::otherFrom(
    const KeyframePoints& nearest, const Pose& T_O_C, const CancellationToken& cancellation) {
  constexpr double kConvergence_px = 0.05;  // where it ends is compared, not taken
  const KeyframeSet::Entry* const other = kept_.beside(T_O_C, nearest, kMinBeside_rad);
  if (other == nullptr || !sees(*other->keyframe, T_O_C)) return std::nullopt;
  KeyframeAlignmentSettings finest = settings_.alignment;
  finest.coarsest_level = finest.finest_level;
  finest.convergence_px = std::max(finest.convergence_px, kConvergence_px);
  const std::vector<KeyframeStart> starts = {{other->number, nearerThan(T_O_C)}};
  return Other{other->keyframe, aligner_->align(starts, finest, cancellation).front()};
}

std::optional<SecondOpinion> KeyframeSearch::secondOpinion(const Hypothesis& found,
                                                           const CancellationToken& cancellation) {
  constexpr double kMinScore = 0.6;  // of the pose's own
  const auto nearest = nearestTo(found.T_O_C);
  if (nearest == nullptr) return std::nullopt;
  const bool is_aligned =
      other_ && other_->keyframe != nearest && sees(*other_->keyframe, found.T_O_C);
  const std::optional<Other> other =
      is_aligned ? other_ : otherFrom(*nearest, found.T_O_C, cancellation);
  if (!other || other->says.state != HypothesisState::kLive ||
      other->says.score < kMinScore * found.score) {
    return std::nullopt;
  }
  const auto besideOf = [&](const KeyframePoints& keyframe) {
    return viewDistance(keyframe, found.T_O_C).rotation_rad;
  };
  return SecondOpinion{other->says.T_O_C, besideOf(*other->keyframe), besideOf(*nearest)};
}

HypothesisTable KeyframeSearch::withBeside(const Observation& observation,
                                           const HypothesisTable& found,
                                           const CancellationToken& cancellation) {
  constexpr double kTurn_rad = 15 * kDegree, kNearer = 0.08;  // the latter of the distance
  constexpr std::size_t kMost = 8;
  if (!isLive(found)) return found;
  const Pose& best = found.front().T_O_C;
  const Eigen::Vector3d& centre = field_->field().metadata.centre;
  std::vector<Pose> starts = {best};  // too: the nearest keyframe may be another one by now
  for (const double sign : {-1.0, 1.0}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Matrix3d R = expSO3(Eigen::Vector3d(sign * kTurn_rad * best.R.col(axis)));
      starts.emplace_back(nearestRotation(R * best.R), centre + R * (best.t - centre));
    }
    starts.emplace_back(best.R, centre + (1 + sign * kNearer) * (best.t - centre));
  }
  HypothesisTable ends = alignNearest(observation, best, starts, cancellation);
  std::stable_sort(ends.begin(), ends.end(), isBetter);
  const bool is_better = isLive(ends) && ends.front().score >= found.front().score;
  return is_better ? bestOf(ends, kMost, field_->field().metadata) : found;
}

HypothesisTable KeyframeSearch::alignNearest(const Observation& observation, const Pose& T_O_C,
                                             const std::vector<Pose>& starts_T_O_C,
                                             const CancellationToken& cancellation) {
  const KeyframeSet::Entry* const nearest = kept_.nearest(T_O_C);
  if (nearest == nullptr) return {};
  lookAround(observation, *nearest->keyframe, T_O_C, kWindowMargin);
  std::vector<KeyframeStart> starts;
  for (const Pose& start : starts_T_O_C) starts.push_back({nearest->number, start});
  return alignToFinest(starts, cancellation);
}

/// Aligns from a fine level. From the coarsest one too if that ends badly: coarse levels reach
/// farther, but they take time, and lead a thin object astray.
HypothesisTable KeyframeSearch::alignClosely(const std::vector<KeyframeStart>& starts,
                                             const CancellationToken& cancellation) {
  constexpr int kFine = 1;
  KeyframeAlignmentSettings fine = settings_.alignment;
  fine.coarsest_level = std::max(fine.finest_level, std::min(fine.coarsest_level, kFine));
  HypothesisTable found = comparable(aligner_->align(starts, fine, cancellation));
  const int coarsest = std::min(settings_.alignment.coarsest_level, settings_.keyframe.levels - 1);
  if (!isDoubtful(found) || coarsest <= fine.coarsest_level) return found;
  const HypothesisTable from_coarse = alignToFinest(starts, cancellation);
  for (std::size_t i = 0; i < starts.size(); ++i) {
    if (isBetter(from_coarse[i], found[i])) found[i] = from_coarse[i];
  }
  return found;
}

/// Aligns from the coarsest level to the finest one.
HypothesisTable KeyframeSearch::alignToFinest(const std::vector<KeyframeStart>& starts,
                                              const CancellationToken& cancellation) {
  return comparable(aligner_->align(starts, settings_.alignment, cancellation));
}

/// Coarse alignments from all around the prior; the best go on to the finest level.
HypothesisTable KeyframeSearch::widely(const Prior& prior, const CancellationToken& cancellation) {
  constexpr double kSpread = 3;  // of the prior's half widths
  constexpr std::size_t kFinalists = 3;
  const FieldMetadata& object = field_->field().metadata;
  const int finest = std::min(2, settings_.keyframe.levels - 1);
  const std::vector<Pose> poses = posesAround(prior, object, kSpread, settings_.wide_starts);
  const HypothesisTable rough =
      aligner_->align(startsOf(poses, &kept_), coarse(settings_.alignment, finest), cancellation);
  const HypothesisTable best = bestOf(rough, kFinalists, object);
  return alignToFinest(startsOf(posesOf(best), &kept_), cancellation);
}

HypothesisTable KeyframeSearch::around(const Observation& observation, const Prior& prior,
                                       const WideStarts& starts,
                                       const CancellationToken& cancellation) {
  const FieldMetadata& object = field_->field().metadata;
  // A turn about each of three axes adds up to 1.7 of them.
  const std::vector<int> sides = bank_->around(prior.T_O_C, 1.4 * prior.rotation_rad);
  loadViews(sides, cancellation);
  const KeyframeSet::Entry* const nearest = small_.nearest(prior.T_O_C);
  if (nearest == nullptr) return {};
  FrameWindow window = frameWindowFor(*nearest->keyframe, observation.camera, prior.T_O_C,
                                      kWindowMargin + prior.translation);
  if (window.finest > 0) {  // some starts are farther away
    --window.finest;
    ++window.levels;
  }
  lookAt(observation, window);
  const std::vector<Pose> poses = posesAround(prior, object, 1, starts.count, starts.round);
  const HypothesisTable rough = withinReach(
      aligner_->align(startsOf(poses, &small_), coarse(settings_.alignment, 1), cancellation),
      prior, object);
  const HypothesisTable refined = bestOfBoth(rough, starts.refined, object);
  const HypothesisTable middle =
      withinReach(aligner_->align(startsOf(posesOf(refined), &small_),
                                  coarse(settings_.alignment, 0), cancellation),
                  prior, object);
  return bestOfBoth(middle, starts.finalists, object);
}

HypothesisTable KeyframeSearch::from(const Observation& observation, const HypothesisTable& poses,
                                     const CancellationToken& cancellation) {
  constexpr double kMargin = 0.5;  // the poses may be apart
  const std::vector<KeyframeStart> starts = startsOf(posesOf(poses), &kept_);
  if (starts.empty()) return {};
  const KeyframeSet::Entry* const nearest = kept_.nearest(starts.front().T_O_C);
  lookAround(observation, *nearest->keyframe, starts.front().T_O_C, kMargin);
  HypothesisTable found = alignToFinest(starts, cancellation);
  std::stable_sort(found.begin(), found.end(), isBetter);
  return found;
}

}  // namespace nerf_pose_refiner
