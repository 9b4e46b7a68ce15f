// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// The hash grid: encoding, and the way back to positions and entries. A part of cpu_kernels.inl,
// which says how it is compiled.

namespace nerf_pose_refiner {
namespace {

constexpr uint32_t kPrimeY = 2654435761u;  // math/hash.h
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
void encodeLevels(const KernelGrid& grid, const float* const position[3], KernelRows out) {
  const float *x = position[0], *y = position[1], *z = position[2];
  for (int l = 0; l < grid.level_count; ++l) {
    float* rows = out.data + (int64_t)l * F * out.stride;
    for (int s = 0; s < out.columns; s += kLanes) {
      Corners corners;
      findCorners(grid.levels[l], x + s, y + s, z + s, &corners);
      interpolateGroup<F>(grid.values, corners, rows + s, out.stride);
    }
  }
}

void encode(const KernelGrid& grid, const float* const position[3], KernelRows out) {
  switch (grid.features) {
    case 1:
      return encodeLevels<1>(grid, position, out);
    case 2:
      return encodeLevels<2>(grid, position, out);
    case 4:
      return encodeLevels<4>(grid, position, out);
    default:
      return encodeLevels<8>(grid, position, out);
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
void addPositionGradient(const KernelGrid& grid, const float* const position[3],
                         ConstKernelRows out_gradient, float* const gradient[3]) {
  const float *x = position[0], *y = position[1], *z = position[2];
  float *gradient_x = gradient[0], *gradient_y = gradient[1], *gradient_z = gradient[2];
  for (int l = 0; l < grid.level_count; ++l) {
    const float* rows = out_gradient.data + (int64_t)l * F * out_gradient.stride;
    const float scale = (float)grid.levels[l].resolution;
    for (int s0 = 0; s0 < out_gradient.columns; s0 += kLanes) {
      Corners corners;
      findCorners(grid.levels[l], x + s0, y + s0, z + s0, &corners);
      float g[8][kLanes];
      for (int s = 0; s < kLanes; ++s) {
        float column[F], products[8];
        for (int f = 0; f < F; ++f) column[f] = rows[(int64_t)f * out_gradient.stride + s0 + s];
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

void encodePositionGradient(const KernelGrid& grid, const float* const position[3],
                            ConstKernelRows out_gradient, float* const gradient[3]) {
  const auto add = grid.features == 1   ? addPositionGradient<1>
                   : grid.features == 2 ? addPositionGradient<2>
                   : grid.features == 4 ? addPositionGradient<4>
                                        : addPositionGradient<8>;
  add(grid, position, out_gradient, gradient);
}

template <int F>
void addGridGradient(const KernelGridLevel& level, const float* const position[3],
                     ConstKernelRows out_gradient, float* grid_gradient) {
  const float *x = position[0], *y = position[1], *z = position[2];
  for (int s0 = 0; s0 < out_gradient.columns; s0 += kLanes) {
    Corners corners;
    findCorners(level, x + s0, y + s0, z + s0, &corners);
    for (int s = 0; s < kLanes; ++s) {
      float g[F];
      float any = 0;
      for (int f = 0; f < F; ++f) {
        g[f] = out_gradient.data[(int64_t)f * out_gradient.stride + s0 + s];
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

void encodeGridGradient(const KernelGrid& grid, int level, const float* const position[3],
                        ConstKernelRows out_gradient, float* grid_gradient) {
  const KernelGridLevel& l = grid.levels[level];
  switch (grid.features) {
    case 1:
      return addGridGradient<1>(l, position, out_gradient, grid_gradient);
    case 2:
      return addGridGradient<2>(l, position, out_gradient, grid_gradient);
    case 4:
      return addGridGradient<4>(l, position, out_gradient, grid_gradient);
    default:
      return addGridGradient<8>(l, position, out_gradient, grid_gradient);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
