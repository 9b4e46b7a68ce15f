// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/settings.h"

#include <cmath>

#include "math/require.h"

namespace nerf_pose_refiner {

void SearchSettings::validate() const {
  require(rotation_deg > 0 && rotation_deg <= 180, "rotation_deg", rotation_deg,
          "above 0 and at most 180");
  require(translation > 0 && translation <= 100, "translation", translation,
          "above 0 and at most 100 object diameters");
  refiner.validate();
}

void TrackingRules::validate() const {
  const auto require_at_least_0 = [](double value, const char* name) {
    require(value >= 0 && std::isfinite(value), name, value, "0 or more");
  };
  require(trust_score >= 0 && trust_score <= 1, "trust_score", trust_score, "0..1");
  require(min_score >= 0 && min_score <= trust_score, "min_score", min_score, "0..trust_score");
  require_at_least_0(max_failures, "max_failures");
  require_at_least_0(recover_s, "recover_s");
  require_at_least_0(image_timeout_s, "image_timeout_s");
  require(detect_rate_hz > 0 && std::isfinite(detect_rate_hz), "detect_rate_hz", detect_rate_hz,
          "above 0");
  require((detect_share > 0 && detect_share <= 1) || std::isinf(detect_share), "detect_share",
          detect_share, "above 0, at most 1, or infinite");
  require(initial_pose_max_age_s > 0, "initial_pose_max_age_s", initial_pose_max_age_s, "above 0");
}

void TrackerSettings::validate() const {
  require(window.views >= 0, "window.views", window.views, "0 or more");
  require(window.apart_deg > 0, "window.apart_deg", window.apart_deg, "above 0");
  require(window.position_dev_m >= 0, "window.position_dev_m", window.position_dev_m, "0 or more");
  require(window.rotation_dev_deg >= 0, "window.rotation_dev_deg", window.rotation_dev_deg,
          "0 or more");
  require(window.time_dev_s >= 0, "window.time_dev_s", window.time_dev_s, "0 or more");
  require(window.renewal_s > 0, "window.renewal_s", window.renewal_s, "above 0");
  rules.validate();
  initial.validate();
  tracking.validate();
}

}  // namespace nerf_pose_refiner
