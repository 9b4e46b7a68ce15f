// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "image/colour.h"
#include "ros/conversions/camera_input.h"
#include "ros/nodelet/message_tracker.h"
#include "support/analytic_scene.h"
#include "tracking/object_search.h"

namespace nerf_pose_refiner {

/// Searches a scene that is known exactly, whatever model it is given.
class SceneSearch final : public ObjectSearch {
 public:
  /// @param scene outlives this object.
  SceneSearch(const LoadedField& scene, const RefinerSettings& initial,
              const RefinerSettings& tracking)
      : scene_(scene),
        backend_(makeCpuBackend(1)),
        initial_(backend_, initial),
        tracking_(backend_, tracking) {}
  void use(std::shared_ptr<const Field>) override {}
  void configure(const RefinerSettings&, const RefinerSettings&) override {}
  Refinement search(const SearchRequest& request, const CancellationToken& cancellation) override {
    FieldRefiner& refiner = request.tracked ? tracking_ : initial_;
    return refiner.refine(scene_, request.observation, request.prior, cancellation);
  }
  /// Finds nothing.
  Refinement detect(const Observation&, double, const CancellationToken&) override { return {}; }

 private:
  const LoadedField& scene_;
  std::shared_ptr<Backend> backend_;
  FieldRefiner initial_, tracking_;
};

/// A preset's first stages.
inline RefinerSettings firstStages(const char* preset, std::size_t stages) {
  RefinerSettings settings = RefinerSettings::named(preset);
  settings.stages.resize(stages);
  return settings;
}

/// A scene in front of grey, as the frame "camera" brings it.
inline CameraFrame photograph(const LoadedField& scene, const Camera& camera, const Pose& T_O_C,
                              const ros::Time& stamp) {
  const Observation view = observeScene(scene, camera, T_O_C);
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.frame_id = "camera";
  image->header.stamp = stamp;
  image->width = static_cast<std::uint32_t>(camera.width);
  image->height = static_cast<std::uint32_t>(camera.height);
  image->encoding = "rgb8";
  image->step = 3 * image->width;
  image->data = toBytes(composite({view.image, view.alpha}, {0.4f, 0.4f, 0.4f})).values;
  auto info = boost::make_shared<sensor_msgs::CameraInfo>(toMessage(camera));
  return {image, info, ros::WallTime::now(), 0};
}

}  // namespace nerf_pose_refiner
