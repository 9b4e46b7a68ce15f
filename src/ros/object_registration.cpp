// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/object_registration.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "nerf_pose_refiner/dataset/path_below.h"

namespace nerf_pose_refiner {
namespace {

Eigen::Vector3d toEigen(const geometry_msgs::Point& p) { return {p.x, p.y, p.z}; }

void requireLength(const std::string& name, double value) {
  if (!std::isfinite(value) || value < 0) {
    throw std::invalid_argument(name + " is " + std::to_string(value) + " but must be >= 0");
  }
}

void applyBox(const RegisterObject::Request& request, Dataset* dataset) {
  const Eigen::Vector3d min = toEigen(request.box_min);
  const Eigen::Vector3d max = toEigen(request.box_max);
  if (min.isZero(0) && max.isZero(0)) return;
  if (!min.allFinite() || !max.allFinite() || !((max - min).minCoeff() > 0)) {
    throw std::invalid_argument("box_max must be greater than box_min on every axis");
  }
  dataset->has_box = true;
  dataset->box_min = min;
  dataset->box_max = max;
}

}  // namespace

ObjectRegistration::ObjectRegistration(const std::string& dataset_root,
                                       const RegistrationSettings& settings,
                                       const ObjectStore& store, EngineFactory make_engine)
    : dataset_root_(dataset_root),
      settings_(settings),
      store_(store),
      make_engine_(std::move(make_engine)) {}

RegisteredObject ObjectRegistration::run(const RegisterObject::Request& request,
                                         const Progress& progress, const StopToken& stop) const {
  requireObjectName(request.name);
  requireLength("metres_per_unit", request.metres_per_unit);
  requireLength("max_seconds", request.max_seconds);
  if (dataset_root_.empty()) throw std::invalid_argument("~dataset_root is not set");

  // The request comes over the network: nothing outside of the folder is read for it.
  DatasetOptions confined;
  confined.threads = settings_.threads;
  confined.confined = true;
  Dataset dataset = loadTransforms(pathBelow(dataset_root_, request.dataset), confined, stop);
  applyBox(request, &dataset);
  RegistrationSettings settings = settings_;
  if (request.max_seconds > 0) settings.max_seconds = request.max_seconds;
  if (request.metres_per_unit > 0) settings.metres_per_unit = request.metres_per_unit;
  if (!(settings.metres_per_unit > 0 || dataset.metres_per_unit > 0)) {
    throw std::invalid_argument("the dataset '" + request.dataset +
                                "' does not say how long its unit is: set metres_per_unit");
  }

  RegisteredObject registered;
  if (!request.force_retrain) {
    const std::shared_ptr<const Field> existing = store_.find(request.name);
    registered.loaded_existing =
        existing && existing->metadata.data_hash == registrationHash(dataset, settings, stop);
    registered.field = registered.loaded_existing ? existing : nullptr;
  }
  if (!registered.field) {
    const std::shared_ptr<Engine> engine = make_engine_();
    auto field =
        std::make_shared<Field>(registerObject(engine.get(), dataset, settings, progress, stop));
    field->metadata.name = request.name;
    store_.save(*field);
    registered.field = field;
  }
  return registered;
}

}  // namespace nerf_pose_refiner
