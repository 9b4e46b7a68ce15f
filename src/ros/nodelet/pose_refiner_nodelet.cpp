// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/pose_refiner_nodelet.h"

#include <pluginlib/class_list_macros.hpp>

#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "backend/gpu_memory.h"
#include "backend/make_backend.h"
#include "concurrency/error_of.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

/// Without an image the worker looks so often for what else there is to do: a model that was
/// loaded, a clock that went on.
constexpr std::chrono::milliseconds kTick(100);

}  // namespace

PoseRefinerNodelet::~PoseRefinerNodelet() {
  {
    std::lock_guard<std::mutex> lock(connect_mutex_);
    enabled_ = false;  // so that nobody subscribes again
    unsubscribe();
  }
  initial_pose_.shutdown();
  initial_pose_with_covariance_.shutdown();
  reset_server_.shutdown();
  enable_server_.shutdown();
  if (advertised_.valid()) advertised_.wait();
  registrations_.reset();  // those who ask for them may wait for the worker
  objects_.reset();        // the same
  stopping_ = true;
  if (tracker_) tracker_->tracker().stop();
  mailbox_.wake();
  if (worker_.joinable()) worker_.join();
  reconfiguration_.reset();
  poses_.reset();  // reconfiguration changed its parameters
}

void PoseRefinerNodelet::onInit() {
  try {
    start();
  } catch (const std::exception& e) {
    NODELET_FATAL("%s", e.what());  // the loader keeps the text to itself
    throw;
  }
}

void PoseRefinerNodelet::readParameters() {
  ParamReader reader = ParamReader::ofNode(getPrivateNodeHandle());
  parameters_ = nerf_pose_refiner::readParameters(reader);
  std::string text;
  for (const std::string& line : reader.log()) text += "\n  " + line;
  NODELET_INFO("parameters:%s", text.c_str());
  for (const std::string& line : reader.unknown()) NODELET_WARN("%s", line.c_str());
}

void PoseRefinerNodelet::start() {
  readParameters();
  ros::NodeHandle& nh = getNodeHandle();
  ros::NodeHandle& pnh = getPrivateNodeHandle();
  const PoseRefinerParameters& p = parameters_;
  process_ = RefinerProcess::ofThisProcess();
  process_->models.setBudget(std::size_t{1000000} * p.model_memory_mb, getName());
  const auto find_processor = [this, find_shared = sharedProcessor()] {
    SearchProcessor processor = find_shared();
    const BackendInfo info = processor.backend->info();
    diagnostics_->backendIs(info.description);
    on_gpu_ = info.memory_bytes > 0;
    return processor;
  };
  const auto make_overlay_backend = [set = p.instruction_set] {
    return std::shared_ptr<Backend>(makeCpuBackend(1, set));
  };

  transforms_ = std::make_unique<tf2_ros::Buffer>(ros::Duration(p.frames.tf_cache_s));
  transform_input_ = std::make_unique<TransformInput>(*transforms_, nh);
  diagnostics_ = std::make_unique<Diagnostics>(nh, pnh, getName(), p.diagnostics);
  diagnostics_->showMemory([this] { return memoryFacts(); });
  {
    // Held while advertising: a listener may be there before the publisher is stored.
    std::lock_guard<std::mutex> lock(connect_mutex_);
    results_ = std::make_unique<ResultPublisher>(
        pnh, p.frames, [this](const ros::SingleSubscriberPublisher&) { onConnect(); });
    const auto on_connect = [this](const image_transport::SingleSubscriberPublisher&) {
      onConnect();
    };
    const auto on_connect_info = [this](const ros::SingleSubscriberPublisher&) { onConnect(); };
    overlay_ = std::make_unique<OverlayPublisher>(
        image_transport::ImageTransport(pnh).advertiseCamera(
            topics::kOverlay, 1, on_connect, on_connect, on_connect_info, on_connect_info),
        make_overlay_backend, p.overlay);
    transport_ = std::make_unique<image_transport::ImageTransport>(nh);
  }
  tracker_ = std::make_unique<MessageTracker>(
      p,
      std::make_unique<RefinerSearch>(find_processor, p.tracker.initial.refiner,
                                      p.tracker.tracking.refiner),
      transforms_.get(), [this](const RefinementStatus& status) { report(status); });
  pairing_ =
      std::make_unique<MaskPairing>(p.tracker.mask_mode, p.mask_timeout_s,
                                    [this](CameraFrame frame) { mailbox_.put(std::move(frame)); });
  const ObjectStore store(p.model_root, &process_->models);
  startPoseService(store);
  worker_ = std::thread([this] { work(); });
  reset_server_ = pnh.advertiseService(topics::kReset, &PoseRefinerNodelet::onReset, this);
  enable_server_ = pnh.advertiseService(topics::kEnable, &PoseRefinerNodelet::onEnable, this);
  initial_pose_ = pnh.subscribe<geometry_msgs::PoseStamped>(
      topics::kInitialPose, 5, &PoseRefinerNodelet::onInitialPose<geometry_msgs::PoseStamped>,
      this);
  initial_pose_with_covariance_ = pnh.subscribe<geometry_msgs::PoseWithCovarianceStamped>(
      topics::kInitialPoseWithCovariance, 5,
      &PoseRefinerNodelet::onInitialPose<geometry_msgs::PoseWithCovarianceStamped>, this);
  enable(true);
  // A call to the master for every topic and service: more of them than the loading should wait
  // for.
  advertised_ = std::async(std::launch::async, [this, store] {
    const std::optional<std::string> error = errorOf([&] {
      startObjectServices(store);
      startReconfiguration();
    });
    if (!error) return;
    NODELET_FATAL("no services: %s", error->c_str());
    tracker_->tracker().modelFailed(TrackReason::kInternal, "no services: " + *error);
  });
}

/// A GPU that is not in use is left asleep.
Diagnostics::Facts PoseRefinerNodelet::memoryFacts() const {
  Diagnostics::Facts facts;
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

ProcessorFactory PoseRefinerNodelet::sharedProcessor() const {
  return [process = process_, choice = parameters_.backendChoice()] {
    return process->backends.searchProcessor(choice);
  };
}

void PoseRefinerNodelet::startPoseService(const ObjectStore& store) {
  const auto make_search = [find_processor = sharedProcessor()](const TrackerSettings& settings) {
    return std::make_unique<RefinerSearch>(find_processor, settings.initial.refiner,
                                           settings.tracking.refiner);
  };
  tracked_ = std::make_unique<TrackedObject>(
      &tracker_->tracker(), [](const std::string& text) { ROS_INFO("%s", text.c_str()); });
  poses_ = std::make_unique<PoseService>(getNodeHandle(), getPrivateNodeHandle(), parameters_,
                                         store, make_search, tracked_.get(), *transforms_);
}

void PoseRefinerNodelet::startObjectServices(const ObjectStore& store) {
  const PoseRefinerParameters& p = parameters_;
  // A training holds its backend for long, so it gets one of its own.
  const auto make_backend = [choice = p.backendChoice()] {
    return std::shared_ptr<Backend>(makeBackend(choice));
  };
  const auto find_schedule = [process = process_, choice = p.backendChoice()] {
    return process->backends.scheduleOf(choice);
  };
  objects_ =
      std::make_unique<ObjectServices>(getPrivateNodeHandle(), store, tracked_.get(), p.object);
  registrations_ = std::make_unique<RegistrationServices>(
      getPrivateNodeHandle(),
      ObjectRegistration(p.dataset_root, p.registration, store, make_backend, find_schedule),
      &process_->registrations, tracked_.get());
}

void PoseRefinerNodelet::startReconfiguration() {
  reconfiguration_ = std::make_unique<Reconfiguration>(
      getPrivateNodeHandle(), parameters_, [this](const PoseRefinerParameters& changed) {
        tracker_->tracker().change(changed.tracker);
        poses_->change(changed);
        overlay_->change(changed.overlay);
      });
}

void PoseRefinerNodelet::enable(bool enabled) {
  {
    std::lock_guard<std::mutex> lock(connect_mutex_);
    enabled_ = enabled;
  }
  onConnect();
}

void PoseRefinerNodelet::guard(const char* name, const std::function<void()>& callback) {
  if (const std::optional<std::string> error = errorOf(callback)) {
    NODELET_ERROR_THROTTLE(5.0, "%s: %s", name, error->c_str());
    diagnostics_->callbackFailed(*error);
  }
}

void PoseRefinerNodelet::onConnect() {
  guard("subscribing to the camera", [this] { subscribeIfWanted(); });
}

void PoseRefinerNodelet::subscribeIfWanted() {
  std::lock_guard<std::mutex> lock(connect_mutex_);
  const bool wanted = enabled_ && (results_->wanted() || overlay_->wanted());
  diagnostics_->expectImages(wanted);
  if (!wanted) {
    unsubscribe();
  } else if (!images_) {
    // A queue, for camera_info comes before an image that is decoded on its way.
    const image_transport::TransportHints hints(parameters_.image_transport, ros::TransportHints(),
                                                getPrivateNodeHandle());
    images_ =
        transport_->subscribeCamera(topics::kImage, 10, &PoseRefinerNodelet::onImage, this, hints);
    if (parameters_.tracker.mask_mode != MaskMode::kNone) {
      masks_ = getNodeHandle().subscribe(topics::kMask, 10, &PoseRefinerNodelet::onMask, this);
    }
    ignore_masks_ =
        getNodeHandle().subscribe(topics::kIgnoreMask, 10, &PoseRefinerNodelet::onIgnoreMask, this);
  }
}

void PoseRefinerNodelet::unsubscribe() {
  images_.shutdown();
  masks_.shutdown();
  ignore_masks_.shutdown();
}

void PoseRefinerNodelet::onImage(const sensor_msgs::ImageConstPtr& image,
                                 const sensor_msgs::CameraInfoConstPtr& info) {
  const ros::WallTime arrival = ros::WallTime::now();
  guard("image", [&] {
    const std::uint32_t clock_jumps = tracker_->tracker().readClock();
    diagnostics_->imageArrived(image->header.stamp);
    if (const auto reason = tracker_->refusal(*image, *info)) {
      NODELET_ERROR_THROTTLE(5.0, "image: %s", reason->c_str());
      mailbox_.wake();  // ~status is to say so
      return;
    }
    pairing_->add({image, info, arrival, clock_jumps}, arrival);
  });
}

void PoseRefinerNodelet::onMask(const sensor_msgs::ImageConstPtr& mask) {
  guard(topics::kMask, [&] { pairing_->addMask(mask, ros::WallTime::now()); });
}

void PoseRefinerNodelet::onIgnoreMask(const sensor_msgs::ImageConstPtr& mask) {
  guard(topics::kIgnoreMask, [&] { pairing_->addIgnoreMask(mask, ros::WallTime::now()); });
}

template <typename PoseMessage>
void PoseRefinerNodelet::onInitialPose(const boost::shared_ptr<const PoseMessage>& message) {
  guard("initial pose", [&] {
    tracker_->tracker().readClock();
    try {
      tracker_->tracker().offer(initialPoseFrom(*message));
    } catch (const InputError& e) {
      NODELET_ERROR("initial pose refused: %s", e.what());
      tracker_->tracker().refuseInitialPose(e.reason(), e.what());
    }
    mailbox_.wake();
  });
}

bool PoseRefinerNodelet::onReset(std_srvs::Trigger::Request&,
                                 std_srvs::Trigger::Response& response) {
  guard(topics::kReset, [&] {
    tracker_->tracker().reset();
    mailbox_.wake();
    response.success = true;
    response.message = "waiting for an initial pose";
  });
  return true;
}

bool PoseRefinerNodelet::onEnable(std_srvs::SetBool::Request& request,
                                  std_srvs::SetBool::Response& response) {
  guard(topics::kEnable, [&] {
    tracker_->tracker().setEnabled(request.data);
    mailbox_.wake();
    enable(request.data);
    response.success = true;
    response.message = request.data ? "enabled: waiting for an initial pose" : "disabled";
  });
  return true;
}

void PoseRefinerNodelet::work() {
  while (!stopping_) guard("refinement", [this] { workOnce(); });
}

void PoseRefinerNodelet::workOnce() {
  tracker_->tracker().applyModels();
  const std::optional<CameraFrame> frame = mailbox_.take(kTick);
  pairing_->tick(ros::WallTime::now());
  tracker_->tracker().readClock();
  if (!frame) {
    tracker_->tracker().reportChange({"", toNanoseconds(ros::Time::now())});
  } else if (const std::optional<FrameResult> result = tracker_->process(*frame)) {
    results_->publish(*result);
    if (result->pose) diagnostics_->posePublished(result->pose->header.stamp);
    report(result->status);
    const TrackOutcome& track = result->track;
    if (track.found) {
      overlay_->draw(
          {result->status.header, track.observation, track.field, track.refinement.T_O_C});
    }
  }
}

void PoseRefinerNodelet::report(const RefinementStatus& status) {
  RefinementStatus full = status;
  full.dropped = mailbox_.dropped() + pairing_->dropped();
  pairing_->setTracking(full.state == RefinementStatus::STATE_TRACKING);
  diagnostics_->statusIs(full);
  results_->publish(full);
  if (full.message.empty()) return;
  // What is as it should be is no warning, and need not be said often.
  if (full.reason == RefinementStatus::REASON_NONE ||
      full.reason == RefinementStatus::REASON_PRIOR_IGNORED) {
    NODELET_INFO_THROTTLE(10.0, "%s", full.message.c_str());
  } else {
    NODELET_WARN_THROTTLE(1.0, "%s", full.message.c_str());
  }
}

}  // namespace nerf_pose_refiner

PLUGINLIB_EXPORT_CLASS(nerf_pose_refiner::PoseRefinerNodelet, nodelet::Nodelet)
