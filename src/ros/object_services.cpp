// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/object_services.h"

#include <ros/console.h>

#include <chrono>
#include <cstdio>

#include "nerf_pose_refiner/ros/input_error.h"
#include "nerf_pose_refiner/ros/topics.h"

namespace nerf_pose_refiner {
namespace {

std::string describe(const FieldMetadata& object) {
  char text[200];
  std::snprintf(text, sizeof text, "'%s' is in use: diameter %.3f m, PSNR %.1f dB",
                object.name.c_str(), object.diameter * object.metres_per_unit, object.psnr_db);
  return text;
}

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

}  // namespace

ObjectServices::ObjectServices(const ros::NodeHandle& pnh, const PoseRefinerParameters& parameters,
                               EngineFactory make_engine, ObjectTracker* tracker)
    : tracker_(tracker),
      store_(parameters.model_root),
      registration_(parameters.dataset_root, parameters.registration, store_,
                    std::move(make_engine)),
      spinner_(2, &queue_) {
  ros::NodeHandle nh(pnh);
  nh.setCallbackQueue(&queue_);
  load_server_ = nh.advertiseService(topics::kLoadObject, &ObjectServices::load, this);
  register_server_ =
      nh.advertiseService(topics::kRegisterObject, &ObjectServices::registerObject, this);
  if (!parameters.object.empty()) {
    tracker_->modelIsLoading();
    first_ = std::async(std::launch::async, [this, name = parameters.object] { loadFirst(name); });
  }
  spinner_.start();
}

ObjectServices::~ObjectServices() {
  stop_.requestStop();
  load_server_.shutdown();
  register_server_.shutdown();
  spinner_.stop();
  if (first_.valid()) first_.wait();
}

void ObjectServices::use(const std::shared_ptr<const Field>& field) {
  tracker_->offerModel(field).get();
  ROS_INFO("%s", describe(field->metadata).c_str());
}

void ObjectServices::loadFirst(const std::string& name) {
  try {
    use(store_.load(name));
  } catch (const InputError& e) {
    ROS_ERROR("%s", e.what());
    tracker_->modelFailed(e.reason(), e.what());
  } catch (const std::exception& e) {
    ROS_ERROR("loading '%s': %s", name.c_str(), e.what());
    tracker_->modelFailed(RefinementStatus::REASON_INTERNAL, e.what());
  }
}

bool ObjectServices::load(LoadObject::Request& request, LoadObject::Response& response) {
  try {
    const std::shared_ptr<const Field> field = store_.load(request.name);
    use(field);
    response.success = true;
    response.message = describe(field->metadata);
  } catch (const std::exception& e) {
    ROS_ERROR("~load_object: %s", e.what());
    response.message = e.what();
  }
  return true;  // false would lose the message on its way
}

bool ObjectServices::registerObject(RegisterObject::Request& request,
                                    RegisterObject::Response& response) {
  const auto start = std::chrono::steady_clock::now();
  try {
    const std::unique_lock<std::mutex> alone(registering_, std::try_to_lock);
    if (!alone) throw std::runtime_error("another registration is running");
    const RegisteredObject registered =
        registration_.run(request, ProgressLog(request.name), stop_);
    use(registered.field);
    response.success = true;
    response.loaded_existing = registered.loaded_existing;
    response.psnr_db = static_cast<float>(registered.field->metadata.psnr_db);
    response.message = describe(registered.field->metadata) +
                       (registered.loaded_existing ? " (loaded, not trained again)" : "");
  } catch (const std::exception& e) {
    ROS_ERROR("~register_object: %s", e.what());
    response.message = e.what();
  }
  const std::chrono::duration<float> seconds = std::chrono::steady_clock::now() - start;
  response.seconds = seconds.count();
  return true;
}

}  // namespace nerf_pose_refiner
