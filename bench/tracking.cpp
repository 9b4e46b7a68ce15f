// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "evaluation/clutter.h"
#include "evaluation/pose_error.h"
#include "field/object_frame.h"
#include "image/colour.h"
#include "math/angle.h"
#include "tracking/object_tracker.h"
#include "work_report.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kTurn = 0.13;  // of the circle through the image, a frame [rad]
constexpr double kLostDeg = 15, kLostFraction = 0.2;
constexpr int kWarmUp = 5;  // frames whose time does not count

struct Frame {
  double deg, fraction, seconds, of_floor;
};

Pose poseOfFrame(const TrackingBenchmark& plan, const FieldMetadata& object, const Pose& last,
                 int i) {
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

Observation observationOf(const TrackingBenchmark& plan, const Rendering& rendering,
                          const Camera& camera, int i) {
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

/// The node's, but for the width of the searches. The first one is as narrow as all others.
TrackerSettings settingsOf(const TrackingBenchmark& plan) {
  TrackerSettings settings;
  settings.tracking =
      SearchSettings::named("track", 1.5 * plan.frame_deg, 1.5 * plan.frame_fraction);
  settings.initial = settings.tracking;
  settings.rules.predict = plan.predict;
  return settings;
}

/// A tracker that gets the true pose where it has none.
class Bench {
 public:
  Bench(const TrackerSettings& settings, const std::shared_ptr<Backend>& backend,
        const std::shared_ptr<const Field>& object)
      : frame_(ObjectFrame::inMetres(object->metadata)), tracker_(backend, object, settings) {}

  /// Starts again from a pose in the next image.
  void beginAt(const Pose& T_O_C) {
    tracker_.reset();
    tracker_.offer({frame_.objectInCamera(T_O_C), "camera", 0, false, {}});
  }

  Refinement track(const Observation& observation) {
    stamp_ns_ += 33000000;
    return tracker_.track({{"camera", stamp_ns_}, [&](bool) { return observation; }}).refinement;
  }

 private:
  ObjectFrame frame_;
  ObjectTracker tracker_;
  std::int64_t stamp_ns_ = 0;
};

/// The object with a scale, which errors do not depend on.
std::shared_ptr<const Field> withScale(const Field& field) {
  auto object = std::make_shared<Field>(field);
  if (!(object->metadata.metres_per_unit > 0)) object->metadata.metres_per_unit = 1;
  return object;
}

void warmUp(const Observation& observation, const Pose& T_O_C, Bench* bench) {
  for (int i = 0; i < kWarmUp; ++i) {
    bench->beginAt(T_O_C);
    bench->track(observation);
  }
}

}  // namespace

void track(const TrackingBenchmark& plan, const std::shared_ptr<Backend>& backend,
           const LoadedField& field, const Floor& floor) {
  const FieldMetadata& object = field.field().metadata;
  const Camera camera = {640, 480, 700, 700, 319.5, 239.5};
  Bench bench(settingsOf(plan), backend, withScale(field.field()));
  std::vector<Frame> frames;
  int lost = 0, near = 0;
  Pose truth = poseOfFrame(plan, object, Pose(), 0);
  for (int i = 1; i <= plan.frames; ++i) {
    const Pose before = truth;
    truth = poseOfFrame(plan, object, truth, i);
    const Rendering rendering = field.render({camera, truth}, {}, {});
    const Observation observation = observationOf(plan, rendering, camera, i);
    if (i == 1) {
      warmUp(observation, before, &bench);
      bench.beginAt(before);
    }
    const Refinement refined = bench.track(observation);
    const PoseError error = poseError(refined.T_O_C, truth, object.centre, camera);
    const Frame frame = {error.rotation_rad / kDegree, error.object_offset / object.diameter,
                         refined.seconds,
                         floorFraction(refined.work, refined.seconds, floor).of_larger};
    frames.push_back(frame);
    near += frame.deg < 0.3 && frame.fraction < 0.005;
    const bool is_lost = !(frame.deg < kLostDeg && frame.fraction < kLostFraction);
    lost += is_lost;
    if (is_lost) bench.beginAt(truth);  // each loss is counted, and the rest goes on
  }
  std::printf(
      "track %s, %.0f deg and %.0f %% a frame%s: %d of %zu within 0.3 deg and 0.5 %%, %d lost; "
      "median %.3f deg, %.3f %%; %.2f ms median, %.2f ms p99; %.2f of the floor\n",
      plan.background.c_str(), plan.frame_deg, 100 * plan.frame_fraction,
      plan.predict ? "" : ", from the last pose", near, frames.size(), lost,
      quantile(frames, &Frame::deg, 0.5), 100 * quantile(frames, &Frame::fraction, 0.5),
      1e3 * quantile(frames, &Frame::seconds, 0.5), 1e3 * quantile(frames, &Frame::seconds, 0.99),
      quantile(frames, &Frame::of_floor, 0.5));
  std::fflush(stdout);
}

}  // namespace nerf_pose_refiner
