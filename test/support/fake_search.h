// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "refinement/covariance.h"
#include "tracking/object_search.h"

namespace nerf_pose_refiner {

/// Finds the object one unit in front of the camera, say, and remembers what it was asked.
class FakeSearch : public ObjectSearch {
 public:
  void use(std::shared_ptr<const Field> field) override {
    if (field->metadata.name == "cursed") throw std::runtime_error("does not fit the memory");
    object = field->metadata.name;
    if (on_use) std::exchange(on_use, nullptr)();
  }

  void configure(const RefinerSettings& initial, const RefinerSettings& tracking) override {
    seeds = {initial.seed, tracking.seed};
  }

  Refinement search(const SearchRequest& request, const CancellationToken& cancellation) override {
    priors.push_back(request.prior);
    was_tracked.push_back(request.tracked);
    width = request.observation.camera.width;
    depth = request.observation.depth;
    side_views = request.observation.side_views;
    boxes = request.observation.boxes;
    if (throws) throw std::runtime_error("the backend broke");
    while (waits_to_be_stopped && !cancellation.cancelRequested()) {
      searching = true;
      std::this_thread::yield();
    }
    Refinement refinement;
    refinement.outcome = cancellation.cancelRequested() ? Outcome::kCancelled : outcome;
    refinement.score = score;
    refinement.visible_fraction = 0.75;
    refinement.T_O_C = T_O_C;
    refinement.is_turned = is_turned;
    refinement.covariance = covariance;
    refinement.depth = depth_report;
    refinement.side_views = side_view_reports;
    if (own_sees && !side_views.empty()) refinement.own = LonePose{T_O_C, covariance};
    refinement.hypotheses.resize(2);
    for (Hypothesis& hypothesis : refinement.hypotheses) {
      hypothesis.T_O_C = T_O_C;
      hypothesis.score = score;
    }
    return refinement;
  }

  Refinement detect(const Observation& observation, double trust_score,
                    const CancellationToken& cancellation) override {
    ++detections;
    least_score = trust_score;
    return search({observation, Prior(), false, 0}, cancellation);
  }

  std::function<void()> on_use;  ///< called once, while the next object is taken over
  std::string object;
  std::vector<Prior> priors;
  std::vector<bool> was_tracked;
  std::vector<std::uint64_t> seeds;  ///< of the settings, once they were changed
  int detections = 0;
  double least_score = 0;  ///< of the last detection
  int width = 0;
  std::shared_ptr<const DepthImage> depth;  ///< of the last observation
  DepthReport depth_report;                 ///< what is said of it
  std::vector<SideView> side_views;         ///< of the last observation
  std::vector<ImageBox> boxes;              ///< of the last observation
  std::vector<SideViewReport> side_view_reports;
  bool own_sees = true;  ///< the observation's own image took part
  Pose T_O_C = {Eigen::Matrix3d::Identity(), {0, 0, -1}};  ///< what is found
  bool is_turned = false;                                  ///< @see Refinement
  Matrix6 covariance = Matrix6::Zero();
  Outcome outcome = Outcome::kRefined;
  double score = 0.9;
  bool throws = false;
  bool waits_to_be_stopped = false;
  std::atomic<bool> searching{false};
};

inline std::shared_ptr<const Field> fieldCalled(const std::string& name) {
  auto field = std::make_shared<Field>();
  field->metadata.name = name;
  field->metadata.metres_per_unit = 0.1;
  field->metadata.diameter = 2;  // 0.2 m
  return field;
}

/// The same object, whose frame is some units further along the model's z axis.
inline std::shared_ptr<Field> fieldWithFrameAt(double z) {
  auto field = std::make_shared<Field>(*fieldCalled("mug"));
  field->metadata.T_O_U.t.z() = z;
  return field;
}

/// The same standard deviations in all directions.
inline Matrix6 covarianceOf(double rotation_rad, double translation_m) {
  Vector6 variances;
  variances << Eigen::Vector3d::Constant(translation_m * translation_m),
      Eigen::Vector3d::Constant(rotation_rad * rotation_rad);
  return variances.asDiagonal();
}

}  // namespace nerf_pose_refiner
