// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/view_window.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "field/object_frame.h"
#include "geometry/line_of_sight.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMoved = 3;          // images that contradict: the object was moved
constexpr double kMinScore = 0.5;  // of the own image's keyframe: what it shows is worth keeping

bool isPast(const SideView& view) { return view.camera == 0; }

}  // namespace

void ViewWindow::configure(const ViewWindowSettings& settings) {
  settings_ = settings;
  while (size() > settings_.views) views_.pop_front();
}

void ViewWindow::clear() {
  views_.clear();
  centre_W_.reset();
  contradictions_ = 0;
  last_T_W_C_.reset();
}

/// How fast the camera moves: what its stamps are off becomes an error of its place.
void ViewWindow::noteMotion(std::int64_t stamp_ns, const Pose& T_W_C) {
  constexpr double kLongest_s = 0.5;
  const double since_s = 1e-9 * static_cast<double>(stamp_ns - last_ns_);
  if (last_T_W_C_ && since_s > 0 && since_s < kLongest_s) {
    speed_m_s_ = (T_W_C.t - last_T_W_C_->t).norm() / since_s;
    turning_rad_s_ = rotationDistance(T_W_C.R, last_T_W_C_->R) / since_s;
  }
  last_T_W_C_ = T_W_C;
  last_ns_ = stamp_ns;
}

/// Between the lines of sight to the object.
double ViewWindow::angleBetween(const Pose& T_W_A, const Pose& T_W_B) const {
  return nerf_pose_refiner::angleBetween(T_W_A.t - *centre_W_, T_W_B.t - *centre_W_);
}

void ViewWindow::addTo(std::int64_t stamp_ns, Observation* observation) {
  if (settings_.views == 0 || !observation->T_W_C || observation->isDepthAlone()) return;
  const Pose& T_W_C = *observation->T_W_C;
  noteMotion(stamp_ns, T_W_C);
  if (!centre_W_) return;
  for (const View& view : views_) {
    if (angleBetween(view.T_W_V, T_W_C) < settings_.apart_deg * kDegree) continue;
    SideView side;
    side.camera = 0;
    side.observation = view.observation;
    side.T_C_V = T_W_C.inverse() * view.T_W_V;
    side.position_dev_m = view.position_dev_m;
    side.rotation_dev_rad = view.rotation_dev_rad;
    side.after_s = 1e-9 * static_cast<double>(view.stamp_ns - stamp_ns);
    observation->side_views.push_back(std::move(side));
  }
}

void ViewWindow::learn(const Observation& observation, std::int64_t stamp_ns,
                       const FieldMetadata& object, const Refinement& found) {
  if (settings_.views == 0 || !observation.T_W_C || observation.isDepthAlone()) return;
  bool compared = false, used = false;
  for (std::size_t i = 0; i < found.side_views.size() && i < observation.side_views.size(); ++i) {
    if (!isPast(observation.side_views[i])) continue;
    compared = compared || found.side_views[i].apart > 0;
    used = used || found.side_views[i].used;
  }
  contradictions_ = used || !compared ? 0 : contradictions_ + 1;
  if (contradictions_ >= kMoved) clear();
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  const Pose T_W_U = *observation.T_W_C * frame.objectInCamera(found.T_O_C);
  centre_W_ = T_W_U * frame.point(object.centre);
  const bool own_sees = observation.side_views.empty() || found.own.has_value();
  if (contradictions_ > 0) return;
  if (!own_sees || found.hypotheses.empty() || found.hypotheses.front().score < kMinScore) return;
  const auto is_near = [&](const View& view) {
    return angleBetween(view.T_W_V, *observation.T_W_C) < settings_.apart_deg * kDegree;
  };
  const auto is_old = [&](const View& view) {
    return 1e-9 * static_cast<double>(stamp_ns - view.stamp_ns) > settings_.renewal_s;
  };
  views_.erase(std::remove_if(views_.begin(), views_.end(),
                              [&](const View& view) { return is_near(view) && is_old(view); }),
               views_.end());
  if (std::none_of(views_.begin(), views_.end(), is_near)) keep(observation, stamp_ns);
}

/// Keeps an image; if there are too many, the one goes that is nearest to another one.
void ViewWindow::keep(const Observation& observation, std::int64_t stamp_ns) {
  auto own = std::make_shared<Observation>(observation);
  own->side_views.clear();
  own->depth.reset();
  own->T_W_C.reset();
  views_.push_back(
      {std::move(own), stamp_ns, *observation.T_W_C,
       std::hypot(settings_.position_dev_m, speed_m_s_ * settings_.time_dev_s),
       std::hypot(settings_.rotation_dev_deg * kDegree, turning_rad_s_ * settings_.time_dev_s)});
  if (size() <= settings_.views) return;
  std::size_t worst = 0;
  double least = HUGE_VAL;
  for (std::size_t i = 0; i + 1 < views_.size(); ++i) {
    double nearest = HUGE_VAL;
    for (std::size_t j = 0; j < views_.size(); ++j) {
      if (j != i) nearest = std::min(nearest, angleBetween(views_[i].T_W_V, views_[j].T_W_V));
    }
    if (nearest >= least) continue;
    least = nearest;
    worst = i;
  }
  views_.erase(views_.begin() + static_cast<std::ptrdiff_t>(worst));
}

}  // namespace nerf_pose_refiner
