// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <utility>
#include <vector>

#include "cuda_error.h"

namespace nerf_pose_refiner {

/// Memory of the device: grows and stays. Move-only.
template <typename T>
class DeviceBuffer {
 public:
  DeviceBuffer() = default;
  explicit DeviceBuffer(std::size_t n) { reserve(n); }
  ~DeviceBuffer() { cudaFree(data_); }
  DeviceBuffer(const DeviceBuffer&) = delete;
  DeviceBuffer& operator=(const DeviceBuffer&) = delete;
  DeviceBuffer(DeviceBuffer&& other) noexcept { swap(&other); }
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    swap(&other);
    return *this;
  }

  /// Memory for n items; what was in it is lost if it grows. Out of memory: throws, and nothing has
  /// changed.
  void reserve(std::size_t n) {
    if (n <= capacity_) return;
    void* grown = nullptr;
    NPR_CUDA_CHECK(cudaMalloc(&grown, n * sizeof(T)));
    cudaFree(data_);  // waits for the kernels that use it
    data_ = static_cast<T*>(grown);
    capacity_ = n;
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  std::size_t capacity() const { return capacity_; }

  /// Enqueues a copy from the host; small ones are staged at once, others need `from` to live on.
  void upload(const T* from, std::size_t n, cudaStream_t stream) {
    reserve(n);
    NPR_CUDA_CHECK(cudaMemcpyAsync(data_, from, n * sizeof(T), cudaMemcpyHostToDevice, stream));
  }
  void upload(const std::vector<T>& from, cudaStream_t stream) {
    upload(from.data(), from.size(), stream);
  }
  void clear(std::size_t n, cudaStream_t stream) {
    reserve(n);
    NPR_CUDA_CHECK(cudaMemsetAsync(data_, 0, n * sizeof(T), stream));
  }

 private:
  void swap(DeviceBuffer* other) {
    std::swap(data_, other->data_);
    std::swap(capacity_, other->capacity_);
  }

  T* data_ = nullptr;
  std::size_t capacity_ = 0;
};

/// Page-locked memory of the host: copies from and to it run beside kernels. Grows and stays.
template <typename T>
class PinnedBuffer {
 public:
  PinnedBuffer() = default;
  ~PinnedBuffer() { cudaFreeHost(data_); }
  PinnedBuffer(const PinnedBuffer&) = delete;
  PinnedBuffer& operator=(const PinnedBuffer&) = delete;

  void reserve(std::size_t n) {
    if (n <= capacity_) return;
    void* grown = nullptr;
    NPR_CUDA_CHECK(cudaMallocHost(&grown, n * sizeof(T)));
    cudaFreeHost(data_);
    data_ = static_cast<T*>(grown);
    capacity_ = n;
  }
  T* data() { return data_; }
  const T* data() const { return data_; }
  std::size_t capacity() const { return capacity_; }

 private:
  T* data_ = nullptr;
  std::size_t capacity_ = 0;
};

/// A stream of its own, never the default one.
class CudaStream {
 public:
  enum class Priority { kUsual, kHighest };

  explicit CudaStream(Priority priority = Priority::kUsual) {
    int lowest = 0, highest = 0;
    NPR_CUDA_CHECK(cudaDeviceGetStreamPriorityRange(&lowest, &highest));
    const int chosen = priority == Priority::kHighest ? highest : lowest;
    NPR_CUDA_CHECK(cudaStreamCreateWithPriority(&stream_, cudaStreamNonBlocking, chosen));
  }
  ~CudaStream() { cudaStreamDestroy(stream_); }
  CudaStream(const CudaStream&) = delete;
  CudaStream& operator=(const CudaStream&) = delete;
  operator cudaStream_t() const { return stream_; }
  void wait() const { NPR_CUDA_CHECK(cudaStreamSynchronize(stream_)); }

 private:
  cudaStream_t stream_ = nullptr;
};

/// A place in a stream that can be waited for.
class CudaEvent {
 public:
  CudaEvent() { NPR_CUDA_CHECK(cudaEventCreateWithFlags(&event_, cudaEventDisableTiming)); }
  ~CudaEvent() { cudaEventDestroy(event_); }
  CudaEvent(const CudaEvent&) = delete;
  CudaEvent& operator=(const CudaEvent&) = delete;
  void record(cudaStream_t stream) const { NPR_CUDA_CHECK(cudaEventRecord(event_, stream)); }
  /// Returns at once if it was never recorded.
  void wait() const { NPR_CUDA_CHECK(cudaEventSynchronize(event_)); }
  /// What is enqueued in a stream from now on waits for it; for nothing if it was never recorded.
  void awaitIn(cudaStream_t stream) const {
    NPR_CUDA_CHECK(cudaStreamWaitEvent(stream, event_, 0));
  }

 private:
  cudaEvent_t event_ = nullptr;
};

/// A place in a stream whose time is known afterwards.
class CudaTimer {
 public:
  CudaTimer() { NPR_CUDA_CHECK(cudaEventCreate(&event_)); }
  ~CudaTimer() { cudaEventDestroy(event_); }
  CudaTimer(const CudaTimer&) = delete;
  CudaTimer& operator=(const CudaTimer&) = delete;
  void record(cudaStream_t stream) const { NPR_CUDA_CHECK(cudaEventRecord(event_, stream)); }
  void wait() const { NPR_CUDA_CHECK(cudaEventSynchronize(event_)); }
  /// Of two that were recorded and are past.
  double secondsSince(const CudaTimer& start) const {
    float milliseconds = 0;
    NPR_CUDA_CHECK(cudaEventElapsedTime(&milliseconds, start.event_, event_));
    return 1e-3 * milliseconds;
  }

 private:
  cudaEvent_t event_ = nullptr;
};

/// A recorded sequence of launches, run again and again.
class CudaGraph {
 public:
  CudaGraph() = default;
  ~CudaGraph() { reset(); }
  CudaGraph(const CudaGraph&) = delete;
  CudaGraph& operator=(const CudaGraph&) = delete;

  bool empty() const { return executable_ == nullptr; }
  void reset() {
    if (executable_ != nullptr) cudaGraphExecDestroy(executable_);
    executable_ = nullptr;
  }

  /// Records what `enqueue` enqueues to the stream.
  template <typename Enqueue>
  void record(cudaStream_t stream, const Enqueue& enqueue) {
    reset();
    NPR_CUDA_CHECK(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
    cudaGraph_t graph = nullptr;
    try {
      enqueue();
    } catch (...) {
      cudaStreamEndCapture(stream, &graph);
      if (graph != nullptr) cudaGraphDestroy(graph);
      cudaGetLastError();
      throw;
    }
    NPR_CUDA_CHECK(cudaStreamEndCapture(stream, &graph));
    const cudaError_t error = cudaGraphInstantiateWithFlags(&executable_, graph, 0);
    cudaGraphDestroy(graph);
    NPR_CUDA_CHECK(error);
  }

  void launch(cudaStream_t stream) const { NPR_CUDA_CHECK(cudaGraphLaunch(executable_, stream)); }

 private:
  cudaGraphExec_t executable_ = nullptr;
};

}  // namespace nerf_pose_refiner
