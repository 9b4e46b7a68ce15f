# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Where the object is: its frame with the table at z = 0, its scale and its box; all from points, a board, or the user."""
import dataclasses

import numpy as np

from photos.common import InputError, require
from photos.geometry import focus
from photos.intake import pixel_of_copy
from photos.mask_volume import MIN_VOTES
from photos.reconstruction import Reconstruction
from photos.scale import scale_from_length
from photos.supporting_plane import (MAX_POINTS, MIN_OBJECT_POINTS, OUTLIERS, SEED, THICKNESS, Plane, bounds, box_of,
                                     find_plane, is_above, is_supported, points_above, without_strays)
from photos.targets import scale_from_target

DEPTH = 0.12            # below a plane that may not be the table, of the object's size: the object may reach so far
MIN_LEVEL = 0.1         # of horizontal axes: their spread in the second direction over that in the first
UNIT_OF_UNSCALED = 1.0  # the longest side of the box, where no scale is known


@dataclasses.dataclass
class Region:
    reconstruction: Reconstruction   # in the object's frame; in metres if the scale is known
    low: np.ndarray                  # box, in which the object is searched
    high: np.ndarray
    is_given: bool                   # whether the box is the user's
    points: np.ndarray               # of the object
    table_is_known: bool             # it is the plane z = 0
    metres_per_unit: float           # 1, or 0: unknown
    sigma: float = 0.0               # of the scale, as a share of it; 0: unknown
    origin: str = ''                 # of scale and frame, for the report
    has_bottom: bool = True          # the box's bottom is the table, or low enough


def scaled(region, metres_per_unit):
    """The region in metres, or with a box of longest side 1 where the scale is not known."""
    known = metres_per_unit > 0
    factor = metres_per_unit if known else UNIT_OF_UNSCALED / float((region.high - region.low).max())
    return dataclasses.replace(region, reconstruction=region.reconstruction.moved(factor, np.eye(3), np.zeros(3)),
                               low=factor * region.low, high=factor * region.high, points=factor * region.points,
                               metres_per_unit=1.0 if known else 0.0)


def on_found_table(reconstruction):
    plane = find_plane(reconstruction)
    box = box_of(points_above(reconstruction, plane), plane)
    moved = reconstruction.moved(1, box.R, box.t)
    points = box.points @ box.R.T + box.t
    if is_supported(reconstruction, plane, box):
        return Region(moved, box.low, box.high, False, points, True, 0, 0, 'z = 0 is the table, found by its texture')
    low = box.low - (0, 0, DEPTH * np.ptp(points, axis=0).max())
    return Region(moved, low, box.high, False, points, False, 0, 0, 'z is up; the table has too little texture to be found: '
                  'the masks alone say where the object ends')


def points_in_masks(reconstruction, photos):
    """Reliable points that nearly all photos which show them take for the object. @param photos that are cut out"""
    points = reconstruction.reliable_points()
    seen, inside_mask = np.zeros(len(points), int), np.zeros(len(points), int)
    for i, photo in enumerate(photos):
        height, width = photo.cut_out.shape
        with np.errstate(invalid='ignore'):
            x, y = np.floor(photo.camera.pixels(points @ reconstruction.R[i].T + reconstruction.t[i])).T
            shown = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        seen += shown
        inside_mask[shown] += photo.cut_out[y[shown].astype(int), x[shown].astype(int)] > 0
    return points[(seen > 0) & (inside_mask >= MIN_VOTES * seen)]


def upwards(reconstruction, turned):
    """The direction that is up in the photos: at right angles to their horizontal axes. @param turned [photos] of bool:
    turned by 90 degrees clockwise"""
    level = np.where(turned[:, None], reconstruction.R[:, 1], reconstruction.R[:, 0])
    up = np.where(turned[:, None], reconstruction.R[:, 0], -reconstruction.R[:, 1]).sum(axis=0)
    _, sizes, axes = np.linalg.svd(level, full_matrices=False)
    if sizes[1] < MIN_LEVEL * sizes[0]:  # photos along one arc: they say one horizontal axis alone
        up -= axes[0] * (axes[0] @ up)
        return up / np.linalg.norm(up)
    return axes[2] if axes[2] @ up >= 0 else -axes[2]


def on_cut_outs(reconstruction, photos, turned):
    """Where all photos say what the object is: no table is needed."""
    points = points_in_masks(reconstruction, photos)
    require(len(points) >= MIN_OBJECT_POINTS, f'only {len(points)} points lie on what the photos show of the object: it has '
            'too little texture, or their masks contradict each other')
    points = without_strays(points)
    n = upwards(reconstruction, turned)
    box = box_of(points, Plane(n, float(np.quantile(points @ n, OUTLIERS)), 0.0))
    points = points @ box.R.T + box.t
    low = box.low - (0, 0, DEPTH * np.ptp(points, axis=0).max())
    return Region(reconstruction.moved(1, box.R, box.t), low, box.high, False, points, False, 0, 0,
                  'z is up as in the photos, 0 at the lowest point: the photos are cut out, and show no table', False)


def on_board(reconstruction, box):
    """@param reconstruction in the board's frame. The object's frame is the board's. @param box the user's; empty: it
    is found by points above the board."""
    distance = float(np.median(np.linalg.norm(reconstruction.centres() - focus(reconstruction), axis=1)))
    plane = Plane(np.array([0, 0, 1.0]), 0.0, THICKNESS * distance)
    if box:
        region = within_box(reconstruction, box)
        return dataclasses.replace(region, points=region.points[is_above(region.points, plane)], table_is_known=True,
                                   metres_per_unit=1.0, origin='scale and frame are those of the board; the box was given')
    points = points_above(reconstruction, plane)
    return Region(reconstruction, *bounds(points), False, points, True, 1.0, 0, 'scale and frame are those of the board')


def within_box(reconstruction, box):
    """@param box min x y z, max x y z in the reconstruction's frame."""
    low, high = np.array(box[:3], dtype=float), np.array(box[3:], dtype=float)
    require(np.all(low < high), '--box is empty: give min x y z, then max x y z')
    inside = np.all((reconstruction.xyz > low) & (reconstruction.xyz < high), axis=1)
    points = reconstruction.xyz[inside]
    points = points[np.random.default_rng(SEED).permutation(len(points))[:MAX_POINTS]]
    return Region(reconstruction, low, high, True, points, False, 0, 0, 'the box was given')


def without_table(region):
    """A region whose box may hold some of the table, without the table's points, if a table is found."""
    try:
        plane = find_plane(region.reconstruction)
    except InputError:
        return region
    above = region.points[is_above(region.points, plane)]
    if len(above) < MIN_OBJECT_POINTS or not is_supported(region.reconstruction, plane, box_of(above, plane)):
        return region
    return dataclasses.replace(region, points=above)


def marks_of(job, reconstruction):
    """--length METRES PHOTO x y x y PHOTO x y x y .. as (metres, marks for scale_from_length)."""
    words = job.options.length
    copies = {copy.source: copy for copy in job.copies}
    try:
        length, marks = float(words[0]), []
        for photo, *pixels in (words[i:i + 5] for i in range(1, len(words), 5)):
            copy, (ax, ay, bx, by) = copies[photo], map(float, pixels)
            marks.append((reconstruction.names.index(copy.name),
                          *(pixel_of_copy(copy, job.cameras[copy.camera], xy) for xy in ((ax, ay), (bx, by)))))
    except (KeyError, ValueError, IndexError) as error:
        raise InputError('--length: give METRES, then for each of two photos its name and x y of both ends [px]; the '
                         f'photos must have poses ({error})') from error
    return length, marks


def found_without_board(job, reconstruction, photos):
    if job.options.box:
        return without_table(within_box(reconstruction, job.options.box))
    if all(photo.cut_out is not None for photo in photos):
        turned = {copy.name: copy.turned for copy in job.copies}
        return on_cut_outs(reconstruction, photos, np.array([turned[name] for name in reconstruction.names]))
    return on_found_table(reconstruction)


def find_region(job, reconstruction, board, photos):
    """@param board ({name of a copy: {number: xy}} of its corners, the board or tags); ({}, None) without one; photos of
    the reconstruction, in its order"""
    options, sigma, origin = job.options, 0.0, ''
    corners, target = board
    if options.poses == 'board':
        region = on_board(reconstruction, options.box)
    elif target:
        found = scale_from_target(reconstruction, [(i, corners[name]) for i, name in enumerate(reconstruction.names)
                                                   if corners[name]], target)
        region = on_board(reconstruction.moved(found.metres_per_unit, found.R, found.t), options.box)
        sigma, origin = found.sigma, f'scale and frame are those of the board or tags ({found.corners} corners)'
    else:
        region = found_without_board(job, reconstruction, photos)
        scale = options.metres_per_unit
        if options.length:
            scale = scale_from_length(region.reconstruction, *marks_of(job, reconstruction))
        return scaled(region, scale)
    return dataclasses.replace(region, sigma=sigma, origin=origin or region.origin)
