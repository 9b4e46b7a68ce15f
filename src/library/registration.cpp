// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/registration.h"

#include <filesystem>

#include "backend/backend.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "registration/registrar.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {

Object registerObject(Backend& backend, const std::string& photos,
                      const RegistrationOptions& settings,
                      const std::function<void(const RegistrationProgress&)>& progress,
                      const CancellationToken& cancellation) {
  DatasetOptions reading;
  reading.threads = settings.threads;
  const Dataset dataset = loadDataset(photos, reading, cancellation);
  Field field = learnField(&backend, dataset, settings, progress, cancellation);
  if (field.metadata.name.empty()) {
    field.metadata.name = std::filesystem::path(dataset.folder).filename().string();
  }
  return ObjectInside::make(std::make_shared<const Field>(std::move(field)));
}

}  // namespace nerf_pose_refiner
