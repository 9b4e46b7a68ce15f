// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "backend/cpu/cpu_kernels.h"
#include "backend/cpu/cpu_networks.h"
#include "backend/cpu/sample_pool.h"
#include "math/half.h"
#include "math/hash.h"
#include "math/random.h"

// The kernels of every instruction set against plain loops in double precision.

namespace nerf_pose_refiner {
namespace {

constexpr int kStride = TiledRows::kTileStride;
constexpr int kColumns = TiledRows::kTile;

class Kernels : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    try {
      kernels_ = &selectCpuKernels(GetParam());
    } catch (const std::runtime_error& error) {
      GTEST_SKIP() << error.what();
    }
  }

  float uniform(double low, double high) {
    return static_cast<float>(low + (high - low) * randomUniform(1, 1, drawn_++));
  }

  TiledRows randomRows(int rows) {
    TiledRows result(rows, kColumns);
    for (int i = 0; i < rows * kStride; ++i) result.at(0)[i] = uniform(-1, 1);
    return result;
  }

  std::vector<float> randomNumbers(std::size_t n) {
    std::vector<float> numbers(n);
    for (float& number : numbers) number = uniform(-1, 1);
    return numbers;
  }

  const CpuKernels* kernels_ = nullptr;

 private:
  std::uint64_t drawn_ = 0;
};

INSTANTIATE_TEST_SUITE_P(InstructionSets, Kernels, ::testing::Values("baseline", "avx2"),
                         [](const auto& p) { return std::string(p.param); });

// --- hash grid

// A grid with dense and hashed levels, and points in it: at random, on faces of cells and of the
// cube, and outside, where the nearest point of the cube counts.
struct GridCase {
  FieldConfig config;
  std::unique_ptr<CpuNetworks> networks;
  std::vector<std::uint16_t> values;
  TiledRows points{3, kColumns};

  KernelGrid grid() const {
    return {networks->levels.data(), values.data(), static_cast<int>(networks->levels.size()),
            config.features};
  }
  const float* axis(int a) const { return points.at(0) + a * kStride; }
  int rows() const { return networks->encoding_rows; }
};

GridCase makeGridCase(int features) {
  GridCase c;
  c.config.levels = 5;
  c.config.features = features;
  c.config.log2_table_size = 9;  // 8^3: the level of 7 cells fills it
  c.config.base_resolution = 3;
  c.config.finest_resolution = 90;
  c.networks = std::make_unique<CpuNetworks>(c.config);
  const KernelGridLevel& last = c.networks->levels.back();
  c.values.resize(std::size_t{last.offset + last.entries} * features);
  std::uint64_t drawn = 0;
  for (std::uint16_t& value : c.values) value = floatToHalf(2 * randomUniform(2, 1, drawn++) - 1);
  for (int a = 0; a < 3; ++a) {
    float* p = c.points.at(0) + a * kStride;
    for (int s = 0; s < kColumns; ++s) p[s] = randomUniform(2, 2 + a, s);
    const float special[8] = {0, 1, 1.0f / 3, 2.0f / 3, -0.25f, 1.5f, 0.99999994f, 1e-7f};
    for (int s = 0; s < 32; ++s) p[s] = special[(s * (2 * a + 1) + s / 8) % 8];
  }
  return c;
}

// The trilinear weight of each corner and its derivatives by the position.
struct Corner {
  std::size_t entry;  // in the whole table
  double weight;
  double derivative[3];
};

std::vector<Corner> cornersAt(const GridCase& c, int level, int column) {
  const KernelGridLevel& l = c.networks->levels[level];
  std::uint32_t cell[3];
  double within[3];
  for (int a = 0; a < 3; ++a) {
    // In float, as rounding decides on which side of a face a point is.
    const float p = std::max(0.0f, std::min(1.0f, c.axis(a)[column]));
    const float scaled = p * static_cast<float>(l.resolution);
    cell[a] = std::min(l.resolution - 1, static_cast<std::uint32_t>(scaled));
    within[a] = static_cast<double>(scaled) - cell[a];
  }
  std::vector<Corner> corners;
  for (std::uint32_t k = 0; k < 8; ++k) {
    const std::uint32_t side[3] = {k & 1, k >> 1 & 1, k >> 2};
    double factor[3], slope[3];
    for (int a = 0; a < 3; ++a) {
      factor[a] = side[a] == 1 ? within[a] : 1 - within[a];
      slope[a] = side[a] == 1 ? l.resolution : -static_cast<double>(l.resolution);
    }
    Corner corner;
    const std::uint32_t x = cell[0] + side[0], y = cell[1] + side[1], z = cell[2] + side[2];
    corner.entry =
        l.offset + (l.hashed ? hashedIndex(x, y, z, l.entries) : denseIndex(x, y, z, l.resolution));
    corner.weight = factor[0] * factor[1] * factor[2];
    corner.derivative[0] = slope[0] * factor[1] * factor[2];
    corner.derivative[1] = factor[0] * slope[1] * factor[2];
    corner.derivative[2] = factor[0] * factor[1] * slope[2];
    corners.push_back(corner);
  }
  return corners;
}

constexpr int kFeatures[4] = {1, 2, 4, 8};

TEST_P(Kernels, EncodeInterpolates) {
  for (const int features : kFeatures) {
    const GridCase c = makeGridCase(features);
    ASSERT_EQ(c.networks->levels[1].hashed, 0u);
    ASSERT_EQ(c.networks->levels[2].hashed, 1u);
    TiledRows out(c.rows(), kColumns);
    const float* const position[3] = {c.axis(0), c.axis(1), c.axis(2)};
    kernels_->encode(c.grid(), position, out.part(0, kColumns));
    for (int row = 0; row < c.rows(); ++row) {
      for (int s = 0; s < kColumns; ++s) {
        double expected = 0;
        for (const Corner& corner : cornersAt(c, row / features, s)) {
          expected +=
              corner.weight * halfToFloat(c.values[corner.entry * features + row % features]);
        }
        ASSERT_NEAR(out.at(0)[row * kStride + s], expected, 1e-6) << features << " " << row;
      }
    }
  }
}

TEST_P(Kernels, EncodePositionGradientIsAddedTo) {
  for (const int features : kFeatures) {
    const GridCase c = makeGridCase(features);
    const TiledRows out_gradient = randomRows(c.rows());
    TiledRows gradient = randomRows(3);
    const std::vector<float> before(gradient.at(0), gradient.at(0) + 3 * kStride);
    const float* const position[3] = {c.axis(0), c.axis(1), c.axis(2)};
    float* const by_position[3] = {gradient.at(0), gradient.at(0) + kStride,
                                   gradient.at(0) + 2 * kStride};
    kernels_->encodePositionGradient(c.grid(), position, out_gradient.constPart(0, kColumns),
                                     by_position);
    for (int s = 0; s < kColumns; ++s) {
      for (int a = 0; a < 3; ++a) {
        double expected = before[a * kStride + s];
        for (int row = 0; row < c.rows(); ++row) {
          for (const Corner& corner : cornersAt(c, row / features, s)) {
            expected += out_gradient.at(0)[row * kStride + s] * corner.derivative[a] *
                        halfToFloat(c.values[corner.entry * features + row % features]);
          }
        }
        // Slopes of up to 90 a unit and feature.
        ASSERT_NEAR(gradient.at(0)[a * kStride + s], expected, 2e-4) << features << " " << s;
      }
    }
  }
}

TEST_P(Kernels, EncodeGridGradientIsAddedTo) {
  for (const int features : kFeatures) {
    const GridCase c = makeGridCase(features);
    for (int level = 0; level < c.config.levels; ++level) {
      const KernelGridLevel& l = c.networks->levels[level];
      TiledRows out_gradient = randomRows(features);
      for (int f = 0; f < features; ++f) out_gradient.at(0)[f * kStride + 40] = 0;
      std::vector<float> gradient(std::size_t{l.entries} * features, 0.25f);
      std::vector<double> expected(gradient.begin(), gradient.end());
      const float* const position[3] = {c.axis(0), c.axis(1), c.axis(2)};
      kernels_->encodeGridGradient(c.grid(), level, position, out_gradient.constPart(0, kColumns),
                                   gradient.data());
      for (int s = 0; s < kColumns; ++s) {
        for (const Corner& corner : cornersAt(c, level, s)) {
          for (int f = 0; f < features; ++f) {
            expected[(corner.entry - l.offset) * features + f] +=
                corner.weight * out_gradient.at(0)[f * kStride + s];
          }
        }
      }
      for (std::size_t i = 0; i < expected.size(); ++i) {
        ASSERT_NEAR(gradient[i], expected[i], 1e-5) << features << " " << level << " " << i;
      }
    }
  }
}

// --- networks

struct LayerSize {
  int outputs, inputs, columns;
};

// As networks of odd sizes have them after padding, and as the backward pass turns them round.
constexpr LayerSize kLayerSizes[] = {{4, 4, 16},   {4, 8, 48},    {12, 20, 128}, {20, 12, 112},
                                     {32, 32, 16}, {16, 64, 128}, {64, 4, 32}};

TEST_P(Kernels, LayerMultiplies) {
  for (const LayerSize& size : kLayerSizes) {
    for (const bool relu : {false, true}) {
      const std::vector<float> weights =
          randomNumbers(static_cast<std::size_t>(size.outputs) * size.inputs);
      const TiledRows in = randomRows(size.inputs);
      TiledRows out = randomRows(size.outputs);
      const float behind = out.at(0)[size.columns];
      kernels_->layer(weights.data(), in.constPart(0, size.columns), out.part(0, size.columns),
                      relu);
      for (int o = 0; o < size.outputs; ++o) {
        for (int s = 0; s < size.columns; ++s) {
          double sum = 0;
          for (int i = 0; i < size.inputs; ++i) {
            sum += static_cast<double>(weights[o * size.inputs + i]) * in.at(0)[i * kStride + s];
          }
          ASSERT_NEAR(out.at(0)[o * kStride + s], relu ? std::max(sum, 0.0) : sum, 1e-5);
        }
      }
      EXPECT_EQ(out.at(0)[size.columns], behind) << "writes behind the columns";
    }
  }
}

TEST_P(Kernels, LayerWeightGradientIsAddedTo) {
  for (const LayerSize& size : kLayerSizes) {
    for (const int inputs : {size.inputs, size.inputs - 1}) {
      const TiledRows out_gradient = randomRows(size.outputs), in = randomRows(inputs);
      std::vector<float> gradient = randomNumbers(static_cast<std::size_t>(size.outputs) * inputs);
      const std::vector<float> before = gradient;
      kernels_->layerWeightGradient(out_gradient.constPart(0, size.columns),
                                    in.constPart(0, size.columns), gradient.data());
      for (int o = 0; o < size.outputs; ++o) {
        for (int i = 0; i < inputs; ++i) {
          double expected = before[o * inputs + i];
          for (int s = 0; s < size.columns; ++s) {
            expected += static_cast<double>(out_gradient.at(0)[o * kStride + s]) *
                        in.at(0)[i * kStride + s];
          }
          ASSERT_NEAR(gradient[o * inputs + i], expected, 1e-5) << inputs;
        }
      }
    }
  }
}

TEST_P(Kernels, ReluGradientPassesWhereTheNeuronIsActive) {
  TiledRows activation(2, kColumns), gradient = randomRows(2);
  activation.at(0)[1] = 0.5f;
  activation.at(0)[2] = -0.5f;
  activation.at(0)[kStride] = std::numeric_limits<float>::denorm_min();
  const float first = gradient.at(0)[1], second = gradient.at(0)[kStride];
  kernels_->reluGradient(activation.constPart(0, 16), gradient.part(0, 16));
  for (int s = 0; s < 16; ++s) {
    EXPECT_EQ(gradient.at(0)[s], s == 1 ? first : 0.0f) << s;
    EXPECT_EQ(gradient.at(0)[kStride + s], s == 0 ? second : 0.0f) << s;
  }
}

TEST_P(Kernels, ExponentialIsAccurateAndBounded) {
  constexpr int kCount = 16000;
  std::vector<float> in(kCount), out(kCount);
  for (int i = 0; i < kCount; ++i) in[i] = -79.5f + 109.4f * static_cast<float>(i) / kCount;
  in[0] = 0;
  kernels_->exponential(in.data(), out.data(), kCount);
  EXPECT_EQ(out[0], 1.0f);
  for (int i = 0; i < kCount; ++i) {
    const double expected = std::exp(static_cast<double>(in[i]));
    ASSERT_NEAR(out[i] / expected, 1, 5e-7) << in[i];
  }
  const float infinity = std::numeric_limits<float>::infinity();
  std::vector<float> bounds = {31, 1e9f, infinity, -81, -1e9f, -infinity};
  bounds.resize(16);
  kernels_->exponential(bounds.data(), bounds.data(), 16);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(bounds[i] / 1.0686474581524463e13, 1, 1e-6);  // exp(30)
  for (int i = 3; i < 6; ++i) {
    EXPECT_GE(bounds[i], 0) << i;
    EXPECT_LT(bounds[i], 1e-30) << i;
  }
}

TEST_P(Kernels, SigmoidIsAccurateAndBounded) {
  constexpr int kCount = 16000;
  std::vector<float> in(kCount), out(kCount);
  for (int i = 0; i < kCount; ++i) in[i] = -20 + 40.0f * static_cast<float>(i) / kCount;
  in[0] = 0, in[1] = 1000, in[2] = -1000;
  kernels_->sigmoid(in.data(), out.data(), kCount);
  EXPECT_EQ(out[0], 0.5f);
  EXPECT_EQ(out[1], 1.0f);
  for (int i = 0; i < kCount; ++i) {
    ASSERT_NEAR(out[i], 1 / (1 + std::exp(-static_cast<double>(in[i]))), 2e-7) << in[i];
    ASSERT_GE(out[i], 0);
  }
}

// --- optimiser

/// Some numbers, as the kernel takes them.
struct Parameters {
  std::vector<float> value, first, second, gradient;
  std::vector<std::uint16_t> half;

  explicit Parameters(std::size_t n)
      : value(n, 1.0f), first(n, 0.0f), second(n, 0.0f), gradient(n, 0.0f), half(n, 0) {}

  KernelParameters all(bool with_halves = true) {
    return {value.data(),
            first.data(),
            second.data(),
            gradient.data(),
            with_halves ? half.data() : nullptr,
            static_cast<std::int64_t>(value.size())};
  }
};

TEST_P(Kernels, AdamByHand) {
  const KernelAdam adam = {0.1f, 0.5f, 0.75f, 0.25f};  // no bias correction
  Parameters p(16);
  p.gradient[3] = 2;
  kernels_->adam(p.all(), adam);
  EXPECT_FLOAT_EQ(p.first[3], 1);
  EXPECT_FLOAT_EQ(p.second[3], 1);
  EXPECT_FLOAT_EQ(p.value[3], 0.92f);  // 1 - 0.1 * 1 / (1 + 0.25)
  EXPECT_EQ(p.gradient[3], 0);
  EXPECT_EQ(p.half[3], 0x3b5c);  // 0.919921875
  p.gradient[3] = -4;
  kernels_->adam(p.all(false), adam);
  EXPECT_FLOAT_EQ(p.first[3], -1.5f);
  EXPECT_FLOAT_EQ(p.second[3], 4.75f);
  EXPECT_FLOAT_EQ(p.value[3], 0.98174238f);  // 0.92 + 0.15 / (2.17944947 + 0.25)
  EXPECT_EQ(p.half[3], 0x3b5c) << "no half values were asked for";
}

TEST_P(Kernels, AdamLeavesAloneWhatHasNoGradient) {
  constexpr int kCount = 64;
  Parameters p(kCount);
  p.value = randomNumbers(kCount);
  p.first = randomNumbers(kCount);
  p.second.assign(kCount, 0.5f);
  for (int i = 0; i < kCount; ++i) p.half[i] = floatToHalf(p.value[i]);
  const Parameters before = p;
  for (const int i : {0, 5, 17, 18, 63}) p.gradient[i] = 1e-20f;  // of any size but 0
  p.gradient[40] = -0.0f;
  kernels_->adam(p.all(), {0.1f, 0.9f, 0.99f, 1e-8f});
  for (int i = 0; i < kCount; ++i) {
    const bool touched = i == 0 || i == 5 || i == 17 || i == 18 || i == 63;
    EXPECT_EQ(p.value[i] != before.value[i], touched) << i;
    EXPECT_EQ(p.first[i] != before.first[i], touched) << i;
    EXPECT_EQ(p.second[i] != before.second[i], touched) << i;
    EXPECT_EQ(p.half[i] != before.half[i], touched) << i;
    EXPECT_EQ(p.gradient[i], 0) << i;
  }
}

TEST_P(Kernels, AdamRoundsHalvesToNearestEven) {
  constexpr int kCount = 4096;
  Parameters p(kCount);
  p.gradient.assign(kCount, 1.0f);
  for (int i = 0; i < kCount; ++i) {
    p.value[i] = std::ldexp(uniform(-2, 2), static_cast<int>(randomIndex(3, 1, i, 42)) - 27);
  }
  p.value[0] = 1 + std::ldexp(3.0f, -11);  // ties, normal and subnormal
  p.value[1] = std::ldexp(2.5f, -24);
  p.value[2] = std::ldexp(-1023.5f, -24);
  kernels_->adam(p.all(), {0.0f, 0.9f, 0.99f, 1e-8f});
  EXPECT_EQ(p.half[0], 0x3c02);
  EXPECT_EQ(p.half[1], 0x0002);
  EXPECT_EQ(p.half[2], 0x8400);
  for (int i = 0; i < kCount; ++i) ASSERT_EQ(p.half[i], floatToHalf(p.value[i])) << p.value[i];
}

}  // namespace
}  // namespace nerf_pose_refiner
