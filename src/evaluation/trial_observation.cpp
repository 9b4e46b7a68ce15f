// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trial_observation.h"

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <utility>

#include "evaluation/clutter.h"
#include "evaluation/disturbance.h"
#include "evaluation/placement.h"
#include "image/colour.h"
#include "image/io.h"
#include "image/resample.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kOccluderStream = 73, kPhotoStream = 74;  // of random numbers

// A photo that fills the image, its middle cut out.
Image photoOfSize(const std::string& path, const Camera& camera) {
  const Image photo = toFloat(readImage(path));
  const double scale = std::max(static_cast<double>(camera.width) / photo.width,
                                static_cast<double>(camera.height) / photo.height);
  Camera from{photo.width, photo.height, 1, 1, (photo.width - 1) / 2.0, (photo.height - 1) / 2.0};
  Camera to{camera.width,
            camera.height,
            scale,
            scale,
            (camera.width - 1) / 2.0,
            (camera.height - 1) / 2.0};
  return resample(photo, from, to);
}

using Condition = std::pair<const char*, std::function<void(TrialObservation*)>>;

/// Of the paper's authors: value + 0.2, noise of 0.01, 5 discs of 50 px in images of 800.
constexpr double kBrightness = 0.2, kGaussian = 0.01, kDiscRadius = 50.0 / 800;
constexpr int kDiscs = 5;

Condition beforePhoto(const char* name, void (*disturb)(TrialObservation*)) {
  return {name, [disturb](TrialObservation* o) {
            o->background = "photo";
            disturb(o);
          }};
}

/// @param least, most of the object's longer side [widths of the image].
Placement inAnyRotation(double least, double most) {
  Placement placement;
  placement.least_width = least;
  placement.most_width = most;
  placement.is_turned = true;
  return placement;
}

const std::vector<Condition>& conditions() {
  static const std::vector<Condition> all = {
      {"clean", [](TrialObservation*) {}},
      {"brightness", [](TrialObservation* o) { o->brightness = kBrightness; }},
      {"gaussian", [](TrialObservation* o) { o->gaussian = kGaussian; }},
      {"poisson", [](TrialObservation* o) { o->poisson = true; }},
      {"discs", [](TrialObservation* o) { o->discs = kDiscs; }},
      {"paper_noise",
       [](TrialObservation* o) {
         o->brightness = kBrightness;
         o->gaussian = kGaussian;
         o->poisson = true;
         o->discs = kDiscs;
       }},
      {"photo", [](TrialObservation* o) { o->background = "photo"; }},
      beforePhoto("occluder", [](TrialObservation* o) { o->occluder = 0.15; }),
      beforePhoto("light", [](TrialObservation* o) { o->gain_bias = 0.3; }),
      beforePhoto("motion_blur", [](TrialObservation* o) { o->motion_blur = 10.0 / 800; }),
      beforePhoto("defocus", [](TrialObservation* o) { o->defocus = 2.0 / 800; }),
      beforePhoto("focal", [](TrialObservation* o) { o->focal_error = 0.01; }),
      beforePhoto("placed", [](TrialObservation* o) { o->placement = Placement(); }),
      beforePhoto("placed_robot",
                  [](TrialObservation* o) {
                    o->placement = Placement();
                    o->occluder = 0.25;
                    o->gain_bias = 0.3;
                    o->noise = 0.03;
                  }),
      beforePhoto("hidden",
                  [](TrialObservation* o) {
                    o->placement = Placement();
                    o->occluder_is_most = true;
                    o->occluder = 0.6;
                  }),
      beforePhoto("turned", [](TrialObservation* o) { o->placement = inAnyRotation(0.2, 0.5); }),
      beforePhoto("small", [](TrialObservation* o) { o->placement = inAnyRotation(0.125, 0.2); }),
      beforePhoto("group", [](TrialObservation* o) { o->is_group = true; }),
      beforePhoto("recoloured",
                  [](TrialObservation* o) {
                    o->placement = Placement();
                    o->is_recoloured = true;
                  }),
      beforePhoto("absent",
                  [](TrialObservation* o) {
                    o->placement = Placement();
                    o->is_absent = true;
                  }),
  };
  return all;
}

/// The view's straight colours, with the paper's noise.
Image disturbedColours(const TrialObservation& how, const PosedView& view,
                       const DisturbanceDraw& draw) {
  Image straight(view.rgba->width, view.rgba->height, 3);
  for (std::size_t i = 0; i < straight.values.size(); ++i) {
    straight.values[i] = view.rgba->values[i / 3 * 4 + i % 3] / 255.0f;
  }
  if (how.brightness > 0) brighten(how.brightness, &straight);
  if (how.gaussian > 0) addGaussianNoise(how.gaussian, draw, &straight);
  if (how.poisson) addPoissonNoise(draw, &straight);
  return straight;
}

PremultipliedImage disturbedObject(const TrialObservation& how, const PosedView& view,
                                   const Image& straight, const DisturbanceDraw& draw) {
  PremultipliedImage object = premultiply(*view.rgba);
  for (std::size_t i = 0; i < straight.values.size(); ++i) {
    object.colour.values[i] = straight.values[i] * object.alpha.values[i / 3];
  }
  if (how.is_recoloured) {
    for (std::size_t i = 0; i < object.colour.values.size(); i += 3) {
      std::rotate(&object.colour.values[i], &object.colour.values[i + 2],
                  &object.colour.values[i] + 3);
    }
  }
  if (how.is_absent) {
    std::fill(object.colour.values.begin(), object.colour.values.end(), 0.0f);
    std::fill(object.alpha.values.begin(), object.alpha.values.end(), 0.0f);
  }
  if (how.gain_bias > 0) applyGainBias(how.gain_bias, draw, &object);
  if (how.discs > 0) cutDiscs(how.discs, how.disc_radius * view.camera.width, draw, &object);
  return object;
}

}  // namespace

TrialObservation TrialObservation::named(const std::string& condition,
                                         const std::string& background) {
  std::string known;
  for (const auto& [name, set] : conditions()) {
    TrialObservation observation;
    observation.background = background;
    observation.disc_radius = kDiscRadius;
    set(&observation);
    if (condition == name) return observation;
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  throw std::invalid_argument("no condition '" + condition + "', there are: " + known);
}

std::vector<std::string> TrialObservation::conditionNames() {
  std::vector<std::string> names;
  for (const auto& condition : conditions()) names.push_back(condition.first);
  return names;
}

TrialImage TrialObservation::imageOf(const std::vector<PosedView>& views,
                                     std::size_t number) const {
  const DisturbanceDraw draw = {seed, number};
  TrialImage image;
  if (is_group) {
    GroupView group = placedGroup(views, number, GroupPlacement(), draw);
    image.view = group.view;
    image.instances = group.instances;
  } else {
    image.view = placement ? placed(views.at(number), *placement, draw) : views.at(number);
    image.instances = {{image.view.T_O_C, 1}};
  }
  double hidden = 0;
  image.observation = disturbed(image.view, number, &hidden);
  for (ShownInstance& one : image.instances) one.visible *= 1 - hidden;
  if (is_absent || is_recoloured) image.instances.clear();
  return image;
}

Observation TrialObservation::of(const PosedView& view, std::uint64_t index) const {
  double hidden = 0;
  return disturbed(view, index, &hidden);
}

/// @param hidden gets the fraction of the object that the occluder hides.
Observation TrialObservation::disturbed(const PosedView& view, std::uint64_t index,
                                        double* hidden) const {
  const DisturbanceDraw draw = {seed, index};
  const Image straight = disturbedColours(*this, view, draw);
  const PremultipliedImage object = disturbedObject(*this, view, straight, draw);
  Observation observation;
  observation.camera = view.camera;
  if (background == "alpha") {
    observation.background = Background::kKnownAlpha;
    observation.image = object.colour;
    observation.alpha = object.alpha;
  } else if (background == "white") {
    observation.background = Background::kKnownColour;
    observation.background_colour = Eigen::Vector3f::Ones();
    observation.image = composite(object, {1, 1, 1});
  } else if (background == "own") {
    observation.background = Background::kMask;
    observation.image = straight;
    observation.alpha = object.alpha;
  } else {
    const auto count = static_cast<std::uint32_t>(photos.size());
    const Image photo =
        count == 0
            ? clutter(view.camera.width, view.camera.height, seed + index)
            : photoOfSize(photos[randomIndex(seed, kPhotoStream, index, count)], view.camera);
    observation.image = object.colour;
    for (std::size_t i = 0; i < photo.values.size(); ++i) {
      observation.image.values[i] += (1 - object.alpha.values[i / 3]) * photo.values[i];
    }
    observation.background = background == "mask" ? Background::kMask : Background::kUnknown;
    if (background == "mask") observation.alpha = object.alpha;
  }
  const double covered =
      occluder_is_most ? occluder * randomUniform(seed, kOccluderStream, index) : occluder;
  if (covered > 0) *hidden = occlude(covered, draw, object.alpha, &observation.image);
  if (motion_blur > 0) blurByMotion(motion_blur * view.camera.width, draw, &observation.image);
  if (defocus > 0) nerf_pose_refiner::defocus(defocus * view.camera.width, &observation.image);
  if (noise > 0) addGaussianNoise(noise, draw, &observation.image);
  observation.camera.fx *= 1 + focal_error;
  observation.camera.fy *= 1 + focal_error;
  return observation;
}

}  // namespace nerf_pose_refiner
