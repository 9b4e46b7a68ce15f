# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The outline of the object in a photo at full size, where the table behind it is known; and where nothing is known."""
import cv2
import numpy as np

from photos.mask_volume import disc
from photos.masks import extent, solid
from photos.plane_match import shows_plane

BAND = 0.05              # of the object's size in the photo: how far the outline may move
NEARBY = 7               # pixels at full size: poses err, and the table from above is blurred
BLUR = 0.8               # of the photo against noise [px]
OTHER = 12               # grey levels beyond what the table shows nearby: the object ..
OF_SPREAD = 0.1          # .. and so much of the spread of these colours
EDGE, OF_LARGEST = 5, 0.35  # within so many pixels: a pixel on the edge shows so much of the object, or it is the table's
SAME = 5                 # grey levels: the table ..
PLAIN = 30               # .. where the spread is less: before the squares of a board everything is like them
FAR = 12                 # cells from where the table is known: nothing is
OUTSIDE, INSIDE = 0.05, 0.1  # of the object's size, around the outline: here a mask may err where nothing is known behind it
MARGIN = 0.2             # of the object's size, around the mask: no outline moves farther
GAP = 9                  # width that a gap between two parts has at least [px]
PERHAPS_OBJECT, PERHAPS_BACKGROUND = 254, 1  # in a mask: such a pixel has no say in the training (docs/photo_formats.md)


def is_unsure(mask):
    return (mask == PERHAPS_OBJECT) | (mask == PERHAPS_BACKGROUND)


def core(mask, share):
    """The mask without a band along its outline. @param share width as a share of the mask's size"""
    return cv2.erode(mask, disc(2 * max(1, round(share * extent(mask))) + 1))


def around(mask, outside, inside):
    """The band around a mask's outline. @param outside, inside widths as shares of the mask's size"""
    outer = 2 * max(1, round(outside * extent(mask))) + 1
    return (cv2.dilate(mask, disc(outer)) > 0) & (core(mask, inside) == 0)


def against_table(look, mask, silhouette):
    """The mask with an outline where the photo begins to differ from the table. @param look see table_pixels; silhouette of
    the volume that all masks have in common"""
    band = around(silhouette, BAND, BAND) & (look.distance < FAR) & ~look.beyond
    result = mask.copy()
    largest = cv2.dilate(look.off, np.ones((EDGE, EDGE), np.uint8))  # on the object, beside its blurred edge
    result[band & (look.off > np.maximum(OTHER + OF_SPREAD * look.spread, OF_LARGEST * largest))] = 255
    is_table = (look.off < SAME) | ((look.off < OF_LARGEST * largest) & (largest > 2 * OTHER))
    result[band & is_table & (look.spread < PLAIN)] = 0
    return solid(cv2.medianBlur(result, 3))


def gaps(look, mask):
    """Where the mask shows what looks like the table, in pieces that begin at its outline: the table between two parts, or
    parts of its colour."""
    like = (look.off < SAME) & (look.spread < PLAIN) & (look.distance < 1) & ~look.beyond & (mask > 0)
    count, pieces = cv2.connectedComponents(cv2.morphologyEx(np.uint8(like), cv2.MORPH_OPEN, disc(GAP)))
    begins = np.zeros(count, bool)
    begins[pieces[cv2.dilate(np.uint8(mask == 0), disc(NEARBY)) > 0]] = True
    begins[0] = False
    return begins[pieces]


def with_doubts(look, mask, supported):
    """The mask where its pixels say that they may err: near its outline if no table is known behind it, and in gaps.
    @param supported see Volume"""
    beyond = cv2.dilate(np.uint8(look.beyond), disc(NEARBY)) > 0
    doubtful = ((around(mask, OUTSIDE, INSIDE) & beyond) | gaps(look, mask)) & (supported > 0)
    return np.where(doubtful, np.where(mask > 0, PERHAPS_OBJECT, PERHAPS_BACKGROUND), mask).astype(np.uint8)


def outlined(view, background, mask, volume):
    """The mask of a photo, better at its outline. @param view of the photo at full size, see masks.View; background (table
    of all photos, made with masks; views to compare this one with, see plane_match); volume that all masks have in common"""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return mask
    margin = round(MARGIN * extent(mask)) + NEARBY
    window = tuple(slice(max(0, line[0] - margin), line[-1] + margin + 1) for line in (rows, columns))
    part, result = view.part(*window), mask.copy()
    part.image = cv2.GaussianBlur(part.image, (0, 0), BLUR)
    (table, partners), found = background, np.ascontiguousarray(mask[window])
    look, silhouette = table.behind(part, NEARBY), volume.silhouette(part)
    shown = cv2.bitwise_and(shows_plane(part, partners), 255 - core(silhouette, BAND))  # no hole by one photo alone
    better = cv2.bitwise_and(against_table(look, found, silhouette), 255 - shown)
    result[window] = with_doubts(look, better, volume.supported(part))
    return result
