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

/// Lists one behind the other. Places are known before there is memory.
class Packer {
 public:
  /// @return place of the list [bytes].
  template <typename T>
  std::size_t add(const std::vector<T>& list) {
    const std::size_t place = bytes_.size();
    const std::size_t size = list.size() * sizeof(T);
    bytes_.resize(place + (size + kAlignment - 1) / kAlignment * kAlignment);
    if (size > 0) std::memcpy(bytes_.data() + place, list.data(), size);
    return place;
  }
  const std::vector<unsigned char>& bytes() const { return bytes_; }

 private:
  std::vector<unsigned char> bytes_;
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

std::vector<ShownRun> runsOfLevel(const KeyframeLevel& level, int shown_count) {
  const int row_runs = runsOf(level.width);
  std::vector<ShownRun> runs(static_cast<std::size_t>(row_runs) * level.height);
  int i = 0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    runs[r] = {0, i};
    const int y = static_cast<int>(r) / row_runs;
    const int left = static_cast<int>(r) % row_runs * kRunCells;
    const int end = y * level.width + std::min(left + kRunCells, level.width);
    for (; i < shown_count && level.shown.cell[i] < end; ++i) {
      runs[r].cells |= 1u << (level.shown.cell[i] - y * level.width - left);
    }
  }
  return runs;
}

std::vector<ChosenColours> coloursOf(const KeyframeLevel& level) {
  std::vector<ChosenColours> colours(level.chosen.size());
  for (std::size_t i = 0; i < colours.size(); ++i) {
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
  return colours;
}

/// Whole groups for each tile, and where these begin.
struct OutlineGroups {
  std::vector<CudaOutlinePoint> points;
  std::vector<int> tiles;
};

OutlineGroups outlineOf(const KeyframeLevel& level) {
  OutlineGroups groups;
  for (std::size_t t = 0; t + 1 < level.outline_tiles.size(); ++t) {
    groups.tiles.push_back(static_cast<int>(groups.points.size()));
    for (std::int32_t i = level.outline_tiles[t]; i < level.outline_tiles[t + 1]; ++i) {
      const OutlinePoint& from = level.outline[i];
      groups.points.push_back({plain(from.point), plain(from.normal), from.look});
    }
    while (groups.points.size() % kPointGroup != 0) groups.points.push_back({});
  }
  groups.tiles.push_back(static_cast<int>(groups.points.size()));
  return groups;
}

LevelPlaces packLevel(const KeyframeLevel& level, Packer* packer) {
  const int shown_count = shownCount(level);
  // One at least: cells that are not shown look at it, too.
  std::vector<Vec3<float>> shown(std::max(shown_count, 1)), shown_colour(shown.size()),
      shown_normal(shown.size());
  for (int i = 0; i < shown_count; ++i) {
    shown[i] = {level.shown.x[i], level.shown.y[i], level.shown.z[i]};
    shown_colour[i] = {level.shown_colour[0][i], level.shown_colour[1][i],
                       level.shown_colour[2][i]};
    shown_normal[i] = level.shown_normal[i];
  }
  std::vector<CudaLightSample> light;
  for (const std::int32_t i : level.light_samples) light.push_back({i, level.shown.cell[i]});
  std::vector<ChosenPlace> places(level.chosen.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    places[i].p = {level.chosen.x[i], level.chosen.y[i], level.chosen.z[i]};
    places[i].cell = level.chosen.cell[i];
  }
  const OutlineGroups outline = outlineOf(level);
  std::vector<int> tiles(level.tiles.begin(), level.tiles.end());
  for (const int first : outline.tiles) {
    tiles.push_back(kChunkPoints * chunksOf(level.chosen.size()) + first);
  }
  LevelPlaces at;
  at.runs = packer->add(runsOfLevel(level, shown_count));
  at.shown = packer->add(shown);
  at.shown_colour = packer->add(shown_colour);
  at.shown_normal = packer->add(shown_normal);
  at.light = packer->add(light);
  at.places = packer->add(places);
  at.colours = packer->add(coloursOf(level));
  at.outline = packer->add(outline.points);
  at.tiles = packer->add(tiles);
  at.outline_count = static_cast<int>(outline.points.size());
  at.tile_count = static_cast<int>(tiles.size()) - 1;
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
  Packer packer;
  std::vector<LevelPlaces> places;
  for (const KeyframeLevel& level : levels) places.push_back(packLevel(level, &packer));
  const std::size_t head = packer.bytes().size();
  const std::size_t bytes = head + levels.size() * sizeof(CudaKeyframeLevel);
  memory_.reserve(bytes);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    sizes_.push_back(levelAt(levels[i], places[i], memory_.data()));
  }
  staged->reserve(bytes);
  std::memcpy(staged->data(), packer.bytes().data(), head);
  std::memcpy(staged->data() + head, sizes_.data(), bytes - head);
  NPR_CUDA_CHECK(
      cudaMemcpyAsync(memory_.data(), staged->data(), bytes, cudaMemcpyHostToDevice, stream));
  levels_ = reinterpret_cast<const CudaKeyframeLevel*>(memory_.data() + head);
}

}  // namespace nerf_pose_refiner
