// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/rendered_image.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "backend/common/pixel_window.h"
#include "backend/cost_counters.h"
#include "concurrency/parallel.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kTilePixels = 16;  // side of the square of pixels whose rays are rendered together

struct Tile {
  int request;
  int x0, y0, x1, y1;  // from pixel (x0, y0) to before (x1, y1)
};

// Tiles of the part of each image that shows the field's box; nothing can be seen elsewhere.
std::vector<Tile> tilesOf(const std::vector<ImageRequest>& requests, const Box& box) {
  std::vector<Tile> tiles;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const PixelWindow window = windowOf(requests[i].camera, requests[i].T_O_C, box);
    const int right = window.x + window.width, bottom = window.y + window.height;
    for (int y = window.y; y < bottom; y += kTilePixels) {
      for (int x = window.x; x < right; x += kTilePixels) {
        tiles.push_back({static_cast<int>(i), x, y, std::min(x + kTilePixels, right),
                         std::min(y + kTilePixels, bottom)});
      }
    }
  }
  return tiles;
}

// Buffers of a thread; they grow and stay.
struct TileBuffers {
  std::vector<Ray> rays;
  std::vector<RayResult> results;
};

void renderTile(const RayRenderer& scene, const ImageRequest& request, const Tile& tile,
                const RenderOptions& options, CostCounters* work) {
  thread_local TileBuffers buffers;
  const Camera& camera = request.camera;
  const int x0 = tile.x0, y0 = tile.y0;
  const int side = request.rays_per_side;
  buffers.rays.clear();
  // Directions are linear in the pixel's coordinates but for their length.
  const Eigen::Vector3f origin = request.T_O_C.t.cast<float>();
  const Eigen::Vector3f corner =
      (request.T_O_C.R * camera.direction(x0 - 0.5, y0 - 0.5)).cast<float>();
  const Eigen::Vector3f right = (request.T_O_C.R.col(0) / camera.fx).cast<float>();
  const Eigen::Vector3f down = (request.T_O_C.R.col(1) / camera.fy).cast<float>();
  for (int y = y0; y < tile.y1; ++y) {
    for (int x = x0; x < tile.x1; ++x) {
      for (int i = 0; i < side * side; ++i) {
        const float u = static_cast<float>(x - x0) + (static_cast<float>(i % side) + 0.5f) / side;
        const float v = static_cast<float>(y - y0) + (static_cast<float>(i / side) + 0.5f) / side;
        const Eigen::Vector3f d = (corner + u * right + v * down).normalized();
        buffers.rays.push_back({{origin.x(), origin.y(), origin.z()}, {d.x(), d.y(), d.z()}});
      }
    }
  }
  const int rays = static_cast<int>(buffers.rays.size());
  buffers.results.resize(buffers.rays.size());
  *work += scene.renderRays({buffers.rays.data(), rays}, options, buffers.results.data());

  const Eigen::Vector3f centre = scene.field().metadata.centre.cast<float>();
  const float fraction = 1.0f / static_cast<float>(side * side);
  const RayResult* ray = buffers.results.data();
  for (int y = y0; y < tile.y1; ++y) {
    for (int x = x0; x < tile.x1; ++x) {
      float* pixel = request.image->pixel(x, y);
      for (int i = 0; i < side * side; ++i, ++ray) {
        for (int c = 0; c < 3; ++c) {
          pixel[c] += fraction * ray->rgb[c];
          pixel[kPoint + c] += fraction * (ray->point[c] - ray->alpha * centre[c]);
        }
        pixel[kOpacity] += fraction * ray->alpha;
      }
    }
  }
}

void addScaled(float factor, const float* from, int n, float* to) {
  for (int i = 0; i < n; ++i) to[i] += factor * from[i];
}

}  // namespace

Ray rayThrough(const Camera& camera, const Pose& T_O_C, double u, double v) {
  const Eigen::Vector3f d = (T_O_C.R * camera.direction(u, v)).normalized().cast<float>();
  const Eigen::Vector3f o = T_O_C.t.cast<float>();
  return {{o.x(), o.y(), o.z()}, {d.x(), d.y(), d.z()}};
}

void renderImages(const RayRenderer& scene, const std::vector<ImageRequest>& requests,
                  const RenderOptions& options, const CancellationToken& cancellation) {
  for (const ImageRequest& request : requests) {
    *request.image = Image(request.camera.width, request.camera.height, kImageChannels);
    for (std::size_t i = 0; i < request.image->pixels(); ++i) {
      request.image->values[kImageChannels * i + kWeight] = 1;
    }
  }
  const std::vector<Tile> tiles = tilesOf(requests, scene.field().box);
  CpuProcessor& processor = scene.processor();
  std::mutex costs_mutex;  // guards the processor's
  parallelFor(processor.threads, static_cast<int>(tiles.size()), [&](int i) {
    cancellation.check();
    CostCounters tile_work;
    renderTile(scene, requests[tiles[i].request], tiles[i], options, &tile_work);
    const std::lock_guard<std::mutex> lock(costs_mutex);
    processor.costs += tile_work;
  });
}

void blurImage(const std::vector<float>& kernel, Image* image, Image* scratch) {
  const int radius = static_cast<int>(kernel.size()) - 1;
  const int width = image->width, height = image->height;
  for (std::size_t i = 0; i < image->pixels(); ++i) {
    float* pixel = image->values.data() + kImageChannels * i;
    for (int c = 0; c < kWeight; ++c) pixel[c] *= pixel[kWeight];
  }
  *scratch = Image(width, height, kImageChannels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      float sum[kImageChannels] = {};
      const int first = std::max(0, x - radius), last = std::min(width - 1, x + radius);
      for (int i = first; i <= last; ++i) {
        addScaled(kernel[std::abs(i - x)], image->pixel(i, y), kImageChannels, sum);
      }
      std::copy(sum, sum + kImageChannels, scratch->pixel(x, y));
    }
  }
  for (int y = 0; y < height; ++y) {
    const int first = std::max(0, y - radius), last = std::min(height - 1, y + radius);
    float* row = image->pixel(0, y);
    std::fill(row, row + static_cast<std::size_t>(width) * kImageChannels, 0.0f);
    for (int i = first; i <= last; ++i) {
      addScaled(kernel[std::abs(i - y)], scratch->pixel(0, i), width * kImageChannels, row);
    }
    for (int x = 0; x < width; ++x) {
      float* pixel = image->pixel(x, y);
      const float inverse = pixel[kWeight] > 0 ? 1 / pixel[kWeight] : 0.0f;
      for (int c = 0; c < kWeight; ++c) pixel[c] *= inverse;
    }
  }
}

}  // namespace nerf_pose_refiner
