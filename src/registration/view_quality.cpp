// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/view_quality.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "image/colour.h"
#include "math/unsure_alpha.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMaxPsnr_db = 100;  // of two images that are equal

/// Where a view says what there is. One with transparency does so wherever it is sure; one without
/// shows whatever lies behind the box as well, and counts only where the box can be seen.
std::vector<std::uint8_t> tellingPixels(const PosedView& view, const Box& box) {
  const std::vector<std::uint8_t>& rgba = view.rgba->values;
  std::vector<std::uint8_t> telling(view.rgba->pixels(), 1);
  bool is_transparent = false;
  for (std::size_t i = 0; i < telling.size(); ++i) {
    const std::uint8_t alpha = rgba[4 * i + 3];
    is_transparent = is_transparent || alpha < 255;
    telling[i] = !isUnsure(alpha);
  }
  if (is_transparent) return telling;
  for (int y = 0; y < view.camera.height; ++y) {
    for (int x = 0; x < view.camera.width; ++x) {
      const Eigen::Vector3d direction_O = view.T_O_C.R * view.camera.direction(x, y);
      telling[static_cast<std::size_t>(y) * view.camera.width + x] =
          box.meets(view.T_O_C.t, direction_O);
    }
  }
  return telling;
}

/// Error of a rendering on black against a view.
struct ViewError {
  double psnr_db;     ///< at most kMaxPsnr_db
  double inside_rms;  ///< where the view shows the object
};

ViewError viewError(const LoadedField& field, const PosedView& view,
                    const CancellationToken& cancellation) {
  const PremultipliedImage truth = premultiply(*view.rgba);
  const std::vector<std::uint8_t> telling = tellingPixels(view, field.field().box);
  const Rendering rendering =
      field.render({view.camera, view.T_O_C}, RenderOptions(), cancellation);
  double squares = 0, inside_squares = 0;
  std::size_t pixels = 0, inside = 0;
  for (std::size_t i = 0; i < telling.size(); ++i) {
    if (!telling[i]) continue;
    double pixel_squares = 0;
    for (int c = 0; c < 3; ++c) {
      const double error = rendering.colour.values[3 * i + c] - truth.colour.values[3 * i + c];
      pixel_squares += error * error;
    }
    squares += pixel_squares;
    ++pixels;
    if (view.rgba->values[4 * i + 3] < 128) continue;
    inside_squares += pixel_squares;
    ++inside;
  }
  const auto mean = [](double sum, std::size_t n) {
    return n > 0 ? sum / (3.0 * static_cast<double>(n)) : 0;
  };
  return {std::min(kMaxPsnr_db, -10 * std::log10(mean(squares, pixels))),
          std::sqrt(mean(inside_squares, inside))};
}

}  // namespace

bool isTelling(const PosedView& view, const Box& box) {
  const std::vector<std::uint8_t> telling = tellingPixels(view, box);
  for (std::size_t i = 0; i < telling.size(); ++i) {
    if (telling[i] && view.rgba->values[4 * i + 3] >= 128) return true;
  }
  return false;
}

void measureQuality(Backend* backend, const std::vector<PosedView>& held_out,
                    const CancellationToken& cancellation, Field* field) {
  if (held_out.empty()) return;
  const auto loaded = backend->load(std::make_shared<Field>(*field));
  double psnr_sum = 0, sum = 0, squares = 0;
  for (const PosedView& view : held_out) {
    const ViewError error = viewError(*loaded, view, cancellation);
    psnr_sum += error.psnr_db;
    sum += error.inside_rms;
    squares += error.inside_rms * error.inside_rms;
  }
  const double n = static_cast<double>(held_out.size());
  field->metadata.psnr_db = psnr_sum / n;
  field->metadata.score.views = static_cast<int>(held_out.size());
  field->metadata.score.mean_loss = sum / n;
  field->metadata.score.stddev_loss = std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
}

double meanPsnr(const LoadedField& field, const std::vector<PosedView>& views,
                const CancellationToken& cancellation) {
  if (views.empty()) throw std::invalid_argument("PSNR of no views");
  double sum = 0;
  for (const PosedView& view : views) sum += viewError(field, view, cancellation).psnr_db;
  return sum / static_cast<double>(views.size());
}

}  // namespace nerf_pose_refiner
