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

/// A request to learn an object from photos.
struct RegistrationRequest {
  std::string name;            ///< of the object and of its model
  std::string dataset;         ///< folder or transforms.json, below the dataset root
  double metres_per_unit = 0;  ///< of the dataset; 0: as the dataset says
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();  ///< of the object [units of the dataset] ...
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();  ///< ... both zero: as the dataset says
  double max_seconds = 0;                             ///< of training; 0: as the settings say
  bool force_retrain = false;  ///< even if a model of the same photos and settings exists
};

/// Where photos are read, and how many.
struct PhotoSource {
  std::string root;  ///< folder of the datasets
  DatasetLimits limits;
};

/// Learns objects on request, in direct calls or through a RegistrationQueue.
class ObjectRegistration {
 public:
  /// @param make_backend called for each training, which must not share a backend with refinements.
  /// @param find_schedule schedule of that backend's processor; refinements have priority there.
  ObjectRegistration(const PhotoSource& photos, const RegistrationOptions& settings,
                     const ObjectStore& store, BackendFactory make_backend,
                     ScheduleFactory find_schedule);

  /// From now on, files for detection are made with models.
  void makeDetectionFilesToo() { makes_detection_files_ = true; }

  /// Trains and saves a model, or loads the existing one if it was made from the same photos and
  /// settings. Training takes minutes.
  /// @throws std::invalid_argument for an invalid request, std::runtime_error, Cancelled. The
  /// existing model, in the file and in memory, is then unchanged.
  RegisteredObject run(const RegistrationRequest& request,
                       const RegistrationQueue::Progress& progress,
                       const CancellationToken& cancellation) const;

  /// The same as a job for the queue, which holds a copy of this object. Jobs with the same key
  /// give the same model in the same file.
  RegistrationQueue::Job jobOf(const RegistrationRequest& request) const;

 private:
  std::string learnToDetect(Backend* backend, const std::shared_ptr<const Field>& field,
                            const Dataset& photos, const CancellationToken& cancellation) const;
  Dataset readPhotos(const RegistrationRequest& request,
                     const CancellationToken& cancellation) const;
  RegistrationOptions settingsOf(const RegistrationRequest& request, const Dataset& dataset) const;

  PhotoSource photos_;
  RegistrationOptions settings_;
  ObjectStore store_;
  BackendFactory make_backend_;
  ScheduleFactory find_schedule_;
  bool makes_detection_files_ = false;
};

}  // namespace nerf_pose_refiner
