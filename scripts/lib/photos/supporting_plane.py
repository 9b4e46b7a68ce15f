# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The plane that the object stands on, and the points above it, from the points of a reconstruction alone."""
import collections

import cv2
import numpy as np

from photos.common import require
from photos.geometry import focus, nearest

# n . x = d for points on it; n points to the cameras. `thickness`: points so near count as on it.
Plane = collections.namedtuple('Plane', 'n d thickness')
# Box of the object in the frame of the table: z up from 0, x along the longer side. `to_table` is R, t of that frame.
TableBox = collections.namedtuple('TableBox', 'low high R t points')

TRIALS = 2000
SEED = 1
THICKNESS = 0.006           # of the cameras' distance
MAX_BELOW = 0.04            # of the points: below the table there is nothing
MIN_ON_PLANE = 30
NEAR = 1.0                  # of the cameras' distance: points farther from where they look do not count
CELL = 0.035                # of the cameras' distance: points nearer than this hang together
MIN_OBJECT_POINTS = 30
BESIDE = 1.15               # times the object's half width and length: a point farther out is beside it
OUTLIERS = 0.01             # of the object's points, at each end of each axis
MARGIN = 0.4                # around the object's points, of their longest side: plain parts have no points
MAX_POINTS = 5000           # of the object, that are used
NEIGHBOURS = 8
STRAY = 2.5                 # times the median distance of a point's eighth neighbour: it does not belong to the object


def distance_of_cameras(reconstruction, point):
    return float(np.median(np.linalg.norm(reconstruction.centres() - point, axis=1)))


def near_points(reconstruction):
    """Points that several photos see, near to where the cameras look. @return (points, focus, distance of cameras)."""
    middle = focus(reconstruction)
    distance = distance_of_cameras(reconstruction, middle)
    points = reconstruction.reliable_points()
    return points[np.linalg.norm(points - middle, axis=1) < NEAR * distance], middle, distance


def fitted_plane(points, towards):
    """(n, d) of the plane nearest to the points, n towards a point."""
    mean = points.mean(axis=0)
    n = np.linalg.svd(points - mean, full_matrices=False)[2][2]
    if n @ (towards - mean) < 0:
        n = -n
    return n, n @ mean


def candidate(points, centres, thickness, three):
    """(number of points on the plane through three points, n, d), or None where it cannot be a table."""
    n = np.cross(three[1] - three[0], three[2] - three[0])
    length = np.linalg.norm(n)
    if length < 1e-12:
        return None
    n, d = n / length, 0
    if np.median(centres @ n - three[0] @ n) < 0:
        n = -n
    d = n @ three[0]
    heights = points @ n - d
    if np.mean(heights < -thickness) > MAX_BELOW or np.mean(centres @ n < d) > 0.05:
        return None
    return np.count_nonzero(np.abs(heights) < thickness), n, d


def find_plane(reconstruction):
    """The plane with most points of those that have all cameras above and nearly no points below.
    @throws InputError if there is none."""
    points, middle, distance = near_points(reconstruction)
    centres, thickness = reconstruction.centres(), THICKNESS * distance
    best = None
    if len(points) >= MIN_ON_PLANE:
        random = np.random.default_rng(SEED)
        for _ in range(TRIALS):
            found = candidate(points, centres, thickness, points[random.choice(len(points), 3, replace=False)])
            if found and (best is None or found[0] > best[0]):
                best = found
    require(best and best[0] >= MIN_ON_PLANE,
            'no table was found below the object: put it on something flat with texture (a printed board, a newspaper), '
            'or give --box')
    _, n, d = best
    for _ in range(3):
        n, d = fitted_plane(points[np.abs(points @ n - d) < thickness], centres.mean(axis=0))
    return Plane(n, d, thickness)


def is_above(points, plane):
    """Which points are surely not on the plane, but on the side of the cameras."""
    return points @ plane.n - plane.d > 1.5 * plane.thickness


def clusters(points, cell):
    """Number of the cluster of each point: cells of a grid that touch, also at a corner, hang together."""
    cells, inverse = np.unique(np.floor(points / cell).astype(int), axis=0, return_inverse=True)
    index = {tuple(c): i for i, c in enumerate(cells)}
    label = np.full(len(cells), -1)
    steps = np.array(np.meshgrid(*3 * [(-1, 0, 1)])).reshape(3, -1).T
    for first in range(len(cells)):
        if label[first] >= 0:
            continue
        label[first], waiting = first, [first]
        while waiting:
            for neighbour in map(tuple, cells[waiting.pop()] + steps):
                i = index.get(neighbour)
                if i is not None and label[i] < 0:
                    label[i] = first
                    waiting.append(i)
    return label[inverse.ravel()]


def without_strays(points):
    """Points that have others around them: wrong matches lie alone."""
    chosen = points[np.random.default_rng(SEED).permutation(len(points))[:MAX_POINTS]]
    if len(chosen) < 2:
        return chosen
    around = nearest(chosen, min(NEIGHBOURS, len(chosen) - 1))[0][:, -1]
    return chosen[around < STRAY * np.median(around)]


def points_above(reconstruction, plane):
    """Points of the object: the cluster above the plane with most points, where those count less that are far from
    where the cameras look."""
    points, middle, distance = near_points(reconstruction)
    above = points[is_above(points, plane)]
    require(len(above) >= MIN_OBJECT_POINTS,
            f'only {len(above)} points lie above the table: the object has too little texture, or is not on it; '
            'give --box')
    labels = clusters(above, CELL * distance)
    weights = np.exp(-0.5 * (np.linalg.norm(above - middle, axis=1) / (0.2 * distance)) ** 2)
    numbers, inverse = np.unique(labels, return_inverse=True)
    best = np.argmax(np.bincount(inverse, weights))
    chosen = without_strays(above[inverse == best])
    require(len(chosen) >= MIN_OBJECT_POINTS, f'the object has only {len(chosen)} points: give --box')
    return chosen


def table_axes(plane, points):
    """R of the table's frame, z up, x along the longer side of the smallest rectangle around the points."""
    x = np.cross(plane.n, np.eye(3)[np.argmin(np.abs(plane.n))])
    x /= np.linalg.norm(x)
    y = np.cross(plane.n, x)
    flat = np.column_stack((points @ x, points @ y))
    low, high = np.quantile(flat, OUTLIERS, axis=0), np.quantile(flat, 1 - OUTLIERS, axis=0)
    inside = np.all((flat >= low) & (flat <= high), axis=1)
    corners = cv2.boxPoints(cv2.minAreaRect(flat[inside].astype(np.float32)))
    sides = np.diff(corners[:3], axis=0)
    longer = sides[np.argmax(np.linalg.norm(sides, axis=1))]
    x = longer[0] * x + longer[1] * y
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(plane.n, x), plane.n])


def is_supported(reconstruction, plane, box):
    """Whether points beside the object lie on the plane, on three sides of it at least. Otherwise the plane may be one of
    the object's own: of a plain table there are no points."""
    points, _, _ = near_points(reconstruction)
    points = points[np.abs(points @ plane.n - plane.d) < plane.thickness] @ box.R.T + box.t
    half = np.max(np.abs(box.points @ box.R.T + box.t)[:, :2], axis=0)
    beside = points[np.any(np.abs(points[:, :2]) > BESIDE * half, axis=1), :2]
    sides = np.unique(np.sign(beside / half @ [[1, 1], [1, -1]]), axis=0)
    return len(beside) >= MIN_ON_PLANE and len(sides) >= 3


def box_of(points, plane):
    """Box around the object's points, in the table's frame; the frame's origin is on the table, below its middle."""
    R = table_axes(plane, points)
    p = points @ R.T
    p[:, 2] -= plane.d
    low, high = bounds(p)
    middle = 0.5 * (low + high)
    t = -np.array([middle[0], middle[1], plane.d])
    return TableBox(low + t * (1, 1, 0), high + t * (1, 1, 0), R, t, points)


def bounds(points):
    """(low, high) of the object in a frame whose table is z = 0: its points' without outliers, with a margin."""
    low, high = np.quantile(points, OUTLIERS, axis=0), np.quantile(points, 1 - OUTLIERS, axis=0)
    margin = MARGIN * (high - low).max()
    return np.array([*(low[:2] - margin), 0.0]), high + margin
