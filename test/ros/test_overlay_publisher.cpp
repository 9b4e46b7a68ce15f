// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Overlays of several cameras, of which some have no subscriber.
#include "ros/nodelet/overlay_publisher.h"

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "field/object_metadata.h"
#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

class OverlayPublisherTest : public PoseRefinerTest {
 protected:
  static image_transport::CameraPublisher advertise(const std::string& camera) {
    return image_transport::ImageTransport(world->nh).advertiseCamera(camera + "/image_raw", 1);
  }

  static OverlayPublisher::View viewOf(std::vector<std::size_t> cameras, double stamp_s) {
    OverlayPublisher::View view;
    view.header.frame_id = kFrame;
    view.header.stamp = ros::Time(stamp_s);
    view.observation = std::make_shared<const Observation>(
        observeScene(*world->scene, squareCamera(96), world->T_O_C));
    view.T_O_C = world->T_O_C;
    view.cameras = std::move(cameras);
    return view;
  }

  /// A view whose image does not have its camera's size.
  static OverlayPublisher::View broken(std::size_t camera, double stamp_s) {
    OverlayPublisher::View view = viewOf({camera}, stamp_s);
    Observation observation = *view.observation;
    observation.camera = squareCamera(95);
    view.observation = std::make_shared<const Observation>(observation);
    return view;
  }

  /// A view of which nothing may be looked at.
  static OverlayPublisher::View nothing(std::size_t camera, double stamp_s) {
    OverlayPublisher::View view = viewOf({camera}, stamp_s);
    view.observation = nullptr;
    return view;
  }

  std::atomic<int> backends_{0};
  std::shared_ptr<const Field> field_ =
      std::make_shared<const Field>(loadField(world->root + "/models/toy.safetensors"));
  OverlayPublisher publisher_{{advertise("overlays/first"), advertise("overlays/second")}, [this] {
                                ++backends_;
                                return std::shared_ptr<Backend>(makeCpuBackend(1));
                              }};
};

TEST_F(OverlayPublisherTest, DrawsForThoseWhoLookAlone) {
  EXPECT_FALSE(publisher_.wanted());
  publisher_.draw({field_, {nothing(0, 1), nothing(1, 1)}});
  EXPECT_EQ(backends_, 0);
  Listener<sensor_msgs::Image> second(world->nh, "overlays/second/image_raw");
  ASSERT_TRUE(waitUntil([&] { return publisher_.wanted(); }));
  publisher_.draw({field_, {nothing(0, 2), viewOf({1}, 2)}});
  const auto image = second.wait();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->header.stamp, ros::Time(2));
  EXPECT_EQ(image->width, 96u);
  EXPECT_EQ(backends_, 1);
  EXPECT_THROW(publisher_.draw({field_, {viewOf({2}, 3)}}), std::out_of_range);
}

/// With a subscriber for each of two cameras.
class TwoOverlays : public OverlayPublisherTest {
 protected:
  /// Sends what a function makes for a stamp, until `isDone`: so that both subscriptions are known
  /// to the publishers. @return false: in vain.
  bool drawUntil(const std::function<bool()>& isDone,
                 const std::function<std::vector<OverlayPublisher::View>(double)>& viewsAt) {
    if (!waitUntil([&] { return first_.connected() && second_.connected(); })) return false;
    double stamp_s = 0;
    return waitUntil([&] {
      stamp_s += 1;
      publisher_.draw({field_, viewsAt(stamp_s)});
      return isDone();
    });
  }

  Listener<sensor_msgs::Image> first_{world->nh, "overlays/first/image_raw"};
  Listener<sensor_msgs::Image> second_{world->nh, "overlays/second/image_raw"};
};

TEST_F(TwoOverlays, DrawsEachCameraByItself) {
  ASSERT_TRUE(drawUntil([&] { return first_.last() && second_.last(); },
                        [](double stamp_s) -> std::vector<OverlayPublisher::View> {
                          return {viewOf({0}, stamp_s), viewOf({1}, stamp_s + 0.5)};
                        }));
  EXPECT_EQ(first_.last()->header.stamp.nsec, 0u);
  EXPECT_EQ(second_.last()->header.stamp.nsec, 500000000u);
}

TEST_F(TwoOverlays, AViewThatCannotBeDrawnDoesNotKeepOthersFromIt) {
  ASSERT_TRUE(drawUntil([&] { return second_.last().has_value(); },
                        [](double stamp_s) -> std::vector<OverlayPublisher::View> {
                          return {broken(0, stamp_s), viewOf({1}, stamp_s)};
                        }));
  EXPECT_FALSE(first_.last());
}

TEST_F(TwoOverlays, OneViewGoesToSeveralPublishers) {
  ASSERT_TRUE(drawUntil([&] { return first_.last() && second_.last(); },
                        [](double stamp_s) -> std::vector<OverlayPublisher::View> {
                          return {viewOf({1, 0}, stamp_s)};
                        }));
  EXPECT_EQ(first_.last()->width, 96u);
  EXPECT_EQ(first_.last()->data, second_.last()->data);
}

}  // namespace
}  // namespace nerf_pose_refiner
