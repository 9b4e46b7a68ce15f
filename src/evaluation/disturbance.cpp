// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/disturbance.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

// Streams of random numbers; per-pixel ones add the image's number.
enum Stream : std::uint64_t {
  kGainBias = 77,
  kOccluder = 78,
  kGaussianDraws = 1000,
  kPoisson = 2000000,
  kDiscDraws = 4000000,
  kMotion = 4000001,
};

float clipped(float value) { return std::min(1.0f, std::max(0.0f, value)); }

/// Nearly Gaussian, of deviation 1: the sum of twelve uniform numbers.
float nearlyGaussian(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter) {
  float sum = -6;
  for (int k = 0; k < 12; ++k) sum += randomUniform(seed, stream, 12 * counter + k);
  return sum;
}

/// Poisson-distributed: by Knuth's products of uniform numbers, or as good as Gaussian.
int drawnCount(double mean, std::uint64_t seed, std::uint64_t stream, std::uint64_t counter) {
  constexpr double kMany = 30;
  constexpr int kMax = 100;  // of draws for a mean of kMany: never reached
  if (mean > kMany) {
    const double drawn = mean + std::sqrt(mean) * nearlyGaussian(seed, stream + 1, counter);
    return static_cast<int>(std::max(0.0, std::round(drawn)));
  }
  double product = 1;
  for (int k = 0; k < kMax; ++k) {
    product *= randomUniform(seed, stream, kMax * counter + k);
    if (product <= std::exp(-mean)) return k;
  }
  return kMax;
}

cv::Mat matOf(Image* image) {
  return cv::Mat(image->height, image->width, CV_32FC(image->channels), image->values.data());
}

/// Numbers of the pixels of the object that have a neighbour beyond it.
std::vector<int> edgePixels(const Image& alpha) {
  std::vector<int> edge;
  for (int y = 1; y + 1 < alpha.height; ++y) {
    for (int x = 1; x + 1 < alpha.width; ++x) {
      if (alpha.at(x, y, 0) < 0.5f) continue;
      const float least = std::min({alpha.at(x - 1, y, 0), alpha.at(x + 1, y, 0),
                                    alpha.at(x, y - 1, 0), alpha.at(x, y + 1, 0)});
      if (least < 0.5f) edge.push_back(y * alpha.width + x);
    }
  }
  return edge;
}

}  // namespace

void brighten(double amount, Image* straight) {
  for (std::size_t i = 0; i < straight->pixels(); ++i) {
    float* rgb = straight->values.data() + 3 * i;
    const float value = std::max({rgb[0], rgb[1], rgb[2]});
    const float brighter = std::min(1.0f, value + static_cast<float>(amount));
    for (int c = 0; c < 3; ++c) rgb[c] = value > 0 ? rgb[c] * (brighter / value) : brighter;
  }
}

void addGaussianNoise(double deviation, const DisturbanceDraw& draw, Image* image) {
  for (std::size_t i = 0; i < image->values.size(); ++i) {
    float& value = image->values[i];
    value = clipped(value + static_cast<float>(deviation) *
                                nearlyGaussian(draw.seed, kGaussianDraws + draw.index, i));
  }
}

void addPoissonNoise(const DisturbanceDraw& draw, Image* image) {
  for (std::size_t i = 0; i < image->values.size(); ++i) {
    float& value = image->values[i];
    value = clipped(drawnCount(255.0 * value, draw.seed, kPoisson + 2 * draw.index, i) / 255.0f);
  }
}

void cutDiscs(int count, double radius_px, const DisturbanceDraw& draw, PremultipliedImage* image) {
  const std::vector<int> edge = edgePixels(image->alpha);
  if (edge.empty()) return;  // an image that the object fills
  const int width = image->alpha.width;
  for (int k = 0; k < count; ++k) {
    const int centre = edge[randomIndex(draw.seed, kDiscDraws, draw.index * 1000 + k,
                                        static_cast<std::uint32_t>(edge.size()))];
    for (int y = 0; y < image->alpha.height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double dx = x - centre % width, dy = y - centre / width;
        if (dx * dx + dy * dy > radius_px * radius_px) continue;
        image->alpha.at(x, y, 0) = 0;
        for (int c = 0; c < 3; ++c) image->colour.at(x, y, c) = 0;
      }
    }
  }
}

void applyGainBias(double amount, const DisturbanceDraw& draw, PremultipliedImage* image) {
  const Image& alpha = image->alpha;
  for (int c = 0; c < 3; ++c) {
    const auto drawn = [&](int k) {
      return 2 * randomUniform(draw.seed, kGainBias, 6 * draw.index + 2 * c + k) - 1;
    };
    const float gain = 1 + static_cast<float>(amount) * drawn(0);
    const float bias = static_cast<float>(amount) / 6 * drawn(1);
    for (std::size_t i = 0; i < alpha.pixels(); ++i) {
      float& value = image->colour.values[3 * i + c];
      value = std::min(std::max(gain * value + bias * alpha.values[i], 0.0f), alpha.values[i]);
    }
  }
}

double occlude(double fraction, const DisturbanceDraw& draw, const Image& alpha, Image* image) {
  int x0 = alpha.width, y0 = alpha.height, x1 = 0, y1 = 0;
  double object = 0, hidden = 0;  // pixels
  for (int y = 0; y < alpha.height; ++y) {
    for (int x = 0; x < alpha.width; ++x) {
      if (alpha.at(x, y, 0) < 0.5f) continue;
      x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
      ++object;
    }
  }
  if (x1 < x0) return 0;
  const double side = std::sqrt(fraction * (x1 - x0) * (y1 - y0));
  const auto drawn = [&](int k) { return randomUniform(draw.seed, kOccluder, 2 * draw.index + k); };
  const int left = x0 + static_cast<int>((x1 - x0 - side) * drawn(0));
  const int top = y0 + static_cast<int>((y1 - y0 - side) * drawn(1));
  for (int y = std::max(0, top); y < std::min<int>(alpha.height, top + side); ++y) {
    for (int x = std::max(0, left); x < std::min<int>(alpha.width, left + side); ++x) {
      const float stripe = (x / 8 + y / 8) % 2 ? 0.35f : 0.25f;
      for (int c = 0; c < 3; ++c) image->at(x, y, c) = stripe + 0.05f * c;
      if (alpha.at(x, y, 0) >= 0.5f) ++hidden;
    }
  }
  return hidden / object;
}

void blurByMotion(double length_px, const DisturbanceDraw& draw, Image* image) {
  const double direction = 3.14159265358979323846 * randomUniform(draw.seed, kMotion, draw.index);
  const double half_x = 0.5 * length_px * std::cos(direction);
  const double half_y = 0.5 * length_px * std::sin(direction);
  const int reach = static_cast<int>(std::ceil(0.5 * length_px)) + 1;
  cv::Mat path = cv::Mat::zeros(2 * reach + 1, 2 * reach + 1, CV_32F);
  const int steps = 8 * (2 * reach + 1);
  for (int k = 0; k < steps; ++k) {  // each moment's part goes to the four pixels around it
    const double t = 2 * (k + 0.5) / steps - 1;
    const double x = reach + t * half_x, y = reach + t * half_y;
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const double right_fraction = x - left, lower_fraction = y - top;
    path.at<float>(top, left) += static_cast<float>((1 - right_fraction) * (1 - lower_fraction));
    path.at<float>(top, left + 1) += static_cast<float>(right_fraction * (1 - lower_fraction));
    path.at<float>(top + 1, left) += static_cast<float>((1 - right_fraction) * lower_fraction);
    path.at<float>(top + 1, left + 1) += static_cast<float>(right_fraction * lower_fraction);
  }
  path /= steps;
  cv::Mat blurred;
  cv::filter2D(matOf(image), blurred, -1, path, cv::Point(-1, -1), 0, cv::BORDER_REPLICATE);
  blurred.copyTo(matOf(image));
  for (float& value : image->values) value = clipped(value);
}

void defocus(double sigma_px, Image* image) {
  cv::Mat blurred;
  cv::GaussianBlur(matOf(image), blurred, cv::Size(), sigma_px, sigma_px, cv::BORDER_REPLICATE);
  blurred.copyTo(matOf(image));
}

}  // namespace nerf_pose_refiner
