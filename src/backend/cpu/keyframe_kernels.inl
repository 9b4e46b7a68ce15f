// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Alignment's arithmetic, compiled once per instruction set by the cpp files that include this; the
// rules of cpu_kernels.inl hold. Templates of math/ are used with vectors of this file's width
// alone, so that no other file has functions of the same name.

#include <stdint.h>
#include <string.h>
#if defined(__AVX2__)
#include <immintrin.h>
#endif

#include "backend/cpu/keyframe_kernels.h"

namespace nerf_pose_refiner {
namespace {

#if defined(__AVX2__)
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;
#endif
static_assert(kPointGroup % kLanes == 0, "groups are whole vectors");
typedef float Vector __attribute__((vector_size(kLanes * 4)));
typedef int32_t IntVector __attribute__((vector_size(kLanes * 4)));
typedef float Channels __attribute__((vector_size(16)));  // of a pixel

inline Vector load(const float* p) {
  Vector v;
  memcpy(&v, p, sizeof v);
  return v;
}
inline Channels loadPixel(const float* p) {
  Channels v;
  memcpy(&v, p, sizeof v);
  return v;
}
inline void store(float* p, Vector v) { memcpy(p, &v, sizeof v); }
inline Vector choose(IntVector mask, Vector a, Vector b) {
  return (Vector)((mask & (IntVector)a) | (~mask & (IntVector)b));
}
inline float sumLanes(Vector v) {
  float total = 0;
  for (int i = 0; i < kLanes; ++i) total += v[i];
  return total;
}

/// Points of a group in the image.
struct Projected {
  Vec3<Vector> p, q;  // relative to the object's centre in O; in C
  IntVector inside;   // whether all four pixels around it are in the image
  IntVector offset;   // of the upper left one, in floats; moved into the image if it is outside
  Vector u, v;        // 0..1, between the pixels
};

// A coordinate as a whole number in 0..last and what is left of it, 0..1. Comparisons are false for
// what is not a number, which goes to 0.
inline void splitCoordinate(Vector x, int last, IntVector* whole, Vector* rest) {
  x = choose(x > 0, x, Vector{});
  x = choose(x < (float)(last + 1), x, Vector{} + (float)(last + 1));
  IntVector i = __builtin_convertvector(x, IntVector);
  i += i > last;  // a comparison is -1 where true
  *whole = i;
  *rest = x - __builtin_convertvector(i, Vector);
}

inline Projected projectGroup(const KernelView& view, const KernelPoints& points, int i) {
  const KernelImage& image = view.image;
  Projected g;
  g.p = {load(points.x + i), load(points.y + i), load(points.z + i)};
  g.q = inCamera(view.pose, g.p);
  const IntVector before = g.q.z > 1e-6f;
  g.q.z = choose(before, g.q.z, Vector{} + 1e-6f);
  const Vector inverse_depth = 1.0f / g.q.z;
  const Vector x = image.K.fx * g.q.x * inverse_depth + image.K.cx;
  const Vector y = image.K.fy * g.q.y * inverse_depth + image.K.cy;
  const float right = (float)(image.width - 1), bottom = (float)(image.height - 1);
  g.inside = before & (x >= 0.0f) & (x <= right) & (y >= 0.0f) & (y <= bottom);
  IntVector column, row;
  splitCoordinate(x, image.width - 2, &column, &g.u);
  splitCoordinate(y, image.height - 2, &row, &g.v);
  g.offset = 4 * (row * image.row_pixels + column);
  return g;
}

inline InterpolatedPixel<Channels> interpolateAt(const KernelImage& image, const Projected& g,
                                                 int lane) {
  const float* upper = image.pixels + g.offset[lane];
  const float* lower = upper + 4 * image.row_pixels;
  return interpolate(PixelQuad<Channels, float>{loadPixel(upper), loadPixel(upper + 4),
                                                loadPixel(lower), loadPixel(lower + 4), g.u[lane],
                                                g.v[lane]});
}

void sampleColours(const KernelView& view, const KernelPoints& points, const KernelCells& cells,
                   float* grid) {
  for (int i = 0; i < cells.count; i += kLanes) {
    const Projected g = projectGroup(view, points, i);
    for (int lane = 0; lane < kLanes; ++lane) {
      const Channels pixel = interpolateAt(view.image, g, lane).value;
      const float weight = g.inside[lane] ? pixel[3] : 0.0f;
      const Channels colour = weight * pixel;
      const Channels squares = colour * pixel;
      float* sums = grid + kCellNumbers * (int64_t)cells.cell[i + lane];
      const float first[4] = {colour[0], colour[1], colour[2], squares[0]};
      const float second[4] = {squares[1], squares[2], weight, 0};
      memcpy(sums, first, sizeof first);
      memcpy(sums + 4, second, sizeof second);
    }
  }
}

/// Red, green and blue of a group's points and their weight: the transpose of what pixels hold.
struct GroupColours {
  float weight[kLanes];
  float value[3][kLanes], du[3][kLanes], dv[3][kLanes];
  InterpolatedPixel<Vector> channel(int c) const {
    return {load(value[c]), load(du[c]), load(dv[c])};
  }
};

inline void interpolateGroup(const KernelImage& image, const Projected& g, GroupColours* observed) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const InterpolatedPixel<Channels> pixel = interpolateAt(image, g, lane);
    observed->weight[lane] = pixel.value[3];
    for (int c = 0; c < 3; ++c) {
      observed->value[c][lane] = pixel.value[c];
      observed->du[c][lane] = pixel.du[c];
      observed->dv[c][lane] = pixel.dv[c];
    }
  }
}

inline void addLanes(const PointSums<Vector>& lanes, PointSums<float>* sums) {
  sums->weight += sumLanes(lanes.weight);
  sums->cost += sumLanes(lanes.cost);
  sums->robust_weight += sumLanes(lanes.robust_weight);
  sums->squared_residual += sumLanes(lanes.squared_residual);
  for (int k = 0; k < 21; ++k) sums->information[k] += sumLanes(lanes.information[k]);
  for (int k = 0; k < 6; ++k) sums->gradient[k] += sumLanes(lanes.gradient[k]);
}

inline void addLanes(const EvidenceSums<Vector>& lanes, EvidenceSums<float>* sums) {
  sums->explained += sumLanes(lanes.explained);
  sums->chance += sumLanes(lanes.chance);
  sums->weight += sumLanes(lanes.weight);
  sums->tone.weight += sumLanes(lanes.tone.weight);
  sums->tone.rendered += sumLanes(lanes.tone.rendered);
  sums->tone.observed += sumLanes(lanes.tone.observed);
  sums->tone.rendered_squared += sumLanes(lanes.tone.rendered_squared);
  sums->tone.observed_squared += sumLanes(lanes.tone.observed_squared);
  sums->tone.product += sumLanes(lanes.tone.product);
}

/// The points of a group, compared with the frame.
struct ComparedGroup {
  Projected place;
  PointResidual<Vector> residual;
  Vector weight;
  Vector brightness;  // observed
};

inline ComparedGroup compareGroup(const KernelView& view, const KernelTile& tile,
                                  float observed_fraction, int i) {
  const KernelColours& colours = tile.colours;
  ComparedGroup compared;
  compared.place = projectGroup(view, tile.points, i);
  GroupColours group;
  interpolateGroup(view.image, compared.place, &group);
  const InterpolatedPixel<Vector> observed[3] = {group.channel(0), group.channel(1),
                                                 group.channel(2)};
  const LocalColours<Vector> local = {
      {load(colours.mean[0] + i), load(colours.mean[1] + i), load(colours.mean[2] + i)},
      {load(colours.inverse_deviation[0] + i), load(colours.inverse_deviation[1] + i),
       load(colours.inverse_deviation[2] + i)}};
  RenderedPoint<Vector> rendered;
  for (int c = 0; c < 3; ++c) {
    rendered.value[c] = load(colours.rendered[c] + i);
    rendered.du[c] = load(colours.rendered_du[c] + i);
    rendered.dv[c] = load(colours.rendered_dv[c] + i);
  }
  compared.residual = pointResidual(rendered, observed, local, observed_fraction);
  compared.weight =
      choose(compared.place.inside, load(group.weight) * load(colours.weight + i), Vector{});
  compared.brightness =
      brightnessOf(load(group.value[0]), load(group.value[1]), load(group.value[2]));
  return compared;
}

void sumTile(const KernelView& view, const KernelTile& tile, const KernelRules& rules,
             PointSums<float>* sums) {
  PointSums<Vector> lanes = {};
  for (int i = tile.first; i < tile.last; i += kLanes) {
    const ComparedGroup group = compareGroup(view, tile, rules.observed_fraction, i);
    addPoint(pointFlow(view.image.K, view.pose, group.place.p, group.place.q), group.residual,
             group.weight, Vector{} + rules.robust_scale, &lanes);
  }
  addLanes(lanes, sums);
}

void sumEvidence(const KernelView& view, const KernelTile& tile, const KernelRules& rules,
                 EvidenceSums<float>* sums) {
  EvidenceSums<Vector> lanes = {};
  for (int i = tile.first; i < tile.last; i += kLanes) {
    const ComparedGroup group = compareGroup(view, tile, rules.observed_fraction, i);
    addEvidence(group.residual, {load(tile.colours.brightness + i), group.brightness}, group.weight,
                Vector{} + rules.robust_scale, &lanes);
  }
  addLanes(lanes, sums);
}

}  // namespace
}  // namespace nerf_pose_refiner

// Its other parts, which use what is above.
#include "backend/cpu/kernels_local_colours.inl"

#include "backend/cpu/kernels_outline.inl"

namespace nerf_pose_refiner {
namespace {

constexpr KeyframeKernels kKernels = {sampleColours, takeLocalColours, sumTile,
                                      sumEvidence,   sumOutline,       sumOutlineEvidence};

}  // namespace
}  // namespace nerf_pose_refiner
