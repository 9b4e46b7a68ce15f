// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend_floor.h"

#include "backend/make_backend.h"

#ifdef NPR_BENCH_CUDA
#include "device_floor.h"
#endif

namespace nerf_pose_refiner {

Floor measureBackendFloor(const BackendInfo& backend, int threads, std::size_t table_bytes) {
#ifdef NPR_BENCH_CUDA
  if (backend.memory_bytes > 0) {
    const DeviceFloor device = measureDeviceFloor(table_bytes);
    return {device.flops_per_s, device.gathers_per_s};
  }
#else
  static_cast<void>(backend);
#endif
  return measureFloor(threads, table_bytes);
}

double deviceMemory_MiB() {
#ifdef NPR_BENCH_CUDA
  if (whyNoCuda().empty()) return static_cast<double>(deviceMemoryUsed()) / (1 << 20);
#endif
  return 0;
}

}  // namespace nerf_pose_refiner
