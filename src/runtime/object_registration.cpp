// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/object_registration.h"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "backend/backend.h"
#include "dataset/path_below.h"
#include "registration/registration_hash.h"
#include "registration/registration_options.h"
#include "runtime/detection_files.h"

namespace nerf_pose_refiner {
namespace {

void requireLength(const std::string& name, double value) {
  if (!std::isfinite(value) || value < 0) {
    throw std::invalid_argument(name + " is " + std::to_string(value) + " but must be >= 0");
  }
}

void applyBox(const RegistrationRequest& request, Dataset* dataset) {
  const Eigen::Vector3d &min = request.box_min, &max = request.box_max;
  if (min.isZero(0) && max.isZero(0)) return;
  if (!min.allFinite() || !max.allFinite() || !((max - min).minCoeff() > 0)) {
    throw std::invalid_argument("box_max must be greater than box_min on every axis");
  }
  dataset->has_box = true;
  dataset->box_min = min;
  dataset->box_max = max;
}

}  // namespace

ObjectRegistration::ObjectRegistration(const PhotoSource& photos,
                                       const RegistrationOptions& settings,
                                       const ObjectStore& store, BackendFactory make_backend,
                                       ScheduleFactory find_schedule)
    : photos_(photos),
      settings_(settings),
      store_(store),
      make_backend_(std::move(make_backend)),
      find_schedule_(std::move(find_schedule)) {}

Dataset ObjectRegistration::readPhotos(const RegistrationRequest& request,
                                       const CancellationToken& cancellation) const {
  if (photos_.root.empty()) throw std::invalid_argument("the root folder of datasets is not set");
  // The request came over the network: it must not cause reads outside the folder.
  DatasetOptions confined;
  confined.limits = photos_.limits;
  confined.threads = settings_.threads;
  confined.confined = true;
  Dataset dataset = loadDataset(pathBelow(photos_.root, request.dataset), confined, cancellation);
  applyBox(request, &dataset);
  return dataset;
}

RegistrationOptions ObjectRegistration::settingsOf(const RegistrationRequest& request,
                                                   const Dataset& dataset) const {
  RegistrationOptions settings = settings_;
  if (request.max_seconds > 0) settings.max_seconds = request.max_seconds;
  if (request.metres_per_unit > 0) settings.metres_per_unit = request.metres_per_unit;
  if (!(settings.metres_per_unit > 0 || dataset.metres_per_unit > 0)) {
    throw std::invalid_argument("the dataset '" + request.dataset +
                                "' does not say how long its unit is: set metres_per_unit");
  }
  return settings;
}

RegisteredObject ObjectRegistration::run(const RegistrationRequest& request,
                                         const RegistrationQueue::Progress& progress,
                                         const CancellationToken& cancellation) const {
  requireObjectName(request.name);
  // Read before training, so that a mistake in the file is reported at once.
  const ObjectMetadata said = store_.metadataOf(request.name);
  requireLength("metres_per_unit", request.metres_per_unit);
  requireLength("max_seconds", request.max_seconds);
  const std::shared_ptr<ProcessorSchedule> schedule = find_schedule_();
  const ProcessorSchedule::Training after_refinements(schedule.get(), cancellation);
  const Dataset dataset = readPhotos(request, cancellation);
  RegistrationOptions settings = settingsOf(request, dataset);
  settings.symmetries = said.symmetries.inFrame(said.T_O_U);
  if (!request.force_retrain) {
    const std::shared_ptr<const Field> existing = store_.find(request.name);
    if (existing &&
        existing->metadata.data_hash == registrationHash(dataset, settings, cancellation)) {
      return {existing, true, dataset.notes};
    }
  }
  store_.requireWritable(request.name, FieldConfig::named(settings.profile));
  const std::shared_ptr<Backend> backend = make_backend_();
  auto field =
      std::make_shared<Field>(learnField(backend.get(), dataset, settings, progress, cancellation));
  field->metadata.name = request.name;
  cancellation.check();  // from here on the model is saved
  const std::shared_ptr<const Field> saved = store_.save(field);
  RegisteredObject result = {saved, false, dataset.notes};
  if (!saved->metadata.exposure_spread && !settings.keep_colours) {
    result.notes.push_back(
        "the photos' exposures could not be compared: too few photos or training steps");
  }
  if (makes_detection_files_) {
    const std::string error = learnToDetect(backend.get(), saved, dataset, cancellation);
    if (!error.empty()) result.notes.push_back(error);
  }
  return result;
}

/// The model is saved by now: what is cut short or fails here, detection makes when it needs it.
/// @return why they were not made; empty if nothing went wrong.
std::string ObjectRegistration::learnToDetect(Backend* backend,
                                              const std::shared_ptr<const Field>& field,
                                              const Dataset& photos,
                                              const CancellationToken& cancellation) const {
  const std::string path = landmarkPathOf(store_.cache(), field);
  if (path.empty()) return {};
  try {
    learnDetection(backend, field, photos, path, cancellation);
  } catch (const Cancelled&) {
  } catch (const std::exception& e) {
    return std::string("what detection needs is not made yet: ") + e.what();
  }
  return {};
}

RegistrationQueue::Job ObjectRegistration::jobOf(const RegistrationRequest& request) const {
  std::ostringstream key;
  key << std::hexfloat << photos_.root << '\n'
      << store_.root() << '\n'
      << request.name << '\n'
      << request.dataset << '\n'
      << request.box_min.transpose() << ' ' << request.box_max.transpose() << '\n'
      << request.metres_per_unit << ' ' << request.max_seconds << ' ' << request.force_retrain
      << '\n';
  visitSettings(settings_, [&key](const char* name, const auto& value, const char*) {
    key << name << ' ' << value << '\n';
  });
  const auto work = [registration = *this, request](const RegistrationQueue::Progress& progress,
                                                    const CancellationToken& cancellation) {
    return registration.run(request, progress, cancellation);
  };
  return {request.name, key.str(), work};
}

}  // namespace nerf_pose_refiner
