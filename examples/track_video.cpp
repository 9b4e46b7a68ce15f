// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Tracks an object through a video file or the images of a webcam, and draws it.
//
//   track_video kiosk.safetensors VIDEO FX FY CX CY  X Y Z QX QY QZ QW  [OUTPUT.avi]
//
// VIDEO is a file, or the number of a webcam. The pose is roughly where the object is at the
// beginning, in the camera's optical frame [m]. Without OUTPUT a window shows the overlay; any key
// ends it.
#include <nerf_pose_refiner/backend.h>
#include <nerf_pose_refiner/object.h>
#include <nerf_pose_refiner/observation.h>
#include <nerf_pose_refiner/overlay.h>
#include <nerf_pose_refiner/tracker.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <opencv2/highgui.hpp>
#include <opencv2/videoio.hpp>
#include <string>

#include "numbers.h"
#include "opencv_images.h"

using namespace nerf_pose_refiner;

bool isWebcam(const std::string& name) {
  return name.find_first_not_of("0123456789") == std::string::npos;
}

cv::VideoCapture openVideo(const std::string& name) {
  cv::VideoCapture video;
  if (!(isWebcam(name) ? video.open(std::atoi(name.c_str())) : video.open(name))) {
    throw std::runtime_error("cannot open the video " + name);
  }
  return video;
}

/// Time of the image that was read last [ns]. (Not every webcam gives one.)
std::int64_t stampOf(const cv::VideoCapture& video, bool is_live) {
  using namespace std::chrono;
  if (is_live) return duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count();
  return static_cast<std::int64_t>(1e6 * video.get(cv::CAP_PROP_POS_MSEC));
}

int main(int argc, char** argv) try {
  if (argc != 14 && argc != 15) {
    std::fprintf(stderr, "Usage: %s MODEL VIDEO FX FY CX CY X Y Z QX QY QZ QW [OUTPUT]\n", argv[0]);
    return 2;
  }
  double number[11];
  for (int i = 0; i < 11; ++i) number[i] = numberOf(argv[3 + i]);
  Camera camera;
  camera.fx = number[0];
  camera.fy = number[1];
  camera.cx = number[2];
  camera.cy = number[3];
  const Pose T_C_O = poseOf(number + 4);

  const std::shared_ptr<Backend> backend = makeBackend("auto");
  const Object object = loadObject(argv[1]);
  TrackerOptions options;
  options.real_time = isWebcam(argv[2]);
  Tracker tracker(backend, object, options);
  tracker.setInitialPose(T_C_O);
  Overlay overlay(backend, object);
  cv::VideoCapture video = openVideo(argv[2]);
  cv::VideoWriter writer;
  cv::Mat frame;
  for (int i = 0; video.read(frame); ++i) {
    const Observation observation = observeMat(frame, camera);
    const TrackResult result = tracker.track(observation, stampOf(video, options.real_time));
    std::printf("%4d %s", i, toString(result.state));
    if (result.trusted) {
      std::printf(": %.4f %.4f %.4f, score %.2f", result.T_C_O.t.x(), result.T_C_O.t.y(),
                  result.T_C_O.t.z(), result.score);
      frame = bgrImage(overlay.draw(observation, result.T_C_O));
    }
    std::printf("\n");
    if (argc == 14) {
      cv::imshow("track_video", frame);
      if (cv::waitKey(1) >= 0) break;
      continue;
    }
    const int codec = cv::VideoWriter::fourcc('M', 'J', 'P', 'G');
    if (!writer.isOpened() && !writer.open(argv[14], codec, 10, frame.size())) {
      throw std::runtime_error(std::string("cannot write ") + argv[14]);
    }
    writer.write(frame);
  }
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
