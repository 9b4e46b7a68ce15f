// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "field/field.h"
#include "support/frozen_ray.h"

namespace nerf_pose_refiner {

/// A field in double precision, written down as field.h defines it and in no other way: no shared
/// code, no batches, no shortcuts. The oracle of the fast implementations.
class ReferenceField {
 public:
  /// A ray in model units.
  struct Ray {
    Eigen::Vector3d origin;
    Eigen::Vector3d direction;  ///< unit length; the samples lie along it
    Eigen::Vector3d view;       ///< unit length; what the colour depends on
  };
  /// On which side of every kink an evaluation was: cells of all levels, signs of hidden neurons.
  using Sides = std::vector<int>;

  explicit ReferenceField(const Field& field) : field_(field), levels_(gridLevels(field.config)) {}

  /// Samples of a ray, in units of N: the lattice from the box's entry to its exit, the last
  /// interval cut off.
  std::vector<FrozenSample> samples(const Ray& ray) const {
    const Eigen::Vector3d origin = toCube(ray.origin);
    double entry = 0, exit = std::numeric_limits<double>::infinity();
    for (int a = 0; a < 3; ++a) {
      const double t0 = (toCube(field_.box.min)[a] - origin[a]) / ray.direction[a];
      const double t1 = (toCube(field_.box.max)[a] - origin[a]) / ray.direction[a];
      entry = std::max(entry, std::min(t0, t1));
      exit = std::min(exit, std::max(t0, t1));
    }
    std::vector<FrozenSample> samples;
    const double step = field_.config.step;
    for (int k = 0; entry + k * step < exit; ++k) {
      const double begin = entry + k * step;
      const double end = std::min(begin + step, exit);
      samples.push_back({(begin + end) / 2, end - begin});
    }
    return samples;
  }

  /// Alpha compositing of the frozen samples. @param sides may be null; is added to.
  RayColour render(const Ray& ray, const std::vector<FrozenSample>& samples, Sides* sides) const {
    return composite(samples, occupiedVolumeAt(ray, samples, sides));
  }

  /// Force [1 / model unit] and torque of a loss whose derivatives by the ray's colour are given.
  FrozenGradient gradient(const Ray& ray, const std::vector<FrozenSample>& samples,
                          const RayColour& by_colour, bool direction_gradient) const {
    FrozenGradient by_pose =
        gradientOf(ray.direction, samples, occupiedVolumeAt(ray, samples, nullptr), by_colour,
                   direction_gradient);
    by_pose.force /= field_.cubeSide();
    return by_pose;
  }

 private:
  std::vector<OccupiedVolume> occupiedVolumeAt(const Ray& ray,
                                               const std::vector<FrozenSample>& samples,
                                               Sides* sides) const {
    std::vector<OccupiedVolume> occupied_volume;
    for (const FrozenSample& sample : samples)
      occupied_volume.push_back(evaluate(ray, sample.t, sides));
    return occupied_volume;
  }

  Eigen::Vector3d toCube(const Eigen::Vector3d& p_O) const {
    return (p_O - field_.cubeCentre()) / field_.cubeSide() + Eigen::Vector3d::Constant(0.5);
  }

  OccupiedVolume evaluate(const Ray& ray, double t, Sides* sides) const {
    const Eigen::Vector3d p = toCube(ray.origin) + t * ray.direction;
    const FieldConfig& config = field_.config;
    const std::vector<Dual> out =
        network(encode(p, sides), field_.density_weights,
                layerSizes(config.levels * config.features, config.density_width,
                           config.density_hidden_layers, 1 + config.geometry_features),
                sides);
    std::vector<Dual> input = harmonics(ray.view);
    input.insert(input.end(), out.begin() + 1, out.end());
    const std::vector<Dual> logits =
        network(input, field_.colour_weights,
                layerSizes(static_cast<int>(input.size()), config.colour_width,
                           config.colour_hidden_layers, 3),
                sides);
    return {exponential(out[0]), {sigmoid(logits[0]), sigmoid(logits[1]), sigmoid(logits[2])}};
  }

  static std::vector<int> layerSizes(int inputs, int width, int hidden_layers, int outputs) {
    std::vector<int> sizes = {inputs};
    sizes.insert(sizes.end(), hidden_layers, width);
    sizes.push_back(outputs);
    return sizes;
  }

  static std::vector<Dual> network(std::vector<Dual> values, const std::vector<float>& weights,
                                   const std::vector<int>& sizes, Sides* sides) {
    std::size_t w = 0;
    for (std::size_t layer = 1; layer < sizes.size(); ++layer) {
      std::vector<Dual> next(sizes[layer]);
      for (Dual& neuron : next) {
        for (const Dual& value : values) {
          neuron = neuron + static_cast<double>(weights[w++]) * value;
        }
        if (layer + 1 == sizes.size()) continue;
        if (sides) sides->push_back(neuron.value > 0);
        neuron = relu(neuron);
      }
      values = next;
    }
    return values;
  }

  std::vector<Dual> encode(const Eigen::Vector3d& p, Sides* sides) const {
    std::vector<Dual> features;
    for (const GridLevel& level : levels_) {
      std::int64_t cell[3];
      Dual within[3];
      for (int a = 0; a < 3; ++a) {
        const double position = p[a] * level.resolution;
        cell[a] = static_cast<std::int64_t>(std::floor(position));
        within[a].value = position - static_cast<double>(cell[a]);
        within[a].d[a] = level.resolution;
        if (sides) sides->push_back(static_cast<int>(cell[a]));
      }
      for (int f = 0; f < field_.config.features; ++f) {
        Dual sum;
        for (int corner = 0; corner < 8; ++corner) {
          Dual weight = {1, {}};
          weight.d.setZero();
          std::int64_t vertex[3];
          for (int a = 0; a < 3; ++a) {
            const int side = corner >> a & 1;
            vertex[a] = cell[a] + side;
            weight = weight * (side == 1 ? within[a] : 1 + (-1.0) * within[a]);
          }
          sum = sum + gridValue(level, vertex, f) * weight;
        }
        features.push_back(sum);
      }
    }
    return features;
  }

  double gridValue(const GridLevel& level, const std::int64_t vertex[3], int feature) const {
    const std::int64_t n = level.resolution + 1;
    std::int64_t index = vertex[0] + n * vertex[1] + n * n * vertex[2];
    if (level.hashed) {
      const auto term = [](std::int64_t v, std::uint64_t prime) {
        return static_cast<std::uint32_t>(static_cast<std::uint64_t>(v) * prime);
      };
      const std::uint32_t hash =
          term(vertex[0], 1) ^ term(vertex[1], 2654435761u) ^ term(vertex[2], 805459861u);
      index = hash % level.entries;
    }
    const std::size_t at = (level.offset + index) * field_.config.features + feature;
    return fromHalf(field_.grid[at]);
  }

  static double fromHalf(std::uint16_t half) {
    const int exponent = half >> 10 & 31;
    const int mantissa = half & 1023;
    const double magnitude =
        exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
    return half >> 15 ? -magnitude : magnitude;
  }

  /// Real spherical harmonics as polynomials of the direction; the factors are the usual square
  /// roots, the sign (-1)^m is included. A turn w moves the direction by w x d.
  std::vector<Dual> harmonics(const Eigen::Vector3d& direction) const {
    Dual x = {direction.x(), {}}, y = {direction.y(), {}}, z = {direction.z(), {}};
    x.d << 0, 0, 0, 0, direction.z(), -direction.y();
    y.d << 0, 0, 0, -direction.z(), 0, direction.x();
    z.d << 0, 0, 0, direction.y(), -direction.x(), 0;
    const double pi = 3.14159265358979323846;
    const Dual x2 = x * x, y2 = y * y, z2 = z * z;
    Dual one;
    one.value = 1;
    const double a = std::sqrt(3 / (4 * pi)), b = std::sqrt(15 / (4 * pi)),
                 c = std::sqrt(5 / (16 * pi)), d = std::sqrt(35 / (32 * pi)),
                 e = std::sqrt(105 / (4 * pi)), f = std::sqrt(21 / (32 * pi)),
                 g = std::sqrt(7 / (16 * pi));
    std::vector<Dual> all = {0.5 / std::sqrt(pi) * one,
                             -a * y,
                             a * z,
                             -a * x,
                             b * (x * y),
                             -b * (y * z),
                             c * (3.0 * z2 - one),
                             -b * (x * z),
                             b / 2 * (x2 - y2),
                             -d * (y * (3.0 * x2 - y2)),
                             e * (x * (y * z)),
                             -f * (y * (5.0 * z2 - one)),
                             g * (z * (5.0 * z2 - 3.0 * one)),
                             -f * (x * (5.0 * z2 - one)),
                             e / 2 * (z * (x2 - y2)),
                             -d * (x * (x2 - 3.0 * y2))};
    all.resize(field_.config.sh_degree * field_.config.sh_degree);
    return all;
  }

  Field field_;
  std::vector<GridLevel> levels_;
};

}  // namespace nerf_pose_refiner
