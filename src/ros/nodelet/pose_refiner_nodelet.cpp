// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/pose_refiner_nodelet.h"

#include <pluginlib/class_list_macros.hpp>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/gpu_memory.h"
#include "backend/make_backend.h"
#include "concurrency/error_of.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/topics.h"
#include "runtime/detection_files.h"
#include "runtime/heap_memory.h"
#include "views/object_inside.h"

namespace nerf_pose_refiner {

void PoseRefinerNodelet::onInit() {
  try {
    start();
  } catch (const std::exception& e) {
    NODELET_FATAL("%s", e.what());  // the nodelet loader does not log the message
    throw;
  }
}

void PoseRefinerNodelet::start() {
  readParameters();
  ros::NodeHandle& pnh = getPrivateNodeHandle();
  process_ = RefinerProcess::ofThisProcess();
  process_->models.setBudget(std::size_t{1000000} * parameters_.model_memory_mb, getName());
  transforms_ = std::make_unique<tf2_ros::Buffer>(ros::Duration(parameters_.frames.tf_cache_s));
  transform_input_ =
      std::make_unique<TransformInput>(*transforms_, getNodeHandle(), &frame_conflict_);
  diagnostics_ = std::make_unique<Diagnostics>(nodeHandles(), getName(), parameters_.diagnostics);
  diagnostics_->showMemory([this] { return memoryFacts(); });
  advertiseResults();
  startTracking();
  startImageServices();
  reset_server_ = pnh.advertiseService(topics::kReset, &PoseRefinerNodelet::onReset, this);
  enable_server_ = pnh.advertiseService(topics::kEnable, &PoseRefinerNodelet::onEnable, this);
  initial_pose_ = pnh.subscribe<geometry_msgs::PoseStamped>(
      topics::kInitialPose, 5, &PoseRefinerNodelet::onInitialPose<geometry_msgs::PoseStamped>,
      this);
  initial_pose_with_covariance_ = pnh.subscribe<geometry_msgs::PoseWithCovarianceStamped>(
      topics::kInitialPoseWithCovariance, 5,
      &PoseRefinerNodelet::onInitialPose<geometry_msgs::PoseWithCovarianceStamped>, this);
  // Advertising takes a call to the master for each service, for which loading should not wait.
  advertised_ = std::async(std::launch::async, [this] {
    const std::optional<std::string> error = errorOf([this] {
      startObjectServices();
      startReconfiguration();
    });
    if (!error) return;
    NODELET_FATAL("no services: %s", error->c_str());
    worker_->tracker().modelFailed(TrackReason::kInternal, "no services: " + *error);
  });
}

void PoseRefinerNodelet::readParameters() {
  ParamReader reader = ParamReader::ofNode(getPrivateNodeHandle());
  parameters_ = nerf_pose_refiner::readParameters(reader);
  std::string text;
  for (const std::string& line : reader.log()) text += "\n  " + line;
  NODELET_INFO("parameters:%s", text.c_str());
  for (const std::string& line : reader.unknown()) NODELET_WARN("%s", line.c_str());
  if (parameters_.detections.use && !parameters_.usesBoxes()) {
    NODELET_WARN("~detections/use does nothing while ~start is initial_pose");
  }
}

void PoseRefinerNodelet::advertiseResults() {
  ros::NodeHandle& pnh = getPrivateNodeHandle();
  camera_ = std::make_unique<CameraSubscription>(nodeHandles(), parameters_.image_transport,
                                                 diagnostics_.get());
  const auto on_connect = [this](const ros::SingleSubscriberPublisher&) { camera_->update(); };
  const auto on_connect_image = [this](const image_transport::SingleSubscriberPublisher&) {
    camera_->update();
  };
  results_ =
      std::make_unique<ResultPublisher>(pnh, parameters_.frames, on_connect, &frame_conflict_);
  const auto make_overlay_backend = [set = parameters_.instruction_set] {
    return std::shared_ptr<Backend>(makeCpuBackend(1, set));
  };
  std::vector<image_transport::CameraPublisher> overlays;
  const auto advertiseOverlay = [&](const std::string& topic) {
    overlays.push_back(image_transport::ImageTransport(pnh).advertiseCamera(
        topic, 1, on_connect_image, on_connect_image, on_connect, on_connect));
  };
  advertiseOverlay(topics::kOverlay);
  for (const std::string& camera : parameters_.cameras.names()) {
    advertiseOverlay(topics::overlayOf(camera));
  }
  overlay_ = std::make_unique<OverlayPublisher>(std::move(overlays), make_overlay_backend,
                                                parameters_.overlay);
}

void PoseRefinerNodelet::startTracking() {
  const TrackerSettings& tracker = parameters_.tracker;
  const auto find_processor = [this, find_shared = sharedProcessor()] {
    SearchProcessor processor = find_shared();
    const BackendInfo info = processor.backend->info();
    diagnostics_->backendIs(info.description);
    const bool was_on_gpu = on_gpu_;
    on_gpu_ = info.memory_bytes > 0;
    if (was_on_gpu && !on_gpu_) {
      ROS_ERROR("The GPU failed: %s. Tracking goes on with %s",
                whyNoCuda(parameters_.device).c_str(), info.description.c_str());
    }
    return processor;
  };
  worker_ = std::make_unique<TrackingWorker>(
      parameters_,
      std::make_unique<RefinerSearch>(find_processor, tracker.initial.refiner,
                                      tracker.tracking.refiner, detectionSetup()),
      transforms_.get(),
      TrackingWorker::Outputs{results_.get(), overlay_.get(), diagnostics_.get()});
  CameraSubscription::Receiver receiver;
  receiver.wanted = [this] { return results_->wanted() || overlay_->wanted(); };
  receiver.image = [this](const auto& image, const auto& info) { worker_->addImage(image, info); };
  if (parameters_.depth.use) {
    receiver.depth = [this](const auto& image, const auto& info) {
      worker_->addDepth({image, info});
    };
    receiver.depth_transport = parameters_.depth.image_transport;
  }
  receiver.side_topics = parameters_.cameras.names();
  receiver.side_view = [this](std::size_t camera, const auto& image, const auto& info) {
    worker_->addSideView(camera, {image, info});
  };
  if (tracker.mask_mode != MaskMode::kNone) {
    receiver.mask = [this](const auto& mask) { worker_->addMask(mask); };
  }
  receiver.unpaired = [this](const std::string& why) {
    if (unpaired_.passes()) NODELET_ERROR("%s", why.c_str());
    worker_->tracker().imageRefused(TrackReason::kBadCameraInfo, why);
    worker_->wake();
  };
  receiver.ignore_mask = [this](const auto& mask) { worker_->addIgnoreMask(mask); };
  if (parameters_.usesBoxes()) {
    receiver.detections = [this](const auto& detections) { worker_->addDetections(detections); };
  }
  images_ = std::make_unique<CameraSubscription::Connection>(camera_.get(), std::move(receiver));
  tracked_ = std::make_unique<TrackedObject>(
      &worker_->tracker(), [](const std::string& text) { ROS_INFO("%s", text.c_str()); },
      [this](const std::shared_ptr<const Field>& field) { prepareDetection(field); });
}

void PoseRefinerNodelet::startImageServices() {
  if (const auto cameras = parameters_.cameras.names(); !cameras.empty()) {
    calibration_ = std::make_unique<CalibrationService>(
        getPrivateNodeHandle(), cameras,
        [this](std::size_t camera, const CalibrationSettings& settings, Pose* stated) {
          return worker_->calibrate(camera, settings, stated);
        });
  }
  const auto make_search = [find_shared = sharedProcessor()](const TrackerSettings& settings) {
    return std::make_unique<RefinerSearch>(find_shared, settings.initial.refiner,
                                           settings.tracking.refiner);
  };
  const auto find_object = [this](const std::string& name) {
    if (!name.empty()) return store().load(name);
    if (std::shared_ptr<const Field> tracked = tracked_->field()) return tracked;
    throw InputError(TrackReason::kModelUnreadable, "no object is tracked: name one");
  };
  poses_ = std::make_unique<PoseService>(nodeHandles(), parameters_, find_object, make_search,
                                         *transforms_);
  detections_ = std::make_unique<DetectionService>(nodeHandles(), parameters_, find_object,
                                                   detection(), *transforms_);
}

void PoseRefinerNodelet::startObjectServices() {
  const PoseRefinerParameters& p = parameters_;
  // A training uses its backend for a long time, so it gets one of its own.
  const auto make_backend = [choice = p.backendChoice()] {
    return std::shared_ptr<Backend>(makeBackend(choice));
  };
  const auto find_schedule = [process = process_, choice = p.backendChoice()] {
    return process->backends.scheduleOf(choice);
  };
  objects_ =
      std::make_unique<ObjectServices>(getPrivateNodeHandle(), store(), tracked_.get(), p.object);
  ObjectRegistration registration({p.dataset_root, p.dataset_limits}, p.registration, store(),
                                  make_backend, find_schedule);
  if (p.tracker.rules.start != TrackStart::kInitialPose) registration.makeDetectionFilesToo();
  registrations_ = std::make_unique<RegistrationServices>(getPrivateNodeHandle(), registration,
                                                          &process_->registrations, tracked_.get());
}

void PoseRefinerNodelet::startReconfiguration() {
  reconfiguration_ = std::make_unique<Reconfiguration>(
      getPrivateNodeHandle(), parameters_, [this](const PoseRefinerParameters& changed) {
        worker_->tracker().change(changed.tracker);
        poses_->change(changed);
        detections_->change(changed);
        overlay_->change(changed.overlay);
      });
}

ProcessorFactory PoseRefinerNodelet::sharedProcessor() const {
  return [process = process_, choice = parameters_.backendChoice()] {
    return process->backends.searchProcessor(choice);
  };
}

DetectionService::Detect PoseRefinerNodelet::detection() const {
  return [process = process_, find_shared = sharedProcessor()](
             const std::shared_ptr<const Field>& field, DetectorOptions options,
             const Observation& observation, const CancellationToken& cancellation) {
    options.landmarks_path = landmarkPathOf(process->models, field);
    Detector detector(find_shared().backend, ObjectInside::make(field), options, cancellation);
    return detector.detect(observation, {}, cancellation);
  };
}

DetectionSetup PoseRefinerNodelet::detectionSetup() const {
  DetectionSetup setup;
  setup.landmarks_path = [process = process_](const std::shared_ptr<const Field>& field) {
    return landmarkPathOf(process->models, field);
  };
  setup.is_expected = parameters_.tracker.rules.start != TrackStart::kInitialPose;
  return setup;
}

/// Before an object is tracked, if tracking begins with detection. If this fails, tracking makes
/// what the files would hold.
void PoseRefinerNodelet::prepareDetection(const std::shared_ptr<const Field>& field) const {
  if (parameters_.tracker.rules.start == TrackStart::kInitialPose) return;
  const std::optional<std::string> error = errorOf([&] {
    const std::shared_ptr<Backend> backend = sharedProcessor()().backend;
    makeDetectionFiles(backend.get(), process_->models, field, closing_);
  });
  if (error) NODELET_WARN("no landmarks yet: %s", error->c_str());
}

ObjectStore PoseRefinerNodelet::store() const {
  return ObjectStore(parameters_.model_root, &process_->models);
}

/// Does not query a GPU that is not in use, which would wake it up.
Diagnostics::Facts PoseRefinerNodelet::memoryFacts() const {
  Diagnostics::Facts facts;
  if (const auto bytes = allocatedMemory()) {
    facts.emplace_back("allocated memory of the process [MiB]", std::to_string(*bytes >> 20));
  }
  const auto gpu = on_gpu_ ? gpuMemory(parameters_.device) : std::nullopt;
  if (gpu) {
    facts.emplace_back("GPU memory [MiB]", std::to_string(gpu->used_bytes >> 20) + " of " +
                                               std::to_string(gpu->total_bytes >> 20));
  }
  for (const CachedModel& model : process_->models.list()) {
    facts.emplace_back("model " + model.metadata.name,
                       std::to_string(model.bytes >> 20) + " MiB" +
                           (model.in_use ? ", in use" : "") +
                           (model.outdated ? ", the file is another one by now" : "") +
                           (model.metadata_error.empty() ? "" : ", " + model.metadata_error));
  }
  return facts;
}

template <typename PoseMessage>
void PoseRefinerNodelet::onInitialPose(const boost::shared_ptr<const PoseMessage>& message) {
  diagnostics_->guard("initial pose", [&] {
    ObjectTracker& tracker = worker_->tracker();
    tracker.readClock();
    try {
      tracker.offer(initialPoseFrom(*message));
    } catch (const InputError& e) {
      NODELET_ERROR("initial pose refused: %s", e.what());
      tracker.refuseInitialPose(e.reason(), e.what());
    }
    worker_->wake();
  });
}

bool PoseRefinerNodelet::onReset(std_srvs::Trigger::Request&,
                                 std_srvs::Trigger::Response& response) {
  diagnostics_->guard(topics::kReset, [&] {
    worker_->tracker().reset();
    worker_->wake();
    response.success = true;
    response.message = "waiting for an initial pose";
  });
  return true;
}

bool PoseRefinerNodelet::onEnable(std_srvs::SetBool::Request& request,
                                  std_srvs::SetBool::Response& response) {
  diagnostics_->guard(topics::kEnable, [&] {
    worker_->tracker().setEnabled(request.data);
    worker_->wake();
    camera_->setEnabled(request.data);
    response.success = true;
    response.message = request.data ? "enabled: waiting for an initial pose" : "disabled";
  });
  return true;
}

}  // namespace nerf_pose_refiner

PLUGINLIB_EXPORT_CLASS(nerf_pose_refiner::PoseRefinerNodelet, nodelet::Nodelet)
