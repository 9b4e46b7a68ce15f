// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "keyframe_light.cuh"
#include "keyframe_outline.cuh"
#include "keyframe_sums.cuh"

// A start is aligned from its coarsest level to the finest by one launch: a crew of blocks shares
// its points, and every block takes the same steps from the same sums.

namespace nerf_pose_refiner {

/// What the threads of a block share of a start.
struct SharedSearch {
  LevelScene scene;
  CudaKeyframeStart start;
  PointTransform<float> transform;  ///< of the trial
  CameraPose<double> trial;
  CudaAlignedKeyframe best;
  PointSums<double> sums;  ///< of the trial
  double of_chosen[2];     ///< the first of them, of the chosen points alone
  SeenPoints seen;         ///< of the trial
  double damping;
  double moved_px;  ///< since the last look around
  bool goes_on, looks_around;
  int trial_groups;  ///< where the trial's sums of groups are; the best one's are in the other
                     ///< place
  double warp_sums[kAlignWarps][kKeyframeSums];
};

/// One start on its way, as its threads see it.
class StartAlignment {
 public:
  __device__ StartAlignment(const KeyframeAlignmentTask& task, const KeyframeCrews& crews,
                            SharedSearch* shared, float4* row_memory)
      : task_(task), crews_(crews), shared_(*shared) {
    crew_.rank = static_cast<int>(blockIdx.x) % crews.blocks;
    crew_.blocks = crews.blocks;
    const int warp = warpIndex();
    if (warp < crews.row_warps) row_memory_ = row_memory + warp * kRowPlanes * crews.row_cells;
  }

  /// Aligns the starts of this crew.
  __device__ void run() {
    const int crew = static_cast<int>(blockIdx.x) / crews_.blocks;
    for (int i = crew; i < task_.count; i += crews_.crews) {
      begin(crew, i);
      alignLevels();
      finish(i);
      crew_.sync();  // the next start takes the same memory
    }
  }

 private:
  __device__ static bool isFirstThread() { return threadIdx.x == 0; }

  __device__ void begin(int crew, int i) {
    const KeyframeScratch& scratch = task_.scratch;
    const std::size_t own = crew;
    chunks_of_start_ = scratch.space.chunks;
    chunk_sums_ = scratch.chunk_sums + own * 2 * chunks_of_start_ * kKeyframeSums;
    group_sums_ = scratch.group_sums + own * 2 * groupsOfStart() * kKeyframeSums;
    copyWords(task_.starts[i], &shared_.start);
    __syncthreads();
    if (!isFirstThread()) return;
    LevelScene& scene = shared_.scene;
    scene.rows = scratch.rows + own * kRowPlanes * scratch.space.cells;
    scene.seen_cells = scratch.seen_cells + own * scratch.space.runs;
    scene.tests = scratch.tests + own * scratch.space.shown;
    scene.nearest = scratch.nearest + own * scratch.space.depth_cells;
    scene.points = scratch.points + own * scratch.space.chosen;
    shared_.best = CudaAlignedKeyframe{};
    shared_.best.pose = shared_.start.pose;
    shared_.best.loss = HUGE_VAL;
    shared_.trial_groups = 0;
  }

  /// What a coarse level found counts only where a finer one finds it better than the start, too.
  __device__ void alignLevels() {
    __syncthreads();
    const CudaKeyframeStart& start = shared_.start;
    bool from_start_too = false;
    for (int level = start.coarsest_level; level >= task_.finest_level; --level) {
      const int frame_level = start.frame_level + level;
      if (frame_level < 0 || frame_level >= task_.frame_levels) continue;
      // A far object has few points at coarse levels.
      const int fewest = level > task_.finest_level ? kMinCoarsePoints : kMinKeyframePoints;
      if (start.levels[level].point_count < fewest) continue;
      beginLevel(level, frame_level);
      alignLevel(task_.rules[level], from_start_too);
      from_start_too = true;
    }
    __syncthreads();
    if (shared_.best.loss < HUGE_VAL) findEvidence();
  }

  /// What speaks for the best pose, by the colours around it.
  __device__ void findEvidence() {
    if (isFirstThread()) setTrial(shared_.best.pose);
    __syncthreads();
    lookAround();
    evaluate<true>(task_.rules[task_.finest_level], true);
    if (!isFirstThread()) return;
    setEvidence(*evidenceIn(&shared_.sums), shared_.of_chosen, &shared_.best);
  }

  __device__ void beginLevel(int level, int frame_level) {
    __syncthreads();  // all have left the level before
    if (isFirstThread()) {
      shared_.scene.level = shared_.start.levels[level];
      shared_.scene.image = task_.frame[frame_level];
      shared_.seen.outline = shared_.scene.level.outline_points;
      shared_.seen.outline_weight = shared_.scene.level.outline_weight;
      shared_.seen.outline_evidence = shared_.scene.level.outline_evidence;
      setTrial(shared_.best.pose);
      shared_.best.sums = {};
      shared_.best.loss = HUGE_VAL;
      shared_.damping = kFirstKeyframeDamping;
      shared_.moved_px = 0;
    }
    __syncthreads();
    const LevelScene& scene = shared_.scene;
    findSeenCells(crew_, scene, shared_.transform);
    findLight();
    sumRows<kRowPlanes>(crew_, scene, shared_.transform, row_memory_, crews_);
    crew_.sync();
    forOwnPoints([&](int i, int) {
      if (i < scene.level.chosen_count) scene.points[i] = seenPoint(scene, shared_.transform, i);
    });
  }

  /// Every block for itself: there are few samples.
  __device__ void findLight() {
    LevelScene& scene = shared_.scene;
    const LightSample own = lightSampleAt(scene, shared_.transform, threadIdx.x);
    const auto sum = [this](double of_lane) { return sumOverWarps(of_lane); };
    estimateLight(own, sum, &scene.light);
  }

  __device__ void alignLevel(const KeyframeLevelRules& rules, bool from_start_too) {
    evaluate(rules, false);
    if (isFirstThread()) judge(rules);
    if (from_start_too) {
      if (isFirstThread()) setTrial(shared_.start.pose);
      __syncthreads();
      lookAround();
      evaluate(rules, true);
      if (isFirstThread()) judge(rules);
    }
    for (int i = 1; i < rules.max_evaluations; ++i) {
      if (isFirstThread()) propose(rules);
      __syncthreads();
      if (!shared_.goes_on) break;
      const bool looks_around = shared_.looks_around;
      if (looks_around) lookAround();
      evaluate(rules, looks_around);
      if (isFirstThread()) shared_.damping = nextDamping(shared_.damping, judge(rules));
    }
  }

  __device__ void setTrial(const CameraPose<double>& pose) {
    shared_.trial = pose;
    shared_.transform = singleTransform(pose, shared_.start.centre);
  }

  /// By one thread; apart, so that its numbers take no registers from those of points.
  __device__ __noinline__ void propose(const KeyframeLevelRules& rules) {
    const KeyframeObject object = {shared_.start.centre, shared_.start.diameter,
                                   shared_.scene.image.K.fx};
    const KeyframeStep step =
        proposeKeyframeStep(shared_.best.pose, shared_.best.sums, shared_.damping, rules, object);
    shared_.goes_on = step.exists && !(step.rim_px < rules.convergence_px);
    if (!shared_.goes_on) return;
    shared_.moved_px += step.rim_px;
    shared_.looks_around = shared_.moved_px > rules.look_around_px;
    if (shared_.looks_around) shared_.moved_px = 0;
    setTrial(step.pose);
  }

  __device__ void lookAround() {
    sumRows<2>(crew_, shared_.scene, shared_.transform, row_memory_, crews_);
    crew_.sync();
  }

  /// Calls with every point of this thread and its chunk. All lanes of a warp get the same chunks;
  /// the last one may end with points that are none.
  template <typename Function>
  __device__ void forOwnPoints(const Function& function) const {
    const int chunks = chunkCount();
    for (int chunk = crew_.warp(); chunk < chunks; chunk += kAlignWarps * crew_.blocks) {
      function(chunk * kChunkPoints + laneIndex(), chunk);
    }
  }

  __device__ int chosenChunks() const { return chunksOf(shared_.scene.level.chosen_count); }
  /// Of chosen points, then of the outline.
  __device__ int chunkCount() const {
    return chosenChunks() + chunksOf(shared_.scene.level.outline_count);
  }
  __device__ int groupsOfStart() const { return chunks_of_start_ * kGroupsOfChunk; }
  __device__ float* groupSums(int which) const {
    return group_sums_ + static_cast<std::size_t>(which) * groupsOfStart() * kKeyframeSums;
  }

  /// Sums of the trial, in shared memory behind it for the block's first warp.
  /// @param looks whether rows were summed anew: local colours follow from them.
  /// @tparam kOnlyEvidence sums are EvidenceSums instead.
  template <bool kOnlyEvidence = false>
  __device__ void evaluate(const KeyframeLevelRules& rules, bool looks) {
    // Taken in turns: another block may still be reading the ones before.
    const std::size_t turn = static_cast<std::size_t>(chunk_turn_) * chunks_of_start_;
    float* chunk_sums = chunk_sums_ + turn * kKeyframeSums;
    chunk_turn_ = 1 - chunk_turn_;
    float* group_sums = groupSums(shared_.trial_groups);
    forOwnPoints([&](int i, int chunk) {
      PointTerms terms = {};
      if (chunk >= chosenChunks()) {
        addOutline<kOnlyEvidence>(rules, i - chosenChunks() * kChunkPoints, &terms);
      } else if (i < shared_.scene.level.chosen_count) {
        addTerms<kOnlyEvidence>(rules, i, looks, &terms);
      }
      float* values = reinterpret_cast<float*>(&terms);
      sumGroup(values);
      const int slot = laneIndex() % kGroup;
      float4* group = reinterpret_cast<float4*>(group_sums + i / kGroup * kKeyframeSums);
      group[slot] = make_float4(values[0], values[1], values[2], values[3]);
      for (int k = 0; k < 4; ++k) {
        values[k] += __shfl_xor_sync(kAllLanes, values[k], kGroup);
        values[k] += __shfl_xor_sync(kAllLanes, values[k], 2 * kGroup);
      }
      float4* to = reinterpret_cast<float4*>(chunk_sums + chunk * kKeyframeSums);
      if (laneIndex() < kGroup) {
        to[slot] = make_float4(values[0], values[1], values[2], values[3]);
      }
    });
    crew_.sync();
    sumChunks(chunk_sums);
  }

  template <bool kOnlyEvidence>
  __device__ void addOutline(const KeyframeLevelRules& rules, int i, PointTerms* terms) const {
    const LevelScene& scene = shared_.scene;
    if (i >= scene.level.outline_count) return;
    const CudaOutlinePoint& point = scene.level.outline[i];
    const Pinhole<float>& K = scene.image.K;
    const OutlineInImage<float> place = placeOutline(K, shared_.transform, point.p, point.normal);
    OutlineProfile<float> profile;
    if (!place.isInSight() || !sampleProfile(scene.image, place, &profile)) return;
    const OutlineOpacities<float> seen = outlineOpacities(profile);
    if (kOnlyEvidence) {
      addOutlineEvidence(point.look, seen, {rules.robust_scale, scene.level.outline_evidence},
                         evidenceIn(terms));
      return;
    }
    float along[6];
    flowAlongNormal(K, shared_.transform, point.p, place, along);
    addOutlinePoint(point.look, seen, along, {rules.robust_scale, scene.level.outline_weight},
                    &terms->sums);
    terms->count = 1;
  }

  template <bool kOnlyEvidence>
  __device__ void addTerms(const KeyframeLevelRules& rules, int i, bool looks,
                           PointTerms* terms) const {
    const LevelScene& scene = shared_.scene;
    const PointTransform<float>& transform = shared_.transform;
    const ChosenPlace place = scene.level.places[i];
    SeenPoint seen = scene.points[i];
    if (looks) scene.points[i].local = seen.local = localColoursAt(scene, place.cell, 0);
    const PointInImage point = projectPoint(scene.image, transform, place.p);
    InterpolatedPixel<float> pixel[4];
    interpolateAt(scene.image, point, pixel);
    const float weight = point.inside ? pixel[3].value * seen.weight : 0.0f;
    const PointResidual<float> residual =
        pointResidual(seen.rendered, pixel, seen.local, rules.observed_fraction);
    if (kOnlyEvidence) {
      const ChosenColours& chosen = scene.level.colours[i];
      const float gain = lightGain(scene.light.change, surfaceNormal(chosen.tangent));
      const float rendered = gain * brightnessOf(chosen.colour, chosen.local);
      const float observed = brightnessOf(pixel[0].value, pixel[1].value, pixel[2].value);
      addEvidence(residual, {rendered, observed}, weight, rules.robust_scale, evidenceIn(terms));
      return;
    }
    addPoint(pointFlow(scene.image.K, transform, place.p, point.q), residual, weight,
             rules.robust_scale, &terms->sums);
    terms->count = seen.weight;
  }

  /// In an order that does not depend on the crew.
  __device__ void sumChunks(const float* chunk_sums) {
    const int chosen = chosenChunks(), all = chunkCount();
    const double of_chosen = sumOverWarps(sumRange(chunk_sums, 0, chosen));
    __syncthreads();
    const double of_outline = sumOverWarps(sumRange(chunk_sums, chosen, all));
    if (warpIndex() != 0) return;
    if (laneIndex() == 0) shared_.seen.weight = of_chosen;
    if (laneIndex() < 2) shared_.of_chosen[laneIndex()] = of_chosen;
    if (laneIndex() == kKeyframeSums - 1) {
      shared_.seen.points = of_chosen;
      shared_.seen.outline_seen = static_cast<int>(of_outline);
    } else {
      reinterpret_cast<double*>(&shared_.sums)[laneIndex()] = of_chosen + of_outline;
    }
    __syncwarp();
  }

  /// This warp's share of the chunks first <= chunk < last.
  __device__ static double sumRange(const float* chunk_sums, int first, int last) {
    double sum = 0;
#pragma unroll 4
    for (int chunk = first + warpIndex(); chunk < last; chunk += kAlignWarps) {
      sum += chunk_sums[chunk * kKeyframeSums + laneIndex()];
    }
    return sum;
  }

  /// Sums of the lanes over all warps, for the lanes of the first one.
  __device__ double sumOverWarps(double of_lane) {
    const int warp = warpIndex(), lane = laneIndex();
    shared_.warp_sums[warp][lane] = of_lane;
    __syncthreads();
    double total = 0;
    if (warp == 0) {
      for (int w = 0; w < kAlignWarps; ++w) total += shared_.warp_sums[w][lane];
    }
    return total;
  }

  /// By one thread. @return whether the trial is the best so far.
  __device__ bool judge(const KeyframeLevelRules& rules) {
    ++shared_.best.evaluations;
    const double loss = keyframeLoss(shared_.sums.cost, shared_.seen, rules.robust_scale);
    if (!(loss < shared_.best.loss)) return false;
    shared_.best.most_weight = shared_.seen.mostWeight();
    shared_.best.surface.most = shared_.seen.points;
    shared_.best.outline.most = shared_.seen.mostOutlineEvidence();
    shared_.best.loss = loss;
    shared_.best.pose = shared_.trial;
    shared_.best.sums = shared_.sums;
    shared_.trial_groups = 1 - shared_.trial_groups;
    return true;
  }

  /// Writes what was found.
  __device__ void finish(int i) {
    __syncthreads();
    if (crew_.rank != 0) return;
    TileSums tiles;
    if (shared_.best.loss < HUGE_VAL) tiles = ownTiles();
    double of_warp = 0;
    const double* sums = reinterpret_cast<const double*>(&tiles);
#pragma unroll
    for (int k = 0; k < kTileSums; ++k) {
      double sum = sums[k];
      for (int away = 16; away > 0; away /= 2) sum += __shfl_xor_sync(kAllLanes, sum, away);
      if (laneIndex() == k) of_warp = sum;
    }
    const double total = sumOverWarps(of_warp);
    if (threadIdx.x < kTileSums) shared_.best.tiles[threadIdx.x] = total;
    __syncthreads();
    copyWords(shared_.best, &task_.found[i]);
  }

  /// What this thread's tiles add to the scatter of the best pose's gradient, and to its evidence,
  /// which was evaluated last.
  __device__ TileSums ownTiles() const {
    const float* groups = groupSums(1 - shared_.trial_groups);
    const float* evidence = groupSums(shared_.trial_groups);
    const double full_chance = chanceLoss(task_.rules[task_.finest_level].robust_scale);
    const CudaKeyframeLevel& level = shared_.scene.level;
    TileSums of_tiles;
    for (int t = threadIdx.x; t < level.tile_count; t += kAlignThreads) {
      NormalEquations6<float> tile;
      EvidenceSums<float> says = {};
      for (int g = level.tiles[t] / kGroup; g < level.tiles[t + 1] / kGroup; ++g) {
        const auto& sums = reinterpret_cast<const PointTerms*>(groups)[g].sums;
        for (int k = 0; k < 21; ++k) tile.information[k] += sums.information[k];
        for (int k = 0; k < 6; ++k) tile.gradient[k] += sums.gradient[k];
        addEvidence(*evidenceIn(&reinterpret_cast<const PointTerms*>(evidence)[g]), &says);
      }
      of_tiles.scatter.addTile(tile);
      of_tiles.evidence.addTile(says, full_chance);
    }
    return of_tiles;
  }

  const KeyframeAlignmentTask& task_;
  const KeyframeCrews& crews_;
  SharedSearch& shared_;
  Crew crew_;
  float4* row_memory_ = nullptr;
  float *chunk_sums_ = nullptr, *group_sums_ = nullptr;
  int chunks_of_start_ = 0;
  int chunk_turn_ = 0;
};

}  // namespace nerf_pose_refiner
