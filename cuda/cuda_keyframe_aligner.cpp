// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_keyframe_aligner.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "backend/common/keyframe_rules.h"
#include "backend/common/plain_pose.h"

namespace nerf_pose_refiner {
namespace {

// Memory of removed keyframes that is kept for the next ones: to free memory waits for all that the
// device does. A tracker that renews its keyframe has two.
constexpr std::size_t kSpare = 2;

// As much as the largest level of all needs. @param frame its levels at hand.
void growSpace(const CudaKeyframe& keyframe, const std::vector<CudaFrameLevel>& frame,
               const CudaKeyframeStart& start, int finest_level, KeyframeSpace* space) {
  for (int level = start.coarsest_level; level >= finest_level; --level) {
    const int of_frame = start.frame_level + level;
    if (of_frame < 0 || of_frame >= static_cast<int>(frame.size())) continue;
    const CudaKeyframeLevel& size = keyframe.sizes()[level];
    const OcclusionGrid grid =
        occlusionGrid(frame[of_frame].width, frame[of_frame].height, size.spacing);
    space->cells = std::max(space->cells, size.width * size.height);
    space->runs = std::max(space->runs, size.height * runsOf(size.width));
    space->shown = std::max(space->shown, size.shown_count);
    space->chosen = std::max(space->chosen, size.chosen_count);
    space->chunks =
        std::max(space->chunks, chunksOf(size.chosen_count) + chunksOf(size.outline_count));
    space->depth_cells = std::max(space->depth_cells, grid.columns * grid.rows);
    space->window = std::max(space->window, size.window);
  }
}

AlignedKeyframe alignedOf(const CudaAlignedKeyframe& from) {
  AlignedKeyframe to;
  to.pose = from.pose;
  to.sums = from.sums;
  std::copy(from.tiles, from.tiles + 21, to.scatter.gradients);
  to.scatter.information = from.tiles[21];
  to.scatter.squared_information = from.tiles[22];
  to.tiles = {from.tiles[23],
              from.tiles[24],
              {from.tiles[25], from.tiles[26], from.tiles[27], from.tiles[28], from.tiles[29],
               from.tiles[30]}};
  to.loss = from.loss;
  to.most_weight = from.most_weight;
  to.surface = from.surface;
  to.outline = from.outline;
  to.evaluations = static_cast<int>(from.evaluations);
  return to;
}

template <typename T>
T* roomFor(std::size_t n, DeviceBuffer<T>* buffer) {
  if (n > buffer->capacity()) buffer->reserve(n + n / 2);  // keyframes differ in size
  return buffer->data();
}

}  // namespace

CudaKeyframeAligner::CudaKeyframeAligner(int device, std::shared_ptr<CudaFrames> frames)
    : device_(device), stream_(CudaStream::Priority::kHighest), frame_(std::move(frames)) {
  limits_ = keyframeDevice();
}

CudaKeyframeAligner::~CudaKeyframeAligner() {
  cudaSetDevice(device_);  // a destructor never throws
  cudaStreamSynchronize(stream_);
}

KeyframeMemory CudaKeyframeAligner::spareMemory() {
  const std::lock_guard<std::mutex> lock(shared_);
  if (spare_.empty()) return {};
  KeyframeMemory memory = std::move(spare_.back());
  spare_.pop_back();
  return memory;
}

void CudaKeyframeAligner::keepSpare(KeyframeMemory memory) {
  const std::lock_guard<std::mutex> lock(shared_);
  if (spare_.size() < kSpare) spare_.push_back(std::move(memory));
}

int CudaKeyframeAligner::add(std::shared_ptr<const KeyframePoints> keyframe) {
  NPR_CUDA_CHECK(cudaSetDevice(device_));
  {
    const std::lock_guard<std::mutex> lock(shared_);
    if (expected_ && expected_->isOf(keyframe)) {
      keyframes_.emplace(next_, std::move(*expected_));
      expected_.reset();
      return next_++;
    }
  }
  uploaded_.wait();  // what was staged before
  keyframes_.emplace(next_, CudaKeyframe(std::move(keyframe), spareMemory(), &staged_, stream_));
  uploaded_.record(stream_);
  return next_++;
}

void CudaKeyframeAligner::expect(const std::shared_ptr<const KeyframePoints>& keyframe) {
  const std::lock_guard<std::mutex> call(expecting_);
  NPR_CUDA_CHECK(cudaSetDevice(device_));
  std::optional<CudaKeyframe> uploaded;
  try {
    uploaded.emplace(keyframe, spareMemory(), &expected_staged_, expected_stream_);
    expected_stream_.wait();
  } catch (const std::exception&) {
    return;  // `add` has more memory once it has removed another one, or says what is wrong
  }
  {
    const std::lock_guard<std::mutex> lock(shared_);
    std::swap(uploaded, expected_);
  }
  if (uploaded) keepSpare(uploaded->release());  // the one before, which nobody has added
}

void CudaKeyframeAligner::remove(int keyframe) {
  const auto found = keyframes_.find(keyframe);
  if (found == keyframes_.end()) return;
  NPR_CUDA_CHECK(cudaSetDevice(device_));
  uploaded_.wait();  // the memory may go to another stream
  keepSpare(found->second.release());
  keyframes_.erase(found);
}

void CudaKeyframeAligner::observe(const Observation& observation, const FrameWindow& window) {
  NPR_CUDA_CHECK(cudaSetDevice(device_));
  frame_.look(observation, window, stream_);
}

CudaKeyframeStart CudaKeyframeAligner::startOf(const KeyframeStart& start,
                                               const KeyframeAlignmentSettings& settings) const {
  const CudaKeyframe& keyframe = keyframes_.at(start.keyframe);
  const KeyframePoints& points = keyframe.points();
  CudaKeyframeStart to = {};
  to.levels = keyframe.levels();
  to.centre = plainVector(points.centre);
  to.diameter = points.diameter;
  to.pose = plainPose(start.T_O_C);
  to.coarsest_level = std::min(settings.coarsest_level, static_cast<int>(points.levels.size()) - 1);
  to.frame_level =
      frameLevelFor(points, frame_.levels().camera(), start.T_O_C) - frame_.levels().finest();
  return to;
}

KeyframeScratch CudaKeyframeAligner::scratchFor(const KeyframeSpace& space, int crews) {
  const std::size_t n = crews;
  const std::size_t chunks = space.chunks;
  constexpr std::size_t kGroups = kChunkPoints / kPointGroup;
  KeyframeScratch scratch = {};
  scratch.space = space;
  scratch.rows = roomFor(n * kRowPlanes * space.cells, &scratch_.rows);
  scratch.seen_cells = roomFor(n * space.runs, &scratch_.seen_cells);
  scratch.tests = roomFor(n * space.shown, &scratch_.tests);
  scratch.nearest = roomFor(n * space.depth_cells, &scratch_.nearest);
  scratch.points = roomFor(n * space.chosen, &scratch_.points);
  scratch.chunk_sums = roomFor(n * 2 * chunks * kKeyframeSums, &scratch_.chunk_sums);
  scratch.group_sums = roomFor(n * 2 * chunks * kGroups * kKeyframeSums, &scratch_.group_sums);
  return scratch;
}

std::vector<Hypothesis> CudaKeyframeAligner::align(const std::vector<KeyframeStart>& starts,
                                                   const KeyframeAlignmentSettings& settings,
                                                   const CancellationToken& cancellation) {
  cancellation.check();
  if (starts.empty()) return {};
  NPR_CUDA_CHECK(cudaSetDevice(device_));
  KeyframeAlignmentTask task = {};
  task.count = static_cast<int>(starts.size());
  task.finest_level = settings.finest_level;
  const std::vector<CudaFrameLevel> frame = frame_.all();
  task.frame_levels = static_cast<int>(frame.size());
  std::copy(frame.begin(), frame.end(), task.frame);
  for (int i = 0; i < kMaxKeyframeLevels; ++i) task.rules[i] = levelRules(settings, i);
  starts_.reserve(starts.size());
  found_.reserve(starts.size());
  KeyframeSpace space = {};
  for (std::size_t i = 0; i < starts.size(); ++i) {
    starts_.data()[i] = startOf(starts[i], settings);
    growSpace(keyframes_.at(starts[i].keyframe), frame, starts_.data()[i], settings.finest_level,
              &space);
  }
  const KeyframeCrews crews = keyframeCrews(limits_, task.count, space.window);
  task.scratch = scratchFor(space, crews.crews);
  task.starts = starts_.data();
  task.found = found_.data();
  alignKeyframes(task, crews, stream_);
  stream_.wait();
  std::vector<Hypothesis> hypotheses;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    hypotheses.push_back(hypothesisOf(alignedOf(found_.data()[i]),
                                      keyframes_.at(starts[i].keyframe).points(), settings));
  }
  return hypotheses;
}

}  // namespace nerf_pose_refiner
