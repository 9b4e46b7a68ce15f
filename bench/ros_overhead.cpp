// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// What ROS adds to a refinement: from the call back of an image to the publication of its pose,
// less the search itself; what onInit takes; what an idle nodelet takes; what the overlay takes.
// Needs a running roscore. The nodelet runs in this process, so that images travel without a copy.
#include <geometry_msgs/PoseStamped.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "dataset/dataset.h"
#include "field/model_file.h"
#include "field/object_frame.h"
#include "image/colour.h"
#include "registration/registrar.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/pose_conversions.h"
#include "support/analytic_scene.h"
#include "support/scene_dataset.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr double kMetresPerUnit = 0.1;
const Camera kCamera = {640, 480, 800, 800, 319.5, 239.5};

/// Of this process, all threads [s].
double cpuSeconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return t.tv_sec + 1e-6 * t.tv_usec; };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(fraction * values.size()))];
}

/// A model in a folder that ends with it, and an image of the object.
struct Subject {
  Subject()
      : root(fs::temp_directory_path() / ("ros_overhead_" + std::to_string(getpid()))),
        backend(makeCpuBackend()),
        scene(makeAnalyticScene()),
        T_O_C(cameraAround(*scene, 0.7, 0.5)) {
    writeSceneDataset(*scene, (root / "photos").string(), 40, 64);
    RegistrationOptions settings;
    settings.steps = 300;
    settings.metres_per_unit = kMetresPerUnit;
    Field field = learnField(backend.get(), loadDataset((root / "photos").string()), settings, {},
                             CancellationToken());
    field.metadata.name = "subject";
    saveModel(field, (root / "subject.safetensors").string());

    const Observation view = observeScene(*scene, kCamera, T_O_C);
    const Image8 picture = toBytes(composite({view.image, view.alpha}, {0.4f, 0.4f, 0.4f}));
    image.header.frame_id = "camera";
    image.width = 640;
    image.height = 480;
    image.encoding = "rgb8";
    image.step = 3 * 640;
    image.data = picture.values;
    info = toMessage(kCamera);
    info.header.frame_id = "camera";
  }
  ~Subject() { fs::remove_all(root); }

  fs::path root;
  std::shared_ptr<Backend> backend;
  std::shared_ptr<const LoadedField> scene;
  Pose T_O_C;
  sensor_msgs::Image image;
  sensor_msgs::CameraInfo info;
};

/// The camera, and ears for what comes of its images.
class Graph {
 public:
  explicit Graph(const Subject& subject)
      : subject_(subject),
        images_(nh_.advertise<sensor_msgs::Image>("camera/image_raw", 2)),
        infos_(nh_.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 2)),
        initial_(nh_.advertise<geometry_msgs::PoseStamped>("pose_refiner/initial_pose", 2)),
        poses_(nh_.subscribe("pose_refiner/pose", 10, &Graph::onPose, this)),
        status_(nh_.subscribe("pose_refiner/status", 10, &Graph::onStatus, this)) {}

  bool ready() const {
    return images_.getNumSubscribers() > 0 && infos_.getNumSubscribers() > 0 &&
           initial_.getNumSubscribers() > 0 && poses_.getNumPublishers() > 0;
  }

  void sendInitialPose() {
    geometry_msgs::PoseStamped pose;
    pose.header.frame_id = "camera";
    pose.pose = toMessage(ObjectFrame(Pose(), kMetresPerUnit).objectInCamera(subject_.T_O_C));
    initial_.publish(pose);
  }

  ros::Time takeImage(const std::vector<double>& distortion) {
    auto image = boost::make_shared<sensor_msgs::Image>(subject_.image);
    auto info = boost::make_shared<sensor_msgs::CameraInfo>(subject_.info);
    if (!distortion.empty()) info->D = distortion;
    const ros::Time stamp = ros::Time::now();
    image->header.stamp = info->header.stamp = stamp;
    infos_.publish(info);
    const ros::WallTime now = ros::WallTime::now();
    images_.publish(image);
    std::lock_guard<std::mutex> lock(mutex_);
    sent_[stamp] = now;
    return stamp;
  }

  struct Times {
    double whole = 0;   ///< image published to pose received [s]
    double search = 0;  ///< of it in the refiner [s]
  };

  /// Waits for what came of an image; nothing: no pose within 20 s.
  std::optional<Times> wait(const ros::Time& stamp) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto complete = [&] { return received_.count(stamp) && search_.count(stamp); };
    if (!changed_.wait_for(lock, std::chrono::seconds(20), complete)) return std::nullopt;
    return Times{(received_[stamp] - sent_[stamp]).toSec(), search_[stamp]};
  }

 private:
  void onPose(const geometry_msgs::PoseStamped& pose) {
    std::lock_guard<std::mutex> lock(mutex_);
    received_[pose.header.stamp] = ros::WallTime::now();
    changed_.notify_all();
  }

  void onStatus(const RefinementStatus& status) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (status.latency_s > 0) search_[status.header.stamp] = status.refinement_s;
    changed_.notify_all();
  }

  const Subject& subject_;
  ros::NodeHandle nh_;
  std::mutex mutex_;  ///< guards all down to search_
  std::condition_variable changed_;
  std::map<ros::Time, ros::WallTime> sent_, received_;
  std::map<ros::Time, double> search_;
  ros::Publisher images_, infos_, initial_;
  ros::Subscriber poses_, status_;
};

void load(nodelet::Loader* loader, const std::string& name, const Subject& subject) {
  ros::param::set(name + "/model_root", subject.root.string());
  ros::param::set(name + "/object", "subject");
  ros::param::set(name + "/image_timeout_s", 0.0);  // images come one by one
  const ros::WallTime start = ros::WallTime::now();
  if (!loader->load(name, "nerf_pose_refiner/PoseRefiner",
                    {{ros::names::resolve("image"), ros::names::resolve("camera/image_raw")}},
                    {})) {
    throw std::runtime_error("the nodelet " + name + " could not be loaded");
  }
  std::printf("%-44s %8.1f ms\n", ("load " + name).c_str(),
              1e3 * (ros::WallTime::now() - start).toSec());
}

/// @param own of the benchmark itself [fraction of a core]. @return the fraction of this process.
double measureIdle(const char* what, double seconds, double own,
                   const std::function<void()>& tick) {
  const double before = cpuSeconds();
  const ros::WallTime start = ros::WallTime::now();
  while ((ros::WallTime::now() - start).toSec() < seconds) {
    tick();
    ros::WallDuration(1.0 / 30).sleep();
  }
  const double fraction = (cpuSeconds() - before) / (ros::WallTime::now() - start).toSec();
  std::printf("%-44s %8.2f %% of a core\n", what, 100 * (fraction - own));
  return fraction;
}

void measureOverhead(const char* what, int images, const std::vector<double>& distortion,
                     Graph* graph) {
  std::vector<double> overhead, search;
  const double before = cpuSeconds();
  for (int i = 0; i < images; ++i) {
    if (i == 0) graph->sendInitialPose();
    const auto times = graph->wait(graph->takeImage(distortion));
    if (!times || i < 5) continue;
    overhead.push_back(1e3 * (times->whole - times->search));
    search.push_back(1e3 * times->search);
  }
  const double cpu = 1e3 * (cpuSeconds() - before) / images;
  std::printf(
      "%-24s %4zu poses: ROS %5.2f ms (90 %%: %5.2f), search %6.1f ms, CPU %6.1f ms an image\n",
      what, overhead.size(), quantile(overhead, 0.5), quantile(overhead, 0.9),
      quantile(search, 0.5), cpu);
}

void run(int images, double idle_s) {
  const Subject subject;
  Graph graph(subject);
  nodelet::Loader loader(false);
  const double own = measureIdle("the benchmark alone", idle_s, 0, [] {});
  const double own_images =
      measureIdle("the benchmark alone, with images", idle_s, 0, [&] { graph.takeImage({}); });
  load(&loader, "/first", subject);  // with the library itself
  load(&loader, "/pose_refiner", subject);
  loader.unload("/first");
  while (ros::ok() && !graph.ready()) ros::WallDuration(0.05).sleep();
  ros::WallDuration(1).sleep();  // the model is read

  measureIdle("idle, without images", idle_s, own, [] {});
  measureIdle("idle, 640 x 480 at 30 Hz, no initial pose", idle_s, own_images,
              [&] { graph.takeImage({}); });
  measureOverhead("without distortion", images, {}, &graph);
  measureOverhead("with distortion", images, {-0.1, 0.01, 0, 0, 0}, &graph);
  const boost::function<void(const sensor_msgs::ImageConstPtr&)> look = [](const auto&) {};
  const ros::Subscriber looking =
      ros::NodeHandle().subscribe<sensor_msgs::Image>("pose_refiner/overlay/image_raw", 2, look);
  ros::WallDuration(0.5).sleep();
  measureOverhead("with an overlay", images, {}, &graph);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  int images = 100;
  double idle_s = 10;
  CLI::App app("Measures what ROS adds to a refinement of 640 x 480 images. Needs a roscore.");
  app.add_option("--images", images, "to refine in each round")->capture_default_str();
  app.add_option("--idle", idle_s, "how long to look at an idle nodelet [s]")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  ros::init(argc, argv, "ros_overhead");
  ros::AsyncSpinner spinner(2);
  spinner.start();
  nerf_pose_refiner::run(images, idle_s);
  return 0;
}
