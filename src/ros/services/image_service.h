// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/Header.h>
#include <tf2/buffer_core.h>

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "field/field.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/observation.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/depth_input.h"
#include "ros/conversions/node_handles.h"
#include "ros/conversions/parameters.h"
#include "ros/conversions/status.h"
#include "ros/conversions/tf_bridge.h"

namespace nerf_pose_refiner {

/// The model of an object by its name; without a name, of the tracked one.
/// @throws ModelError, InputError.
using FindObject = std::function<std::shared_ptr<const Field>(const std::string& name)>;

/// A call of a service that answers about one image.
struct ImageCall {
  ros::Time called;
  PoseRefinerParameters parameters;     ///< as they were then
  std::shared_ptr<const Field> object;  ///< that the call names
  CancellationToken cancellation;       ///< when its time is up, or the service closes
};

/// The image of a call.
struct ImageOfCall {
  ImageStamp at;
  Observation observation;
  Pose T_W_C;               ///< the camera in the frame of the answer [m]
  std_msgs::Header header;  ///< of the answer: the image's stamp, ~output_frame
};

/// What services have in common that answer about one image, beside the tracking and without a
/// trace in it. Calls are answered one after the other, on a queue of their own.
class ImageService {
 public:
  /// @param transforms filled by another thread; outlives this object.
  ImageService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
               FindObject find_object, tf2::BufferCore& transforms);
  /// Cancels the call in progress.
  ~ImageService();

  /// Begins to answer, in a thread of its own.
  /// @param answer fills in the response. What it throws makes the response a failure: InputError,
  /// ModelError, Cancelled, any other exception (REASON_INTERNAL).
  template <typename Request, typename Response>
  void serve(const std::string& name,
             std::function<void(const Request&, const ImageCall&, Response*)> answer) {
    ros::NodeHandle nh(nodes_.pnh);
    nh.setCallbackQueue(&queue_);
    server_ = nh.advertiseService<Request, Response>(
        name, [this, name, answer = std::move(answer)](Request& request, Response& response) {
          const Outcome outcome =
              carryOut(request.timeout_s, request.object,
                       [&](const ImageCall& call) { answer(request, call, &response); });
          if (outcome.failure) {
            response.reason = toMessage(outcome.failure->reason());
            response.message = outcome.failure->what();
          }
          if (!response.success) {
            response.message += outcome.after;
            warn(name, response.message);
          }
          return true;  // false would lose the message on its way
        });
    spinner_.start();
  }

  /// Takes over changed parameters, from the next call on. By any thread.
  void change(const PoseRefinerParameters& parameters);

  /// The image of a request, or if that has no data, the first one on the topic that is not older
  /// than the call, with its depth if depth is used; with the request's mask. Listens to the camera
  /// for as long as it takes, whether or not the tracking does.
  /// @throws InputError if the cancellation comes before an image, or for what cannot be used.
  template <typename Request>
  ImageOfCall imageOf(const Request& request, const ImageCall& call) {
    return imageOf(request.image, request.camera_info, request.mask, call);
  }

  const TfBridge& transforms() const { return tf_; }

 private:
  /// How a call ended.
  struct Outcome {
    std::optional<InputError> failure;
    std::string after;  ///< " after 3 s" if its time was up; else empty
  };

  Outcome carryOut(double timeout_s, const std::string& object,
                   const std::function<void(const ImageCall&)>& work);
  std::shared_ptr<const DepthImage> depthOf(const Companion& depth, const ImageStamp& at,
                                            const ImageCall& call) const;
  void warn(const std::string& service, const std::string& message) const;
  ImageOfCall imageOf(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info,
                      const sensor_msgs::Image& mask, const ImageCall& call);

  NodeHandles nodes_;
  std::mutex mutex_;  ///< guards parameters_
  PoseRefinerParameters parameters_;
  FindObject find_object_;
  CameraInput input_;
  TfBridge tf_;
  CancellationToken closing_;
  ros::CallbackQueue queue_;
  ros::ServiceServer server_;
  ros::AsyncSpinner spinner_;
};

}  // namespace nerf_pose_refiner
