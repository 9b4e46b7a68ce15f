// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trust_table.h"

#include <utility>

#include "evaluation/pose_error.h"
#include "evaluation/start.h"
#include "field/object_frame.h"
#include "geometry/matrix6.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::int64_t kInterval_ns = 100000000;
// Starts of tracks; those of first poses follow the width of a search.
constexpr double kNear_rad = 2 * kDegree, kNear = 0.02;

TrackerSettings fromFiles(TrackerSettings settings) {
  settings.mask_mode = MaskMode::kEveryFrame;
  settings.tracking.refiner.keyframes.real_time = false;
  return settings;
}

}  // namespace

TrustCounts& TrustCounts::operator+=(const TrustCounts& other) {
  images += other.images;
  right += other.right;
  published += other.published;
  wrong += other.wrong;
  runs += other.runs;
  back += other.back;
  return *this;
}

TrustTable::TrustTable(std::shared_ptr<Backend> backend, std::shared_ptr<const Field> object,
                       const TrackerSettings& settings)
    : object_(object), tracker_(std::move(backend), std::move(object), fromFiles(settings)) {}

void TrustTable::offerStart(const TrustScene& scene, double rotation_rad, double translation) {
  const FieldMetadata& object = object_->metadata;
  const StartSpread spread = {rotation_rad, translation * object.diameter, true};
  const Pose start = perturbedStart(scene.T_O_C, spread, object.centre, scene.draw.seed, starts_++);
  tracker_.reset();
  tracker_.offer({ObjectFrame::inMetres(object).objectInCamera(start), "camera", 0, false, {}});
}

TrustSample TrustTable::judged(const TrustImage& image, const TrustScene& scene,
                               const TrackOutcome& outcome) const {
  constexpr double kMaxDegrees = 5, kMaxOffset = 0.05;
  const FieldMetadata& object = object_->metadata;
  const Pose& T_O_C = outcome.refinement.T_O_C;
  const PoseError error =
      poseError(T_O_C, scene.T_O_C, object.centre, scene.camera, object.symmetries);
  TrustSample sample = {
      image, 0,    outcome, error.rotation_rad / kDegree, error.object_offset / object.diameter,
      0,     false};
  sample.right = outcome.found && image.shows_object && sample.rotation_deg <= kMaxDegrees &&
                 sample.offset <= kMaxOffset;
  if (sample.right) {
    const Vector6 away =
        cameraTwist(T_O_C, nearestEquivalent(scene.T_O_C, T_O_C, object.symmetries), object.centre);
    sample.squared_error = squaredDistance(away, outcome.refinement.covariance) / 6;
  }
  return sample;
}

TrustCounts TrustTable::show(const TrustRow& row, const TrustScene& scene, const Report& report) {
  TrustCounts counts;
  bool last_is_right = false;
  int number = 0;
  for (const TrustImage& image : row.images(scene)) {
    if (!row.tracked) {
      offerStart(scene, row.start_factor * kSearchRotation_rad,
                 row.start_factor * kSearchTranslation);
    } else if (number == 0) {
      offerStart(scene, kNear_rad, kNear);
    }
    stamp_ns_ += kInterval_ns;
    const TrackOutcome outcome =
        tracker_.track({{"camera", stamp_ns_}, [&image](bool) { return image.observation; }});
    TrustSample sample = judged(image, scene, outcome);
    sample.number = number++;
    last_is_right = sample.right && outcome.trusted;
    ++counts.images;
    counts.right += sample.right;
    counts.published += outcome.trusted;
    counts.wrong += outcome.trusted && !sample.right;
    if (report) report(sample);
  }
  counts.runs = row.tracked ? 1 : 0;
  counts.back = row.tracked && last_is_right ? 1 : 0;
  return counts;
}

}  // namespace nerf_pose_refiner
