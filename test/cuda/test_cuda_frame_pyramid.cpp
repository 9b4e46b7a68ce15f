// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <random>
#include <vector>

#include "../../cuda/cuda_frame_pyramid.h"
#include "backend/cpu/frame_pyramid.h"
#include "cuda_test.h"

// Levels of a part of an image on the GPU against the CPU's.

namespace nerf_pose_refiner {
namespace {

class CudaFramePyramidTest : public CudaTest {
 protected:
  static Observation noise(int width, int height, bool has_weight) {
    std::mt19937 random(7);
    Image8 image(width, height, 3);
    for (std::uint8_t& value : image.values) value = static_cast<std::uint8_t>(random());
    Observation observation =
        observe(std::move(image), Camera{width, height, 300, 300, width / 2.0, height / 2.0});
    if (!has_weight) return observation;
    observation.weight = Image(width, height, 1, 1.0f);
    for (float& weight : observation.weight.values) weight = static_cast<float>(random() % 3) / 2;
    return observation;
  }

  static std::vector<float> download(const CudaLevelPixels& level, cudaStream_t stream) {
    std::vector<float> values(static_cast<std::size_t>(4) * level.width * level.height);
    NPR_CUDA_CHECK(cudaMemcpyAsync(values.data(), level.pixels, values.size() * sizeof(float),
                                   cudaMemcpyDeviceToHost, stream));
    NPR_CUDA_CHECK(cudaStreamSynchronize(stream));
    return values;
  }

  static void expectSame(const Observation& observation, const FramePart& part) {
    FramePyramid on_cpu;
    on_cpu.make(observation, part);
    CudaFramePyramid on_cuda;
    const CudaStream stream;
    on_cuda.make(observation, part, stream);
    for (int level = part.finest; level <= part.coarsest; ++level) {
      SCOPED_TRACE(level);
      const Image& expected = on_cpu.level(level);
      const CudaLevelPixels actual = on_cuda.level(level);
      ASSERT_EQ(actual.width, expected.width);
      ASSERT_EQ(actual.height, expected.height);
      const std::vector<float> values = download(actual, stream);
      for (std::size_t i = 0; i < values.size(); ++i) {
        ASSERT_NEAR(values[i], expected.values[i], 1e-5) << i;
      }
    }
  }
};

TEST_F(CudaFramePyramidTest, LevelsAreThoseOfTheCpu) {
  for (const bool has_weight : {false, true}) {
    SCOPED_TRACE(has_weight);
    const Observation observation = noise(1283, 1045, has_weight);
    expectSame(observation, {{0, 0, 1283, 1045}, 0, 3});
    expectSame(observation, {{0, 0, 1283, 1045}, 0, 9});  // more than a block halves
    expectSame(observation, {{64, 128, 1219, 917}, 2, 6});
    expectSame(observation, {{32, 32, 96, 64}, 4, 5});
    expectSame(observation, {{8, 16, 7, 11}, 0, 0});
  }
}

TEST_F(CudaFramePyramidTest, SoAreThoseOfFloats) {
  Observation observation = noise(203, 151, false);
  observation.image = Image(203, 151, 3, 0.25f);
  observation.image.at(100, 75, 1) = 1;
  observation.pixels = nullptr;
  expectSame(observation, {{0, 0, 203, 151}, 0, 5});
}

}  // namespace
}  // namespace nerf_pose_refiner
