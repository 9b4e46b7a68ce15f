// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Sums over points of an outline. A part of keyframe_kernels.inl, which says how it is compiled.

namespace nerf_pose_refiner {
namespace {

/// Points of an outline in the frame.
struct SeenOutline {
  // A mask. Unseen are those whose normal is seen end-on, or leaves the image or what has weight.
  IntVector seen;
  Vec3<Vector> point;
  OutlineInImage<Vector> place;
  OutlineOpacities<Vector> opacities;  // as the frame shows them
};

inline Vec3<Vector> loadVectors(const float (*columns)[kPointGroup], int first) {
  return {load(columns[0] + first), load(columns[1] + first), load(columns[2] + first)};
}

/// @return whether these places lie in the image, and show something.
inline IntVector samplePlaces(const KernelImage& image, Vector x, Vector y, Vector colour[3]) {
  const float right = (float)(image.width - 1), bottom = (float)(image.height - 1);
  const IntVector inside = (x >= 0.0f) & (x < right) & (y >= 0.0f) & (y < bottom);
  Projected places;
  IntVector column, row;
  splitCoordinate(x, image.width - 2, &column, &places.u);
  splitCoordinate(y, image.height - 2, &row, &places.v);
  places.offset = 4 * (row * image.row_pixels + column);
  float pixels[kLanes][4], channels[4][kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    const Channels pixel = interpolateAt(image, places, lane).value;
    memcpy(pixels[lane], &pixel, sizeof pixel);
  }
  for (int c = 0; c < 4; ++c) {
    for (int lane = 0; lane < kLanes; ++lane) channels[c][lane] = pixels[lane][c];
  }
  for (int c = 0; c < 3; ++c) colour[c] = load(channels[c]);
  return inside & (load(channels[3]) >= kOutlineSeen);
}

inline SeenOutline lookAtOutline(const KernelView& view, const OutlineGroup& group, int first) {
  SeenOutline outline;
  outline.point = loadVectors(group.point, first);
  outline.place =
      placeOutline(view.image.K, view.pose, outline.point, loadVectors(group.normal, first));
  const OutlineInImage<Vector>& place = outline.place;
  outline.seen = place.isInSight();
  OutlineProfile<Vector> profile;
  for (int i = 0; i < kOutlinePlaces; ++i) {
    const float s = (float)(i - kOutlineReach);
    outline.seen &= samplePlaces(view.image, place.middle.u + s * place.step.u,
                                 place.middle.v + s * place.step.v, profile.colour[i]);
  }
  outline.opacities = outlineOpacities(profile);
  return outline;
}

inline OutlineLook<Vector> loadLook(const OutlineGroup& group, int first) {
  OutlineLook<Vector> look;
  for (int i = 0; i < kOutlineOpacities; ++i) {
    look.opacity[i] = load(group.opacity[i] + first);
    for (int c = 0; c < 3; ++c) look.shade[i][c] = load(group.shade[i][c] + first);
  }
  return look;
}

inline OutlineRules<Vector> rulesFor(IntVector seen, const OutlineRules<float>& rules) {
  return {Vector{} + rules.robust_scale, choose(seen, Vector{} + rules.weight, Vector{})};
}

int sumOutline(const KernelView& view, const OutlineTile& tile, const OutlineRules<float>& rules,
               PointSums<float>* sums) {
  PointSums<Vector> lanes = {};
  IntVector seen = {};
  for (int i = tile.first; i < tile.last; ++i) {
    const OutlineGroup& group = tile.groups[i];
    for (int first = 0; first < kPointGroup; first += kLanes) {
      const SeenOutline outline = lookAtOutline(view, group, first);
      Vector along[6];
      flowAlongNormal(view.image.K, view.pose, outline.point, outline.place, along);
      for (int k = 0; k < 6; ++k) along[k] = choose(outline.seen, along[k], Vector{});
      addOutlinePoint(loadLook(group, first), outline.opacities, along,
                      rulesFor(outline.seen, rules), &lanes);
      seen += outline.seen;  // a mask is -1 where it is true
    }
  }
  addLanes(lanes, sums);
  int count = 0;
  for (int lane = 0; lane < kLanes; ++lane) count -= seen[lane];
  return count;
}

void sumOutlineEvidence(const KernelView& view, const OutlineTile& tile,
                        const OutlineRules<float>& rules, EvidenceSums<float>* sums) {
  EvidenceSums<Vector> lanes = {};
  for (int i = tile.first; i < tile.last; ++i) {
    for (int first = 0; first < kPointGroup; first += kLanes) {
      const SeenOutline outline = lookAtOutline(view, tile.groups[i], first);
      addOutlineEvidence(loadLook(tile.groups[i], first), outline.opacities,
                         rulesFor(outline.seen, rules), &lanes);
    }
  }
  addLanes(lanes, sums);
}

}  // namespace
}  // namespace nerf_pose_refiner
