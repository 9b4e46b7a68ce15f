// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "following.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <vector>

#include "evaluation/clutter.h"
#include "evaluation/pose_error.h"
#include "image/colour.h"
#include "refinement/refiner.h"
#include "tracking/prediction.h"
#include "work_report.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kTurn = 0.13;  // of the circle through the image, a frame [rad]
constexpr double kLostDeg = 15, kLostFraction = 0.2;
constexpr int kWarmUp = 5;  // frames whose time does not count

struct Frame {
  double deg, fraction, seconds, of_floor;
};

Pose poseOfFrame(const Following& plan, const FieldMetadata& object, const Pose& last, int i) {
  const double phase = kTurn * i, radius = plan.frame_fraction / kTurn;
  const Eigen::Vector3d axis =
      Eigen::Vector3d(std::sin(phase), 1, 0.5 * std::cos(0.7 * phase)).normalized();
  const Eigen::Vector3d object_C =
      object.diameter * Eigen::Vector3d(radius * std::cos(phase), radius * std::sin(phase), 2.2);
  Pose T_O_C;
  T_O_C.R = expSO3(Eigen::Vector3d(plan.frame_deg * kDegree * axis)) * last.R;
  T_O_C.t = object.centre - T_O_C.R * object_C;
  return T_O_C;
}

Observation observationOf(const Following& plan, const Rendering& rendering, const Camera& camera,
                          int i) {
  Observation observation;
  observation.camera = camera;
  if (plan.background == "grey") {
    observation.background = Background::kKnownColour;
    observation.background_colour.setConstant(0.5f);
    observation.image = composite({rendering.colour, rendering.alpha}, {0.5f, 0.5f, 0.5f});
    return observation;
  }
  observation.image = clutter(camera.width, camera.height, plan.seed, 2.0 * i);
  for (std::size_t k = 0; k < rendering.alpha.values.size(); ++k) {
    for (std::size_t c = 0; c < 3; ++c) {
      float& value = observation.image.values[3 * k + c];
      value = rendering.colour.values[3 * k + c] + (1 - rendering.alpha.values[k]) * value;
    }
  }
  if (plan.background == "mask") {
    observation.background = Background::kMask;
    observation.alpha = rendering.alpha;
    for (float& value : observation.alpha.values) value = value > 0.5f ? 1.0f : 0.0f;
  }
  return observation;
}

double quantile(const std::vector<Frame>& frames, double Frame::*value, double fraction) {
  std::vector<double> values;
  for (const Frame& frame : frames) values.push_back(frame.*value);
  std::sort(values.begin(), values.end());
  const double last = static_cast<double>(values.size()) - 1;
  return values[static_cast<std::size_t>(std::lround(fraction * last))];
}

}  // namespace

void follow(const Following& plan, const std::shared_ptr<Backend>& backend,
            const LoadedField& field, const Floor& floor) {
  const FieldMetadata& object = field.field().metadata;
  const Camera camera = {640, 480, 700, 700, 319.5, 239.5};
  Refiner refiner(backend, RefinerSettings::named("track"));
  std::vector<Frame> frames;
  int lost = 0, near = 0;
  Pose truth = poseOfFrame(plan, object, Pose(), 0), found = truth;
  std::optional<Pose> before;  // the pose found before `found`
  for (int i = 1; i <= plan.frames; ++i) {
    truth = poseOfFrame(plan, object, truth, i);
    const Rendering rendering = field.render({camera, truth}, {}, {});
    const Observation observation = observationOf(plan, rendering, camera, i);
    Prior prior;
    prior.T_O_C = found;
    prior.rotation_rad = 1.5 * plan.frame_deg * kDegree;
    prior.translation = 1.5 * plan.frame_fraction;
    if (plan.predict && before) prior = predictConstantVelocity(prior, *before, 1, object);
    if (i == 1) {
      for (int k = 0; k < kWarmUp; ++k) refiner.refine(field, observation, prior);
    }
    const Refinement refined = refiner.refine(field, observation, prior);
    const PoseError error = poseError(refined.T_O_C, truth, object.centre, camera);
    const Frame frame = {error.rotation_rad / kDegree, error.object_offset / object.diameter,
                         refined.seconds,
                         floorFraction(refined.work, refined.seconds, floor).of_larger};
    frames.push_back(frame);
    near += frame.deg < 0.3 && frame.fraction < 0.005;
    const bool is_lost = !(frame.deg < kLostDeg && frame.fraction < kLostFraction);
    lost += is_lost;
    before = is_lost ? std::nullopt : std::make_optional(found);
    found = is_lost ? truth : refined.T_O_C;  // each loss is counted, and the rest goes on
  }
  std::printf(
      "follow %s, %.0f deg and %.0f %% a frame%s: %d of %zu within 0.3 deg and 0.5 %%, %d lost; "
      "median %.3f deg, %.3f %%; %.2f ms median, %.2f ms p99; %.2f of the floor\n",
      plan.background.c_str(), plan.frame_deg, 100 * plan.frame_fraction,
      plan.predict ? "" : ", from the last pose", near, frames.size(), lost,
      quantile(frames, &Frame::deg, 0.5), 100 * quantile(frames, &Frame::fraction, 0.5),
      1e3 * quantile(frames, &Frame::seconds, 0.5), 1e3 * quantile(frames, &Frame::seconds, 0.99),
      quantile(frames, &Frame::of_floor, 0.5));
  std::fflush(stdout);
}

}  // namespace nerf_pose_refiner
