// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/overlay.h"

#include <stdexcept>

#include "backend/backend.h"
#include "backend/common/draw_overlay.h"
#include "backend/common/observed_colours.h"
#include "backend/loaded_field.h"
#include "math/require.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {

struct Overlay::Parts {
  Object object;
  std::shared_ptr<Backend> backend;
  std::shared_ptr<const LoadedField> field;
};

Overlay::Overlay(std::shared_ptr<Backend> backend, const Object& object) {
  if (!backend) throw std::invalid_argument("Overlay: the backend is null");
  std::shared_ptr<const LoadedField> field = backend->load(ObjectInside::field(object));
  parts_ = std::make_unique<Parts>(Parts{object, std::move(backend), std::move(field)});
}

Overlay::~Overlay() = default;
Overlay::Overlay(Overlay&&) noexcept = default;
Overlay& Overlay::operator=(Overlay&&) noexcept = default;

Image8 Overlay::draw(const Observation& observation, const Pose& T_C_O, double opacity) {
  observation.validate();
  require(opacity >= 0 && opacity <= 1, "opacity", opacity, "0..1");
  if (!T_C_O.isFinite() || !T_C_O.isRigid()) {
    throw std::invalid_argument("Overlay: the pose is not a rigid transform");
  }
  const View view{observation.camera, ObjectInside::frame(parts_->object).cameraInModel(T_C_O)};
  return drawOverlay(overlayGround(observation),
                     parts_->field->render(view, RenderOptions(), CancellationToken()), opacity);
}

}  // namespace nerf_pose_refiner
