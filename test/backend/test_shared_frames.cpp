// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/shared_frames.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>

#include "backend/cpu/frame_pyramid.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kWidth = 200, kHeight = 150;

/// Images of noise, and windows in them.
class SharedFramesOfNoise : public testing::Test {
 protected:
  static Observation observation(unsigned seed) {
    std::mt19937 random(seed);
    Image8 image(kWidth, kHeight, 3);
    for (std::uint8_t& value : image.values) value = static_cast<std::uint8_t>(random());
    return observe(std::move(image), Camera{kWidth, kHeight, 200, 200, 99.5, 74.5});
  }

  static FrameLevels levels(const Observation& observation, const PixelWindow& window,
                            int finest = 0, int count = 3) {
    return {observation, FrameWindow{window, finest, count}};
  }

  // Tells what is made.
  struct Note {
    FramePart part;
    const Observation* of = nullptr;
  };
  using Frames = SharedFrames<Note>;

  void look(Frames::Reader* reader, const Observation& from, const PixelWindow& window,
            int finest = 0) {
    reader->look(from, levels(from, window, finest), [&](const FramePart& part, Note* note) {
      *note = {part, &from};
      ++made_;
    });
    EXPECT_TRUE(reader->part().holds(levels(from, window, finest)));
    EXPECT_EQ(reader->frame().part.window.x, reader->part().window.x);
  }

  std::shared_ptr<Frames> frames_ = std::make_shared<Frames>(0);
  Frames::Reader first_{frames_}, second_{frames_};
  int made_ = 0;
};

TEST_F(SharedFramesOfNoise, WhatIsSeenDoesNotDependOnThePart) {
  std::mt19937 random(5);
  const auto upTo = [&random](int n) { return static_cast<int>(random() % n); };
  Observation noise = observation(1);
  for (const bool has_weight : {false, true}) {
    if (has_weight) {
      noise.weight = Image(kWidth, kHeight, 1, 1.0f);
      for (float& weight : noise.weight.values) weight = static_cast<float>(upTo(3)) / 2;
    }
    FramePyramid whole;
    whole.make(noise, {{0, 0, kWidth, kHeight}, 0, 5});
    FramePyramid pyramid;  // whose memory is used again
    for (int trial = 0; trial < 50; ++trial) {
      const FrameLevels some =
          levels(noise, {upTo(kWidth - 1), upTo(kHeight - 1), 1 + upTo(99), 1 + upTo(99)}, upTo(4),
                 1 + upTo(2));
      const FramePart part = partFor(some);
      ASSERT_TRUE(part.holds(some));
      pyramid.make(noise, part);
      for (int level = some.finest(); some.has(level); ++level) {
        const PixelWindow own = part.pixelsOf(some, level);
        ASSERT_EQ(own.width, some.window().width >> level);
        for (int y = 0; y < own.height; ++y) {
          for (int i = 0; i < 4 * own.width; ++i) {
            ASSERT_EQ(pyramid.level(level).pixel(own.x, own.y + y)[i],
                      whole.level(level).pixel(some.window().x >> level,
                                               (some.window().y >> level) + y)[i]);
          }
        }
      }
    }
  }
}

TEST_F(SharedFramesOfNoise, EachPartOfAnImageIsMadeOnce) {
  const Observation noise = observation(1);
  look(&first_, noise, {40, 40, 60, 60});
  look(&second_, noise, {50, 50, 40, 40});
  EXPECT_EQ(made_, 1);
  EXPECT_EQ(&first_.frame(), &second_.frame());
  look(&second_, noise, {50, 50, 40, 40}, 1);  // coarser levels than those that are there
  EXPECT_EQ(made_, 2);
  look(&second_, noise, {0, 0, 40, 40});
  EXPECT_EQ(made_, 3);
}

TEST_F(SharedFramesOfNoise, AnotherImageIsMadeAnew) {
  const Observation a = observation(1), b = observation(1);
  look(&first_, a, {40, 40, 60, 60});
  look(&second_, b, {40, 40, 60, 60});
  EXPECT_EQ(made_, 2);
  EXPECT_EQ(second_.frame().of, &b);
}

TEST_F(SharedFramesOfNoise, MakesWhatOthersWillLookAtWhereThatSavesWork) {
  const Observation before = observation(1), now = observation(2);
  const PixelWindow left = {30, 40, 60, 60}, right = {60, 40, 60, 60};
  look(&first_, before, left);
  look(&second_, before, right);
  EXPECT_EQ(made_, 2);
  look(&first_, now, left);
  look(&second_, now, {61, 41, 60, 60});  // it has moved a little
  EXPECT_EQ(made_, 3);
}

TEST_F(SharedFramesOfNoise, LeavesWhatIsFarAwayToOthers) {
  const Observation before = observation(1), now = observation(2);
  const PixelWindow corner = {0, 0, 20, 20}, opposite = {170, 120, 20, 20};
  look(&first_, before, corner);
  look(&second_, before, opposite);
  look(&first_, now, corner);
  EXPECT_LT(makingWork(first_.part()), 0.1 * 2 * kWidth * kHeight);
  look(&second_, now, opposite);
  EXPECT_EQ(made_, 4);
  // Beginning alone costs as much as a whole image: then it is better made at once.
  const auto slow_to_begin = std::make_shared<Frames>(2 * kWidth * kHeight);
  Frames::Reader third(slow_to_begin), fourth(slow_to_begin);
  look(&third, before, corner);
  look(&fourth, before, opposite);
  look(&third, now, corner);
  look(&fourth, now, opposite);
  EXPECT_EQ(made_, 7);
}

TEST_F(SharedFramesOfNoise, OtherThreadsMakeWhatTheyLookAt) {
  const Observation before = observation(1), now = observation(2);
  look(&first_, before, {30, 40, 60, 60});
  std::thread([&] { look(&second_, before, {60, 40, 60, 60}); }).join();
  look(&first_, now, {30, 40, 60, 60});
  const FrameLevels own = levels(now, {30, 40, 60, 60});
  EXPECT_EQ(first_.part().window.width, partFor(own).window.width);
  std::thread([&] { look(&second_, now, {35, 45, 40, 40}); }).join();
  EXPECT_EQ(made_, 3);  // what is there is taken
}

TEST_F(SharedFramesOfNoise, AReaderThatIsGoneIsNotExpected) {
  const Observation before = observation(1), now = observation(2);
  look(&first_, before, {30, 40, 60, 60});
  {
    Frames::Reader another(frames_);
    look(&another, before, {60, 40, 60, 60});
  }
  look(&first_, now, {30, 40, 60, 60});
  const FrameLevels own = levels(now, {30, 40, 60, 60});
  EXPECT_EQ(first_.part().window.width, partFor(own).window.width);
}

TEST_F(SharedFramesOfNoise, IgnoredPixelsAndImagesOfFloatsAreNotShared) {
  Observation ignoring = observation(1);
  ignoring.weight = Image(kWidth, kHeight, 1, 1.0f);
  look(&first_, ignoring, {40, 40, 60, 60});
  look(&second_, ignoring, {40, 40, 60, 60});
  EXPECT_EQ(made_, 2);
  Observation floats = observation(1);
  floats.pixels = nullptr;
  floats.image = Image(kWidth, kHeight, 3, 0.5f);
  look(&first_, floats, {40, 40, 60, 60});
  look(&second_, floats, {40, 40, 60, 60});
  EXPECT_EQ(made_, 4);
}

TEST_F(SharedFramesOfNoise, WhatCouldNotBeMadeIsMadeByTheNext) {
  const Observation noise = observation(1);
  const auto fail = [](const FramePart&, Note*) { throw std::runtime_error("no memory"); };
  EXPECT_THROW(first_.look(noise, levels(noise, {40, 40, 60, 60}), fail), std::runtime_error);
  look(&second_, noise, {40, 40, 60, 60});
  look(&first_, noise, {40, 40, 60, 60});
  EXPECT_EQ(made_, 1);
}

/// Threads that go on together.
class Barrier {
 public:
  explicit Barrier(int threads) : threads_(threads) {}
  void wait() {
    std::unique_lock<std::mutex> lock(mutex_);
    const int round = round_;
    if (++waiting_ == threads_) {
      waiting_ = 0;
      ++round_;
      changed_.notify_all();
    }
    changed_.wait(lock, [&] { return round_ != round; });
  }

 private:
  int threads_, waiting_ = 0, round_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
};

TEST_F(SharedFramesOfNoise, ThreadsWaitForWhatAnotherMakes) {
  constexpr int kImages = 200, kThreads = 4;
  std::vector<Observation> images;
  for (unsigned i = 0; i < kImages; ++i) images.push_back(observation(i));
  const auto shared = std::make_shared<SharedFrames<FramePyramid>>(0);
  std::atomic<int> made{0}, wrong{0};
  Barrier barrier(kThreads);
  const auto follow = [&] {
    SharedFrames<FramePyramid>::Reader reader(shared);
    for (const Observation& image : images) {
      const FrameLevels own = levels(image, {30, 30, 80, 80});
      barrier.wait();
      reader.look(image, own, [&](const FramePart& part, FramePyramid* pyramid) {
        ++made;
        pyramid->make(image, part);
      });
      FramePyramid alone;
      alone.make(image, partFor(own));
      wrong += reader.frame().level(0).values != alone.level(0).values;
      barrier.wait();  // what was made stays as long as somebody has it
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) threads.emplace_back(follow);
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(made, kImages);
}

TEST_F(SharedFramesOfNoise, WhoLooksAtTheSameObjectIsNotExpected) {
  const Observation before = observation(1), now = observation(2);
  look(&first_, before, {40, 40, 60, 60});
  look(&second_, before, {44, 40, 60, 60});  // reaches a little beyond
  look(&first_, now, {40, 40, 60, 60});
  const FrameLevels own = levels(now, {40, 40, 60, 60});
  EXPECT_EQ(first_.part().window.width, partFor(own).window.width);
}

TEST_F(SharedFramesOfNoise, ImagesOfAnotherSizeAreNotExpected) {
  const Observation before = observation(1);
  const Observation small = observe(Image8(24, 24, 3), Camera{24, 24, 20, 20, 11.5, 11.5});
  look(&first_, before, {30, 40, 60, 60});
  second_.look(before, levels(before, {60, 40, 60, 60}, 2, 4), [&](const auto&, Note*) {});
  look(&first_, small, {4, 4, 12, 12});
  EXPECT_LE(first_.part().coarsest, 2);
}

}  // namespace
}  // namespace nerf_pose_refiner
