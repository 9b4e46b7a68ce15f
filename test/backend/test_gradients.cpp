// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <vector>

#include "backend/cpu/ray_renderer.h"
#include "backend/loaded_field.h"
#include "math/loss.h"
#include "nerf_pose_refiner/pose.h"
#include "support/cpu_rays.h"
#include "support/random_field.h"
#include "support/reference_field.h"

// Gradients of the paper's mode: the double-precision reference against central differences of
// itself, and the CPU backend against the reference. Sample distances, the viewing direction and
// the denominators of the relative losses are frozen; no ray ends early; no cell is skipped.

namespace nerf_pose_refiner {
namespace {

constexpr int kCases = 1000;
constexpr double kStep = 1e-6;  // of the central differences [model units, rad]

struct Case {
  Ray ray;
  Eigen::Vector3d target;      // observed colour
  Eigen::Vector3d background;  // known colour behind the object
};

double uniform(std::uint64_t seed, int counter, double low, double high) {
  return low + (high - low) * randomUniform(seed, 2, counter);
}

// A ray from outside through a random point of the box.
Case makeCase(const Field& field, std::uint64_t seed) {
  Eigen::Vector3d origin, through;
  Case c;
  for (int a = 0; a < 3; ++a) {
    origin[a] = field.cubeCentre()[a] + uniform(seed, a, -1, 1) + (a == 0 ? 3 : 0);
    through[a] = uniform(seed, 3 + a, field.box.min[a], field.box.max[a]);
    c.target[a] = uniform(seed, 6 + a, 0, 1);
    c.background[a] = uniform(seed, 9 + a, 0, 1);
  }
  const Eigen::Vector3f o = origin.cast<float>();
  const Eigen::Vector3f d = (through - origin).normalized().cast<float>();
  c.ray = {{o.x(), o.y(), o.z()}, {d.x(), d.y(), d.z()}};
  return c;
}

ReferenceField::Ray doubleRay(const Ray& ray) {
  ReferenceField::Ray r;
  r.origin = Eigen::Map<const Eigen::Vector3f>(ray.origin).cast<double>();
  r.direction = Eigen::Map<const Eigen::Vector3f>(ray.direction).cast<double>();
  r.view = r.direction;
  return r;
}

// The ray of the moved camera: axes 0..2 move it, 3..5 turn it about its centre, from the left.
ReferenceField::Ray moved(ReferenceField::Ray ray, int axis, double by, bool turns_view) {
  if (axis < 3) {
    ray.origin[axis] += by;
  } else {
    const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(by * Eigen::Vector3d::Unit(axis - 3)));
    ray.direction = turn * ray.direction;
    if (turns_view) ray.view = ray.direction;
  }
  return ray;
}

Eigen::Vector3d onBackground(const RayColour& colour, const Case& c) {
  return colour.rgb + (1 - colour.alpha) * c.background;
}

// The losses written again, their denominators those of `frozen`.
double frozenLoss(Loss kind, double p, double target, double frozen) {
  const double e = std::abs(p - target);
  switch (kind) {
    case Loss::kL1:
      return e;
    case Loss::kL2:
      return e * e;
    case Loss::kLogL1:
      return std::log(1 + e);
    case Loss::kRelativeL2:
      return e * e / (frozen * frozen + 0.01);
    case Loss::kMape:
      return e / (std::abs(frozen) + 0.01);
    case Loss::kSmape:
      return e / ((std::abs(frozen) + std::abs(target)) / 2 + 0.01);
    case Loss::kSmoothL1:
      return e < 0.1 ? e * e / 0.2 : e - 0.05;
  }
  return 0;
}

double meanLoss(Loss kind, const Eigen::Vector3d& p, const Case& c, const Eigen::Vector3d& frozen) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) sum += frozenLoss(kind, p[i], c.target[i], frozen[i]) / 3;
  return sum;
}

template <typename T>
Eigen::Matrix<T, 4, 1> lossGradient(Loss kind, const Eigen::Matrix<T, 3, 1>& p, const Case& c) {
  Eigen::Matrix<T, 4, 1> g = Eigen::Matrix<T, 4, 1>::Zero();
  for (int i = 0; i < 3; ++i) {
    g[i] = lossTerm<T>(kind, p[i], static_cast<T>(c.target[i])).derivative / 3;
    g[3] -= g[i] * static_cast<T>(c.background[i]);
  }
  return g;
}

// Colours on the background: at a case's pose, and a step to both sides along the six axes.
struct Renderings {
  Eigen::Vector3d centre;
  Eigen::Vector3d plus[6], minus[6];
  // No step crosses a kink: each sees the same cells and the same signs of all neurons, and no
  // channel's error changes its sign. Elsewhere the derivative is not defined.
  bool smooth = true;
};

Renderings renderAround(const ReferenceField& field, const Case& c, bool turns_view) {
  const ReferenceField::Ray ray = doubleRay(c.ray);
  const auto samples = field.samples(ray);
  Renderings all;
  ReferenceField::Sides sides;
  all.centre = onBackground(field.render(ray, samples, &sides), c);
  const auto render = [&](int axis, double by) {
    ReferenceField::Sides there;
    const Eigen::Vector3d colour =
        onBackground(field.render(moved(ray, axis, by, turns_view), samples, &there), c);
    const Eigen::Array3d errors = (colour - c.target).array() * (all.centre - c.target).array();
    all.smooth = all.smooth && there == sides && (errors > 0).all();
    return colour;
  };
  for (int axis = 0; axis < 6; ++axis) {
    all.plus[axis] = render(axis, kStep);
    all.minus[axis] = render(axis, -kStep);
  }
  return all;
}

using Vector6d = Eigen::Matrix<double, 6, 1>;

// Force and torque have different units: each is compared on its own.
bool agree(const Vector6d& a, const Vector6d& b, double tolerance) {
  const auto close = [&](int first) {
    const double error = (a.segment<3>(first) - b.segment<3>(first)).norm();
    return error <= tolerance * b.segment<3>(first).norm() + 1e-9;
  };
  return close(0) && close(3);
}

Vector6d referenceGradient(const ReferenceField& field, const Case& c, Loss kind, bool turns_view) {
  const ReferenceField::Ray ray = doubleRay(c.ray);
  const auto samples = field.samples(ray);
  const Eigen::Vector3d p = onBackground(field.render(ray, samples, nullptr), c);
  const Eigen::Vector4d g = lossGradient<double>(kind, p, c);
  const auto gradient = field.gradient(ray, samples, {g.head<3>(), g[3]}, turns_view);
  Vector6d both;
  both << gradient.force, gradient.torque;
  return both;
}

struct SmoothCases {
  std::vector<Case> cases;
  std::vector<Renderings> renderings;
};

// Draws cases and leaves out those on a kink.
SmoothCases drawSmoothCases(const ReferenceField& field, const Field& parameters, int count,
                            bool turns_view) {
  SmoothCases drawn;
  int seed = 0;
  for (; static_cast<int>(drawn.cases.size()) < count; ++seed) {
    const Case c = makeCase(parameters, seed);
    const Renderings renderings = renderAround(field, c, turns_view);
    if (!renderings.smooth) continue;
    drawn.cases.push_back(c);
    drawn.renderings.push_back(renderings);
  }
  EXPECT_LT(seed, 10 * count) << "nearly all cases lie on a kink";
  return drawn;
}

Vector6d centralDifferences(const Case& c, const Renderings& at, Loss kind) {
  Vector6d differences;
  for (int axis = 0; axis < 6; ++axis) {
    differences[axis] = (meanLoss(kind, at.plus[axis], c, at.centre) -
                         meanLoss(kind, at.minus[axis], c, at.centre)) /
                        (2 * kStep);
  }
  return differences;
}

void expectReferenceMatchesDifferences(bool turns_view) {
  const Field parameters = randomField(smallConfig(), 7);
  const ReferenceField field(parameters);
  const SmoothCases drawn = drawSmoothCases(field, parameters, kCases, turns_view);
  for (int k = 0; k < kLossCount; ++k) {
    const Loss kind = static_cast<Loss>(k);
    int failures = 0;
    for (int i = 0; i < kCases; ++i) {
      const Vector6d gradient = referenceGradient(field, drawn.cases[i], kind, turns_view);
      const Vector6d expected = centralDifferences(drawn.cases[i], drawn.renderings[i], kind);
      if (!agree(gradient, expected, 1e-3)) ++failures;
    }
    EXPECT_LE(failures, kCases / 100) << lossName(kind);
  }
}

TEST(Gradients, referenceMatchesCentralDifferencesForEveryLoss) {
  expectReferenceMatchesDifferences(false);
}

TEST(Gradients, referenceMatchesCentralDifferencesThroughTheViewingDirectionToo) {
  expectReferenceMatchesDifferences(true);
}

// The backend's forces and torques of all cases, in one call.
std::vector<Vector6d> backendGradients(const RayRenderer& scene, const std::vector<Case>& cases,
                                       Loss kind, bool turns_view) {
  std::vector<Ray> rays;
  for (const Case& c : cases) rays.push_back(c.ray);
  RenderOptions options;
  options.min_transmittance = 0;
  options.min_weight = 0;
  options.use_occupancy = false;
  std::vector<RayGradient> gradients(cases.size());
  const auto gradient = [&](int i, const RayResult& ray) -> RayLossGradient {
    const Eigen::Vector3f p = Eigen::Map<const Eigen::Vector3f>(ray.rgb) +
                              (1 - ray.alpha) * cases[i].background.cast<float>();
    const Eigen::Vector4f g = lossGradient<float>(kind, p, cases[i]);
    return {{g[0], g[1], g[2]}, g[3]};
  };
  scene.rayGradients({rays.data(), static_cast<int>(rays.size())}, options, turns_view, gradient,
                     gradients.data());
  std::vector<Vector6d> all;
  for (const RayGradient& of_ray : gradients) {
    Vector6d both;
    both << Eigen::Map<const Eigen::Vector3f>(of_ray.force).cast<double>(),
        Eigen::Map<const Eigen::Vector3f>(of_ray.torque).cast<double>();
    all.push_back(both);
  }
  return all;
}

void expectBackendMatchesReference(const FieldConfig& config, const char* instruction_set,
                                   bool turns_view, int count) {
  const auto parameters = std::make_shared<Field>(randomField(config, 7));
  const ReferenceField reference(*parameters);
  const auto scene = load(*parameters, instruction_set);
  const auto cases = drawSmoothCases(reference, *parameters, count, turns_view).cases;
  for (int k = 0; k < kLossCount; ++k) {
    const Loss kind = static_cast<Loss>(k);
    const std::vector<Vector6d> gradients = backendGradients(*scene, cases, kind, turns_view);
    int failures = 0;
    for (int i = 0; i < count; ++i) {
      const Vector6d expected = referenceGradient(reference, cases[i], kind, turns_view);
      if (!agree(gradients[i], expected, 1e-2)) ++failures;
    }
    EXPECT_LE(failures, count / 100) << lossName(kind);
  }
}

TEST(Gradients, backendMatchesReferenceForEveryLoss) {
  expectBackendMatchesReference(smallConfig(), "auto", false, kCases);
}

TEST(Gradients, backendMatchesReferenceThroughTheViewingDirectionToo) {
  expectBackendMatchesReference(smallConfig(), "auto", true, kCases);
}

TEST(Gradients, backendMatchesReferenceWithoutVectorInstructions) {
  expectBackendMatchesReference(smallConfig(), "baseline", false, kCases);
}

TEST(Gradients, backendMatchesReferenceInThePapersNetwork) {
  FieldConfig config = FieldConfig::named("paper");
  config.step = 0.11f;  // few samples, each of which matters
  expectBackendMatchesReference(config, "auto", false, 100);
}

}  // namespace
}  // namespace nerf_pose_refiner
