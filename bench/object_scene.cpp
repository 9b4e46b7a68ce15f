// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "object_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evaluation/aimed_view.h"
#include "evaluation/placement.h"
#include "evaluation/trial_observation.h"

namespace nerf_pose_refiner {

SceneComposer::SceneComposer(const std::vector<std::string>& data, std::vector<std::string> photos,
                             int width, int height)
    : photos_(std::move(photos)), width_(width), height_(height) {
  for (const std::string& file : data) views_.push_back(loadDataset(file).views);
}

ObjectScene SceneComposer::compose(std::size_t number) const {
  constexpr double kOfCell = 0.9;
  const auto count = static_cast<int>(objects());
  const auto columns = static_cast<int>(std::ceil(std::sqrt(4.0 / 3 * count)));
  const int rows = (count + columns - 1) / columns;
  const double wide = static_cast<double>(width_) / columns;
  const double high = static_cast<double>(height_) / rows;
  double focal = width_;
  for (std::size_t object = 0; object < objects(); ++object) {
    const PosedView& view = viewOf(object, number);
    const Eigen::Vector2d sizes = silhouetteBox(view).sizes();
    const double scale = kOfCell * std::min(wide / sizes.x(), high / sizes.y());
    focal = std::min(focal, scale * view.camera.fx);
  }
  PosedView all;
  all.camera =
      all.photo_camera = {width_, height_, focal, focal, (width_ - 1) / 2.0, (height_ - 1) / 2.0};
  PremultipliedImage image = {Image(width_, height_, 3), Image(width_, height_, 1)};
  ObjectScene scene;
  for (int object = 0; object < count; ++object) {
    const Eigen::Vector2d middle((object % columns + 0.5) * wide, (object / columns + 0.5) * high);
    const PosedView& view = viewOf(static_cast<std::size_t>(object), number);
    const AimedView aimed =
        aimedView(view, rotationToPlace(view, all.camera, middle, 0), all.camera);
    putInFront(aimed.object, &image);
    scene.T_O_C.push_back(aimed.T_O_C);
  }
  all.rgba = std::make_shared<const Image8>(straightBytes(image));
  TrialObservation how = TrialObservation::named("photo", "alpha");
  how.photos = photos_;
  scene.observation = how.of(all, number);
  return scene;
}

const PosedView& SceneComposer::viewOf(std::size_t object, std::size_t number) const {
  return views_[object][(number + object) % views_[object].size()];
}

}  // namespace nerf_pose_refiner
