# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Scale and frame of a reconstruction: from a board in the photos, or from a known length."""
import collections

import numpy as np

from photos.common import count, require
from photos.geometry import similarity, triangulated

# scale: metres of a unit; sigma: its standard deviation, as a share of it. R, t: from the scaled world to the board.
Scale = collections.namedtuple('Scale', 'metres_per_unit sigma R t corners')

MIN_VIEWS = 3
MIN_CORNERS = 6
OUTLIER = 4.0        # times the median residual
MAX_RESIDUAL = 0.02  # of the board's size: more is not that board


def corner_points(reconstruction, corners):
    """Where the board's corners lie in the world. @param corners [(photo, {number: xy})]. @return {number: point}."""
    seen = collections.defaultdict(list)
    for photo, found in corners:
        for number, xy in found.items():
            seen[number].append((photo, xy))
    points = {}
    for number, views in seen.items():
        if len(views) >= MIN_VIEWS:
            photos, xy = zip(*views)
            points[number], _ = triangulated(reconstruction, list(photos), np.array(xy))
    return points


def scale_from_board(reconstruction, corners, board_points):
    """@param board_points {number: point on the board [m]}, z up. @throws InputError if the board is not seen enough, or
    is another one."""
    found = corner_points(reconstruction, corners)
    numbers = sorted(set(found) & set(board_points))
    require(len(numbers) >= MIN_CORNERS,
            f'the board was found with {count(len(numbers), "corner")} in {count(len(corners), "photo")} with a pose: at '
            f'least {MIN_CORNERS} corners must be sharp in {MIN_VIEWS} photos each. Is it the board that --board names?')
    source = np.array([found[number] for number in numbers])
    target = np.array([board_points[number] for number in numbers])
    kept = np.ones(len(numbers), bool)
    for _ in range(3):
        scale, R, t = similarity(source[kept], target[kept])
        residual = np.linalg.norm(scale * source @ R.T + t - target, axis=1)
        kept = residual <= OUTLIER * np.median(residual) + 1e-12
    size = float(np.linalg.norm(np.ptp(target, axis=0)))
    rms = float(np.sqrt(np.mean(residual[kept] ** 2)))
    require(rms < MAX_RESIDUAL * size,
            f'the corners lie {1000 * rms:.1f} mm beside those of the board: it is not the one that --board names, or it '
            'was moved or bent')
    spread = target[kept] - target[kept].mean(axis=0)
    sigma = rms / np.sqrt(3) / float(np.sqrt((spread ** 2).sum()))
    return Scale(scale, sigma, R, t, int(kept.sum()))


def scale_from_length(reconstruction, length_m, marks):
    """From two points of known distance, each marked in the same two photos or more.
    @param marks [(photo, xy of the first point, xy of the second)]. @return metres of a unit."""
    photos = [photo for photo, _, _ in marks]
    require(len(set(photos)) >= 2, 'a known length needs its two ends marked in two photos with poses')
    ends = [triangulated(reconstruction, photos, np.array([mark[end] for mark in marks], dtype=float))[0]
            for end in (1, 2)]
    distance = float(np.linalg.norm(ends[0] - ends[1]))
    require(distance > 0 and length_m > 0, 'the two ends of the known length are the same point')
    return length_m / distance
