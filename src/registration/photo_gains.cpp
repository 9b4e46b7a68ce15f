// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/photo_gains.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>

#include "concurrency/parallel.h"
#include "image/colour.h"
#include "image/resample.h"
#include "math/unsure_alpha.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kLongSide_px = 128;            // of the renderings: gains need no detail
constexpr float kSurelyOpaque = 0.95f;          // of photo and model, for a pixel that counts
constexpr double kDark = 0.02, kBright = 0.98;  // beyond, sensors clip
constexpr int kMinPixels = 60;
constexpr int kMaxThreads = 8;       // each holds a photo as floats
constexpr int kReweightings = 8;     // of reweighting
constexpr double kMinScale = 0.02;   // of residuals, below which all are alike
constexpr double kBiasPrior = 0.03;  // standard deviation of a bias
constexpr double kGainPrior = 0.5;   // and of a gain
constexpr double kResidual = 0.1;    // of a model, which errs alike over whole parts ..
constexpr double kAlikePixels = 50;  // .. so that as many count as one
constexpr double kMinGain = 0.25, kMaxGain = 4;
constexpr double kMeanGrey = 0.4;

struct Pair {
  double photo, model;
};

using Channels = std::array<std::vector<Pair>, 3>;

/// A view at a low resolution, on black.
struct SmallView {
  Camera camera;
  Image colour, alpha;
};

SmallView smallOf(const PosedView& view) {
  const double scale =
      std::min(1.0, kLongSide_px / std::max(view.camera.width, view.camera.height));
  const Camera camera = view.camera.scaled(scale);
  PremultipliedImage full = premultiply(*view.rgba);
  for (std::size_t i = 0; i < full.alpha.values.size(); ++i) {
    if (isUnsure(view.rgba->values[4 * i + 3])) full.alpha.values[i] = 0;
  }
  return {camera, resample(full.colour, view.camera, camera),
          resample(full.alpha, view.camera, camera)};
}

/// Colours of the pixels that show the object in both.
Channels pairsOf(const SmallView& photo, const Rendering& model) {
  Channels pairs;
  for (std::size_t i = 0; i < photo.alpha.values.size(); ++i) {
    const float alpha = photo.alpha.values[i], opacity = model.alpha.values[i];
    if (alpha < kSurelyOpaque || opacity < kSurelyOpaque) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const double seen = photo.colour.values[3 * i + c] / alpha;
      const double shown = model.colour.values[3 * i + c] / opacity;
      if (seen > kDark && seen < kBright) pairs[c].push_back({seen, shown});
    }
  }
  return pairs;
}

double middleOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// One weighted fit of model = gain * photo + bias, with priors of 1 and 0.
std::pair<double, double> fitted(const std::vector<Pair>& pairs,
                                 const std::vector<double>& weights) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    n += weights[i];
    x += weights[i] * pairs[i].photo;
    y += weights[i] * pairs[i].model;
    xx += weights[i] * pairs[i].photo * pairs[i].photo;
    xy += weights[i] * pairs[i].photo * pairs[i].model;
  }
  const double unit = kAlikePixels * kResidual * kResidual;
  Eigen::Matrix2d A;
  A << xx + unit / (kGainPrior * kGainPrior), x, x, n + unit / (kBiasPrior * kBiasPrior);
  const Eigen::Vector2d b(xy + unit / (kGainPrior * kGainPrior), y);
  const Eigen::Vector2d solution = A.inverse() * b;
  return {solution[0], solution[1]};
}

/// Weights fall with the residual as Geman and McClure have it.
std::pair<double, double> robustFit(const std::vector<Pair>& pairs) {
  std::vector<double> weights(pairs.size(), 1), residuals(pairs.size());
  std::pair<double, double> line = {1, 0};
  for (int round = 0; round < kReweightings; ++round) {
    line = fitted(pairs, weights);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      residuals[i] = std::abs(line.first * pairs[i].photo + line.second - pairs[i].model);
    }
    const double scale = std::max(kMinScale, 2 * middleOf(residuals));
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const double ratio = residuals[i] / scale;
      weights[i] = 1 / ((1 + ratio * ratio) * (1 + ratio * ratio));
    }
  }
  return line;
}

/// Nothing, if the view shows too little of the object.
std::optional<PhotoGain> gainOf(const Channels& pairs) {
  PhotoGain gain;
  for (std::size_t c = 0; c < 3; ++c) {
    if (pairs[c].size() < static_cast<std::size_t>(kMinPixels)) return std::nullopt;
    const auto [factor, offset] = robustFit(pairs[c]);
    gain.gain[static_cast<Eigen::Index>(c)] = std::clamp(factor, kMinGain, kMaxGain);
    gain.bias[static_cast<Eigen::Index>(c)] = offset;
  }
  return gain;
}

/// So that the median view keeps its colours.
void normalise(std::vector<PhotoGain>* gains) {
  for (Eigen::Index c = 0; c < 3; ++c) {
    std::vector<double> gain, bias;
    for (const PhotoGain& one : *gains) {
      gain.push_back(one.gain[c]);
      bias.push_back(one.bias[c]);
    }
    const double middle = middleOf(gain), offset = middleOf(bias);
    for (PhotoGain& one : *gains) {
      one.gain[c] /= middle;
      one.bias[c] = (one.bias[c] - offset) / middle;
    }
  }
}

}  // namespace

std::vector<PhotoGain> photoGains(const LoadedField& field, const std::vector<PosedView>& views,
                                  int threads, const CancellationToken& cancellation) {
  const int count = static_cast<int>(views.size());
  threads = std::min(threadCount(threads), kMaxThreads);
  std::vector<SmallView> photos(views.size());
  parallelFor(threads, count, [&](int i) {
    cancellation.check();
    photos[i] = smallOf(views[i]);
  });
  std::vector<Rendering> models;  // each uses all threads
  for (std::size_t i = 0; i < views.size(); ++i) {
    models.push_back(
        field.render({photos[i].camera, views[i].T_O_C}, RenderOptions(), cancellation));
  }
  std::vector<std::optional<PhotoGain>> found(views.size());
  parallelFor(threads, count, [&](int i) { found[i] = gainOf(pairsOf(photos[i], models[i])); });
  std::vector<PhotoGain> known;
  for (const std::optional<PhotoGain>& gain : found) {
    if (gain) known.push_back(*gain);
  }
  std::vector<PhotoGain> gains(views.size());
  if (known.empty()) return gains;
  normalise(&known);
  auto next = known.begin();
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i]) gains[i] = *next++;
  }
  return gains;
}

double gainSpread(const std::vector<PhotoGain>& gains) {
  if (gains.empty()) return 0;
  Eigen::Array3d squares = Eigen::Array3d::Zero();
  for (const PhotoGain& gain : gains) {
    const Eigen::Array3d grey = gain(Eigen::Array3d::Constant(kMeanGrey)).max(0.01);
    squares += (grey / kMeanGrey).log().square();
  }
  return std::sqrt((squares / static_cast<double>(gains.size())).maxCoeff());
}

PhotoGain combined(const PhotoGain& first, const PhotoGain& second) {
  return {second.gain * first.gain, second(first.bias)};
}

std::vector<PosedView> withGains(const std::vector<PosedView>& views,
                                 const std::vector<PhotoGain>& gains, int threads) {
  std::vector<PosedView> changed = views;
  parallelFor(
      std::min(threadCount(threads), kMaxThreads), static_cast<int>(views.size()), [&](int view) {
        const auto i = static_cast<std::size_t>(view);
        Image8 image = *views[i].rgba;
        for (std::size_t c = 0; c < 3; ++c) {
          const auto channel = static_cast<Eigen::Index>(c);
          std::array<std::uint8_t, 256> table;
          for (std::size_t v = 0; v < table.size(); ++v) {
            const double colour =
                gains.at(i).gain[channel] * (static_cast<double>(v) / 255) + gains[i].bias[channel];
            table[v] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(colour, 0.0, 1.0)));
          }
          for (std::size_t p = c; p < image.values.size(); p += 4) {
            image.values[p] = table[image.values[p]];
          }
        }
        changed[i].rgba = std::make_shared<const Image8>(std::move(image));
      });
  return changed;
}

}  // namespace nerf_pose_refiner
