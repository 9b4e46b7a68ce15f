# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""How much of an object is seen, by casting rays at the meshes. Needs Blender's mathutils."""
import math

import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

GRID = 72  # rays across the object's bounding square


class Surface:
    """The triangles of an object's parts, in the object's frame. `labelled`: whether a polygon is the label's."""

    def __init__(self, parts, label=None):
        self.vertices, self.polygons, self.labelled = [], [], []
        for part in parts:
            first = len(self.vertices)
            self.vertices += [tuple(v.co) for v in part.data.vertices]
            materials = [m.name for m in part.data.materials]
            for polygon in part.data.polygons:
                self.polygons.append([first + i for i in polygon.vertices])
                self.labelled.append(materials[polygon.material_index] == label)
        self.tree = BVHTree.FromPolygons(self.vertices, self.polygons)

    def points(self):
        return np.array(self.vertices)

    def write_obj(self, path, name):
        """Wavefront OBJ of triangles, in metres."""
        with open(path, "w") as file:
            file.write("o %s\n" % name)
            file.writelines("v %.6f %.6f %.6f\n" % v for v in self.vertices)
            for polygon in self.polygons:
                corners = [i + 1 for i in polygon]
                file.writelines("f %d %d %d\n" % (corners[0], *pair) for pair in zip(corners[1:], corners[2:]))


class View:
    """Rays of a pinhole camera through a surface's bounding square; pixel centres are integers."""

    def __init__(self, width, height, focal_px):
        self.width, self.height, self.focal_px = width, height, focal_px
        self.cx, self.cy = (width - 1) / 2, (height - 1) / 2

    def _square(self, points_O, T_C_O):
        seen = points_O @ T_C_O[:3, :3].T + T_C_O[:3, 3]
        uv = seen[:, :2] / seen[:, 2:] * self.focal_px + [self.cx, self.cy]
        low, high = uv.min(axis=0), uv.max(axis=0)
        return (low + high) / 2, float((high - low).max())

    def visibility(self, surface, T_C_O, occluder=None, T_C_X=None):
        """@return (visible_fraction, label_fraction, label_px): the part of the silhouette that is in the image with
        nothing before it; the label's part of what is seen; the label's area in pixels."""
        middle, side = self._square(surface.points(), T_C_O)
        step = side / GRID
        into_O = Matrix(np.linalg.inv(T_C_O))
        into_X = Matrix(np.linalg.inv(T_C_X)) if occluder else None
        silhouette = seen = label = 0
        for v in middle[1] + step * (np.arange(GRID) + 0.5 - GRID / 2):
            for u in middle[0] + step * (np.arange(GRID) + 0.5 - GRID / 2):
                direction = Vector(((u - self.cx) / self.focal_px, (v - self.cy) / self.focal_px, 1.0)).normalized()
                hit, _, polygon, distance = _cast(surface, into_O, direction)
                if hit is None:
                    continue
                silhouette += 1
                inside = -0.5 <= u < self.width - 0.5 and -0.5 <= v < self.height - 0.5
                if inside and not (occluder and _cast(occluder, into_X, direction, distance)[0]):
                    seen += 1
                    label += surface.labelled[polygon]
        return seen / max(1, silhouette), label / max(1, seen), label * step * step


def _cast(surface, into, direction, reach=math.inf):
    """Casts a ray from the camera's centre. @param into: from the camera's frame to the surface's."""
    return surface.tree.ray_cast(into.translation, into.to_3x3() @ direction, min(reach, 100.0))
