// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tools/trust_trials.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "evaluation/pose_error.h"
#include "evaluation/start.h"
#include "field/object_frame.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kRadPerDegree = 0.017453292519943295769;

void require(bool holds, const char* name, double value, const char* range) {
  if (!holds) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) + ", must be " +
                                range);
  }
}

/// One of `count` numbers from 0 on, by seed and run.
int drawn(int count, std::uint64_t seed, int run) {
  const float fraction = randomUniform(seed, static_cast<std::uint64_t>(run), 0);
  return std::min(count - 1, static_cast<int>(fraction * static_cast<float>(count)));
}

ros::Time stampOf(const Recording::Image& image) { return image.frame.image->header.stamp; }

}  // namespace

Recording Recording::of(const BagSequence& bag) {
  Recording recording;
  for (int i = 0; i < bag.size(); ++i) {
    Image image;
    image.frame = bag.frame(i);
    const std_msgs::Header& header = image.frame.image->header;
    image.true_T_C_U = bag.truth(header.frame_id, header.stamp);
    recording.images.push_back(std::move(image));
  }
  return recording;
}

void TrustSettings::validate() const {
  require(images >= 1, "images", images, "1 or more");
  require(every >= 1, "every", every, "1 or more");
  require(before >= 1, "before", before, "1 or more");
  require(limit >= 1, "limit", limit, "1 or more");
  require(after >= 0, "after", after, "0 or more");
  StartSpread{start_rotation_deg * kRadPerDegree, start_translation, true}.validate();
}

PublishedPoses& PublishedPoses::operator+=(const PublishedPoses& other) {
  images += other.images;
  right += other.right;
  published += other.published;
  published_right += other.published_right;
  return *this;
}

/// A tracker with an initial pose, and its clock.
class TrustTrials::Run {
 public:
  Run(const TrustTrials& trials, const Recording::Image& first, int number)
      : tracker_(
            trials.parameters_, searchFor(trials, number), &transforms_,
            [](const RefinementStatus&) {}, [this] { return now_; }) {
    std::future<void> loaded = tracker_.offerModel(trials.field_);
    tracker_.applyModels();
    loaded.get();
    InitialPose start;
    start.T_P_U = trials.initialPose(first.true_T_C_U, number);
    start.frame_id = first.frame.image->header.frame_id;
    start.stamp = stampOf(first);
    tracker_.offer(start);
  }

  /// Nothing: the image was left alone.
  std::optional<FrameResult> process(const Recording::Image& image) {
    now_ = stampOf(image);
    const std::uint32_t jumps = tracker_.readClock();
    const BagFrame& frame = image.frame;
    if (const auto refused = tracker_.refusal(*frame.image, *frame.info)) {
      throw std::runtime_error("frame " + std::to_string(frame.index) + ": " + *refused);
    }
    return tracker_.process(
        {frame.image, frame.info, ros::WallTime::now(), jumps, {frame.mask, nullptr}});
  }

 private:
  static std::unique_ptr<ObjectSearch> searchFor(const TrustTrials& trials, int number) {
    RefinerSettings initial = trials.parameters_.initial.refiner,
                    tracking = trials.parameters_.tracking.refiner;
    initial.seed += static_cast<std::uint64_t>(number);
    tracking.seed += static_cast<std::uint64_t>(number);
    return std::make_unique<RefinerSearch>(
        [backend = trials.backend_] { return SearchProcessor{backend}; }, initial, tracking);
  }

  ros::Time now_;
  tf2::BufferCore transforms_;
  ObjectTracker tracker_;
};

TrustTrials::TrustTrials(std::shared_ptr<Backend> backend, std::shared_ptr<const Field> field,
                         const PoseRefinerParameters& parameters, const TrustSettings& settings)
    : backend_(std::move(backend)),
      field_(std::move(field)),
      parameters_(parameters),
      settings_(settings) {
  settings_.validate();
  parameters_.validate();
  const FieldMetadata& object = field_->metadata;
  if (!(object.metres_per_unit > 0)) {
    throw std::invalid_argument("the model '" + object.name +
                                "' does not know its scale: train it with --metres-per-unit");
  }
  const ObjectFrame frame = ObjectFrame::inMetres(object);
  diameter_m_ = frame.lengthPerUnit() * object.diameter;
  centre_m_ = frame.point(object.centre);
  symmetries_m_ = object.symmetries.inFrame(object.T_O_U.inverse()).scaled(frame.lengthPerUnit());
}

Pose TrustTrials::initialPose(const Pose& true_T_C_U, int run) const {
  const StartSpread spread = {settings_.start_rotation_deg * kRadPerDegree,
                              settings_.start_translation * diameter_m_, true};
  return perturbedStart(true_T_C_U.inverse(), spread, centre_m_, settings_.seed,
                        static_cast<std::uint64_t>(run))
      .inverse();
}

bool TrustTrials::isRight(const FrameResult& result, const Pose& true_T_C_U) const {
  if (!result.found) return false;
  const Pose T_C_U =
      ObjectFrame::inMetres(field_->metadata).objectInCamera(result.refinement.T_O_C);
  const PoseError error = poseError(T_C_U.inverse(), true_T_C_U.inverse(), centre_m_,
                                    result.observation->camera, symmetries_m_);
  return error.rotation_rad <= settings_.right_rotation_deg * kRadPerDegree &&
         error.object_offset <= settings_.right_offset * diameter_m_;
}

PublishedPoses TrustTrials::follow(const Recording& recording, int run) {
  const int size = static_cast<int>(recording.images.size());
  const int span = (settings_.images - 1) * settings_.every;
  const int first = drawn(std::max(1, size - span), settings_.seed, run);
  Run tracker(*this, recording.images.at(first), run);
  PublishedPoses counts;
  for (int i = first; i < size && i <= first + span; i += settings_.every) {
    const Recording::Image& image = recording.images[i];
    ++counts.images;
    const std::optional<FrameResult> result = tracker.process(image);
    if (!result) continue;
    const bool right = isRight(*result, image.true_T_C_U);
    counts.right += right;
    counts.published += result->pose.has_value();
    counts.published_right += right && result->pose.has_value();
  }
  return counts;
}

Disappearance TrustTrials::lose(const Recording& recording, const Recording& gone, int run) {
  const auto& images = recording.images;
  const int lead = settings_.before * settings_.every;
  const int size = static_cast<int>(gone.images.size());
  // Places in both at which the object may go: with enough images before and after.
  std::vector<std::pair<int, int>> changes;
  for (int k = 0; k + (settings_.limit - 1) * settings_.every < size; ++k) {
    const auto same = std::find_if(images.begin(), images.end(), [&](const Recording::Image& i) {
      return stampOf(i) == stampOf(gone.images[k]);
    });
    const int place = static_cast<int>(same - images.begin());
    if (same != images.end() && place >= lead) changes.emplace_back(place, k);
  }
  if (changes.empty()) {
    throw std::runtime_error("too few images have the stamps of the recording that they continue");
  }
  const auto [place, from] = changes[drawn(static_cast<int>(changes.size()), settings_.seed, run)];
  Run tracker(*this, images[place - lead], run);
  Disappearance outcome;
  for (int i = place - lead; i < place; i += settings_.every) {
    const std::optional<FrameResult> result = tracker.process(images[i]);
    outcome.tracked = result && result->status.state == RefinementStatus::STATE_TRACKING;
  }
  for (int k = from, seen = 1; k < size && seen <= settings_.limit; k += settings_.every, ++seen) {
    if (outcome.lost_after > 0 && seen > outcome.lost_after + settings_.after) break;
    const std::optional<FrameResult> result = tracker.process(gone.images[k]);
    if (!result) continue;
    outcome.published += result->pose.has_value();
    const bool lost = result->status.state == RefinementStatus::STATE_LOST;
    if (lost && outcome.lost_after == 0) outcome.lost_after = seen;
  }
  return outcome;
}

}  // namespace nerf_pose_refiner
