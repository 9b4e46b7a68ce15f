// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Vectors, and numbers in half precision. A part of cpu_kernels.inl, which says how it is compiled.

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
inline Vector select(IntVector mask, Vector a, Vector b) {
  return (Vector)((mask & (IntVector)a) | (~mask & (IntVector)b));
}
inline Vector minimum(Vector a, Vector b) { return select(a < b, a, b); }
inline Vector maximum(Vector a, Vector b) { return select(a > b, a, b); }
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

}  // namespace
}  // namespace nerf_pose_refiner
