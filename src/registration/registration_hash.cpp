// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/registration_hash.h"

#include <cstring>

#include "math/checksum.h"

namespace nerf_pose_refiner {
namespace {

/// Adds settings in the form in which models of earlier versions have them.
class SettingHasher {
 public:
  SettingHasher(const Dataset& dataset, Checksum* checksum)
      : dataset_(dataset), checksum_(*checksum) {}

  void operator()(const char*, const std::string& text, const char*) {
    checksum_.add(text.data(), text.size());
  }
  template <typename Number>
  void operator()(const char* name, Number number, const char*) {
    add(static_cast<double>(number));
    if (name == std::string("metres_per_unit")) add(dataset_.metres_per_unit);  // its default
  }
  /// Only if set: models from before there was the setting stay valid.
  void operator()(const char* name, bool set, const char*) {
    if (!set) return;
    checksum_.add(&set, sizeof set);
    if (name != std::string("refine_poses")) checksum_.add(name, std::strlen(name));  // the first
  }

 private:
  void add(double number) { checksum_.add(&number, sizeof number); }

  const Dataset& dataset_;
  Checksum& checksum_;
};

void addAxis(const SymmetryAxis& axis, Checksum* checksum) {
  checksum->add(axis.direction.data(), 3 * sizeof(double));
  checksum->add(axis.point.data(), 3 * sizeof(double));
}

void addPose(const Pose& pose, Checksum* checksum) {
  checksum->add(pose.R.data(), 9 * sizeof(double));
  checksum->add(pose.t.data(), 3 * sizeof(double));
}

/// What is measured of poses is modulo the symmetries. None add nothing: models of objects without
/// them stay valid.
void addSymmetries(const Symmetries& symmetries, Checksum* checksum) {
  if (!symmetries.any()) return;
  if (symmetries.axis()) addAxis(*symmetries.axis(), checksum);
  for (const Pose& motion : symmetries.motions()) addPose(motion, checksum);
}

}  // namespace

std::string registrationHash(const Dataset& dataset, const RegistrationOptions& settings,
                             const CancellationToken& cancellation) {
  Checksum checksum;
  for (const PosedView& view : dataset.views) {
    cancellation.check();
    checksum.add(view.rgba->values.data(), view.rgba->values.size());
    for (const double number : {view.camera.fx, view.camera.fy, view.camera.cx, view.camera.cy}) {
      checksum.add(&number, sizeof number);
    }
    addPose(view.T_O_C, &checksum);
  }
  checksum.add(&dataset.has_alpha, sizeof dataset.has_alpha);
  if (dataset.has_box) {
    checksum.add(dataset.box_min.data(), 3 * sizeof(double));
    checksum.add(dataset.box_max.data(), 3 * sizeof(double));
  }
  visitSettings(settings, SettingHasher(dataset, &checksum));
  addSymmetries(settings.symmetries, &checksum);
  return checksum.text();
}

}  // namespace nerf_pose_refiner
