// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "math/require.h"
#include "refinement/settings.h"

namespace nerf_pose_refiner {
namespace {

void requirePositive(const char* name, double value) {
  require(value > 0 && std::isfinite(value), std::string("InversionSettings::") + name, value,
          "positive");
}

void requireNotNegative(const char* name, double value) {
  require(value >= 0 && std::isfinite(value), std::string("InversionSettings::") + name, value,
          "0 or more");
}

void requireFraction(const char* name, double value) {
  require(value > 0 && value <= 1, std::string("InversionSettings::") + name, value, "in (0, 1]");
}

void requireAverage(const char* name, double value) {
  require(value >= 0 && value < 1, std::string("InversionSettings::") + name, value, "in [0, 1)");
}

void validateDescent(const OptimisationPlan& plan) {
  requirePositive("descent.length_unit", plan.length_unit);
  requirePositive("descent.translation_learning_rate", plan.translation_learning_rate);
  requirePositive("descent.rotation_learning_rate", plan.rotation_learning_rate);
  requireFraction("descent.decay", plan.schedule.decay);
  requirePositive("descent.decay_updates", plan.schedule.decay_updates);
  require(plan.schedule.anneal_fraction >= 0 && plan.schedule.anneal_fraction <= 1,
          "InversionSettings::descent.anneal_share", plan.schedule.anneal_fraction, "in [0, 1]");
  requireAverage("descent.beta1", plan.beta1);
  requireAverage("descent.beta2", plan.beta2);
  requirePositive("descent.epsilon", plan.epsilon);
  requireNotNegative("descent.regularisation", plan.regularisation);
  requirePositive("descent.steps_per_update", plan.steps_per_update);
  constexpr int kMaxPerStep = 1 << 27;  // four times as many must fit 32 bits
  require(plan.samples_per_step >= 1 && plan.samples_per_step <= kMaxPerStep,
          "InversionSettings::descent.samples_per_step", plan.samples_per_step, "1 to 134217728");
  requirePositive("descent.score_steps", plan.score_steps);
}

}  // namespace

double InversionSettings::unitFor(double object_diameter) const {
  return unit > 0 ? unit : object_diameter / kInversionUnitsPerDiameter;
}

int InversionSettings::survivors(int round) const {
  const int fraction = static_cast<int>(hypotheses * keep_fraction * std::pow(keep_decay, round));
  return std::min(hypotheses, std::max(keep_at_least, fraction));
}

void InversionSettings::validate() const {
  requireNotNegative("unit", unit);
  requirePositive("hypotheses", hypotheses);
  requirePositive("first_steps", first_steps);
  requireNotNegative("rounds", rounds);
  requirePositive("round_steps", round_steps);
  requireNotNegative("spread_rotation_rad", spread_rotation_rad);
  requireNotNegative("spread_translation", spread_translation);
  requireFraction("keep_share", keep_fraction);
  requireFraction("keep_decay", keep_decay);
  requirePositive("keep_at_least", keep_at_least);
  requireNotNegative("jitter_rotation_rad", jitter_rotation_rad);
  requireNotNegative("jitter_translation", jitter_translation);
  requirePositive("score_pixels", score_pixels);
  validateDescent(descent);
}

}  // namespace nerf_pose_refiner
