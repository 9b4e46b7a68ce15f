// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/registration_services.h"

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kServiceThreads = 4;  // so many callers of ~register_object can wait at once

/// Logs the progress of a registration now and then, by the wall clock: a simulated one may stand.
class ProgressLog {
 public:
  explicit ProgressLog(const std::string& name) : name_(name) {}

  void operator()(const RegistrationProgress& progress) {
    if (progress.seconds < next_s_) return;
    next_s_ = progress.seconds + 2;
    ROS_INFO("registering '%s': %s, step %d of %d, loss %.4f, %.0f s left", name_.c_str(),
             progress.stage.c_str(), progress.step, progress.steps, progress.loss,
             progress.seconds_left);
  }

 private:
  std::string name_;
  double next_s_ = 0;
};

Eigen::Vector3d toEigen(const geometry_msgs::Point& p) { return {p.x, p.y, p.z}; }

/// @param message a request of the service, or a goal of the action.
template <typename Message>
RegistrationRequest toRequest(const Message& message) {
  RegistrationRequest request;
  request.name = message.name;
  request.dataset = message.dataset;
  request.metres_per_unit = message.metres_per_unit;
  request.box_min = toEigen(message.box_min);
  request.box_max = toEigen(message.box_max);
  request.max_seconds = message.max_seconds;
  request.force_retrain = message.force_retrain;
  return request;
}

RegisterResult toResult(const RegisterObject::Response& response) {
  RegisterResult result;
  result.success = response.success;
  result.message = response.message;
  result.psnr_db = response.psnr_db;
  result.seconds = response.seconds;
  result.loaded_existing = response.loaded_existing;
  return result;
}

RegisterFeedback toFeedback(const RegistrationProgress& progress) {
  RegisterFeedback feedback;
  feedback.stage = progress.stage;
  feedback.step = static_cast<std::uint32_t>(progress.step);
  feedback.steps = static_cast<std::uint32_t>(progress.steps);
  feedback.loss = static_cast<float>(progress.loss);
  feedback.psnr_db = static_cast<float>(progress.psnr_db);
  feedback.seconds_left = static_cast<float>(progress.seconds_left);
  return feedback;
}

}  // namespace

RegistrationServices::RegistrationServices(const ros::NodeHandle& pnh,
                                           const ObjectRegistration& registration,
                                           RegistrationQueue* queue, TrackedObject* tracked)
    : registration_(registration),
      queue_(queue),
      tracked_(tracked),
      service_spinner_(kServiceThreads, &service_queue_),
      action_spinner_(1, &action_queue_) {
  ros::NodeHandle service_nh(pnh);
  service_nh.setCallbackQueue(&service_queue_);
  service_ =
      service_nh.advertiseService(topics::kRegisterObject, &RegistrationServices::onService, this);
  ros::NodeHandle action_nh(pnh);
  action_nh.setCallbackQueue(&action_queue_);
  // A second publisher of the topic: the action server does not show its own.
  feedback_ = ros::NodeHandle(action_nh, topics::kRegister)
                  .advertise<RegisterActionFeedback>("feedback", 50);
  action_ = std::make_unique<Server>(
      action_nh, topics::kRegister, [this](Server::GoalHandle handle) { onGoal(handle); },
      [this](Server::GoalHandle handle) { onCancel(handle); }, false);
  action_->start();
  service_spinner_.start();
  action_spinner_.start();
}

RegistrationServices::~RegistrationServices() {
  cancellation_.requestCancel();
  service_.shutdown();
  service_spinner_.stop();
  action_spinner_.stop();  // from here on there are no new goals
  for (const std::unique_ptr<Goal>& goal : goals_) goal->cancellation.requestCancel();
  for (const std::unique_ptr<Goal>& goal : goals_) goal->thread.join();
  goals_.clear();
  action_.reset();
}

/// Registers and tracks. Never throws.
RegisterObject::Response RegistrationServices::answer(const RegistrationRequest& request,
                                                      const RegistrationQueue::Listener& listener,
                                                      const CancellationToken& cancellation) {
  const auto start = std::chrono::steady_clock::now();
  RegisterObject::Response response;
  try {
    const RegisteredObject registered =
        queue_->run(registration_.jobOf(request), listener, cancellation);
    response.loaded_existing = registered.loaded_existing;
    response.psnr_db = static_cast<float>(registered.field->metadata.psnr_db);
    response.message = tracked_->track(registered.field) +
                       (registered.loaded_existing ? " (loaded, not trained again)" : "");
    for (const std::string& note : registered.notes) {
      ROS_INFO("photos of '%s': %s", request.name.c_str(), note.c_str());
      response.message += " " + note;
    }
    response.success = true;
  } catch (const std::exception& e) {
    ROS_ERROR("registering '%s': %s", request.name.c_str(), e.what());
    response.message = e.what();
  }
  const std::chrono::duration<float> seconds = std::chrono::steady_clock::now() - start;
  response.seconds = seconds.count();
  return response;
}

bool RegistrationServices::onService(RegisterObject::Request& request,
                                     RegisterObject::Response& response) {
  RegistrationQueue::Listener listener;
  listener.progress = [log = std::make_shared<ProgressLog>(request.name)](
                          const RegistrationUpdate& update) { (*log)(update.progress); };
  response = answer(toRequest(request), listener, cancellation_);
  return true;  // false would lose the message on its way
}

void RegistrationServices::onGoal(Server::GoalHandle handle) {
  joinThoseDone();
  std::lock_guard<std::mutex> lock(mutex_);
  if (goals_.size() >= kMaxGoals) {
    RegisterResult result;
    result.message = std::to_string(goals_.size()) + " goals wait for their registration already";
    ROS_ERROR("registering '%s': %s", handle.getGoal()->name.c_str(), result.message.c_str());
    handle.setRejected(result, result.message);
    return;
  }
  handle.setAccepted();
  goals_.push_back(std::make_unique<Goal>());
  Goal* goal = goals_.back().get();
  goal->handle = handle;
  goal->thread = std::thread([this, goal] { carryOut(goal); });
}

void RegistrationServices::onCancel(Server::GoalHandle handle) {
  std::lock_guard<std::mutex> lock(mutex_);
  for (const std::unique_ptr<Goal>& goal : goals_) {
    if (goal->handle == handle) goal->cancellation.requestCancel();
  }
}

void RegistrationServices::carryOut(Goal* goal) {
  std::vector<std::uint8_t> sent;
  RegistrationQueue::Listener listener;
  listener.wants_preview = [this] { return feedback_.getNumSubscribers() > 0; };
  listener.progress = [&](const RegistrationUpdate& update) {
    RegisterFeedback feedback = toFeedback(update.progress);
    if (update.preview_jpeg != sent) {
      feedback.preview.header.stamp = ros::Time::now();
      feedback.preview.format = "jpeg";
      feedback.preview.data = sent = update.preview_jpeg;
    }
    goal->handle.publishFeedback(feedback);
  };
  const auto goal_message = goal->handle.getGoal();
  const RegisterResult result =
      toResult(answer(toRequest(*goal_message), listener, goal->cancellation));
  if (result.success) {
    goal->handle.setSucceeded(result, result.message);
  } else if (goal->cancellation.cancelRequested()) {
    goal->handle.setCanceled(result, result.message);
  } else {
    goal->handle.setAborted(result, result.message);
  }
  std::lock_guard<std::mutex> lock(mutex_);
  goal->done = true;
}

/// Clears away goals that have ended. Called by the action's thread.
void RegistrationServices::joinThoseDone() {
  std::list<std::unique_ptr<Goal>> done;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    for (auto goal = goals_.begin(); goal != goals_.end();) {
      const auto next = std::next(goal);
      if ((*goal)->done) done.splice(done.end(), goals_, goal);
      goal = next;
    }
  }
  for (const std::unique_ptr<Goal>& goal : done) goal->thread.join();
}

}  // namespace nerf_pose_refiner
