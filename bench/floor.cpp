// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "floor.h"

#include <chrono>
#include <cstdint>
#include <cstring>
#include <vector>

namespace nerf_pose_refiner {
namespace {

constexpr double kSeconds = 0.4;   // of each measurement
constexpr int kAccumulators = 10;  // hide the latency of a fused multiply-add

typedef float Vector8 __attribute__((vector_size(32)));

#if defined(__x86_64__)
#define NPR_FMA_TARGET __attribute__((target("avx2,fma"), optimize("fp-contract=fast")))
#else
#define NPR_FMA_TARGET
#endif

/// @return something of the result, so that the loop is not left out.
NPR_FMA_TARGET float multiplyAdd(int rounds) {
  Vector8 sum[kAccumulators];
  for (int k = 0; k < kAccumulators; ++k) {
    for (int i = 0; i < 8; ++i) sum[k][i] = static_cast<float>(k + i);
  }
  // The compiler must not see that the factors never change, or it does the sum at once.
  Vector8 a = {0.999f, 0.999f, 0.999f, 0.999f, 0.999f, 0.999f, 0.999f, 0.999f};
  Vector8 b = a * 1e-3f;
  for (int r = 0; r < rounds; ++r) {
    for (int k = 0; k < kAccumulators; ++k) sum[k] = sum[k] * a + b;
#if defined(__x86_64__)
    __asm__ volatile("" : "+x"(a), "+x"(b));
#elif defined(__aarch64__)
    __asm__ volatile("" : "+w"(a), "+w"(b));
#endif
  }
  float total = 0;
  for (int k = 0; k < kAccumulators; ++k) total += sum[k][k % 8];
  return total;
}

std::uint64_t gather(const std::vector<std::uint64_t>& table, int rounds, std::uint64_t state) {
  const std::uint64_t mask = table.size() - 1;
  std::uint64_t total = 0;
  for (int r = 0; r < rounds; ++r) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    // Four places from one random number: the generator must not be the limit.
    total += table[(state >> 40) & mask] ^ table[(state >> 28) & mask] ^
             table[(state >> 17) & mask] ^ table[(state >> 9) & mask];
  }
  return total;
}

/// Calls work(rounds) on every thread again and again. @return rounds a second, of all threads.
template <typename Body>
double rate(int threads, int rounds, const Body& work) {
  double total = 0;
#pragma omp parallel num_threads(threads) reduction(+ : total)
  {
    const auto start = std::chrono::steady_clock::now();
    double seconds = 0, done = 0;
    while (seconds < kSeconds) {
      work(rounds);
      done += rounds;
      seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
    total += done / seconds;
  }
  return total;
}

}  // namespace

Floor measureFloor(int threads, std::size_t table_bytes) {
  std::size_t entries = 1;
  while (entries * 2 * sizeof(std::uint64_t) <= table_bytes) entries *= 2;
  std::vector<std::uint64_t> table(entries);
  for (std::size_t i = 0; i < entries; ++i) table[i] = i * 0x9E3779B97F4A7C15ull;
  volatile float float_sink = 0;
  volatile std::uint64_t integer_sink = 0;
  Floor floor;
  floor.flops_per_s = 2.0 * 8 * kAccumulators *
                      rate(threads, 20000, [&](int rounds) { float_sink = multiplyAdd(rounds); });
  floor.gathers_per_s = 4.0 * rate(threads, 20000, [&](int rounds) {
                          const auto seed =
                              reinterpret_cast<std::uintptr_t>(&rounds) +
                              static_cast<std::uintptr_t>(
                                  std::chrono::steady_clock::now().time_since_epoch().count());
                          integer_sink = gather(table, rounds, seed);
                        });
  (void)float_sink;
  (void)integer_sink;
  return floor;
}

}  // namespace nerf_pose_refiner
