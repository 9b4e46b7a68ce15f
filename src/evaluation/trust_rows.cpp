// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trust_rows.h"

#include <algorithm>
#include <cmath>

#include "evaluation/trial_observation.h"
#include "image/resample.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kClearBefore = 4, kHidden = 10, kClearAfter = 14;  // images
constexpr float kNoise = 0.03f;

/// Pixels left <= x < right, top <= y < bottom.
struct Rectangle {
  double left, top, right, bottom;

  double width() const { return right - left; }
  double height() const { return bottom - top; }
};

Rectangle rectangleOf(const Image& alpha) {
  Rectangle box = {static_cast<double>(alpha.width), static_cast<double>(alpha.height), 0, 0};
  for (int y = 0; y < alpha.height; ++y) {
    for (int x = 0; x < alpha.width; ++x) {
      if (alpha.at(x, y, 0) < 0.5f) continue;
      box = {std::min<double>(box.left, x), std::min<double>(box.top, y),
             std::max(box.right, x + 1.0), std::max(box.bottom, y + 1.0)};
    }
  }
  return box;
}

Rectangle grown(const Rectangle& box, double fraction) {
  const double x = fraction * box.width(), y = fraction * box.height();
  return {box.left - x, box.top - y, box.right + x, box.bottom + y};
}

/// Calls with every pixel of a rectangle, or of the ellipse in it, that is in the image.
template <typename Function>
void forPixels(const Rectangle& box, bool ellipse, const Image& image, const Function& function) {
  const double cx = 0.5 * (box.left + box.right), cy = 0.5 * (box.top + box.bottom);
  for (int y = std::max(0, static_cast<int>(box.top));
       y < std::min<double>(image.height, box.bottom); ++y) {
    for (int x = std::max(0, static_cast<int>(box.left));
         x < std::min<double>(image.width, box.right); ++x) {
      const double u = 2 * (x - cx) / box.width(), v = 2 * (y - cy) / box.height();
      if (!ellipse || u * u + v * v <= 1) function(x, y);
    }
  }
}

void fill(const Rectangle& box, bool ellipse, float tone, Image* image) {
  forPixels(box, ellipse, *image, [&](int x, int y) {
    for (int c = 0; c < 3; ++c) image->at(x, y, c) = tone;
  });
}

Image photoOf(const TrustScene& scene) {
  Image photo = scene.object.colour;
  for (std::size_t i = 0; i < photo.values.size(); ++i) {
    photo.values[i] += (1 - scene.object.alpha.values[i / 3]) * scene.behind.values[i];
  }
  return photo;
}

TrustImage imageOf(const TrustScene& scene, Image image, bool shows_object = true) {
  TrustImage shown;
  shown.observation.image = std::move(image);
  shown.observation.camera = scene.camera;
  shown.shows_object = shows_object;
  return shown;
}

TrustImage clear(const TrustScene& scene) { return imageOf(scene, photoOf(scene)); }

Image plain(const TrustScene& scene, float tone) {
  return Image(scene.camera.width, scene.camera.height, 3, tone);
}

/// Clear images, then some that something happens to, then clear ones again.
std::vector<TrustImage> between(const TrustScene& scene, int count,
                                const std::function<TrustImage(int)>& disturbed) {
  std::vector<TrustImage> images(kClearBefore, clear(scene));
  for (int i = 0; i < count; ++i) images.push_back(disturbed(i));
  for (int i = 0; i < kClearAfter; ++i) images.push_back(clear(scene));
  return images;
}

/// A rectangle, as high as the object and so wide in its widths, passes before it.
std::vector<TrustImage> passes(const TrustScene& scene, double width, float tone) {
  const Rectangle box = rectangleOf(scene.object.alpha);
  return between(scene, kHidden, [&](int i) {
    const double progress = (i + 0.5) / kHidden;
    Rectangle bar = grown(box, 0.1);
    bar.left = box.left + box.width() * (progress * (1 + width) - width);
    bar.right = bar.left + width * box.width();
    Image image = photoOf(scene);
    fill(bar, false, tone, &image);
    return imageOf(scene, std::move(image));
  });
}

std::vector<TrustImage> isCovered(const TrustScene& scene) {
  return between(scene, kHidden, [&](int) {
    Image image = photoOf(scene);
    fill(grown(rectangleOf(scene.object.alpha), 0.1), false, 0.02f, &image);
    return imageOf(scene, std::move(image), false);
  });
}

std::vector<TrustImage> isPlain(const TrustScene& scene, float tone) {
  return between(scene, kHidden / 2,
                 [&](int) { return imageOf(scene, plain(scene, tone), false); });
}

/// Another light from one image to the next.
std::vector<TrustImage> isSwitched(const TrustScene& scene) {
  return between(scene, kHidden, [&](int) {
    Image image = photoOf(scene);
    const float gain[3] = {0.7f, 0.55f, 0.45f};
    for (std::size_t i = 0; i < image.values.size(); ++i) image.values[i] *= gain[i % 3];
    return imageOf(scene, std::move(image));
  });
}

Image greyOf(Image image) {
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    float* rgb = image.values.data() + 3 * i;
    const float grey = 0.299f * rgb[0] + 0.587f * rgb[1] + 0.114f * rgb[2];
    std::fill_n(rgb, 3, std::round(255 * grey) / 255);
  }
  return image;
}

/// Boxes and ellipses in the object's place, of five tones, with and without noise.
std::vector<TrustImage> boxes(const TrustScene& scene) {
  std::vector<TrustImage> images;
  const Rectangle box = grown(rectangleOf(scene.object.alpha), 0.05);
  for (const float tone : {0.0f, 0.08f, 0.16f, 0.5f, 0.9f}) {
    for (const bool ellipse : {false, true}) {
      Image image = photoOf(scene);
      fill(box, ellipse, tone, &image);
      if (images.size() % 4 >= 2) addGaussianNoise(kNoise, scene.draw, &image);
      images.push_back(imageOf(scene, std::move(image), false));
    }
  }
  return images;
}

/// A clear image with the object's mask, changed.
std::vector<TrustImage> masked(const TrustScene& scene,
                               const std::function<void(Image* mask)>& change) {
  TrustImage shown = clear(scene);
  shown.observation.background = Background::kMask;
  Image& mask = shown.observation.alpha;
  mask = scene.object.alpha;
  for (float& value : mask.values) value = value > 0.5f ? 1.0f : 0.0f;
  change(&mask);
  return {shown};
}

void shift(int pixels, Image* mask) {
  Image moved(mask->width, mask->height, 1);
  for (int y = 0; y < mask->height; ++y) {
    for (int x = std::max(0, pixels); x < mask->width; ++x) {
      moved.at(x, y, 0) = mask->at(x - pixels, y, 0);
    }
  }
  *mask = moved;
}

std::vector<TrustImage> mirrored(const TrustScene& scene) {
  TrustScene other = scene;
  const Rectangle box = rectangleOf(scene.object.alpha);
  for (int y = 0; y < scene.camera.height; ++y) {
    for (int x = 0; x < scene.camera.width; ++x) {
      const int from = static_cast<int>(box.left + box.right) - 1 - x;
      const bool inside = from >= 0 && from < scene.camera.width;
      other.object.alpha.at(x, y, 0) = inside ? scene.object.alpha.at(from, y, 0) : 0;
      for (int c = 0; c < 3; ++c) {
        other.object.colour.at(x, y, c) = inside ? scene.object.colour.at(from, y, c) : 0;
      }
    }
  }
  return {imageOf(scene, photoOf(other), false)};
}

std::vector<TrustImage> covered(const TrustScene& scene, double fraction) {
  Image image = photoOf(scene);
  occlude(fraction, scene.draw, scene.object.alpha, &image);
  return {imageOf(scene, std::move(image))};
}

std::vector<TrustImage> inOtherLight(const TrustScene& scene) {
  TrustScene lit = scene;
  applyGainBias(0.3, scene.draw, &lit.object);
  return {clear(lit)};
}

std::vector<TrustImage> disturbed(const TrustScene& scene,
                                  const std::function<void(Image*)>& disturb) {
  Image image = photoOf(scene);
  disturb(&image);
  return {imageOf(scene, std::move(image))};
}

std::vector<TrustRow> trackedRows() {
  using Scene = TrustScene;
  return {
      {"a black bar passes, half the object's width", true, 1,
       [](const Scene& s) { return passes(s, 0.5, 0.02f); }},
      {"a black rectangle passes, as wide as it", true, 1,
       [](const Scene& s) { return passes(s, 1, 0.02f); }},
      {"a grey rectangle passes, as wide as it", true, 1,
       [](const Scene& s) { return passes(s, 1, 0.5f); }},
      {"covered by a black rectangle", true, 1, isCovered},
      {"black images", true, 1, [](const Scene& s) { return isPlain(s, 0); }},
      {"white images", true, 1, [](const Scene& s) { return isPlain(s, 1); }},
      {"the light is switched", true, 1, isSwitched},
  };
}

std::vector<TrustRow> maskRows() {
  using Scene = TrustScene;
  return {
      {"the true mask", false, 1, [](const Scene& s) { return masked(s, [](Image*) {}); }},
      {"an empty mask", false, 1,
       [](const Scene& s) {
         return masked(s, [](Image* m) { std::fill(m->values.begin(), m->values.end(), 0.0f); });
       }},
      {"an inverted mask", false, 1,
       [](const Scene& s) {
         return masked(s, [](Image* m) {
           for (float& value : m->values) value = 1 - value;
         });
       }},
      {"a mask that is shifted by its width", false, 1,
       [](const Scene& s) {
         const int width = static_cast<int>(rectangleOf(s.object.alpha).width());
         return masked(s, [width](Image* m) { shift(width, m); });
       }},
  };
}

std::vector<TrustRow> searchedRows() {
  using Scene = TrustScene;
  return {
      {"the object as it is", false, 1, [](const Scene& s) { return std::vector{clear(s)}; }},
      {"the same, grey", false, 1,
       [](const Scene& s) { return std::vector{imageOf(s, greyOf(photoOf(s)))}; }},
      {"starts twice as far off", false, 2, [](const Scene& s) { return std::vector{clear(s)}; }},
      {"a quarter of its box covered", false, 1, [](const Scene& s) { return covered(s, 0.25); }},
      {"half of its box covered", false, 1, [](const Scene& s) { return covered(s, 0.5); }},
      {"other light", false, 1, inOtherLight},
      {"motion blur, 1 % of the width", false, 1,
       [](const Scene& s) {
         return disturbed(s, [&](Image* i) { blurByMotion(0.01 * s.camera.width, s.draw, i); });
       }},
      {"noise of 0.05", false, 1,
       [](const Scene& s) {
         return disturbed(s, [&](Image* i) { addGaussianNoise(0.05, s.draw, i); });
       }},
      {"boxes and ellipses in its place", false, 1, boxes},
      {"what is behind it alone", false, 1,
       [](const Scene& s) { return std::vector{imageOf(s, s.behind, false)}; }},
      {"its mirror image", false, 1, mirrored},
  };
}

}  // namespace

TrustScene TrustScene::of(const PosedView& view, int width, const std::vector<std::string>& photos,
                          DisturbanceDraw draw) {
  TrialObservation how;
  how.background = "alpha";
  const Observation known = how.of(view, draw.index);
  TrialObservation empty;
  empty.background = "photo";
  empty.photos = photos;
  empty.seed = draw.seed;
  PosedView nothing = view;
  nothing.rgba = std::make_shared<const Image8>(view.rgba->width, view.rgba->height, 4);
  const Observation behind = empty.of(nothing, draw.index);
  const double scale = std::min(1.0, static_cast<double>(width) / view.camera.width);
  TrustScene scene;
  scene.camera = view.camera.scaled(scale);
  scene.T_O_C = view.T_O_C;
  scene.object.colour = resample(known.image, view.camera, scene.camera);
  scene.object.alpha = resample(known.alpha, view.camera, scene.camera);
  scene.behind = resample(behind.image, view.camera, scene.camera);
  scene.draw = draw;
  return scene;
}

const std::vector<TrustRow>& trustRows() {
  static const std::vector<TrustRow> rows = [] {
    std::vector<TrustRow> all = searchedRows();
    for (const TrustRow& row : maskRows()) all.push_back(row);
    for (const TrustRow& row : trackedRows()) all.push_back(row);
    return all;
  }();
  return rows;
}

}  // namespace nerf_pose_refiner
