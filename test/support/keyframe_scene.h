// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <memory>

#include "backend/loaded_field.h"
#include "evaluation/clutter.h"
#include "math/angle.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

const Camera kCamera = {320, 240, 400, 400, 159.5, 119.5};

/// What tests of alignment to keyframes look at: the analytic scene before clutter.
class KeyframeScene {
 protected:
  const FieldMetadata& object() const { return scene_->field().metadata; }

  KeyframePoints keyframeAt(const Pose& T_O_C, const KeyframeSettings& settings = {}) const {
    return renderKeyframe(*scene_, {kCamera, T_O_C}, settings);
  }

  /// The scene before clutter, its colours times a gain, plus an offset.
  Image imageOf(const Pose& T_O_C, const Eigen::Array3f& gain = Eigen::Array3f::Ones(),
                float offset = 0) const {
    const Observation scene = observeScene(*scene_, kCamera, T_O_C);
    Image image = clutter(kCamera.width, kCamera.height, 7);
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      const float alpha = scene.alpha.values[i];
      for (std::size_t c = 0; c < 3; ++c) {
        const float colour = gain[static_cast<Eigen::Index>(c)] * scene.image.values[3 * i + c];
        float& value = image.values[3 * i + c];
        value = colour + alpha * offset + (1 - alpha) * value;
      }
    }
    return image;
  }

  /// The scene before clutter in other light: the logarithm of its brightness changes with the
  /// surface's normal, which looks away from the camera. @param change of it, in the axes of O.
  Image imageInLight(const Pose& T_O_C, const Eigen::Vector3f& change) const {
    const Rendering rendering = scene_->render({kCamera, T_O_C}, RenderOptions(), {});
    const auto pointAt = [&](int x, int y) -> Eigen::Vector3f {
      return Eigen::Map<const Eigen::Vector3f>(rendering.point.pixel(x, y)) /
             rendering.alpha.at(x, y, 0);
    };
    const Image plain = imageOf(T_O_C), black = imageOf(T_O_C, Eigen::Array3f::Zero());
    Image image = plain;
    for (int y = 1; y + 1 < image.height; ++y) {
      for (int x = 1; x + 1 < image.width; ++x) {
        const Eigen::Vector3f normal = (pointAt(x + 1, y) - pointAt(x - 1, y))
                                           .cross(pointAt(x, y + 1) - pointAt(x, y - 1))
                                           .normalized();
        if (!normal.allFinite()) continue;
        const float gain = std::exp(change.dot(normal));
        for (int c = 0; c < 3; ++c) {
          const float empty = black.at(x, y, c);
          image.at(x, y, c) = empty + gain * (plain.at(x, y, c) - empty);
        }
      }
    }
    return image;
  }

  /// Turned by up to `deg` and moved by up to as many hundredths of the diameter.
  Pose offBy(const Pose& T_O_C, const Eigen::Vector3d& direction, double deg) const {
    const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(deg * kDegree * direction));
    const Eigen::Vector3d shift = 0.01 * deg * object().diameter *
                                  Eigen::Vector3d(direction.z(), -direction.x(), direction.y());
    return {turn * T_O_C.R, object().centre + shift + turn * (T_O_C.t - object().centre)};
  }

  static Observation observed(const Image& image) {
    Observation observation;
    observation.image = image;
    observation.camera = kCamera;
    return observation;
  }

  /// The middle of the object behind strong colours.
  static Image covered(Image image) {
    for (int y = 90; y < 150; ++y) {
      for (int x = 100; x < 140; ++x) {
        for (int c = 0; c < 3; ++c) image.at(x, y, c) = (x / 5 + y / 5 + c) % 2 ? 0.9f : 0.1f;
      }
    }
    return image;
  }

  /// The same pixels without weight.
  static Observation withoutCovered(const Image& image) {
    Observation observation = observed(image);
    observation.weight = Image(kCamera.width, kCamera.height, 1, 1.0f);
    for (int y = 90; y < 150; ++y) {
      for (int x = 100; x < 140; ++x) observation.weight.at(x, y, 0) = 0;
    }
    return observation;
  }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  Pose truth_ = cameraAround(*scene_, 0.6, 0.5);
};

}  // namespace nerf_pose_refiner
