// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/visual_hull.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "concurrency/parallel.h"
#include "field/occupied_volume.h"
#include "math/unsure_alpha.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kCoarseResolution = 64;  // for the first, generous box
constexpr int kOpaque = 13;            // alpha of 255 that shows the object: 5 %
constexpr double kMarginCells = 2;     // around the hull

/// A pixel's number, however far outside of the image the point lies.
int pixelAt(double whole) { return static_cast<int>(std::min(1e9, std::max(-1e9, whole))); }

/// Numbers of pixels that may show the object in upright rectangles, by a summed-area table.
class Silhouette {
 public:
  explicit Silhouette(const Image8& rgba)
      : width_(rgba.width),
        height_(rgba.height),
        sums_(static_cast<std::size_t>(rgba.width + 1) * (rgba.height + 1), 0) {
    for (int y = 0; y < height_; ++y) {
      int row = 0;
      for (int x = 0; x < width_; ++x) {
        const std::uint8_t alpha = rgba.at(x, y, 3);
        row += alpha >= kOpaque || isUnsure(alpha);
        sums_[index(x + 1, y + 1)] = sum(x + 1, y) + row;
      }
    }
  }

  /// The larger of width and height of what is opaque [px].
  int extent() const {
    int columns = 0, rows = 0;
    for (int x = 0; x < width_; ++x) columns += touches(x, 0, x, height_ - 1);
    for (int y = 0; y < height_; ++y) rows += touches(0, y, width_ - 1, y);
    return std::max(columns, rows);
  }

  /// True if an opaque pixel lies on the image's border: the object may reach out of it.
  bool touchesBorder() const {
    return touches(0, 0, width_ - 1, 0) || touches(0, height_ - 1, width_ - 1, height_ - 1) ||
           touches(0, 0, 0, height_ - 1) || touches(width_ - 1, 0, width_ - 1, height_ - 1);
  }

  /// True if a pixel of the rectangle (clipped to the image) is opaque.
  bool touches(int x0, int y0, int x1, int y1) const {
    x0 = std::max(0, x0), y0 = std::max(0, y0);
    x1 = std::min(width_ - 1, x1), y1 = std::min(height_ - 1, y1);
    if (x0 > x1 || y0 > y1) return false;
    return sum(x1 + 1, y1 + 1) - sum(x0, y1 + 1) - sum(x1 + 1, y0) + sum(x0, y0) > 0;
  }

 private:
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * (width_ + 1) + x; }
  int sum(int x, int y) const { return sums_[index(x, y)]; }

  int width_, height_;
  std::vector<int> sums_;
};

/// What a view shows of where the object is.
struct Witness {
  Camera camera;
  Pose T_C_O;
  Silhouette silhouette;
  bool cut_off;     ///< the object may reach out of the image
  double slack_px;  ///< how far the silhouette may be out of place

  Witness(const PosedView& view, double slack)
      : camera(view.camera),
        T_C_O(view.T_O_C.inverse()),
        silhouette(*view.rgba),
        cut_off(silhouette.touchesBorder()),
        slack_px(slack > 0 ? slack * silhouette.extent() : 0) {}
};

std::vector<Witness> witnessesOf(const std::vector<PosedView>& views, double slack, int threads,
                                 const CancellationToken& cancellation) {
  std::vector<std::unique_ptr<Witness>> made(views.size());
  parallelFor(threads, static_cast<int>(views.size()), [&](int i) {
    cancellation.check();
    made[i] = std::make_unique<Witness>(views[i], slack);
  });
  std::vector<Witness> witnesses;
  for (std::unique_ptr<Witness>& witness : made) witnesses.push_back(std::move(*witness));
  return witnesses;
}

/// A generous first box: a cube around the point nearest to all optical axes. Half its side is the
/// longest half diagonal of what the images show at that point's distance.
Box boxOfImages(const std::vector<PosedView>& views) {
  Eigen::Matrix3d A = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const PosedView& view : views) {
    const Eigen::Vector3d axis = view.T_O_C.R.col(2);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    A += across;
    b += across * view.T_O_C.t;
  }
  const Eigen::Vector3d centre = A.ldlt().solve(b);
  double radius = 0;
  for (const PosedView& view : views) {
    const double width = view.camera.width / view.camera.fx;
    const double height = view.camera.height / view.camera.fy;
    radius = std::max(radius, 0.5 * std::hypot(width, height) * (centre - view.T_O_C.t).norm());
  }
  return {centre - Eigen::Vector3d::Constant(radius), centre + Eigen::Vector3d::Constant(radius)};
}

/// The cells of a box's cube, and what is known of each.
struct Cells {
  Cells(const Box& of, int resolution)
      : box(of),
        n(resolution),
        size((of.max - of.min).maxCoeff() / resolution),
        corner(0.5 * (of.min + of.max) - Eigen::Vector3d::Constant(0.5 * n * size)),
        alive(static_cast<std::size_t>(n) * n * n, 1),
        seen(alive.size(), 0) {}

  Box box;
  int n;        ///< along the cube
  double size;  ///< [model units]
  Eigen::Vector3d corner;
  std::vector<std::uint8_t> alive;  ///< [z][y][x]: no view denies it so far
  std::vector<std::uint16_t> seen;  ///< views that hold it

  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * n + y) * n + x;
  }
  Eigen::Vector3d middle(int x, int y, int z) const {
    return corner + size * Eigen::Vector3d(x + 0.5, y + 0.5, z + 0.5);
  }
  bool overlapsBox(const Eigen::Vector3d& middle) const {
    return ((middle.array() + 0.5 * size > box.min.array()) &&
            (middle.array() - 0.5 * size < box.max.array()))
        .all();
  }
};

/// Lets a view judge the cells of one slice. A cell is taken for the ball around it.
void judgeSlice(const Witness& view, int z, Cells* cells) {
  const double radius = 0.5 * std::sqrt(3.0) * cells->size;
  for (int y = 0; y < cells->n; ++y) {
    for (int x = 0; x < cells->n; ++x) {
      const std::size_t i = cells->index(x, y, z);
      if (!cells->alive[i]) continue;
      const Eigen::Vector3d p_C = view.T_C_O * cells->middle(x, y, z);
      if (p_C.z() <= radius) continue;
      const Eigen::Vector2d centre = view.camera.project(p_C);
      const double reach =
          radius * std::max(view.camera.fx, view.camera.fy) / p_C.z() + view.slack_px;
      if (view.cut_off && (centre.x() - reach < -0.5 || centre.y() - reach < -0.5 ||
                           centre.x() + reach > view.camera.width - 0.5 ||
                           centre.y() + reach > view.camera.height - 0.5)) {
        continue;  // not wholly inside: this view cannot deny it
      }
      ++cells->seen[i];
      cells->alive[i] = view.silhouette.touches(
          pixelAt(std::floor(centre.x() - reach)), pixelAt(std::floor(centre.y() - reach)),
          pixelAt(std::ceil(centre.x() + reach)), pixelAt(std::ceil(centre.y() + reach)));
    }
  }
}

/// Cells of the box that no silhouette denies, in a grid over the box's cube.
OccupancyGrid carve(const std::vector<Witness>& views, const Box& box, int n, int threads,
                    const CancellationToken& cancellation) {
  Cells cells(box, n);
  parallelFor(threads, n, [&](int z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        cells.alive[cells.index(x, y, z)] = cells.overlapsBox(cells.middle(x, y, z));
      }
    }
    for (const Witness& view : views) {
      cancellation.check();
      judgeSlice(view, z, &cells);
    }
  });
  OccupancyGrid grid{n, std::vector<std::uint8_t>(cells.alive.size() / 8, 0)};
  const std::size_t enough = std::max<std::size_t>(1, views.size() / 4);
  for (std::size_t i = 0; i < cells.alive.size(); ++i) {
    if (cells.alive[i] && cells.seen[i] >= enough) {
      grid.bits[i >> 3] |= static_cast<std::uint8_t>(1u << (i & 7));
    }
  }
  return grid;
}

/// The part of the box that holds occupied cells, with a margin, inside `box`.
Box tightBox(const OccupancyGrid& grid, const Box& box, const std::string& folder) {
  const int n = grid.resolution;
  const double side = (box.max - box.min).maxCoeff(), cell = side / n;
  const Eigen::Vector3d corner = 0.5 * (box.min + box.max) - Eigen::Vector3d::Constant(0.5 * side);
  Eigen::Vector3d low = Eigen::Vector3d::Constant(n), high = Eigen::Vector3d::Constant(-1);
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        if (!grid.occupied(x, y, z)) continue;
        low = low.cwiseMin(Eigen::Vector3d(x, y, z));
        high = high.cwiseMax(Eigen::Vector3d(x + 1, y + 1, z + 1));
      }
    }
  }
  if (high.x() < 0) {
    throw std::runtime_error(folder +
                             ": the silhouettes have no common volume; do the poses belong to "
                             "the images, and are the masks those of one object, not mirrored?");
  }
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(kMarginCells * cell);
  return {(corner + cell * low - margin).cwiseMax(box.min),
          (corner + cell * high + margin).cwiseMin(box.max)};
}

}  // namespace

Hull visualHull(const Dataset& dataset, int resolution, int threads,
                const CancellationToken& cancellation, double slack) {
  if (dataset.views.empty()) throw std::runtime_error(dataset.folder + ": no views");
  const Box given{dataset.box_min, dataset.box_max};
  if (!dataset.has_alpha) {
    if (!dataset.has_box) {
      throw std::runtime_error(dataset.folder +
                               ": images without alpha need masks (mask_path) or a box (aabb)");
    }
    return {given, OccupancyGrid{}};
  }
  const int count = threadCount(threads);
  const std::vector<Witness> views = witnessesOf(dataset.views, slack, count, cancellation);
  Box box = dataset.has_box ? given : boxOfImages(dataset.views);
  // Twice: the second pass has finer cells, for the box is tighter.
  for (int pass = 0; pass < 2; ++pass) {
    box = tightBox(carve(views, box, kCoarseResolution, count, cancellation), box, dataset.folder);
  }
  return {box, dilated(carve(views, box, resolution, count, cancellation))};
}

}  // namespace nerf_pose_refiner
