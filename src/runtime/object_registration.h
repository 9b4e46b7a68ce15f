// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "registration/registrar.h"
#include "runtime/backend_pool.h"
#include "runtime/object_store.h"
#include "runtime/processor_schedule.h"
#include "runtime/registration_queue.h"

namespace nerf_pose_refiner {

/// An object that is to be learned from photos.
struct RegistrationRequest {
  std::string name;            ///< of the object and of its model
  std::string dataset;         ///< folder or transforms file of the photos, below the dataset root
  double metres_per_unit = 0;  ///< of the dataset; 0: as the dataset says
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();  ///< of the object [units of the dataset] ...
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();  ///< ... both zero: as the dataset says
  double max_seconds = 0;                             ///< of training; 0: as the settings say
  bool force_retrain = false;  ///< even if the model that is there was made of the same
};

/// Where photos are read, and how many.
struct PhotoSource {
  std::string root;  ///< folder of the datasets
  DatasetLimits limits;
};

/// Learns objects on request, one call after the other or through a RegistrationQueue.
class ObjectRegistration {
 public:
  /// @param make_backend called for each training: it must not share a backend with refinements.
  /// @param find_schedule of that backend's processor: refinements go before.
  ObjectRegistration(const PhotoSource& photos, const RegistrationSettings& settings,
                     const ObjectStore& store, BackendFactory make_backend,
                     ScheduleFactory find_schedule);

  /// Trains and saves a model, or loads the one that is there if it was made of the same photos and
  /// settings. A call takes minutes.
  /// @throws std::invalid_argument for a request that makes no sense, std::runtime_error,
  /// Cancelled: then the model that was there, in the file and in memory, stays.
  RegisteredObject run(const RegistrationRequest& request,
                       const RegistrationQueue::Progress& progress,
                       const CancellationToken& cancellation) const;

  /// The same for the queue; it holds a copy of this object. Its key tells apart what may give
  /// another model or writes another file.
  RegistrationQueue::Job jobOf(const RegistrationRequest& request) const;

 private:
  Dataset readPhotos(const RegistrationRequest& request,
                     const CancellationToken& cancellation) const;
  RegistrationSettings settingsOf(const RegistrationRequest& request, const Dataset& dataset) const;

  PhotoSource photos_;
  RegistrationSettings settings_;
  ObjectStore store_;
  BackendFactory make_backend_;
  ScheduleFactory find_schedule_;
};

}  // namespace nerf_pose_refiner
