// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/registrar.h"

#include <algorithm>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "registration/data_check.h"
#include "registration/field_training.h"
#include "registration/registration_hash.h"
#include "trust/look_alikes.h"
#include "trust/pose_errors.h"
#include "trust/pose_statistics.h"

namespace nerf_pose_refiner {
namespace {

void requireBox(const Dataset& dataset) {
  if (!dataset.has_box) return;
  const Eigen::Vector3d &low = dataset.box_min, &high = dataset.box_max;
  if (low.allFinite() && high.allFinite() && (low.array() < high.array()).all()) return;
  std::ostringstream text;
  text << "the box from " << low.transpose() << " to " << high.transpose() << " is empty";
  throw std::invalid_argument(text.str());
}

/// Views whose poses are found again, to learn how well that goes: those held out, and some that
/// were learned, for few are held out. @param count so many, if there are as many.
std::vector<PosedView> poseViews(const SplitViews& split, std::size_t count) {
  const std::vector<PosedView>& training = split.training;
  std::vector<PosedView> views = split.held_out;
  const std::size_t missing = std::min(count - std::min(count, views.size()), training.size());
  for (std::size_t i = 0; i < missing; ++i)
    views.push_back(training[training.size() * i / missing]);
  return views;
}

/// Measures what decides whether a pose that is found with the field can be trusted.
void calibrate(Backend* backend, const SplitViews& views, const RegistrationOptions& settings,
               const CancellationToken& cancellation, Field* field) {
  constexpr std::size_t kSearched = 12, kAligned = 48;  // views
  const auto loaded = [&] { return backend->load(std::make_shared<Field>(*field)); };
  FieldMetadata& object = field->metadata;
  object.symmetries = settings.symmetries;
  object.look_alikes = measureLookAlikes(backend, *loaded(), cancellation);
  const std::vector<PosedView> searched = poseViews(views, kSearched);
  const std::shared_ptr<const LoadedField> unmeasured = loaded();
  object.pose = measurePoses(backend, *unmeasured, searched, cancellation);
  if (!settings.accept_poor_data) requireUsableModel(object, static_cast<int>(searched.size()));
  measurePoseErrors(backend, *unmeasured, poseViews(views, kAligned), cancellation, &object.pose);
}

}  // namespace

Field learnField(Backend* backend, const Dataset& dataset, const RegistrationOptions& settings,
                 const std::function<void(const RegistrationProgress&)>& progress,
                 const CancellationToken& cancellation) {
  settings.validate();
  requireBox(dataset);
  if (!settings.accept_poor_data) requireDifferentViews(dataset);
  RegistrationProgress last;
  const auto remember = [&](const RegistrationProgress& report) {
    last = report;
    last.preview = {};
    if (progress) progress(report);
  };
  TrainedField trained = trainField(backend, dataset, settings, remember, cancellation);
  last.stage = "pose quality";
  if (progress) progress(last);
  Field& field = trained.field;
  calibrate(backend, trained.views, settings, cancellation, &field);
  field.metadata.metres_per_unit =
      settings.metres_per_unit > 0 ? settings.metres_per_unit : dataset.metres_per_unit;
  field.metadata.data_hash = registrationHash(dataset, settings, cancellation);
  return std::move(field);
}

}  // namespace nerf_pose_refiner
