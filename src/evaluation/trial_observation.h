// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "evaluation/group_placement.h"
#include "evaluation/placement.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// An image of a trial, and what is to be found in it.
struct TrialImage {
  Observation observation;
  PosedView view;  ///< whose image it is, without what goes wrong
  std::vector<ShownInstance> instances;
};

/// What a trial makes of a view of a dataset: what is behind the object, and what goes wrong on
/// the way to the robot. The same for the same seed and index.
struct TrialObservation {
  /// white; alpha (known); mask (a photo, and a mask); photo (unknown); own (the view's own photo
  /// as it is, its alpha taken for a mask)
  std::string background = "white";
  std::vector<std::string> photos;  ///< one is drawn, to be put behind the object; none: clutter

  // The paper's noise, on the object's straight colours before anything is put behind it.
  double brightness = 0;     ///< added to the value of HSV, at most 1 then
  double gaussian = 0;       ///< standard deviation
  bool poisson = false;      ///< of the 8-bit values, as counted photons
  int discs = 0;             ///< missing ones, centred on the silhouette's edge
  double disc_radius = 0.0;  ///< [widths of the image]

  // What robots meet.
  double gain_bias = 0;           ///< half width of the object's gain per channel around 1
  double occluder = 0;            ///< fraction of the object's box that a square covers
  bool occluder_is_most = false;  ///< the fraction is drawn between none and that
  double motion_blur = 0;         ///< length of the path, of a direction that is drawn [widths]
  double defocus = 0;             ///< sigma [widths]
  double noise = 0;               ///< standard deviation; clipped at 0 and 1, as a camera does
  std::optional<Placement> placement;  ///< small and somewhere in a larger image
  bool is_group = false;               ///< several instances in one image, @see GroupPlacement
  bool is_recoloured = false;  ///< another object, of the same shape: red is green, green is blue
  bool is_absent = false;      ///< the object is not there
  double focal_error = 0;      ///< fraction by which the given focal length is too great

  std::uint64_t seed = 1;

  /// Conditions of the experiments: "clean"; "brightness", "gaussian", "poisson", "discs" and all
  /// four, "paper_noise", as the paper's authors set them; before an unknown background "photo",
  /// "occluder", "light", "motion_blur", "defocus", "focal"; small and anywhere before one
  /// "placed", the same a quarter covered, in other light and with noise "placed_robot", and
  /// without the object "absent"; placed and up to three fifths covered "hidden", two to five
  /// instances in one image "group"; placed in any rotation in the image "turned", the same an
  /// eighth to a fifth of the image wide "small"; placed, an object of the same shape in other
  /// colours "recoloured".
  /// @param background of those that keep it: alpha or own.
  /// @throws std::invalid_argument listing the names that exist.
  static TrialObservation named(const std::string& condition, const std::string& background);
  static std::vector<std::string> conditionNames();

  /// @param number of the view that is disturbed. @throws std::invalid_argument,
  /// std::runtime_error.
  TrialImage imageOf(const std::vector<PosedView>& views, std::size_t number) const;

  /// A view as it is, disturbed. @param index of the view among those that are tried.
  /// @throws std::runtime_error.
  Observation of(const PosedView& view, std::uint64_t index) const;

 private:
  Observation disturbed(const PosedView& view, std::uint64_t index, double* hidden) const;
};

}  // namespace nerf_pose_refiner
