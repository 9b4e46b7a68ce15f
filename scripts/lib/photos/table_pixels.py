# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What the photos show of the table, put together from all of them, tells it from the object: where a photo does not show
what the others show in that place, something is before it (a part whose colour is elsewhere in the background, say)."""
import collections

import cv2
import numpy as np

from photos.common import in_threads
from photos.plane_match import HALF, below_horizon, plane_to_pixels

GRID = 640              # of the table as seen from above [px]
STRIP = 32              # rows of it at once
UNKNOWN = np.int16(32767)
BEYOND = 1.25           # around the box, of its size
VIEWS = 24              # that the table is put together from
FEW_VIEWS = 6           # less: nothing is known of a place
UNCOVERED = 0.45        # of them must show a place beside the object: fewer may all take the same part of it for the table
COVER = 5               # pixels: masks may be so much too small, all around
OTHER = 15              # grey levels from all that the table shows nearby: something is before it
NEARBY = 5              # pixels of a view, for poses err
GAP = 12                # cells around a place of which the colour is not known: it has one of theirs
STEADY = 15             # median deviation between the photos: all show the table, nothing stands there
SURE_VIEWS = 3          # that surely show the table (photos.plane_match): then these alone count ..
STEADY_OF_SURE = 20     # .. and may differ so much
CONTRAST = 120          # grey levels in a gap's surroundings: they tell little of what is in it
FOOT = 0.15             # of the box's size: gaps between the object's points from above that belong to it

# A photo against the table behind it, for each pixel. `off`: how far its colour is from all that the table shows nearby;
# `spread` of these colours [grey levels]; `distance` to the nearest place of which the colour is known [cells]; `beyond`:
# whether the ray passes the part of the table that is known.
Look = collections.namedtuple('Look', 'off spread distance beyond')


def median_of(values):
    """Over the last axis, of int16, without UNKNOWN; UNKNOWN if there is no other."""
    values = np.sort(values, axis=-1)  # UNKNOWN are last
    count = np.count_nonzero(values < UNKNOWN, axis=-1)[..., None]
    low, high = (np.take_along_axis(values, np.maximum(i, 0), axis=-1)[..., 0] for i in ((count - 1) // 2, count // 2))
    return np.where(count[..., 0] > 0, 0.5 * low + 0.5 * high, UNKNOWN).astype(np.float32)


def common_colour(above):
    """What photos of the table show of it. @param above [(image [h, w, 3] of uint8, which of its pixels count)] of the photos
    @return (colour, median deviation from it) of float32, UNKNOWN where no pixel counts"""
    shown = np.stack([image for image, _ in above], axis=-1).astype(np.int16)
    counts = np.stack([counting for _, counting in above], axis=-1)
    colour = median_of(np.where(counts[:, :, None], shown, UNKNOWN))
    deviation = np.abs(shown - np.round(colour).astype(np.int16)[..., None]).max(axis=2)
    return colour, median_of(np.where(counts, deviation, UNKNOWN))


def largest(image):
    """Over the channels. (numpy.max takes 20 times as long.)"""
    return np.maximum(np.maximum(image[:, :, 0], image[:, :, 1]), image[:, :, 2])


def square(width):
    return np.ones((width, width), np.uint8)


class Table:
    """The table's plane z = 0 from above, put together from all views. @param views see masks.View, which know where they
    surely show the table; box (low, high); points of the object, below which nothing is the table; masks of the object in
    the views, where they are known: then what they cover does not count, and what they never cover may be the table, below
    the object's points, too."""

    def __init__(self, views, box, points, masks=None):
        side = (1 + 2 * BEYOND) * float((box[1] - box[0])[:2].max())
        corner = 0.5 * (box[0] + box[1])[:2] - 0.5 * side
        self.to_plane = np.array([[side / GRID, 0, corner[0]], [0, side / GRID, corner[1]], [0, 0, 1]])
        chosen = np.unique(np.linspace(0, len(views) - 1, min(VIEWS, len(views))).astype(int))
        above = in_threads(lambda i: self.from_above(views[i], None if masks is None else masks[i]), chosen)
        is_sure = np.sum([surely for _, _, surely in above], axis=0) >= SURE_VIEWS
        above = [(image, np.where(is_sure, surely, inside)) for image, inside, surely in above]
        strips = in_threads(lambda rows: common_colour([(image[rows], counts[rows]) for image, counts in above]),
                            [slice(first, first + STRIP) for first in range(0, GRID, STRIP)])
        self.colour, deviation = (np.concatenate(part) for part in zip(*strips))
        least = FEW_VIEWS
        if masks is not None:
            least = max(FEW_VIEWS, UNCOVERED * len(chosen))
        steady = (deviation < STEADY) & (np.sum([counts for _, counts in above], axis=0) >= least)
        steady |= is_sure & (deviation < STEADY_OF_SURE)
        if masks is None:
            steady &= self.foot(points) == 0
        self.find_gaps(steady)

    def find_gaps(self, steady):
        """Where no colour is known: a gap, as below the object, has that of the nearest place, or, on a board, any of those
        around it; what joins the border is beyond the table."""
        whole = cv2.morphologyEx(cv2.morphologyEx(np.uint8(steady), cv2.MORPH_CLOSE, square(5)), cv2.MORPH_OPEN, square(5))
        _, pieces = cv2.connectedComponents(1 - whole)
        outer = np.unique(np.concatenate((pieces[0], pieces[-1], pieces[:, 0], pieces[:, -1])))
        self.beyond = np.isin(pieces, outer[outer > 0]).astype(np.uint8)
        self.low, self.high, self.distance = self.colour, self.colour, np.full(steady.shape, 2 * GRID, np.float32)
        if not steady.any():
            return
        self.distance, label = cv2.distanceTransformWithLabels(np.uint8(~steady), cv2.DIST_L2, 5,
                                                               labelType=cv2.DIST_LABEL_PIXEL)
        nearest = np.zeros((label.max() + 1, 3), np.float32)
        nearest[label[steady]] = self.colour[steady]
        gap = ~steady[:, :, None]
        low = cv2.erode(np.where(gap, 255, self.colour), square(2 * GAP + 1))
        high = cv2.dilate(np.where(gap, 0, self.colour), square(2 * GAP + 1))
        is_plain = (high - low).max(axis=2, keepdims=True) < CONTRAST
        self.low = np.where(gap & ~is_plain, low, nearest[label])
        self.high = np.where(gap & ~is_plain, high, nearest[label])

    def homography(self, view):
        """Pixels from above to pixels of a view."""
        return plane_to_pixels(view) @ self.to_plane @ HALF

    def from_above(self, view, mask):
        """@return (image, which of its pixels the view shows beside the mask, where it surely shows the table)"""
        H, nearest = self.homography(view), cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        shown = np.full(view.shape, 255, np.uint8)
        if mask is not None:
            shown[cv2.dilate(mask, square(COVER)) > 0] = 0
        inside, surely = (cv2.warpPerspective(image, H, (GRID, GRID), flags=nearest) > 0 for image in (shown, view.table))
        return (cv2.warpPerspective(view.image, H, (GRID, GRID), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP), inside,
                surely)

    def foot(self, points):
        """Where the object's points lie from above, without gaps."""
        image = np.zeros((GRID, GRID), np.uint8)
        pixel = np.floor((points[:, :2] - self.to_plane[:2, 2]) / self.to_plane[0, 0]).astype(int)
        inside = np.all((pixel >= 0) & (pixel < GRID), axis=1)
        image[pixel[inside, 1], pixel[inside, 0]] = 255
        width = int(FOOT * GRID / (1 + 2 * BEYOND)) | 1
        return cv2.morphologyEx(image, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width)))

    def behind(self, view, nearby=NEARBY):
        """The Look of a view. @param nearby width of the window of colours that count as those of a pixel [px]"""
        H, size, below = self.homography(view), view.shape[::-1], below_horizon(view)
        low = cv2.erode(cv2.warpPerspective(self.low, H, size, flags=cv2.INTER_LINEAR), square(nearby))
        high = cv2.dilate(cv2.warpPerspective(self.high, H, size, flags=cv2.INTER_LINEAR), square(nearby))
        image = view.image.astype(np.float32)
        distance = cv2.warpPerspective(self.distance, H, size, flags=cv2.INTER_LINEAR, borderValue=2 * GRID)
        beyond = cv2.warpPerspective(self.beyond, H, size, flags=cv2.INTER_NEAREST, borderValue=1)
        return Look(largest(np.maximum(image - high, low - image)), largest(high - low), distance,
                    (beyond > 0) | ~below)

    def hidden_in(self, view):
        """(255 where a view surely shows something before the table, 255 where it is beyond)."""
        look = self.behind(view)
        known = cv2.erode(np.uint8((look.distance < 1) & ~look.beyond), square(NEARBY))
        shown = np.where((look.off > OTHER) & (known > 0), 255, 0).astype(np.uint8)
        return cv2.morphologyEx(shown, cv2.MORPH_OPEN, square(3)), np.where(look.beyond, 255, 0).astype(np.uint8)
