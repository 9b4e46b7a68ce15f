// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

namespace nerf_pose_refiner {

/// Gives memory that was freed back to the system. The C library keeps what threads free for their
/// next allocations; after a training that is a hundred megabytes and more, each time in the heaps
/// of other threads. Takes some milliseconds, in which allocations may wait. Does nothing where the
/// C library has no such call.
void returnFreedMemory();

/// What this process has allocated and not freed [bytes]. Unlike its resident memory, it does not
/// depend on what the C library keeps: it shows a leak at once. None where the C library cannot say
/// (glibc before 2.33, others).
std::optional<std::size_t> allocatedMemory();

}  // namespace nerf_pose_refiner
