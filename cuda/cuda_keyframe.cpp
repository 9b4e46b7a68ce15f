// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_keyframe.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

namespace nerf_pose_refiner {
namespace {

constexpr std::size_t kAlignment = 16;

/// Lists one behind the other in memory that is there. Without memory they are only counted.
class Packer {
 public:
  explicit Packer(unsigned char* memory) : memory_(memory) {}

  /// Room for a list. @param place of the list [bytes]. @return it, or null without memory.
  template <typename T>
  T* add(std::size_t count, std::size_t* place) {
    *place = bytes_;
    bytes_ += (count * sizeof(T) + kAlignment - 1) / kAlignment * kAlignment;
    return memory_ == nullptr ? nullptr : reinterpret_cast<T*>(memory_ + *place);
  }
  std::size_t bytes() const { return bytes_; }

 private:
  unsigned char* memory_;
  std::size_t bytes_ = 0;
};

/// Where the lists of a level are.
struct LevelPlaces {
  std::size_t runs, shown, shown_colour, shown_normal, light, places, colours, outline, tiles;
  int outline_count, tile_count;
};

Vec3<float> plain(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

// How many shown points are none: they fill groups.
int shownCount(const KeyframeLevel& level) {
  const std::int32_t none = level.width * level.height;
  int count = level.shown.size();
  while (count > 0 && level.shown.cell[count - 1] == none) --count;
  return count;
}

void fillRuns(const KeyframeLevel& level, int shown_count, ShownRun* runs) {
  const int row_runs = runsOf(level.width);
  int i = 0;
  for (int r = 0; r < row_runs * level.height; ++r) {
    ShownRun run = {0, i};
    const int y = r / row_runs;
    const int left = r % row_runs * kRunCells;
    const int end = y * level.width + std::min(left + kRunCells, level.width);
    for (; i < shown_count && level.shown.cell[i] < end; ++i) {
      run.cells |= 1u << (level.shown.cell[i] - y * level.width - left);
    }
    runs[r] = run;
  }
}

void fillChosen(const KeyframeLevel& level, ChosenPlace* places, ChosenColours* colours) {
  for (int i = 0; i < level.chosen.size(); ++i) {
    places[i].p = {level.chosen.x[i], level.chosen.y[i], level.chosen.z[i]};
    places[i].cell = level.chosen.cell[i];
    ChosenColours& to = colours[i];
    const ChosenSurface& surface = level.surface[i];
    to.weight = level.weight[i];
    to.local = level.local.at(i);
    for (int t = 0; t < 2; ++t) to.tangent[t] = plain(surface.tangent[t]);
    for (int c = 0; c < 3; ++c) {
      to.colour[c] = level.colour[c][i];
      to.gradient[c] = {surface.gradient[c].x(), surface.gradient[c].y()};
    }
  }
}

/// Whole groups for each tile: where the tiles begin, and last their number of points.
std::vector<int> outlineTilesOf(const KeyframeLevel& level) {
  std::vector<int> tiles = {0};
  for (std::size_t t = 0; t + 1 < level.outline_tiles.size(); ++t) {
    const int points = level.outline_tiles[t + 1] - level.outline_tiles[t];
    tiles.push_back(tiles.back() + (points + kPointGroup - 1) / kPointGroup * kPointGroup);
  }
  return tiles;
}

void fillOutline(const KeyframeLevel& level, const std::vector<int>& tiles, CudaOutlinePoint* to) {
  for (std::size_t t = 0; t + 1 < tiles.size(); ++t) {
    const int first = level.outline_tiles[t], count = level.outline_tiles[t + 1] - first;
    for (int i = 0; i < tiles[t + 1] - tiles[t]; ++i) {
      CudaOutlinePoint& point = to[tiles[t] + i];
      point = {};
      if (i >= count) continue;
      const OutlinePoint& from = level.outline[first + i];
      point = {plain(from.point), plain(from.normal), from.look};
    }
  }
}

void fillShown(const KeyframeLevel& level, int count, Vec3<float>* points, Vec3<float>* colours,
               Vec3<float>* normals) {
  for (int i = 0; i < count; ++i) {
    points[i] = {level.shown.x[i], level.shown.y[i], level.shown.z[i]};
    colours[i] = {level.shown_colour[0][i], level.shown_colour[1][i], level.shown_colour[2][i]};
    normals[i] = level.shown_normal[i];
  }
  if (count == 0) points[0] = colours[0] = normals[0] = {};
}

LevelPlaces packLevel(const KeyframeLevel& level, Packer* packer) {
  const int shown_count = shownCount(level);
  const int shown_room = std::max(shown_count, 1);  // cells that are not shown look at it, too
  const int run_count = runsOf(level.width) * level.height;
  const std::vector<int> outline_tiles = outlineTilesOf(level);
  LevelPlaces at;
  at.outline_count = outline_tiles.back();
  at.tile_count = static_cast<int>(level.tiles.size() + outline_tiles.size()) - 1;
  ShownRun* const runs = packer->add<ShownRun>(run_count, &at.runs);
  auto* const shown = packer->add<Vec3<float>>(shown_room, &at.shown);
  auto* const shown_colour = packer->add<Vec3<float>>(shown_room, &at.shown_colour);
  auto* const shown_normal = packer->add<Vec3<float>>(shown_room, &at.shown_normal);
  auto* light = packer->add<CudaLightSample>(level.light_samples.size(), &at.light);
  auto* const places = packer->add<ChosenPlace>(level.chosen.size(), &at.places);
  auto* const colours = packer->add<ChosenColours>(level.chosen.size(), &at.colours);
  auto* const outline = packer->add<CudaOutlinePoint>(at.outline_count, &at.outline);
  int* tiles = packer->add<int>(at.tile_count + 1, &at.tiles);
  if (runs == nullptr) return at;
  fillRuns(level, shown_count, runs);
  fillShown(level, shown_count, shown, shown_colour, shown_normal);
  for (const std::int32_t i : level.light_samples) *light++ = {i, level.shown.cell[i]};
  fillChosen(level, places, colours);
  fillOutline(level, outline_tiles, outline);
  tiles = std::copy(level.tiles.begin(), level.tiles.end(), tiles);
  for (const int first : outline_tiles) {
    *tiles++ = kChunkPoints * chunksOf(level.chosen.size()) + first;
  }
  return at;
}

CudaKeyframeLevel levelAt(const KeyframeLevel& level, const LevelPlaces& at,
                          const unsigned char* memory) {
  CudaKeyframeLevel to = {};
  to.spacing = level.spacing;
  to.width = level.width;
  to.height = level.height;
  to.window = level.window;
  to.shown_count = shownCount(level);
  to.chosen_count = level.chosen.size();
  to.outline_count = at.outline_count;
  to.tile_count = at.tile_count;
  to.outline_points = static_cast<int>(level.outline.size());
  to.light_count = static_cast<int>(level.light_samples.size());
  to.point_count = level.point_count + to.outline_points;
  to.outline_weight = level.outline_weight;
  to.outline_evidence = level.outline_evidence;
  to.runs = reinterpret_cast<const ShownRun*>(memory + at.runs);
  to.shown = reinterpret_cast<const Vec3<float>*>(memory + at.shown);
  to.shown_colour = reinterpret_cast<const Vec3<float>*>(memory + at.shown_colour);
  to.shown_normal = reinterpret_cast<const Vec3<float>*>(memory + at.shown_normal);
  to.light = reinterpret_cast<const CudaLightSample*>(memory + at.light);
  to.places = reinterpret_cast<const ChosenPlace*>(memory + at.places);
  to.colours = reinterpret_cast<const ChosenColours*>(memory + at.colours);
  to.outline = reinterpret_cast<const CudaOutlinePoint*>(memory + at.outline);
  to.tiles = reinterpret_cast<const int*>(memory + at.tiles);
  return to;
}

}  // namespace

CudaKeyframe::CudaKeyframe(std::shared_ptr<const KeyframePoints> points, KeyframeMemory memory,
                           PinnedBuffer<unsigned char>* staged, cudaStream_t stream)
    : points_(std::move(points)), memory_(std::move(memory)) {
  const std::vector<KeyframeLevel>& levels = points_->levels;
  if (levels.size() > kMaxKeyframeLevels) {
    throw std::invalid_argument("a keyframe has " + std::to_string(levels.size()) +
                                " levels, at most " + std::to_string(kMaxKeyframeLevels) +
                                " are aligned on a GPU");
  }
  std::vector<LevelPlaces> places;
  const auto pack = [&](unsigned char* to) {
    Packer packer(to);
    places.clear();
    for (const KeyframeLevel& level : levels) places.push_back(packLevel(level, &packer));
    return packer.bytes();
  };
  const std::size_t head = pack(nullptr);
  const std::size_t bytes = head + levels.size() * sizeof(CudaKeyframeLevel);
  // Keyframes differ in size: memory must not be asked for each time.
  if (bytes > memory_.capacity()) memory_.reserve(bytes + bytes / 4);
  if (bytes > staged->capacity()) staged->reserve(2 * bytes);
  pack(staged->data());
  for (std::size_t i = 0; i < levels.size(); ++i) {
    sizes_.push_back(levelAt(levels[i], places[i], memory_.data()));
  }
  std::memcpy(staged->data() + head, sizes_.data(), bytes - head);
  NPR_CUDA_CHECK(
      cudaMemcpyAsync(memory_.data(), staged->data(), bytes, cudaMemcpyHostToDevice, stream));
  levels_ = reinterpret_cast<const CudaKeyframeLevel*>(memory_.data() + head);
}

}  // namespace nerf_pose_refiner
