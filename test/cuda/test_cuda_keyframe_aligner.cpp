// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <limits>
#include <stdexcept>
#include <thread>

#include "backend/backend.h"
#include "backend/gpu_memory.h"
#include "backend/keyframe_aligner.h"
#include "cuda_test.h"
#include "image/colour.h"
#include "support/keyframe_scene.h"

// Alignment of keyframes on the GPU against the CPU's, of the same keyframes with the same images.

namespace nerf_pose_refiner {
namespace {

class CudaKeyframeAligner : public CudaTest, protected KeyframeScene {
 protected:
  using Keyframe = std::shared_ptr<const KeyframePoints>;

  Keyframe keyframe(const Pose& T_O_C, const KeyframeSettings& settings = {}) const {
    return std::make_shared<const KeyframePoints>(keyframeAt(T_O_C, settings));
  }

  static std::vector<Hypothesis> align(Backend* backend, const Observation& observation,
                                       const Keyframe& keyframe, const std::vector<Pose>& from,
                                       const KeyframeAlignmentSettings& settings = {}) {
    const auto aligner = backend->makeKeyframeAligner();
    aligner->observe(observation, frameWindowFor(*keyframe, kCamera, from.front()));
    const int number = aligner->add(keyframe);
    std::vector<KeyframeStart> starts;
    for (const Pose& pose : from) starts.push_back({number, pose});
    return aligner->align(starts, settings, {});
  }

  // As of an object without any texture: nothing but its outline is chosen.
  Keyframe onlyOutline(const Pose& T_O_C) const {
    KeyframePoints points = keyframeAt(T_O_C);
    for (KeyframeLevel& level : points.levels) {
      level.chosen = {};
      level.point_count = 0;
      level.weight.clear();
      for (auto& colour : level.colour) colour.clear();
      level.local = {};
      level.surface.clear();
      level.tiles = {0};
    }
    return std::make_shared<const KeyframePoints>(points);
  }

  // Along and about each axis, both ways.
  std::vector<Pose> startsAround(double deg) const {
    std::vector<Pose> starts;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {-1, 1}) {
        starts.push_back(offBy(truth_, sign * Eigen::Vector3d::Unit(axis), deg));
      }
    }
    return starts;
  }

  // One look at the poses, with no step.
  static KeyframeAlignmentSettings onlyLooking(int finest_level) {
    KeyframeAlignmentSettings settings;
    settings.finest_level = settings.coarsest_level = finest_level;
    settings.max_evaluations = 1;
    return settings;
  }

  void expectSameSums(const Observation& observation, const Keyframe& keyframe,
                      const std::vector<Pose>& poses) {
    for (int level = 0; level < static_cast<int>(keyframe->levels.size()); ++level) {
      const auto a = align(cpu.get(), observation, keyframe, poses, onlyLooking(level));
      const auto b = align(cuda.get(), observation, keyframe, poses, onlyLooking(level));
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t i = 0; i < a.size(); ++i) {
        SCOPED_TRACE(testing::Message() << "level " << level << ", pose " << i);
        expectSame(a[i], b[i]);
      }
    }
  }

  // Sums are rounded in another order. A point at the image's edge or at a depth jump may fall to
  // the other side of it: one of some thousand.
  static void expectSame(const Hypothesis& a, const Hypothesis& b) {
    constexpr double kPoint = 2e-3;
    EXPECT_EQ(a.state, b.state);
    EXPECT_EQ(a.iterations, b.iterations);
    EXPECT_EQ(a.T_O_C.R, b.T_O_C.R);
    EXPECT_EQ(a.T_O_C.t, b.T_O_C.t);
    if (std::isinf(a.loss)) {
      EXPECT_EQ(a.loss, b.loss);
    } else {
      EXPECT_NEAR(a.loss, b.loss, kPoint * a.loss);
    }
    EXPECT_NEAR(a.score, b.score, kPoint);
    EXPECT_NEAR(a.visible_fraction, b.visible_fraction, kPoint);
    EXPECT_NEAR(a.residual_variance, b.residual_variance, kPoint * a.residual_variance);
    EXPECT_LE((a.information - b.information).norm(), kPoint * a.information.norm());
    EXPECT_LE((a.gradient_scatter - b.gradient_scatter).norm(),
              5 * kPoint * a.gradient_scatter.norm());
  }

  // Both ends are within the convergence of each other.
  void expectSameEnds(const Observation& observation, const Keyframe& keyframe,
                      const std::vector<Pose>& from,
                      const KeyframeAlignmentSettings& settings = {}) {
    const auto a = align(cpu.get(), observation, keyframe, from, settings);
    const auto b = align(cuda.get(), observation, keyframe, from, settings);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      SCOPED_TRACE(testing::Message() << "start " << i);
      EXPECT_EQ(a[i].state, b[i].state);
      EXPECT_LT(rotationDistance(a[i].T_O_C.R, b[i].T_O_C.R) / kDegree, 0.02);
      EXPECT_LT((a[i].T_O_C.t - b[i].T_O_C.t).norm() / object().diameter, 1e-3);
      EXPECT_NEAR(a[i].score, b[i].score, 0.01);
      EXPECT_NEAR(a[i].visible_fraction, b[i].visible_fraction, 0.01);
    }
  }

  static void expectSameBits(const Hypothesis& a, const Hypothesis& b) {
    EXPECT_EQ(a.T_O_C.R, b.T_O_C.R);
    EXPECT_EQ(a.T_O_C.t, b.T_O_C.t);
    EXPECT_EQ(a.loss, b.loss);
    EXPECT_EQ(a.score, b.score);
    EXPECT_EQ(a.information, b.information);
    EXPECT_EQ(a.gradient_scatter, b.gradient_scatter);
    EXPECT_EQ(a.iterations, b.iterations);
  }
};

TEST_F(CudaKeyframeAligner, SumsAsTheCpu) {
  std::vector<Pose> poses = startsAround(4);
  poses.push_back(truth_);
  expectSameSums(observed(imageOf(truth_)), keyframe(truth_), poses);
}

TEST_F(CudaKeyframeAligner, SumsAsTheCpuInOtherLight) {
  const Image lit = imageInLight(truth_, {0.7f, -0.5f, 0.4f});
  expectSameSums(observed(lit), keyframe(truth_), startsAround(4));
}

TEST_F(CudaKeyframeAligner, SumsAsTheCpuWhatIsCovered) {
  expectSameSums(withoutCovered(covered(imageOf(truth_))), keyframe(truth_), startsAround(4));
}

TEST_F(CudaKeyframeAligner, SumsAsTheCpuWhatHidesItself) {
  expectSameSums(observed(imageOf(truth_)), keyframe(offBy(truth_, {0.7, 0.7, 0}, 20)),
                 startsAround(4));
}

TEST_F(CudaKeyframeAligner, SumsAsTheCpuWhatLeavesTheImage) {
  const Pose beside(truth_.R, truth_.t + truth_.R * Eigen::Vector3d(0.85, 0, 0));
  expectSameSums(observed(imageOf(beside)), keyframe(beside), {beside, truth_});
}

TEST_F(CudaKeyframeAligner, SumsAsTheCpuWithWideNeighbourhoods) {
  KeyframeSettings settings;
  settings.finest_window_px = 60;
  settings.coarsest_window_px = 25;  // wider than a row of the grid
  settings.max_shown = 1000000;
  expectSameSums(observed(imageOf(truth_)), keyframe(truth_, settings), startsAround(4));
}

TEST_F(CudaKeyframeAligner, SumsAsTheCpuOutlinesAlone) {
  const Keyframe outline = onlyOutline(truth_);
  ASSERT_GE(outline->levels[0].outline.size(), 24u);  // enough for a pose
  const Image image = imageOf(truth_);
  expectSameSums(observed(image), outline, startsAround(1));
  expectSameSums(withoutCovered(image), outline, startsAround(1));
  EXPECT_GT(align(cuda.get(), observed(image), outline, {truth_}).front().score, 0.1);
}

TEST_F(CudaKeyframeAligner, SumsAsTheCpuOfBytes) {
  Observation observation = observe(toBytes(imageOf(truth_)), kCamera);
  expectSameSums(observation, keyframe(truth_), startsAround(4));
  observation.weight = withoutCovered(imageOf(truth_)).weight;
  expectSameSums(observation, keyframe(truth_), startsAround(4));
}

TEST_F(CudaKeyframeAligner, EndsWhereTheCpuEnds) {
  expectSameEnds(observed(imageOf(truth_)), keyframe(offBy(truth_, {0.6, 0.5, -0.6}, 6)),
                 startsAround(5));
}

TEST_F(CudaKeyframeAligner, EndsWhereTheCpuEndsInOtherLight) {
  expectSameEnds(observed(imageOf(truth_, {0.7f, 0.9f, 1.1f}, -0.05f)),
                 keyframe(offBy(truth_, {0.6, 0.5, -0.6}, 6)), startsAround(4));
}

TEST_F(CudaKeyframeAligner, EndsWhereTheCpuEndsBehindAnOccluder) {
  const Image image = covered(imageOf(truth_));
  expectSameEnds(observed(image), keyframe(truth_), startsAround(4));
  expectSameEnds(withoutCovered(image), keyframe(truth_), startsAround(4));
}

TEST_F(CudaKeyframeAligner, EndsWhereTheCpuEndsNearAndFar) {
  for (const double distance : {0.8, 2.0}) {
    SCOPED_TRACE(distance);
    const Pose other(truth_.R, object().centre + distance * (truth_.t - object().centre));
    expectSameEnds(observed(imageOf(truth_)), keyframe(other), startsAround(3));
  }
}

TEST_F(CudaKeyframeAligner, EndsWhereTheCpuEndsAtCoarseLevels) {
  KeyframeAlignmentSettings settings;
  settings.finest_level = 1;
  expectSameEnds(observed(imageOf(truth_)), keyframe(truth_), startsAround(5), settings);
}

TEST_F(CudaKeyframeAligner, SaysWhatCannotBeFound) {
  const Pose outside(truth_.R, truth_.t + truth_.R * Eigen::Vector3d(5, 0, 0));
  const Pose behind(truth_.R, truth_.t + truth_.R * Eigen::Vector3d(0, 0, 6));
  const auto found =
      align(cuda.get(), observed(imageOf(truth_)), keyframe(truth_), {truth_, outside, behind});
  EXPECT_EQ(found[0].state, HypothesisState::kLive);
  EXPECT_EQ(found[1].state, HypothesisState::kOutOfImage);
  EXPECT_EQ(found[2].state, HypothesisState::kBehindCamera);
}

TEST_F(CudaKeyframeAligner, NoLevelToCompareIsOutOfTheImage) {
  const auto aligner = cuda->makeKeyframeAligner();
  const int number = aligner->add(keyframe(truth_));
  aligner->observe(observed(imageOf(truth_)), {{0, 0, 320, 240}, 5, 1});
  const Hypothesis found = aligner->align({{number, truth_}}, {}, {}).front();
  EXPECT_EQ(found.state, HypothesisState::kOutOfImage);
  EXPECT_EQ(found.iterations, 0);
}

// However many blocks share a start.
TEST_F(CudaKeyframeAligner, ManyStartsAreAsOneByOne) {
  const auto aligner = cuda->makeKeyframeAligner();
  aligner->observe(observed(imageOf(truth_)), frameWindowFor(keyframeAt(truth_), kCamera, truth_));
  const int a = aligner->add(keyframe(truth_));
  const int b = aligner->add(keyframe(offBy(truth_, {0.6, 0.5, -0.6}, 6)));
  for (const int count : {20, 40, 300}) {
    SCOPED_TRACE(count);
    std::vector<KeyframeStart> starts;
    for (int i = 0; i < count; ++i) {
      starts.push_back({i % 2 ? a : b, offBy(truth_, Eigen::Vector3d::Unit(i % 3), i % 9 - 4)});
    }
    const std::vector<Hypothesis> together = aligner->align(starts, {}, {});
    ASSERT_EQ(together.size(), starts.size());
    for (int i = 0; i < count; i += 7) {
      expectSameBits(aligner->align({starts[i]}, {}, {}).front(), together[i]);
    }
  }
}

TEST_F(CudaKeyframeAligner, TheSameBitsEveryTimeAndBesideAnother) {
  const Observation observation = observed(imageOf(truth_));
  const Keyframe shown = keyframe(truth_);
  const std::vector<Pose> starts = startsAround(4);
  const auto once = align(cuda.get(), observation, shown, starts);
  std::vector<Hypothesis> beside[2];
  std::thread other([&] { beside[0] = align(cuda.get(), observation, shown, starts); });
  beside[1] = align(cuda.get(), observation, shown, starts);
  other.join();
  for (const auto& again : beside) {
    ASSERT_EQ(again.size(), once.size());
    for (std::size_t i = 0; i < once.size(); ++i) expectSameBits(once[i], again[i]);
  }
}

// Each looks at a window of its own, which may lie in what another has made of the image.
TEST_F(CudaKeyframeAligner, TheSameBitsBesideOthersThatLookAtTheSameImages) {
  constexpr int kImages = 20, kAligners = 4;
  const Keyframe shown = keyframe(truth_);
  const std::vector<Pose> starts = startsAround(4);
  std::vector<Observation> images;
  for (int i = 0; i < kImages; ++i) {
    images.push_back(observe(toBytes(imageOf(offBy(truth_, {0.3, 0.1, 0}, 0.2 * i))), kCamera));
  }
  const auto findIn = [&](KeyframeAligner* aligner, int number, const Observation& image, int i) {
    const double margin = 0.1 + 0.1 * i;
    aligner->observe(image, frameWindowFor(*shown, kCamera, truth_, margin));
    return aligner->align({{number, starts.at(i)}}, {}, {}).front();
  };
  std::vector<Hypothesis> alone[kAligners], beside[kAligners];
  for (int i = 0; i < kAligners; ++i) {
    for (const Observation& image : images) {
      const auto aligner = cuda->makeKeyframeAligner();
      alone[i].push_back(findIn(aligner.get(), aligner->add(shown), image, i));
    }
  }
  std::vector<std::thread> threads;
  for (int i = 0; i < kAligners; ++i) {
    threads.emplace_back([&, i] {
      const auto aligner = cuda->makeKeyframeAligner();
      const int number = aligner->add(shown);
      for (const Observation& image : images) {
        beside[i].push_back(findIn(aligner.get(), number, image, i));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (int i = 0; i < kAligners; ++i) {
    ASSERT_EQ(beside[i].size(), alone[i].size());
    for (int k = 0; k < kImages; ++k) expectSameBits(alone[i][k], beside[i][k]);
  }
}

TEST_F(CudaKeyframeAligner, TakesImagesOfAllSizesOneAfterTheOther) {
  const auto aligner = cuda->makeKeyframeAligner();
  const Keyframe shown = keyframe(truth_);
  const int number = aligner->add(shown);
  const FrameWindow window = frameWindowFor(*shown, kCamera, truth_);
  const Pose start = startsAround(3).front();
  aligner->observe(observed(imageOf(truth_)), window);
  const Hypothesis before = aligner->align({{number, start}}, {}, {}).front();
  aligner->observe(withoutCovered(imageOf(truth_)), {{0, 0, 320, 240}, 0, 4});
  aligner->observe(observed(covered(imageOf(truth_))), {{150, 110, 8, 8}, 0, 4});
  aligner->align({{number, start}}, {}, {});
  aligner->observe(observed(imageOf(truth_)), window);
  expectSameBits(before, aligner->align({{number, start}}, {}, {}).front());
}

TEST_F(CudaKeyframeAligner, KeyframesComeAndGo) {
  const auto aligner = cuda->makeKeyframeAligner();
  aligner->observe(observed(imageOf(truth_)), frameWindowFor(keyframeAt(truth_), kCamera, truth_));
  const Keyframe shown = keyframe(truth_), other = keyframe(offBy(truth_, {0, 1, 0}, 8));
  const Pose start = startsAround(3).front();
  int number = aligner->add(shown);
  const Hypothesis before = aligner->align({{number, start}}, {}, {}).front();
  const int stays = aligner->add(other);
  const Hypothesis other_before = aligner->align({{stays, start}}, {}, {}).front();
  for (int i = 0; i < 20; ++i) {
    const int renewed = aligner->add(i % 2 ? shown : other);
    aligner->remove(number);
    number = renewed;
  }
  EXPECT_THROW(aligner->align({{number + 1, start}}, {}, {}), std::out_of_range);
  aligner->remove(number + 1);  // there is none
  expectSameBits(before, aligner->align({{number, start}}, {}, {}).front());
  expectSameBits(other_before, aligner->align({{stays, start}}, {}, {}).front());
}

// What another thread announces while this one aligns.
TEST_F(CudaKeyframeAligner, AnExpectedKeyframeIsAsAnyOther) {
  const auto aligner = cuda->makeKeyframeAligner();
  aligner->observe(observed(imageOf(truth_)), frameWindowFor(keyframeAt(truth_), kCamera, truth_));
  const Keyframe first = keyframe(truth_), second = keyframe(offBy(truth_, {0, 1, 0}, 8));
  const Pose start = startsAround(3).front();
  const int number = aligner->add(first);
  const Hypothesis before = aligner->align({{number, start}}, {}, {}).front();
  const int directly = aligner->add(second);
  const Hypothesis other = aligner->align({{directly, start}}, {}, {}).front();
  for (int i = 0; i < 20; ++i) {
    std::thread announcing([&] {
      aligner->expect(first);  // and something else comes
      aligner->expect(second);
    });
    expectSameBits(before, aligner->align({{number, start}}, {}, {}).front());
    announcing.join();
    const int expected = aligner->add(second);
    expectSameBits(other, aligner->align({{expected, start}}, {}, {}).front());
    aligner->remove(expected);
  }
}

TEST_F(CudaKeyframeAligner, GivesItsMemoryBack) {
  constexpr std::size_t kOfOthers = 16u << 20;  // what CUDA keeps for itself
  const Keyframe shown = keyframe(truth_);
  const auto used = [] { return gpuMemory(0)->used_bytes; };
  { cuda->makeKeyframeAligner()->add(shown); }
  const std::size_t before = used();
  {
    const auto aligner = cuda->makeKeyframeAligner();
    std::vector<int> numbers;
    for (int i = 0; i < 100; ++i) numbers.push_back(aligner->add(shown));
    EXPECT_GT(used(), before + kOfOthers);
    for (const int number : numbers) aligner->remove(number);
    EXPECT_LT(used(), before + kOfOthers);
  }
  EXPECT_LT(used(), before + kOfOthers);
}

TEST_F(CudaKeyframeAligner, CanBeCancelled) {
  const auto aligner = cuda->makeKeyframeAligner();
  const Keyframe shown = keyframe(truth_);
  aligner->observe(observed(imageOf(truth_)), frameWindowFor(*shown, kCamera, truth_));
  const int number = aligner->add(shown);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(aligner->align({{number, truth_}}, {}, cancellation), Cancelled);
}

TEST_F(CudaKeyframeAligner, RefusesWhatMakesNoSense) {
  Observation tiny;
  tiny.camera = {8, 8, 10, 10, 3.5, 3.5};
  tiny.image = Image(8, 8, 3);
  const auto aligner = cuda->makeKeyframeAligner();
  EXPECT_THROW(aligner->observe(tiny, {{0, 0, 8, 8}, 0, 4}), std::invalid_argument);
  EXPECT_TRUE(aligner->align({}, {}, {}).empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
