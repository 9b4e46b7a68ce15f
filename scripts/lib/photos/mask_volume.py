# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The volume that the masks of photos have in common: a visual hull (Laurentini 1994) by votes, for masks that err."""
import cv2
import numpy as np

from photos.common import in_threads

CELLS = 96               # of the volume, along the box's longest side
MIN_VOTES = 0.85         # of the photos that show a cell: the cell belongs to the object
MIN_VOTES_OF_DRAWN = 0.5  # the same, where a mask that the user drew adds it to what the photos show without it
MIN_SEEN = 0.3           # of the photos must show a cell
SIDE_VIEWS = 5           # a photo and those from the nearest directions: one side of the object
MAX_COSINE = float(np.cos(np.radians(5)))  # of the angle between two of them
SIDE_DENIALS = 4         # of them: the cell does not belong to the object, whatever the other sides say
SURE_DENIALS = 2         # photos that surely show the table where a cell would be: it is gone ..
SURE_SHARE = 0.05        # .. if they are so many of those that show it, too: each may err
DOUBT = 0.5              # weight of a vote where a photo shows what is beyond the table: nothing else tells what is there
SUPPORT = 0.3            # of the photos show the table behind a cell: in the others its pixels may be unsure ..
VOTERS = 8               # .. and if these are so many, they alone vote: each of fewer would have a veto
DOUBTFUL_DENIALS = 0.8   # of the others (SIDE_VIEWS or more) deny a cell that the voters keep: it is gone all the same
CHUNK = 1 << 15          # cells at once, to bound memory
# What a pixel says of a cell that it shows: nothing if it is beside the image.
INSIDE, DENIED, TABLE, BEYOND, ADDED, BESIDE_DRAWN = (np.uint8(1 << bit) for bit in range(6))


def disc(width):
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))


def sides(views, middle):
    """Indices of the views that see each side: each view with the nearest ones that are not from the same place. In a video
    neighbours err together."""
    directions = np.array([-view.R.T @ view.t - middle for view in views])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    cosines, groups = directions @ directions.T, []
    for nearest in np.argsort(-cosines, axis=1, kind='stable'):
        group = []
        for i in nearest:
            if len(group) < SIDE_VIEWS and np.all(cosines[i, group] < MAX_COSINE):
                group.append(i)
        if len(group) == SIDE_VIEWS:
            groups.append(group)
    return groups


class Volume:
    """Cells of the object's box, and how the masks vote for each."""

    def __init__(self, low, high):
        self.low, self.high = np.asarray(low, float), np.asarray(high, float)
        self.size = (self.high - self.low).max() / CELLS
        axes = [np.arange(a + self.size / 2, b, self.size) for a, b in zip(low, high)]
        self.cells = np.stack(np.meshgrid(*axes, indexing='ij'), axis=-1).reshape(-1, 3).astype(np.float32)
        self.occupied = np.ones(len(self.cells), bool)
        self.is_supported = np.zeros(len(self.cells), bool)

    def vote(self, views, masks):
        """Keeps the cells that most photos take for the object, and those of no side deny: a hollow, or the gap below an
        edge, is seen from one side alone."""
        groups = sides(views, 0.5 * (self.low + self.high))
        said = list(zip(views, in_threads(lambda pair: flags_of(*pair), zip(views, masks))))
        parts = [self.cells[first:first + CHUNK] for first in range(0, len(self.cells), CHUNK)]
        found = in_threads(lambda cells: belongs(cells, said, groups), parts)
        self.occupied, self.is_supported = (np.concatenate(kind) for kind in zip(*found))

    def bounds(self):
        """(low, high) of the occupied cells, or None."""
        cells = self.cells[self.occupied]
        return (cells.min(axis=0) - self.size / 2, cells.max(axis=0) + self.size / 2) if len(cells) else None

    def silhouette(self, view):
        """Of the occupied cells, as a photo shows them: uint8, 255 inside."""
        return self.shown(view, self.cells[self.occupied])

    def supported(self, view):
        """Where a photo shows cells alone of which other photos tell enough, of all that may be the object's: uint8."""
        telling, others = self.is_supported, self.occupied & ~self.is_supported
        return cv2.bitwise_and(self.shown(view, self.cells[telling]), 255 - self.shown(view, self.cells[others]))

    def shown(self, view, cells):
        image = np.zeros(view.shape, np.uint8)
        inside, x, y = view.pixels_of(cells)
        if not inside.any():
            return image
        image[y, x] = 255
        depth = np.median(cells[inside] @ view.R[2] + view.t[2])
        width = min(2 * int(np.ceil(view.focal * self.size / depth)) + 1, max(view.shape) | 1)
        return cv2.morphologyEx(image, cv2.MORPH_CLOSE, disc(width))


def flags_of(view, mask):
    """What a photo says of a cell that one of its pixels shows: flags of the pixels, row by row, and of what is beside."""
    flags = INSIDE | (mask == 0) * DENIED | (view.table > 0) * TABLE
    if view.drawn is None:
        flags |= (view.beyond > 0) * BEYOND  # else the user knows what is there
    else:
        flags |= (view.added > 0) * ADDED | (cv2.dilate(view.drawn, disc(3)) == 0) * BESIDE_DRAWN
    return np.append(flags, np.uint8(0))


def belongs(cells, said, groups):
    """Which cells are the object's, and for which enough photos show the table behind. What the user drew in some photos is
    carried to the others: cells beside a drawn mask are gone, and those that it adds need fewer votes.
    @param said [(view, flags of its pixels)]"""
    flags = np.array([pixels[view.numbers_of(cells)] for view, pixels in said])

    def count(said_of_it, unsaid=0):
        return np.count_nonzero(flags & np.uint8(said_of_it | unsaid) == said_of_it, axis=0)
    known, doubtful = count(INSIDE, BEYOND), count(BEYOND)
    is_added, is_supported = count(ADDED) > 0, known >= SUPPORT * len(said)
    only_known = is_supported & (known >= VOTERS) & ~is_added
    doubt, doubtful_denials = np.where(only_known, 0, DOUBT), count(BEYOND | DENIED)
    votes = known + doubt * doubtful
    against = count(DENIED, BEYOND) + doubt * doubtful_denials
    least = np.where(is_added, MIN_VOTES_OF_DRAWN, MIN_VOTES)
    enough = (known + doubtful >= MIN_SEEN * len(said)) & (votes - against >= least * votes)
    gone = only_known & (doubtful >= SIDE_VIEWS) & (doubtful_denials > DOUBTFUL_DENIALS * doubtful)
    denied = (flags & DENIED > 0) & ~((flags & BEYOND > 0) & only_known)
    for group in groups:
        gone |= np.count_nonzero(denied[group], axis=0) >= SIDE_DENIALS
    gone |= count(TABLE) >= np.maximum(SURE_DENIALS, SURE_SHARE * (known + doubtful))
    return (count(BESIDE_DRAWN) == 0) & (~gone | is_added) & enough, is_supported
