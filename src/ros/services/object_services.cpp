// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/object_services.h"

#include <ros/console.h>

#include "concurrency/error_of.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kRenewal_s = 0.5;  // between looks at the object's metadata

/// The metadata of an object, from the file beside its model.
void describeFrame(const FieldMetadata& object, ObjectInfo* info) {
  const double unit_m = object.metres_per_unit;
  info->frame_in_model = toMessage(Pose(object.T_O_U.R, unit_m * object.T_O_U.t));
  if (object.box) {
    info->box_min = toPoint(unit_m * object.box->min);
    info->box_max = toPoint(unit_m * object.box->max);
  }
  info->symmetries = describe(object.symmetries);
}

/// Does what a service is asked for. `action` returns the message of a success.
template <typename Response>
bool answer(const char* service, Response* response, const std::function<std::string()>& action) {
  const std::optional<std::string> error = errorOf([&] { response->message = action(); });
  response->success = !error;
  if (error) {
    response->message = *error;
    ROS_ERROR("~%s: %s", service, error->c_str());
  }
  return true;  // false would lose the message on its way
}

}  // namespace

ObjectServices::ObjectServices(const ros::NodeHandle& pnh, const ObjectStore& store,
                               TrackedObject* tracked, const std::string& first_object)
    : store_(store), tracked_(tracked), spinner_(1, &queue_) {
  ros::NodeHandle nh(pnh);
  nh.setCallbackQueue(&queue_);
  servers_ = {nh.advertiseService(topics::kLoadObject, &ObjectServices::load, this),
              nh.advertiseService(topics::kUnloadObject, &ObjectServices::unload, this),
              nh.advertiseService(topics::kListObjects, &ObjectServices::list, this),
              nh.advertiseService(topics::kSetObject, &ObjectServices::set, this)};
  renewal_ = nh.createWallTimer(ros::WallDuration(kRenewal_s),
                                [this](const ros::WallTimerEvent&) { renewTracked(); });
  if (!first_object.empty()) {
    tracked_->isLoading();
    first_ = std::async(std::launch::async, [this, first_object] { loadFirst(first_object); });
  }
  spinner_.start();
}

ObjectServices::~ObjectServices() {
  for (ros::ServiceServer& server : servers_) server.shutdown();
  renewal_.stop();
  spinner_.stop();
  if (first_.valid()) first_.wait();
}

void ObjectServices::renewTracked() {
  const std::shared_ptr<const Field> tracked = tracked_->field();
  if (!tracked) return;
  const std::optional<std::string> error = errorOf([&] {
    if (const auto renewed = store_.renewed(tracked)) tracked_->renew(tracked, renewed);
  });
  if (error) {
    ROS_ERROR("what is said of '%s' stays as it was: %s", tracked->metadata.name.c_str(),
              error->c_str());
  }
}

void ObjectServices::loadFirst(const std::string& name) {
  try {
    tracked_->track(store_.load(name));
  } catch (const ModelError& e) {
    ROS_ERROR("%s", e.what());
    tracked_->failed(reasonOf(e), e.what());
  } catch (const std::exception& e) {
    ROS_ERROR("loading '%s': %s", name.c_str(), e.what());
    tracked_->failed(TrackReason::kInternal, e.what());
  }
}

bool ObjectServices::load(LoadObject::Request& request, LoadObject::Response& response) {
  return answer(topics::kLoadObject, &response, [&] {
    const std::shared_ptr<const Field> field = store_.load(request.name);
    const std::shared_ptr<const Field> tracked = tracked_->field();
    if (!tracked) return tracked_->track(field);
    if (tracked == field) return "in use: " + describe(field->metadata);
    return "in memory: " + describe(field->metadata) + "; tracked is '" + tracked->metadata.name +
           "' as it was, until ~set_object";
  });
}

bool ObjectServices::unload(UnloadObject::Request& request, UnloadObject::Response& response) {
  return answer(topics::kUnloadObject, &response, [&] {
    store_.unload(request.name);
    return "'" + request.name + "' is no longer in memory";
  });
}

bool ObjectServices::list(ListObjects::Request&, ListObjects::Response& response) {
  return answer(topics::kListObjects, &response, [&] {
    const std::shared_ptr<const Field> tracked = tracked_->field();
    for (const StoredObject& object : store_.list()) {
      ObjectInfo info;
      info.name = object.name;
      info.in_memory = object.in_memory;
      info.in_use = object.in_use;
      info.tracked = tracked && object.in_memory && tracked->metadata.name == object.name &&
                     tracked->metadata.data_hash == object.metadata.data_hash;
      info.bytes = object.bytes;
      info.metres_per_unit = object.metadata.metres_per_unit;
      info.diameter_m = object.metadata.diameter * object.metadata.metres_per_unit;
      info.psnr_db = object.metadata.psnr_db;
      info.message = object.message;
      describeFrame(object.metadata, &info);
      response.objects.push_back(info);
    }
    for (const CachedModel& model : store_.cache().list()) response.memory_bytes += model.bytes;
    response.files_read = store_.cache().filesRead();
    return std::to_string(response.objects.size()) + " models below " + store_.root();
  });
}

bool ObjectServices::set(SetObject::Request& request, SetObject::Response& response) {
  return answer(topics::kSetObject, &response,
                [&] { return tracked_->track(store_.load(request.name)); });
}

}  // namespace nerf_pose_refiner
