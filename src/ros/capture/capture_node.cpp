// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/capture/capture_node.h"

#include <actionlib/client/simple_action_client.h>
#include <image_transport/camera_common.h>
#include <nerf_pose_refiner/RegisterAction.h>
#include <nerf_pose_refiner/RegisterObject.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <thread>

#include "concurrency/error_of.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kTick_s = 0.05;  // how soon an image is used once its TF is there
constexpr int kQueue = 30;        // messages whose partners have not come yet

CaptureParameters readParameters(const ros::NodeHandle& pnh) {
  ParamReader reader = ParamReader::ofNode(pnh);
  const CaptureParameters parameters = CaptureParameters::read(&reader);
  std::string text;
  for (const std::string& line : reader.log()) text += "\n  " + line;
  ROS_INFO("parameters:%s", text.c_str());
  for (const std::string& line : reader.unknown()) ROS_WARN("%s", line.c_str());
  return parameters;
}

using RegisterClient = actionlib::SimpleActionClient<RegisterAction>;

std::string inWords(const RegisterFeedback& feedback) {
  std::string text = "registering: " + feedback.stage;
  if (feedback.steps > 0) {
    text += ", step " + std::to_string(feedback.step) + " of " + std::to_string(feedback.steps) +
            ", " + std::to_string(std::lround(feedback.seconds_left)) + " s left";
  }
  return text;
}

/// Waits by the wall clock: a simulated one may stand.
bool isThere(const RegisterClient& client) {
  constexpr std::chrono::seconds kPatience(2);
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!client.isServerConnected()) {
    if (!ros::ok() || std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

/// By the action beside the service, which tells of its progress, or by the service if there is
/// none.
/// @return why the object was not registered; empty: it was.
std::string callRegistration(const std::string& service, const RegisterGoal& goal,
                             const std::function<void(const std::string&)>& on_progress) {
  if (!ros::service::exists(service, false)) return "there is no service " + service;
  RegisterClient client(
      ros::names::append(ros::names::parentNamespace(service), topics::kRegister));
  if (isThere(client)) {
    client.sendGoal(
        goal, RegisterClient::SimpleDoneCallback(), RegisterClient::SimpleActiveCallback(),
        [&](const RegisterFeedbackConstPtr& feedback) { on_progress(inWords(*feedback)); });
    if (!client.waitForResult()) return "the registration was interrupted";
    const RegisterResultConstPtr result = client.getResult();
    if (result->success) return "";
    return result->message.empty() ? client.getState().toString() : result->message;
  }
  RegisterObject::Request request;
  request.name = goal.name;
  request.dataset = goal.dataset;
  request.metres_per_unit = goal.metres_per_unit;
  request.box_min = goal.box_min;
  request.box_max = goal.box_max;
  RegisterObject::Response response;
  if (!ros::service::call(service, request, response)) return "the call of " + service + " failed";
  return response.success ? "" : response.message;
}

}  // namespace

CaptureNode::CaptureNode(ros::NodeHandle nh, ros::NodeHandle pnh)
    : parameters_(readParameters(pnh)),
      nh_(nh),
      transform_input_(transforms_, nh),
      capture_(parameters_, transforms_),
      status_(pnh.advertise<CaptureStatus>("status", 1, true)),
      transport_(nh) {
  report(CaptureStatus::STATE_IDLE, "call ~start");
  start_server_ = pnh.advertiseService("start", &CaptureNode::onStart, this);
  finish_server_ = pnh.advertiseService("finish", &CaptureNode::onFinish, this);
  abort_server_ = pnh.advertiseService("abort", &CaptureNode::onAbort, this);
  timer_ = nh_.createWallTimer(ros::WallDuration(kTick_s),
                               [this](const ros::WallTimerEvent&) { onTimer(); });
  subscribe(&nh);
}

void CaptureNode::subscribe(ros::NodeHandle* nh) {
  const image_transport::TransportHints hints(parameters_.image_transport);
  infos_.registerCallback(&CaptureNode::onCameraInfo, this);
  if (parameters_.use_masks) {
    triples_ = std::make_unique<message_filters::TimeSynchronizer<Image, CameraInfo, Image>>(
        images_, infos_, masks_, kQueue);
    triples_->registerCallback(&CaptureNode::onImage, this);
    masks_.subscribe(transport_, "mask", kQueue);
  } else {
    pairs_ = std::make_unique<message_filters::TimeSynchronizer<Image, CameraInfo>>(images_, infos_,
                                                                                    kQueue);
    pairs_->registerCallback(&CaptureNode::onPair, this);
  }
  images_.subscribe(transport_, "image", kQueue, hints);
  infos_.subscribe(*nh, image_transport::getCameraInfoTopic(nh->resolveName("image")), kQueue);
}

void CaptureNode::report(std::uint8_t state, const std::string& message) {
  CaptureStatus status = capture_.status();
  status.header.stamp = ros::Time::now();
  status.state = state;
  if (!message.empty()) status.message = message;
  const bool news = status.state != reported_.state || status.views != reported_.views ||
                    status.message != reported_.message;
  if (news && state == CaptureStatus::STATE_FAILED) {
    ROS_ERROR("%s", status.message.c_str());
  } else if (news) {
    ROS_INFO("%u views of %u images, directions covered: %.0f %%. %s", status.views, status.images,
             100 * status.coverage, status.message.c_str());
  }
  reported_ = status;
  status_.publish(status);
}

void CaptureNode::onImage(const sensor_msgs::ImageConstPtr& image,
                          const sensor_msgs::CameraInfoConstPtr& info,
                          const sensor_msgs::ImageConstPtr& mask) {
  capture_.add({image, info, mask});
}

void CaptureNode::onTimer() {
  // Whatever goes wrong (a full disk, say): what was captured stays, for ~finish or ~abort.
  const auto error = errorOf([this] {
    watchCapture();
    watchRegistration();
  });
  if (!error) return;
  finish_failed_ = true;
  report(capture_.capturing() ? CaptureStatus::STATE_CAPTURING : CaptureStatus::STATE_FAILED,
         capture_.capturing() ? *error + "; the views are kept: call ~finish again" : *error);
}

void CaptureNode::watchCapture() {
  if (!capture_.capturing()) return;
  const CaptureStatus before = capture_.status();
  const bool complete = capture_.process(ros::Time::now());
  const CaptureStatus now = capture_.status();
  if (complete && !finish_failed_) {
    finish();
  } else if (now.views != before.views || now.message != before.message) {
    report(CaptureStatus::STATE_CAPTURING, "");
  }
}

void CaptureNode::watchRegistration() {
  if (!registration_.valid()) return;
  if (registration_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    std::string progress;
    {
      std::lock_guard<std::mutex> lock(progress_mutex_);
      progress.swap(progress_);
    }
    if (!progress.empty()) report(CaptureStatus::STATE_REGISTERING, progress);
    return;
  }
  const std::string problem = registration_.get();
  report(problem.empty() ? CaptureStatus::STATE_DONE : CaptureStatus::STATE_FAILED,
         problem.empty() ? "registered" : "written, but not registered: " + problem);
}

void CaptureNode::finish() {
  capture_.finish();
  const std::string written = "the dataset is written as '" + capture_.status().dataset + "'";
  if (parameters_.register_service.empty()) {
    report(CaptureStatus::STATE_DONE, written);
  } else {
    learnField();
    report(CaptureStatus::STATE_REGISTERING, written + ", and registered now");
  }
}

/// In a thread of its own, for it takes as long as the training.
void CaptureNode::learnField() {
  RegisterGoal request;
  request.name = parameters_.name;
  request.dataset = capture_.status().dataset;
  request.metres_per_unit = 1;
  if (parameters_.has_box) {
    request.box_min = toPoint(parameters_.box_min);
    request.box_max = toPoint(parameters_.box_max);
  }
  registration_ = std::async(std::launch::async, [this, request] {
    return callRegistration(ros::names::resolve(parameters_.register_service), request,
                            [this](const std::string& progress) {
                              std::lock_guard<std::mutex> lock(progress_mutex_);
                              progress_ = progress;
                            });
  });
}

bool CaptureNode::onStart(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const auto error = errorOf([this] {
    if (registration_.valid()) throw std::runtime_error("the last dataset is being registered");
    if (!info_) throw std::runtime_error("no camera_info came on " + infos_.getTopic());
    capture_.start(*info_);
    finish_failed_ = false;
    report(CaptureStatus::STATE_CAPTURING, "");
  });
  response.success = !error;
  response.message = error.value_or("move the camera around the object, then call ~finish");
  if (error) ROS_ERROR("~start: %s", error->c_str());
  return true;  // false would lose the message on its way
}

bool CaptureNode::onFinish(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const auto error = errorOf([this] {
    if (capture_.capturing()) capture_.process(ros::Time::now());
    finish();
  });
  response.success = !error;
  response.message = error.value_or(reported_.message);
  if (error) ROS_ERROR("~finish: %s", error->c_str());
  return true;
}

bool CaptureNode::onAbort(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  response.success = capture_.capturing();
  response.message = response.success ? "what was captured is removed" : "nothing is captured";
  if (response.success) {
    capture_.abort();
    report(CaptureStatus::STATE_IDLE, response.message);
  }
  return true;
}

}  // namespace nerf_pose_refiner
