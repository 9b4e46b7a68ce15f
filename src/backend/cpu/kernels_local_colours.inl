// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Mean and spread of the colours around points. A part of keyframe_kernels.inl, which says how it
// is compiled. In each row only the cells from the first to the last one that shows the object are
// added, and only boxes around points: a lamp fills a tenth of its grid.

namespace nerf_pose_refiner {
namespace {

static_assert(kCellNumbers % kLanes == 0, "cells are whole vectors");
static_assert(kLocalWeight < kCellNumbers, "a cell holds all sums");

inline Vector squareRoot(Vector v) {
#if defined(__AVX2__)
  return (Vector)_mm256_sqrt_ps((__m256)v);
#else
  for (int lane = 0; lane < kLanes; ++lane) v[lane] = __builtin_sqrtf(v[lane]);
  return v;
#endif
}

/// Sums over the cells of a box, number by number.
struct CellSums {
  Vector part[kCellNumbers / kLanes];

  void add(const float* cell) {
    for (int k = 0; k < kCellNumbers / kLanes; ++k) part[k] += load(cell + k * kLanes);
  }
  void move(const float* to, const float* from) {
    for (int k = 0; k < kCellNumbers / kLanes; ++k)
      part[k] += load(to + k * kLanes) - load(from + k * kLanes);
  }
};

/// Adds the cells of a row, times a sign, to sums over columns.
inline void addRow(const CellGrid& grid, int y, float sign, float* columns) {
  const ShownInRow& shown = grid.shown[y];
  const float* const row = grid.cells + (int64_t)kCellNumbers * grid.width * y;
  for (int i = kCellNumbers * shown.first; i < kCellNumbers * shown.last; i += kLanes) {
    store(columns + i, load(columns + i) + sign * load(row + i));
  }
}

/// Sums over the boxes around a row's points. @param columns sums over the columns of the boxes, 0
/// for `half` cells and one more on either side.
inline void sumBoxes(const CellGrid& grid, int y, const float* columns, float* boxes) {
  const int half = grid.half;
  CellSums sums = {};
  int x = -1;  // of `sums`
  for (int i = grid.row_begins[y]; i < grid.row_begins[y + 1]; ++i) {
    const PointInRow& wanted = grid.points[i];
    if (x < 0 || wanted.x > x + 2 * half + 1) {
      sums = {};
      for (int u = wanted.x - half; u <= wanted.x + half; ++u) sums.add(columns + kCellNumbers * u);
      x = wanted.x;
    }
    for (; x < wanted.x; ++x)
      sums.move(columns + kCellNumbers * (x + half + 1), columns + kCellNumbers * (x - half));
    memcpy(boxes + (int64_t)kCellNumbers * wanted.point, &sums, sizeof sums);
  }
}

/// Local colours of kLanes points. @param boxes sums of theirs.
inline void normaliseGroup(const float* boxes, int first, const KernelLocalColours& local) {
  float columns[kLocalWeight + 1][kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    for (int k = 0; k <= kLocalWeight; ++k) columns[k][lane] = boxes[kCellNumbers * lane + k];
  }
  Vector sums[kLocalWeight + 1];
  for (int k = 0; k <= kLocalWeight; ++k) sums[k] = load(columns[k]);
  const Vector weight = sums[kLocalWeight];
  const Vector least = Vector{} + kMinLocalWeight;
  const LocalMoments<Vector> moments =
      localMoments(sums, 1 / choose(weight > least, weight, least));
  for (int c = 0; c < 3; ++c) {
    const Vector variance = choose(moments.variance[c] > 0, moments.variance[c], Vector{});
    store(local.mean[c] + first, moments.mean[c]);
    store(local.inverse_deviation[c] + first,
          1 / squareRoot(variance + kFlatDeviation * kFlatDeviation));
  }
}

void takeLocalColours(const CellGrid& grid, float* scratch, const KernelLocalColours& local) {
  const int half = grid.half, points = grid.row_begins[grid.height];
  float* const boxes = scratch;
  float* const padded = boxes + (int64_t)kCellNumbers * points;
  memset(padded, 0, sizeof(float) * kCellNumbers * (grid.width + 2 * (half + 1)));
  float* const columns = padded + kCellNumbers * (half + 1);
  for (int y = 0; y < half && y < grid.height; ++y) addRow(grid, y, 1, columns);
  for (int y = 0; y < grid.height; ++y) {
    if (y + half < grid.height) addRow(grid, y + half, 1, columns);
    if (y - half > 0) addRow(grid, y - half - 1, -1, columns);
    sumBoxes(grid, y, columns, boxes);
  }
  for (int i = 0; i < points; i += kLanes)
    normaliseGroup(boxes + (int64_t)kCellNumbers * i, i, local);
}

}  // namespace
}  // namespace nerf_pose_refiner
