// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Where rays meet occupied space first. A part of cpu_kernels.inl, which says how it is compiled.

namespace nerf_pose_refiner {
namespace {

/// Rays side by side, one a lane.
struct RayLanes {
  Vector origin[3], direction[3], inverse[3], ahead[3], sign[3];
  Vector entry, exit;  // of the box
  Vector lattice;      // where interval 0 starts
};

/// Takes rays s to s + kLanes - 1.
inline void enterBox(const KernelSpace& space, const KernelRays& given, int s, RayLanes* rays) {
  Vector entry = broadcast(space.near), exit = broadcast(1e30f);
  for (int a = 0; a < 3; ++a) {
    const Vector o = load(given.origin[a] + s);
    Vector d = load(given.direction[a] + s);
    // An axis that the ray does not move along: its faces are very far away.
    d = select((d < 1e-12f) & (d > -1e-12f), broadcast(1e-12f), d);
    const Vector inverse = 1.0f / d;
    const Vector t0 = (space.box_min[a] - o) * inverse, t1 = (space.box_max[a] - o) * inverse;
    entry = maximum(entry, minimum(t0, t1));
    exit = minimum(exit, maximum(t0, t1));
    rays->origin[a] = o;
    rays->direction[a] = d;
    rays->inverse[a] = inverse;
    rays->ahead[a] = select(d < 0, Vector{}, broadcast(1));
    rays->sign[a] = select(d < 0, broadcast(-1), broadcast(1));
  }
  rays->entry = entry;
  rays->exit = exit;
  rays->lattice = entry - load(given.offset + s) * space.step;
}

inline IntVector cellsOf(Vector p, int n) {
  const Vector cell = minimum(maximum(p * (float)n, Vector{}), broadcast((float)(n - 1)));
  return __builtin_convertvector(cell, IntVector);
}

/// One step of kLanes rays at distances t: lanes in occupied cells, and for the others the way out
/// of the empty block around them.
inline IntVector lookAhead(const KernelSpace& space, const RayLanes& rays, Vector t, Vector* way) {
  Vector p[3];
  IntVector coarse[3], fine[3];
  for (int a = 0; a < 3; ++a) {
    p[a] = rays.origin[a] + t * rays.direction[a];
    coarse[a] = cellsOf(p[a], space.coarse);
    fine[a] = cellsOf(p[a], space.fine);
  }
  const IntVector block = (coarse[2] * space.coarse + coarse[1]) * space.coarse + coarse[0];
  const IntVector cell = (fine[2] * space.fine + fine[1]) * space.fine + fine[0];
  IntVector distance = {}, occupied_volume = {};
  for (int i = 0; i < kLanes; ++i) {
    distance[i] = space.distance[block[i]];
    occupied_volume[i] = -(space.bits[cell[i] >> 3] >> (cell[i] & 7) & 1);
  }
  const IntVector far = distance > 0;
  const Vector radius = select(far, __builtin_convertvector(distance - 1, Vector), Vector{});
  const Vector size =
      select(far, broadcast(1.0f / (float)space.coarse), broadcast(1.0f / (float)space.fine));
  *way = broadcast(1e30f);
  for (int a = 0; a < 3; ++a) {
    const Vector corner = __builtin_convertvector((coarse[a] & far) | (fine[a] & ~far), Vector);
    const Vector face = corner + rays.ahead[a] + radius * rays.sign[a];
    *way = minimum(*way, (face * size - p[a]) * rays.inverse[a]);
  }
  *way = maximum(*way, Vector{});
  return occupied_volume & ~far;
}

void firstSamples(const KernelSpace& space, const KernelRays& given, int32_t* first) {
  const float inverse_step = 1.0f / space.step;
  for (int s = 0; s < given.count; s += kLanes) {
    RayLanes rays;
    enterBox(space, given, s, &rays);
    IntVector k = {}, result = (IntVector){} - 1;
    IntVector active = rays.entry < rays.exit;
    while (true) {
      const Vector begin = rays.lattice + __builtin_convertvector(k, Vector) * space.step;
      active &= begin < rays.exit;
      int any = 0;
      for (int i = 0; i < kLanes; ++i) any |= active[i];
      if (!any) break;
      // Lanes that are done stay where they are: at the box's exit at most.
      const Vector t = 0.5f * (minimum(maximum(begin, rays.entry), rays.exit) +
                               minimum(begin + space.step, rays.exit));
      Vector way;
      const IntVector found = lookAhead(space, rays, t, &way) & active;
      result = (result & ~found) | (k & found);
      active &= ~found;
      const Vector leave = minimum(t + way, rays.exit + space.step);
      const IntVector next =
          __builtin_convertvector((leave - rays.lattice) * inverse_step + 0.5f, IntVector);
      const IntVector at_least = k + 1;
      const IntVector later = next > at_least;
      k = (active & ((next & later) | (at_least & ~later))) | (k & ~active);
    }
    memcpy(first + s, &result, sizeof result);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
