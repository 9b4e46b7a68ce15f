// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/bag/trust_trials.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "evaluation/pose_error.h"
#include "evaluation/start.h"
#include "field/object_frame.h"
#include "math/angle.h"
#include "math/random.h"
#include "math/require.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/status.h"

namespace nerf_pose_refiner {
namespace {

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
  StartSpread{start_rotation_deg * kDegree, start_translation, true}.validate();
}

PublishedPoses& PublishedPoses::operator+=(const PublishedPoses& other) {
  images += other.images;
  right += other.right;
  published += other.published;
  published_right += other.published_right;
  return *this;
}

/// A tracker with an initial pose.
class TrustTrials::Run {
 public:
  Run(const TrustTrials& trials, const Recording::Image& first, int number)
      : rectified_(trials.parameters_.image_is_rectified),
        input_(rectified_),
        tracker_(trials.backend_, trials.field_, settingsOf(trials, number)) {
    const std_msgs::Header& header = first.frame.image->header;
    tracker_.offer({trials.initialPose(first.true_T_C_U, number),
                    header.frame_id,
                    toNanoseconds(header.stamp),
                    false,
                    {}});
  }

  /// @throws std::runtime_error for an image that cannot be used.
  TrackOutcome process(const Recording::Image& image) {
    const BagFrame& frame = image.frame;
    try {
      checkImage(*frame.image, cameraFromMessage(*frame.info, rectified_).camera);
    } catch (const InputError& e) {
      throw std::runtime_error("frame " + std::to_string(frame.index) + ": " + e.what());
    }
    const auto observe = [&](bool use_mask) {
      return input_.observe(frame.image, *frame.info, {use_mask ? frame.mask : nullptr, nullptr});
    };
    return tracker_.track({imageStampOf(frame.image->header), observe});
  }

 private:
  static TrackerSettings settingsOf(const TrustTrials& trials, int number) {
    TrackerSettings settings = trials.parameters_.tracker;
    for (SearchSettings* search : {&settings.initial, &settings.tracking}) {
      search->refiner.seed += static_cast<std::uint64_t>(number);
    }
    return settings;
  }

  const bool rectified_;
  CameraInput input_;
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
  const StartSpread spread = {settings_.start_rotation_deg * kDegree,
                              settings_.start_translation * diameter_m_, true};
  return perturbedStart(true_T_C_U.inverse(), spread, centre_m_, settings_.seed,
                        static_cast<std::uint64_t>(run))
      .inverse();
}

bool TrustTrials::isRight(const TrackOutcome& result, const Pose& true_T_C_U) const {
  if (!result.found) return false;
  const PoseError error = poseError(result.T_C_O_m.inverse(), true_T_C_U.inverse(), centre_m_,
                                    result.observation->camera, symmetries_m_);
  return error.rotation_rad <= settings_.right_rotation_deg * kDegree &&
         error.object_offset <= settings_.right_offset * diameter_m_;
}

PublishedPoses TrustTrials::track(const Recording& recording, int run) {
  const int size = static_cast<int>(recording.images.size());
  const int span = (settings_.images - 1) * settings_.every;
  const int first = drawn(std::max(1, size - span), settings_.seed, run);
  Run tracker(*this, recording.images.at(first), run);
  PublishedPoses counts;
  for (int i = first; i < size && i <= first + span; i += settings_.every) {
    const Recording::Image& image = recording.images[i];
    ++counts.images;
    const TrackOutcome result = tracker.process(image);
    const bool right = isRight(result, image.true_T_C_U);
    counts.right += right;
    counts.published += result.trusted;
    counts.published_right += right && result.trusted;
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
    const TrackOutcome result = tracker.process(images[i]);
    outcome.tracked = result.refined && result.state == TrackState::kTracking;
  }
  for (int k = from, seen = 1; k < size && seen <= settings_.limit; k += settings_.every, ++seen) {
    if (outcome.lost_after > 0 && seen > outcome.lost_after + settings_.after) break;
    const TrackOutcome result = tracker.process(gone.images[k]);
    if (!result.refined) continue;
    outcome.published += result.trusted;
    const bool lost = result.state == TrackState::kLost;
    if (lost && outcome.lost_after == 0) outcome.lost_after = seen;
  }
  return outcome;
}

}  // namespace nerf_pose_refiner
