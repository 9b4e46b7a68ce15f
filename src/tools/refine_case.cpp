// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tools/refine_case.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "image/colour.h"
#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {
namespace {

bool hasTransparency(const Image8& image) {
  if (image.channels != 4) return false;
  for (std::size_t i = 3; i < image.values.size(); i += 4) {
    if (image.values[i] != 255) return true;
  }
  return false;
}

/// The colours as the camera saw them, whatever the alpha, [h][w][3].
Image straightColour(const Image8& image) {
  Image colour(image.width, image.height, 3);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const std::uint8_t value = image.values[image.channels * i + c];
      colour.values[3 * i + c] = static_cast<float>(value) / 255.0f;
    }
  }
  return colour;
}

std::string sizeOf(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

}  // namespace

RefineCase caseOfPhoto(const Image8& photo, const Image8& mask, const Camera& camera,
                       const Distortion& distortion) {
  const Undistorter undistorter(camera, distortion);
  RefineCase result;
  result.image = undistorter.undistort(photo);
  if (!mask.empty()) result.mask = undistorter.undistort(mask);
  result.camera = undistorter.camera();
  return result;
}

void addDepth(ImageOf<std::uint16_t> values, double unit_m, const DepthNoise& noise,
              RefineCase* input) {
  const Camera& camera = input->camera;
  if (values.width != camera.width || values.height != camera.height) {
    throw std::invalid_argument("the depth image has " + sizeOf(values.width, values.height) +
                                " pixels, the image " + sizeOf(camera.width, camera.height));
  }
  DepthImage depth = *depthImage(std::move(values), camera, Pose(), noise);
  depth.unit_m = unit_m;
  depth.validate();
  input->depth = std::make_shared<const DepthImage>(std::move(depth));
}

RefineCase caseOfView(const PosedView& view, const Image8& mask) {
  RefineCase result;
  result.name = view.name;
  result.image = *view.rgba;
  if (!mask.empty()) {
    result.mask = Undistorter(view.photo_camera, view.distortion).undistort(mask);
  }
  result.camera = view.camera;
  result.true_T_O_C = view.T_O_C;
  return result;
}

Observation observationOf(const RefineCase& input, const std::vector<float>& background) {
  if (input.image.empty() && input.depth) return observe(input.depth);
  const PremultipliedImage premultiplied = premultiply(input.image);
  Observation observation;
  observation.camera = input.camera;
  observation.depth = input.depth;
  if (!input.mask.empty()) {
    observation.background = Background::kMask;
    observation.image = straightColour(input.image);
    observation.alpha = toFloat(input.mask);
    for (std::size_t i = 0; i < observation.alpha.values.size(); ++i) {
      observation.alpha.values[i] *= premultiplied.alpha.values[i];
    }
  } else if (!background.empty()) {
    observation.background = Background::kKnownColour;
    observation.background_colour = {background[0], background[1], background[2]};
    observation.image = composite(premultiplied, {background[0], background[1], background[2]});
  } else if (hasTransparency(input.image)) {
    observation.background = Background::kKnownAlpha;
    observation.image = premultiplied.colour;
    observation.alpha = premultiplied.alpha;
  } else {
    observation.image = premultiplied.colour;
  }
  return observation;
}

}  // namespace nerf_pose_refiner
