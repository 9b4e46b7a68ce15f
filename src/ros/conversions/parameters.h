// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "backend/make_backend.h"
#include "dataset/dataset.h"
#include "nerf_pose_refiner/depth.h"
#include "registration/registrar.h"
#include "ros/conversions/param_reader.h"
#include "tracking/settings.h"

namespace nerf_pose_refiner {

/// How ~overlay is drawn.
struct OverlaySettings {
  int width_px = 640;  ///< wider images are drawn in this width, >= 16
  double opacity = 1;  ///< of the rendering, 0..1: 0 leaves its outline alone
};

/// What /diagnostics warns of.
struct DiagnosticSettings {
  double min_image_rate_hz = 0;  ///< fewer images are a warning [Hz], none an error
  double max_image_age_s = 5;    ///< older ones are an error [s], > 0
};

/// Frames, and how long to wait for transforms.
struct FrameSettings {
  std::string object_frame;  ///< the object's TF frame; empty: the object's name
  std::string output_frame;  ///< in which poses are published; empty: the camera's optical frame
  std::string fixed_frame;   ///< in which the object stands still; empty: none is known
  bool publish_tf = true;
  double tf_timeout_s = 0.1;  ///< wall time to wait for a transform [s], >= 0
  double tf_cache_s = 60;     ///< history of transforms [s], > 0
};

/// Depth images beside the colour images: group ~depth.
struct DepthSettings {
  bool use = false;
  bool is_rectified = false;   ///< P of its camera_info applies, not K and D
  double tolerance_s = 0.015;  ///< between the stamps of an image and its depth [s], >= 0
  double timeout_s = 1;        ///< without depth for so long, images do not wait for it [s], >= 0
  double unit_m = 0.001;       ///< of 16UC1 [m], > 0
  std::string image_transport = "raw";
  DepthNoise noise;
};

/// Boxes of a 2-D detector, in which the object is looked for: group ~detections.
struct BoxSettings {
  bool use = false;
  int class_id = -1;  ///< of the object; -1: boxes of all classes are its own
};

/// Further cameras that look at the object: group ~cameras.
struct CameraSettings {
  std::string topics;              ///< of their images, camera_info beside them; spaces between
  bool are_rectified = false;      ///< P of their camera_info applies, not K and D
  double tolerance_s = 0.015;      ///< between the stamps of an image and theirs [s], >= 0
  double timeout_s = 1;            ///< without one for so long, images do not wait for it [s], >= 0
  double wait_s = 0.1;             ///< images wait so long for one that is late [s], >= 0
  double position_dev_m = 0.0005;  ///< standard deviation of their places in TF [m], >= 0
  double rotation_dev_deg = 0.03;  ///< alike [degrees], >= 0

  /// One name for each camera.
  std::vector<std::string> names() const;
};

/// All parameters of the nodelet. Meanings, ranges and advice: config/pose_refiner.yaml.
struct PoseRefinerParameters {
  std::string object;      ///< loaded at the start; empty: none
  std::string model_root;  ///< models are read and written below this folder
  int model_memory_mb =
      0;  ///< of all models of the process [10^6 bytes]; 0: as others say, no limit
  std::string dataset_root;  ///< photos to learn from are read below this folder
  std::string image_transport = "raw";
  bool image_is_rectified = false;
  std::string backend = "auto";          ///< auto, cpu or cuda, @see BackendChoice
  int device = 0;                        ///< of the CUDA backend: number of the GPU
  int threads = 0;                       ///< of the CPU backend; 0: all cores
  std::string instruction_set = "auto";  ///< of the CPU backend
  /// Without a mask, or boxes, for so long: as if there were none [s], >= 0
  double mask_timeout_s = 1;
  DepthSettings depth;
  CameraSettings cameras;
  BoxSettings detections;
  OverlaySettings overlay;
  DiagnosticSettings diagnostics;
  FrameSettings frames;
  TrackerSettings tracker;  ///< `initial`: group ~refiner; `tracking`: group ~tracker
  RegistrationOptions registration;
  DatasetLimits dataset_limits;  ///< group ~dataset

  /// Whether the object is looked for in the boxes of ~detections: not where tracking begins with
  /// an initial pose alone.
  bool usesBoxes() const {
    return detections.use && tracker.rules.start != TrackStart::kInitialPose;
  }

  /// The backend to search and to learn with.
  BackendChoice backendChoice() const;

  /// @throws std::invalid_argument naming the parameter and the value that is out of range.
  void validate() const;
};

/// Reads and checks all parameters. Unknown keys at the top level are left to the caller
/// (`reader.unknown()`), for other libraries keep keys of their own there; in the groups they are
/// errors.
/// @param defaults of what is absent.
/// @throws std::invalid_argument naming the parameter.
PoseRefinerParameters readParameters(ParamReader& reader,
                                     const PoseRefinerParameters& defaults = {});

}  // namespace nerf_pose_refiner
