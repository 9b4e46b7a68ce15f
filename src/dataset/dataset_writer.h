// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "files/file_lock.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// What all views of a dataset have in common.
struct DatasetHeader {
  Camera camera;               ///< of the images as they are written, but for those with their own
  Distortion distortion;       ///< that they have; written as it is, for the loader takes it out
  double metres_per_unit = 1;  ///< 0: unknown
  bool has_box = false;
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();  ///< of the object, in O [model units]
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();
};

/// Writes posed views as a folder that loadDataset reads: transforms.json and PNG images.
///
/// The folder appears whole or not at all: until `finish` all is written to a hidden one beside it,
/// which is removed if that is never reached, and by the next writer if the process was killed.
/// Of all writers of one folder, in this process and in others, one works at a time.
class DatasetWriter {
 public:
  /// @param folder to be made; its parent is made too.
  /// @throws std::invalid_argument for a camera or box that makes no sense, std::runtime_error if
  /// the folder is there already, is being written by another writer, or cannot be made.
  DatasetWriter(const std::string& folder, const DatasetHeader& header);
  ~DatasetWriter();
  DatasetWriter(const DatasetWriter&) = delete;
  DatasetWriter& operator=(const DatasetWriter&) = delete;

  /// @param image RGB, or RGBA with straight alpha; of the camera's size.
  /// @throws std::invalid_argument, std::runtime_error naming the file (a full disk, say): then the
  /// views before it stay, and others can be added.
  void add(const Image8& image, const Pose& T_O_C);

  /// The same for an image of another camera, whose lens has no distortion. Only where the header's
  /// has none either.
  void add(const Image8& image, const Pose& T_O_C, const Camera& camera);

  int views() const { return static_cast<int>(views_.size()); }

  /// Makes the folder appear, with all views, once they are safe on the disk. Once; afterwards
  /// nothing can be added.
  /// @return the folder; with "_2" (3, 4...) at its end, if something else took its name meanwhile.
  /// @throws std::runtime_error if there are no views or it cannot be written: then nothing
  /// appears, and it can be tried again.
  std::string finish();

 private:
  struct View {
    Pose T_O_C;
    Camera camera;
  };
  std::string json() const;
  void writeJson() const;
  std::string publish() const;

  std::string folder_;
  std::string hidden_;  ///< empty: finished
  std::optional<FolderLock> lock_;
  DatasetHeader header_;
  std::vector<View> views_;
};

}  // namespace nerf_pose_refiner
