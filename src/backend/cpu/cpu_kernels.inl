// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// The field's arithmetic, compiled once per instruction set by the cpp files that include this.
// Everything stands in an anonymous namespace and uses neither Eigen nor templates of the standard
// library: a function of this file that the linker merged with another's would carry its
// instructions to processors that lack them. The vectors are GCC's and Clang's own extension; the
// compiler maps them to what the target has, so the code is the same for all.

#include <stdint.h>
#include <string.h>
#if defined(__AVX2__) && defined(__F16C__)
#include <immintrin.h>
#endif

#include "backend/cpu/cpu_kernels.h"

namespace nerf_pose_refiner {
namespace {

#if defined(__AVX2__)
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;
#endif
typedef float Vector __attribute__((vector_size(kLanes * 4)));
typedef int32_t IntVector __attribute__((vector_size(kLanes * 4)));
typedef uint32_t UintVector __attribute__((vector_size(kLanes * 4)));

inline Vector load(const float* p) {
  Vector v;
  memcpy(&v, p, sizeof v);
  return v;
}
inline void store(float* p, Vector v) { memcpy(p, &v, sizeof v); }
inline Vector broadcast(float x) { return x - Vector{}; }
inline Vector resample(IntVector mask, Vector a, Vector b) {
  return (Vector)((mask & (IntVector)a) | (~mask & (IntVector)b));
}
inline Vector minimum(Vector a, Vector b) { return resample(a < b, a, b); }
inline Vector maximum(Vector a, Vector b) { return resample(a > b, a, b); }
inline float sumLanes(Vector v) {
  float total = 0;
  for (int i = 0; i < kLanes; ++i) total += v[i];
  return total;
}

// --- half precision

inline float halfBitsToFloat(uint16_t half) {
  uint32_t bits = (uint32_t)(half & 0x7fffu) << 13;
  float value;
  memcpy(&value, &bits, sizeof value);
  value *= 5.192296858534828e33f;  // 2^112: the exponents' difference; right for subnormals too
  return (half & 0x8000u) ? -value : value;
}

// Finite values below 65504 only: the table's entries stay far from it, for the optimiser's steps
// are small. (A model with others is refused when it is saved or loaded.)
inline uint16_t floatToHalfBits(float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  const uint32_t sign = (bits >> 16) & 0x8000u;
  bits &= 0x7fffffffu;
  if (bits < 0x38800000u) {  // subnormal: the adder rounds at 2^-24
    float magnitude;
    memcpy(&magnitude, &bits, sizeof magnitude);
    magnitude += 0.5f;
    memcpy(&bits, &magnitude, sizeof bits);
    return (uint16_t)(sign | (bits - 0x3f000000u));
  }
  const uint32_t rounded = bits + 0xfffu + ((bits >> 13) & 1u);
  return (uint16_t)(sign | ((rounded - 0x38000000u) >> 13));
}

// --- hash grid

constexpr uint32_t kPrimeY = 2654435761u;  // maths/hash.h
constexpr uint32_t kPrimeZ = 805459861u;

/// Eight corners of the cells of kLanes samples at one level. Corner c is at
/// (x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)).
struct Corners {
  uint32_t index[8][kLanes];
  float weight[8][kLanes];  // trilinear
  float fx[kLanes], fy[kLanes], fz[kLanes];
};

inline void splitCell(const float* p, int resolution, UintVector* cell, Vector* fraction) {
  const Vector scaled =
      minimum(maximum(load(p) * (float)resolution, Vector{}), broadcast((float)resolution));
  IntVector whole = __builtin_convertvector(scaled, IntVector);
  whole += whole >= resolution;  // a comparison is -1 where true: the last cell holds the far face
  *cell = (UintVector)whole;
  *fraction = scaled - __builtin_convertvector(whole, Vector);
}

inline void findCorners(const KernelGridLevel& level, const float* x, const float* y,
                        const float* z, Corners* corners) {
  UintVector ix, iy, iz;
  Vector fx, fy, fz;
  splitCell(x, (int)level.resolution, &ix, &fx);
  splitCell(y, (int)level.resolution, &iy, &fy);
  splitCell(z, (int)level.resolution, &iz, &fz);
  store(corners->fx, fx);
  store(corners->fy, fy);
  store(corners->fz, fz);
  const Vector gx = 1 - fx, gy = 1 - fy, gz = 1 - fz;
  const Vector rows_weight[4] = {gy * gz, fy * gz, gy * fz, fy * fz};
  for (int r = 0; r < 4; ++r) {
    store(corners->weight[2 * r], gx * rows_weight[r]);
    store(corners->weight[2 * r + 1], fx * rows_weight[r]);
  }
  if (level.hashed) {
    const uint32_t mask = level.entries - 1;
    const UintVector y0 = iy * kPrimeY, y1 = y0 + kPrimeY;
    const UintVector z0 = iz * kPrimeZ, z1 = z0 + kPrimeZ;
    const UintVector rows[4] = {y0 ^ z0, y1 ^ z0, y0 ^ z1, y1 ^ z1};
    for (int r = 0; r < 4; ++r) {
      const UintVector a = ((ix ^ rows[r]) & mask) + level.offset;
      const UintVector b = (((ix + 1u) ^ rows[r]) & mask) + level.offset;
      memcpy(corners->index[2 * r], &a, sizeof a);
      memcpy(corners->index[2 * r + 1], &b, sizeof b);
    }
  } else {
    const uint32_t row = level.resolution + 1;
    const UintVector base = ix + row * (iy + row * iz) + level.offset;
    const uint32_t steps[4] = {0, row, row * row, row * row + row};
    for (int r = 0; r < 4; ++r) {
      const UintVector a = base + steps[r];
      const UintVector b = a + 1u;
      memcpy(corners->index[2 * r], &a, sizeof a);
      memcpy(corners->index[2 * r + 1], &b, sizeof b);
    }
  }
}

/// Features of sample s at one level, any instruction set.
template <int F>
inline void interpolateSample(const uint16_t* values, const Corners& corners, int s, float* out) {
  float sum[F] = {};
  for (int c = 0; c < 8; ++c) {
    const uint16_t* entry = values + (uint64_t)corners.index[c][s] * F;
    for (int f = 0; f < F; ++f) sum[f] += corners.weight[c][s] * halfBitsToFloat(entry[f]);
  }
  for (int f = 0; f < F; ++f) out[f] = sum[f];
}

#if defined(__AVX2__) && defined(__F16C__)
// Every operand comes from memory: the conversion and the weight's broadcast then need no shuffle,
// whose single port would be the limit.
inline __m128 interpolateFour(const uint16_t* values, const Corners& corners, int s) {
  __m128 even = _mm_setzero_ps(), odd = _mm_setzero_ps();
  for (int r = 0; r < 4; ++r) {
    const __m128i a =
        _mm_loadl_epi64((const __m128i*)(values + (uint64_t)corners.index[2 * r][s] * 4));
    const __m128i b =
        _mm_loadl_epi64((const __m128i*)(values + (uint64_t)corners.index[2 * r + 1][s] * 4));
    even = _mm_fmadd_ps(_mm_broadcast_ss(&corners.weight[2 * r][s]), _mm_cvtph_ps(a), even);
    odd = _mm_fmadd_ps(_mm_broadcast_ss(&corners.weight[2 * r + 1][s]), _mm_cvtph_ps(b), odd);
  }
  return _mm_add_ps(even, odd);
}

// Two halves are 4 bytes: four corners at a time.
template <>
inline void interpolateSample<2>(const uint16_t* values, const Corners& corners, int s,
                                 float* out) {
  const float fx = corners.fx[s], fy = corners.fy[s], fz = corners.fz[s];
  const __m256 wx = _mm256_set_ps(fx, fx, 1 - fx, 1 - fx, fx, fx, 1 - fx, 1 - fx);
  const __m256 wy = _mm256_set_ps(fy, fy, fy, fy, 1 - fy, 1 - fy, 1 - fy, 1 - fy);
  const __m256 wxy = _mm256_mul_ps(wx, wy);
  const float wz[2] = {1 - fz, fz};
  __m256 sum = _mm256_setzero_ps();
  for (int r = 0; r < 2; ++r) {
    uint32_t entry[4];
    for (int c = 0; c < 4; ++c) {
      memcpy(&entry[c], values + (uint64_t)corners.index[4 * r + c][s] * 2, 4);
    }
    const __m128i quad = _mm_set_epi32((int)entry[3], (int)entry[2], (int)entry[1], (int)entry[0]);
    sum = _mm256_fmadd_ps(_mm256_mul_ps(wxy, _mm256_set1_ps(wz[r])), _mm256_cvtph_ps(quad), sum);
  }
  __m128 half_sum = _mm_add_ps(_mm256_castps256_ps128(sum), _mm256_extractf128_ps(sum, 1));
  half_sum = _mm_add_ps(half_sum, _mm_movehl_ps(half_sum, half_sum));
  _mm_storel_pi((__m64*)out, half_sum);
}
#endif

/// Rows of a level's features for kLanes samples.
template <int F>
inline void interpolateGroup(const uint16_t* values, const Corners& corners, float* rows,
                             int stride) {
  float columns[kLanes][F];
  for (int s = 0; s < kLanes; ++s) interpolateSample<F>(values, corners, s, columns[s]);
  for (int f = 0; f < F; ++f) {
    for (int s = 0; s < kLanes; ++s) rows[(int64_t)f * stride + s] = columns[s][f];
  }
}

#if defined(__AVX2__) && defined(__F16C__)
template <>
inline void interpolateGroup<4>(const uint16_t* values, const Corners& corners, float* rows,
                                int stride) {
  for (int s = 0; s < kLanes; s += 4) {
    __m128 a = interpolateFour(values, corners, s);
    __m128 b = interpolateFour(values, corners, s + 1);
    __m128 c = interpolateFour(values, corners, s + 2);
    __m128 d = interpolateFour(values, corners, s + 3);
    _MM_TRANSPOSE4_PS(a, b, c, d);
    _mm_storeu_ps(rows + s, a);
    _mm_storeu_ps(rows + stride + s, b);
    _mm_storeu_ps(rows + 2 * (int64_t)stride + s, c);
    _mm_storeu_ps(rows + 3 * (int64_t)stride + s, d);
  }
}
#endif

template <int F>
void encodeLevels(const KernelGrid& grid, const float* x, const float* y, const float* z, int n,
                  float* out, int stride) {
  for (int l = 0; l < grid.level_count; ++l) {
    float* rows = out + (int64_t)l * F * stride;
    for (int s = 0; s < n; s += kLanes) {
      Corners corners;
      findCorners(grid.levels[l], x + s, y + s, z + s, &corners);
      interpolateGroup<F>(grid.values, corners, rows + s, stride);
    }
  }
}

void encode(const KernelGrid& grid, const float* x, const float* y, const float* z, int n,
            float* out, int stride) {
  switch (grid.features) {
    case 1:
      return encodeLevels<1>(grid, x, y, z, n, out, stride);
    case 2:
      return encodeLevels<2>(grid, x, y, z, n, out, stride);
    case 4:
      return encodeLevels<4>(grid, x, y, z, n, out, stride);
    default:
      return encodeLevels<8>(grid, x, y, z, n, out, stride);
  }
}

/// Products of each corner's features with `g`: the loss' derivative by the corners' weights.
template <int F>
inline void cornerProducts(const uint16_t* values, const Corners& corners, int s, const float* g,
                           float out[8]) {
  for (int c = 0; c < 8; ++c) {
    const uint16_t* entry = values + (uint64_t)corners.index[c][s] * F;
    float sum = 0;
    for (int f = 0; f < F; ++f) sum += halfBitsToFloat(entry[f]) * g[f];
    out[c] = sum;
  }
}

#if defined(__AVX2__) && defined(__F16C__)
template <>
inline void cornerProducts<4>(const uint16_t* values, const Corners& corners, int s, const float* g,
                              float out[8]) {
  const __m256 gradient = _mm256_broadcast_ps((const __m128*)g);
  __m256 products[4];  // lanes: four of corner r, four of corner r + 4
  for (int r = 0; r < 4; ++r) {
    const __m128i a = _mm_loadl_epi64((const __m128i*)(values + (uint64_t)corners.index[r][s] * 4));
    const __m128i pair = _mm_castpd_si128(_mm_loadh_pd(
        _mm_castsi128_pd(a), (const double*)(values + (uint64_t)corners.index[r + 4][s] * 4)));
    products[r] = _mm256_mul_ps(_mm256_cvtph_ps(pair), gradient);
  }
  // Horizontal sums keep the halves apart: corners 0..3 end up in the low one, 4..7 in the high.
  _mm256_storeu_ps(out, _mm256_hadd_ps(_mm256_hadd_ps(products[0], products[1]),
                                       _mm256_hadd_ps(products[2], products[3])));
}
#endif

template <int F>
void addPositionGradient(const KernelGrid& grid, const float* x, const float* y, const float* z,
                         int n, const float* out_gradient, int stride, float* gradient_x,
                         float* gradient_y, float* gradient_z) {
  for (int l = 0; l < grid.level_count; ++l) {
    const float* rows = out_gradient + (int64_t)l * F * stride;
    const float scale = (float)grid.levels[l].resolution;
    for (int s0 = 0; s0 < n; s0 += kLanes) {
      Corners corners;
      findCorners(grid.levels[l], x + s0, y + s0, z + s0, &corners);
      float g[8][kLanes];
      for (int s = 0; s < kLanes; ++s) {
        float column[F], products[8];
        for (int f = 0; f < F; ++f) column[f] = rows[(int64_t)f * stride + s0 + s];
        cornerProducts<F>(grid.values, corners, s, column, products);
        for (int c = 0; c < 8; ++c) g[c][s] = products[c];
      }
      Vector v[8];
      for (int c = 0; c < 8; ++c) v[c] = load(g[c]);
      const Vector fx = load(corners.fx), fy = load(corners.fy), fz = load(corners.fz);
      const Vector x00 = v[0] + fx * (v[1] - v[0]), x10 = v[2] + fx * (v[3] - v[2]);
      const Vector x01 = v[4] + fx * (v[5] - v[4]), x11 = v[6] + fx * (v[7] - v[6]);
      const Vector dx0 = v[1] - v[0] + fy * (v[3] - v[2] - v[1] + v[0]);
      const Vector dx1 = v[5] - v[4] + fy * (v[7] - v[6] - v[5] + v[4]);
      const Vector dy0 = x10 - x00, dy1 = x11 - x01;
      const Vector dz = x01 + fy * dy1 - x00 - fy * dy0;
      store(gradient_x + s0, load(gradient_x + s0) + scale * (dx0 + fz * (dx1 - dx0)));
      store(gradient_y + s0, load(gradient_y + s0) + scale * (dy0 + fz * (dy1 - dy0)));
      store(gradient_z + s0, load(gradient_z + s0) + scale * dz);
    }
  }
}

void encodePositionGradient(const KernelGrid& grid, const float* x, const float* y, const float* z,
                            int n, const float* out_gradient, int stride, float* gradient_x,
                            float* gradient_y, float* gradient_z) {
  const auto add = grid.features == 1   ? addPositionGradient<1>
                   : grid.features == 2 ? addPositionGradient<2>
                   : grid.features == 4 ? addPositionGradient<4>
                                        : addPositionGradient<8>;
  add(grid, x, y, z, n, out_gradient, stride, gradient_x, gradient_y, gradient_z);
}

template <int F>
void addGridGradient(const KernelGridLevel& level, const float* x, const float* y, const float* z,
                     int n, const float* out_gradient, int stride, float* grid_gradient) {
  for (int s0 = 0; s0 < n; s0 += kLanes) {
    Corners corners;
    findCorners(level, x + s0, y + s0, z + s0, &corners);
    for (int s = 0; s < kLanes; ++s) {
      float g[F];
      float any = 0;
      for (int f = 0; f < F; ++f) {
        g[f] = out_gradient[(int64_t)f * stride + s0 + s];
        any += g[f] * g[f];
      }
      if (any == 0) continue;
      for (int c = 0; c < 8; ++c) {
        float* entry = grid_gradient + (uint64_t)(corners.index[c][s] - level.offset) * F;
        for (int f = 0; f < F; ++f) entry[f] += corners.weight[c][s] * g[f];
      }
    }
  }
}

void encodeGridGradient(const KernelGrid& grid, int level, const float* x, const float* y,
                        const float* z, int n, const float* out_gradient, int stride,
                        float* grid_gradient) {
  const KernelGridLevel& l = grid.levels[level];
  switch (grid.features) {
    case 1:
      return addGridGradient<1>(l, x, y, z, n, out_gradient, stride, grid_gradient);
    case 2:
      return addGridGradient<2>(l, x, y, z, n, out_gradient, stride, grid_gradient);
    case 4:
      return addGridGradient<4>(l, x, y, z, n, out_gradient, stride, grid_gradient);
    default:
      return addGridGradient<8>(l, x, y, z, n, out_gradient, stride, grid_gradient);
  }
}

// --- empty space

/// Rays side by side, one a lane.
struct RayLanes {
  Vector origin[3], direction[3], inverse[3], ahead[3], sign[3];
  Vector entry, exit;  // of the box
  Vector lattice;      // where interval 0 starts
};

inline void enterBox(const KernelSpace& space, const float* const origin[3],
                     const float* const direction[3], const float* offset, int s, RayLanes* rays) {
  Vector entry = broadcast(space.near), exit = broadcast(1e30f);
  for (int a = 0; a < 3; ++a) {
    const Vector o = load(origin[a] + s);
    Vector d = load(direction[a] + s);
    // An axis that the ray does not move along: its faces are very far away.
    d = resample((d < 1e-12f) & (d > -1e-12f), broadcast(1e-12f), d);
    const Vector inverse = 1.0f / d;
    const Vector t0 = (space.box_min[a] - o) * inverse, t1 = (space.box_max[a] - o) * inverse;
    entry = maximum(entry, minimum(t0, t1));
    exit = minimum(exit, maximum(t0, t1));
    rays->origin[a] = o;
    rays->direction[a] = d;
    rays->inverse[a] = inverse;
    rays->ahead[a] = resample(d < 0, Vector{}, broadcast(1));
    rays->sign[a] = resample(d < 0, broadcast(-1), broadcast(1));
  }
  rays->entry = entry;
  rays->exit = exit;
  rays->lattice = entry - load(offset + s) * space.step;
}

inline IntVector cellsOf(Vector p, int n) {
  const Vector cell = minimum(maximum(p * (float)n, Vector{}), broadcast((float)(n - 1)));
  return __builtin_convertvector(cell, IntVector);
}

/// One step of kLanes rays at distances t: lanes in occupied cells, and for the others the way out
/// of the empty block around them.
inline IntVector lookAhead(const KernelSpace& space, const RayLanes& rays, Vector t, Vector* way) {
  Vector p[3];
  IntVector coarse[3], fine[3];
  for (int a = 0; a < 3; ++a) {
    p[a] = rays.origin[a] + t * rays.direction[a];
    coarse[a] = cellsOf(p[a], space.coarse);
    fine[a] = cellsOf(p[a], space.fine);
  }
  const IntVector block = (coarse[2] * space.coarse + coarse[1]) * space.coarse + coarse[0];
  const IntVector cell = (fine[2] * space.fine + fine[1]) * space.fine + fine[0];
  IntVector distance = {}, occupied_volume = {};
  for (int i = 0; i < kLanes; ++i) {
    distance[i] = space.distance[block[i]];
    occupied_volume[i] = -(space.bits[cell[i] >> 3] >> (cell[i] & 7) & 1);
  }
  const IntVector far = distance > 0;
  const Vector radius = resample(far, __builtin_convertvector(distance - 1, Vector), Vector{});
  const Vector size =
      resample(far, broadcast(1.0f / (float)space.coarse), broadcast(1.0f / (float)space.fine));
  *way = broadcast(1e30f);
  for (int a = 0; a < 3; ++a) {
    const Vector corner = __builtin_convertvector((coarse[a] & far) | (fine[a] & ~far), Vector);
    const Vector face = corner + rays.ahead[a] + radius * rays.sign[a];
    *way = minimum(*way, (face * size - p[a]) * rays.inverse[a]);
  }
  *way = maximum(*way, Vector{});
  return occupied_volume & ~far;
}

void firstSamples(const KernelSpace& space, const float* const origin[3],
                  const float* const direction[3], const float* offset, int n, int32_t* first) {
  const float inverse_step = 1.0f / space.step;
  for (int s = 0; s < n; s += kLanes) {
    RayLanes rays;
    enterBox(space, origin, direction, offset, s, &rays);
    IntVector k = {}, result = (IntVector){} - 1;
    IntVector active = rays.entry < rays.exit;
    while (true) {
      const Vector begin = rays.lattice + __builtin_convertvector(k, Vector) * space.step;
      active &= begin < rays.exit;
      int any = 0;
      for (int i = 0; i < kLanes; ++i) any |= active[i];
      if (!any) break;
      // Lanes that are done stay where they are: at the box's exit at most.
      const Vector t = 0.5f * (minimum(maximum(begin, rays.entry), rays.exit) +
                               minimum(begin + space.step, rays.exit));
      Vector way;
      const IntVector found = lookAhead(space, rays, t, &way) & active;
      result = (result & ~found) | (k & found);
      active &= ~found;
      const Vector leave = minimum(t + way, rays.exit + space.step);
      const IntVector next =
          __builtin_convertvector((leave - rays.lattice) * inverse_step + 0.5f, IntVector);
      const IntVector at_least = k + 1;
      const IntVector later = next > at_least;
      k = (active & ((next & later) | (at_least & ~later))) | (k & ~active);
    }
    memcpy(first + s, &result, sizeof result);
  }
}

// --- networks

/// Four rows of outputs for kColumnGroup columns: eight accumulators hide the FMA's latency, and
/// six loads feed eight multiplications.
void layer(const float* weights, int outputs, int inputs, const float* in, float* out, int n,
           int stride, bool relu) {
  constexpr int kVectors = kColumnGroup / kLanes;
  for (int s = 0; s < n; s += kColumnGroup) {
    for (int o = 0; o < outputs; o += 4) {
      Vector sum[4][kVectors] = {};
      const float* w = weights + (int64_t)o * inputs;
      const float* column = in + s;
      for (int i = 0; i < inputs; ++i, column += stride) {
        Vector v[kVectors];
        for (int k = 0; k < kVectors; ++k) v[k] = load(column + k * kLanes);
        for (int r = 0; r < 4; ++r) {
          const Vector a = broadcast(w[r * inputs + i]);
          for (int k = 0; k < kVectors; ++k) sum[r][k] += a * v[k];
        }
      }
      for (int r = 0; r < 4; ++r) {
        for (int k = 0; k < kVectors; ++k) {
          const Vector v = relu ? maximum(sum[r][k], Vector{}) : sum[r][k];
          store(out + (int64_t)(o + r) * stride + s + k * kLanes, v);
        }
      }
    }
  }
}

/// Sums over columns for a tile of four outputs and two inputs.
void layerWeightGradient(int outputs, int inputs, const float* out_gradient, const float* in, int n,
                         int stride, float* weight_gradient) {
  for (int o = 0; o < outputs; o += 4) {
    for (int i = 0; i < inputs; i += 2) {
      const int second = i + 1 < inputs ? 1 : 0;
      const float* a = out_gradient + (int64_t)o * stride;
      const float* b = in + (int64_t)i * stride;
      Vector sum[4][2] = {};
      for (int s = 0; s < n; s += kLanes) {
        const Vector b0 = load(b + s), b1 = load(b + second * stride + s);
        for (int r = 0; r < 4; ++r) {
          const Vector g = load(a + (int64_t)r * stride + s);
          sum[r][0] += g * b0;
          sum[r][1] += g * b1;
        }
      }
      for (int r = 0; r < 4; ++r) {
        float* row = weight_gradient + (int64_t)(o + r) * inputs + i;
        row[0] += sumLanes(sum[r][0]);
        if (second) row[1] += sumLanes(sum[r][1]);
      }
    }
  }
}

void reluGradient(const float* activation, float* gradient, int rows, int n, int stride) {
  for (int r = 0; r < rows; ++r) {
    const float* a = activation + (int64_t)r * stride;
    float* g = gradient + (int64_t)r * stride;
    for (int s = 0; s < n; s += kLanes) {
      store(g + s, resample(load(a + s) > 0, load(g + s), Vector{}));
    }
  }
}

/// exp by 2^k * p(f): p is the Taylor polynomial of degree 6 on |f| <= ln(2) / 2, relative error
/// below 2e-7. The argument is bounded to [-80, 80], where floats hold the result.
inline Vector exponentialOf(Vector x) {
  x = minimum(maximum(x, broadcast(-80)), broadcast(80));
  const Vector scaled = x * 1.44269504088896341f;
  // Adding 1.5 * 2^23 rounds to the nearest integer in the low bits of the float.
  const Vector shifted = scaled + 12582912.0f;
  const IntVector k = (IntVector)shifted - (IntVector)broadcast(12582912.0f);
  const Vector whole = shifted - 12582912.0f;
  const Vector f = (x - whole * 0.693359375f) + whole * 2.12194440e-4f;
  Vector p = broadcast(1.0f / 720);
  p = p * f + 1.0f / 120;
  p = p * f + 1.0f / 24;
  p = p * f + 1.0f / 6;
  p = p * f + 0.5f;
  p = p * f + 1.0f;
  p = p * f + 1.0f;
  return p * (Vector)((k + 127) << 23);
}

void exponential(const float* in, float* out, int n) {
  for (int s = 0; s < n; s += kLanes) {
    store(out + s, exponentialOf(minimum(load(in + s), broadcast(30))));
  }
}

void sigmoid(const float* in, float* out, int n) {
  for (int s = 0; s < n; s += kLanes) store(out + s, 1.0f / (1.0f + exponentialOf(-load(in + s))));
}

// --- optimiser

inline Vector squareRoot(Vector v) {
#if defined(__AVX2__)
  return _mm256_sqrt_ps(v);
#else
  Vector r = {};
  for (int i = 0; i < kLanes; ++i) r[i] = __builtin_sqrtf(v[i]);
  return r;
#endif
}

void adam(float* values, float* first_moment, float* second_moment, float* gradient,
          uint16_t* half_values, int64_t n, float learning_rate, float beta1, float beta2,
          float epsilon) {
  for (int64_t i = 0; i < n; i += kLanes) {
    const Vector g = load(gradient + i);
    const IntVector touched = g != 0;
    int any = 0;
    for (int k = 0; k < kLanes; ++k) any |= touched[k];
    if (!any) continue;
    const Vector m0 = load(first_moment + i), v0 = load(second_moment + i), p0 = load(values + i);
    const Vector m = beta1 * m0 + (1 - beta1) * g;
    const Vector v = beta2 * v0 + (1 - beta2) * g * g;
    const Vector p = p0 - learning_rate * m / (squareRoot(v) + epsilon);
    const Vector updated = resample(touched, p, p0);
    store(first_moment + i, resample(touched, m, m0));
    store(second_moment + i, resample(touched, v, v0));
    store(values + i, updated);
    store(gradient + i, Vector{});
    if (half_values) {
      for (int k = 0; k < kLanes; ++k) half_values[i + k] = floatToHalfBits(updated[k]);
    }
  }
}

constexpr CpuKernels makeKernels(const char* name) {
  return {name,
          firstSamples,
          encode,
          encodePositionGradient,
          encodeGridGradient,
          layer,
          layerWeightGradient,
          reluGradient,
          exponential,
          sigmoid,
          adam};
}

}  // namespace
}  // namespace nerf_pose_refiner
