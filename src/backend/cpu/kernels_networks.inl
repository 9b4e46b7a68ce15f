// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Layers, activations, and the optimiser of weights and grid. A part of cpu_kernels.inl, which says
// how it is compiled.

namespace nerf_pose_refiner {
namespace {

/// Four rows of outputs for kColumnGroup columns: eight accumulators hide the FMA's latency, and
/// six loads feed eight multiplications.
void layer(const float* weights, ConstKernelRows in, KernelRows out, bool relu) {
  constexpr int kVectors = kColumnGroup / kLanes;
  const int inputs = in.rows;
  for (int s = 0; s < out.columns; s += kColumnGroup) {
    for (int o = 0; o < out.rows; o += 4) {
      Vector sum[4][kVectors] = {};
      const float* w = weights + (int64_t)o * inputs;
      const float* column = in.data + s;
      for (int i = 0; i < inputs; ++i, column += in.stride) {
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
          store(out.data + (int64_t)(o + r) * out.stride + s + k * kLanes, v);
        }
      }
    }
  }
}

/// Sums over columns for a tile of four outputs and two inputs.
void layerWeightGradient(ConstKernelRows out_gradient, ConstKernelRows in, float* weight_gradient) {
  const int inputs = in.rows;
  for (int o = 0; o < out_gradient.rows; o += 4) {
    for (int i = 0; i < inputs; i += 2) {
      const int second = i + 1 < inputs ? 1 : 0;
      const float* a = out_gradient.data + (int64_t)o * out_gradient.stride;
      const float* b = in.data + (int64_t)i * in.stride;
      Vector sum[4][2] = {};
      for (int s = 0; s < in.columns; s += kLanes) {
        const Vector b0 = load(b + s), b1 = load(b + second * in.stride + s);
        for (int r = 0; r < 4; ++r) {
          const Vector g = load(a + (int64_t)r * out_gradient.stride + s);
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

void reluGradient(ConstKernelRows activation, KernelRows gradient) {
  for (int r = 0; r < gradient.rows; ++r) {
    const float* a = activation.data + (int64_t)r * activation.stride;
    float* g = gradient.data + (int64_t)r * gradient.stride;
    for (int s = 0; s < gradient.columns; s += kLanes) {
      store(g + s, select(load(a + s) > 0, load(g + s), Vector{}));
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

void adam(const KernelParameters& parameters, const KernelAdam& adam) {
  float *values = parameters.values, *gradient = parameters.gradient;
  float *first_moment = parameters.first_moment, *second_moment = parameters.second_moment;
  uint16_t* half_values = parameters.half_values;
  const float beta1 = adam.beta1, beta2 = adam.beta2;
  const int64_t n = parameters.count;
  for (int64_t i = 0; i < n; i += kLanes) {
    const Vector g = load(gradient + i);
    const IntVector touched = g != 0;
    int any = 0;
    for (int k = 0; k < kLanes; ++k) any |= touched[k];
    if (!any) continue;
    const Vector m0 = load(first_moment + i), v0 = load(second_moment + i), p0 = load(values + i);
    const Vector m = beta1 * m0 + (1 - beta1) * g;
    const Vector v = beta2 * v0 + (1 - beta2) * g * g;
    const Vector p = p0 - adam.learning_rate * m / (squareRoot(v) + adam.epsilon);
    const Vector updated = select(touched, p, p0);
    store(first_moment + i, select(touched, m, m0));
    store(second_moment + i, select(touched, v, v0));
    store(values + i, updated);
    store(gradient + i, Vector{});
    if (half_values) {
      for (int k = 0; k < kLanes; ++k) half_values[i + k] = floatToHalfBits(updated[k]);
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
