// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/reconfiguration.h"

#include <dynamic_reconfigure/server.h>
#include <nerf_pose_refiner/OverlayConfig.h>
#include <nerf_pose_refiner/PoseRefinerConfig.h>
#include <nerf_pose_refiner/SearchConfig.h>
#include <nerf_pose_refiner/TrackerConfig.h>
#include <ros/console.h>

#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

namespace nerf_pose_refiner {
namespace {

template <typename Config>
void searchTo(const SearchSettings& search, Config* config) {
  config->rotation_deg = search.rotation_deg;
  config->translation = search.translation;
  config->robust_scale = search.refiner.robust_scale;
  config->compare_contrast = search.refiner.compare_contrast;
  config->fit_gain_bias = search.refiner.fit_gain_bias;
  config->seed = static_cast<int>(search.refiner.seed);
}

template <typename Config>
void searchFrom(const Config& config, SearchSettings* search) {
  search->rotation_deg = config.rotation_deg;
  search->translation = config.translation;
  search->refiner.robust_scale = config.robust_scale;
  search->refiner.compare_contrast = config.compare_contrast;
  search->refiner.fit_gain_bias = config.fit_gain_bias;
  search->refiner.seed = static_cast<std::uint64_t>(config.seed);
}

// What each group has of the parameters, there and back.

void toConfig(const PoseRefinerParameters& p, PoseRefinerConfig* config) {
  config->initial_pose_policy = p.tracker.rules.initial_pose_policy == InitialPosePolicy::kAlways
                                    ? PoseRefiner_always
                                    : PoseRefiner_when_not_tracking;
  config->initial_pose_max_age_s = p.tracker.rules.initial_pose_max_age_s;
  config->image_timeout_s = p.tracker.rules.image_timeout_s;
  config->recover_s = p.tracker.rules.recover_s;
}

void fromConfig(const PoseRefinerConfig& config, PoseRefinerParameters* p) {
  const bool always = config.initial_pose_policy == PoseRefiner_always;
  if (!always && config.initial_pose_policy != PoseRefiner_when_not_tracking) {
    throw std::invalid_argument("parameter ~initial_pose_policy is '" + config.initial_pose_policy +
                                "' but must be " + PoseRefiner_when_not_tracking + " or " +
                                PoseRefiner_always);
  }
  p->tracker.rules.initial_pose_policy =
      always ? InitialPosePolicy::kAlways : InitialPosePolicy::kWhenNotTracking;
  p->tracker.rules.initial_pose_max_age_s = config.initial_pose_max_age_s;
  p->tracker.rules.image_timeout_s = config.image_timeout_s;
  p->tracker.rules.recover_s = config.recover_s;
}

void toConfig(const PoseRefinerParameters& p, SearchConfig* config) {
  searchTo(p.tracker.initial, config);
}

void fromConfig(const SearchConfig& config, PoseRefinerParameters* p) {
  searchFrom(config, &p->tracker.initial);
}

void toConfig(const PoseRefinerParameters& p, TrackerConfig* config) {
  searchTo(p.tracker.tracking, config);
  config->trust_score = p.tracker.rules.trust_score;
  config->min_score = p.tracker.rules.min_score;
  config->max_failures = p.tracker.rules.max_failures;
  config->predict = p.tracker.rules.predict;
}

void fromConfig(const TrackerConfig& config, PoseRefinerParameters* p) {
  searchFrom(config, &p->tracker.tracking);
  p->tracker.rules.trust_score = config.trust_score;
  p->tracker.rules.min_score = config.min_score;
  p->tracker.rules.max_failures = config.max_failures;
  p->tracker.rules.predict = config.predict;
}

void toConfig(const PoseRefinerParameters& p, OverlayConfig* config) {
  config->width_px = p.overlay.width_px;
  config->opacity = p.overlay.opacity;
}

void fromConfig(const OverlayConfig& config, PoseRefinerParameters* p) {
  p->overlay.width_px = config.width_px;
  p->overlay.opacity = config.opacity;
}

/// The parameters as they are now, for all servers.
class Current {
 public:
  Current(const PoseRefinerParameters& parameters, Reconfiguration::OnChange on_change)
      : parameters_(parameters), on_change_(std::move(on_change)) {}

  template <typename Config>
  void fill(Config* config) const {
    std::lock_guard<std::mutex> lock(mutex_);
    toConfig(parameters_, config);
  }

  /// Takes a change over; puts the old values into `config` if it is not in order.
  template <typename Config>
  void change(Config* config) {
    std::lock_guard<std::mutex> lock(mutex_);
    PoseRefinerParameters changed = parameters_;
    try {
      fromConfig(*config, &changed);
      changed.validate();
    } catch (const std::exception& e) {
      ROS_ERROR("a change is refused: %s", e.what());
      toConfig(parameters_, config);
      return;
    }
    parameters_ = changed;
    on_change_(parameters_);
  }

 private:
  mutable std::mutex mutex_;  ///< guards parameters_
  PoseRefinerParameters parameters_;
  Reconfiguration::OnChange on_change_;
};

/// One group. The server begins with what was read, not with what it makes of it.
template <typename Config>
class Group {
 public:
  Group(const ros::NodeHandle& nh, Current* current) : server_(mutex_, nh) {
    Config config = Config::__getDefault__();
    current->fill(&config);
    server_.updateConfig(config);
    server_.setCallback([current](Config& changed, std::uint32_t) { current->change(&changed); });
  }

 private:
  boost::recursive_mutex mutex_;  // of the server
  dynamic_reconfigure::Server<Config> server_;
};

}  // namespace

struct Reconfiguration::Servers {
  Servers(const ros::NodeHandle& pnh, const PoseRefinerParameters& parameters, OnChange on_change)
      : current(parameters, std::move(on_change)),
        top(pnh, &current),
        refiner(ros::NodeHandle(pnh, "refiner"), &current),
        tracker(ros::NodeHandle(pnh, "tracker"), &current),
        overlay(ros::NodeHandle(pnh, "overlay"), &current) {}

  Current current;
  Group<PoseRefinerConfig> top;
  Group<SearchConfig> refiner;
  Group<TrackerConfig> tracker;
  Group<OverlayConfig> overlay;
};

Reconfiguration::Reconfiguration(const ros::NodeHandle& pnh,
                                 const PoseRefinerParameters& parameters, OnChange on_change)
    : servers_(std::make_unique<Servers>(pnh, parameters, std::move(on_change))) {}

Reconfiguration::~Reconfiguration() = default;

}  // namespace nerf_pose_refiner
