// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/overlay_publisher.h"

#include <ros/console.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "backend/backend_lost.h"
#include "backend/common/draw_overlay.h"
#include "backend/common/observed_colours.h"
#include "image/resample.h"
#include "ros/conversions/camera_input.h"

namespace nerf_pose_refiner {

OverlayPublisher::OverlayPublisher(std::vector<image_transport::CameraPublisher> publishers,
                                   BackendFactory make_backend, const OverlaySettings& settings)
    : publishers_(std::move(publishers)),
      make_backend_(std::move(make_backend)),
      settings_(settings),
      thread_([this] { run(); }) {}

OverlayPublisher::~OverlayPublisher() {
  cancellation_.requestCancel();
  jobs_.wake();
  thread_.join();
}

void OverlayPublisher::change(const OverlaySettings& settings) {
  std::lock_guard<std::mutex> lock(settings_mutex_);
  settings_ = settings;
}

bool OverlayPublisher::wanted() const {
  return std::any_of(publishers_.begin(), publishers_.end(),
                     [](const auto& publisher) { return publisher.getNumSubscribers() > 0; });
}

void OverlayPublisher::draw(Job job) {
  const auto nobodyLooks = [this](std::size_t camera) {
    return publishers_.at(camera).getNumSubscribers() == 0;
  };
  const auto isInVain = [&](View& view) {
    std::vector<std::size_t>& cameras = view.cameras;
    cameras.erase(std::remove_if(cameras.begin(), cameras.end(), nobodyLooks), cameras.end());
    return cameras.empty();
  };
  job.views.erase(std::remove_if(job.views.begin(), job.views.end(), isInVain), job.views.end());
  if (!job.views.empty()) jobs_.put(std::move(job));
}

void OverlayPublisher::run() {
  while (!cancellation_.cancelRequested()) {
    const std::optional<Job> job = jobs_.take(std::chrono::seconds(1));
    if (!job) {
      loaded_.reset();  // so that a model that is no longer tracked can go
      field_.reset();
      continue;
    }
    try {
      drawNow(*job);
    } catch (const BackendLost& e) {
      ROS_ERROR("overlay: %s", e.what());
      loaded_.reset();
      field_.reset();
      backend_.reset();  // the next image is drawn with another one
    } catch (const std::exception& e) {
      logThrottled(e);
    }
  }
}

void OverlayPublisher::logThrottled(const std::exception& error) {
  if (cancellation_.cancelRequested() || !errors_.passes()) return;
  ROS_ERROR("overlay: %s", error.what());
}

void OverlayPublisher::drawNow(const Job& job) {
  if (!backend_) backend_ = make_backend_();
  if (field_ != job.field) {
    loaded_ = backend_->load(job.field);
    field_ = job.field;
  }
  OverlaySettings settings;
  {
    std::lock_guard<std::mutex> lock(settings_mutex_);
    settings = settings_;
  }
  for (const View& view : job.views) {
    try {
      drawNow(view, settings);
    } catch (const BackendLost&) {
      throw;  // the other views cannot be drawn either
    } catch (const std::exception& e) {
      logThrottled(e);
    }
  }
}

void OverlayPublisher::drawNow(const View& view, const OverlaySettings& settings) {
  const Camera& full = view.observation->camera;
  const double shrink = static_cast<double>(settings.width_px) / full.width;
  const Camera camera = full.scaled(std::min(1.0, shrink));
  const Rendering rendering = loaded_->render({camera, view.T_O_C}, RenderOptions(), cancellation_);
  const Image seen = resample(overlayGround(*view.observation), full, camera);
  const Image8 overlay = drawOverlay(seen, rendering, settings.opacity);

  sensor_msgs::Image image;
  image.header = view.header;
  image.width = static_cast<std::uint32_t>(overlay.width);
  image.height = static_cast<std::uint32_t>(overlay.height);
  image.encoding = sensor_msgs::image_encodings::RGB8;
  image.step = 3 * image.width;
  image.data = overlay.values;
  sensor_msgs::CameraInfo info = toMessage(camera);
  info.header = view.header;
  for (const std::size_t number : view.cameras) publishers_.at(number).publish(image, info);
}

}  // namespace nerf_pose_refiner
