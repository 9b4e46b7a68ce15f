# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Masks of a job's photos in a box that is found with them: it grows while the object reaches its sides."""
import numpy as np

from photos.common import require
from photos.masks import CELLS, find_masks

MAX_ROUNDS = 3
GROWTH = 0.3     # of the longest side, where the object reaches a side
MARGIN = 0.03    # of the object's longest side, around the final box


def touched(box, bounds):
    """Which sides of the box the bounds reach: ([3], [3]) of bool, low and high. The bottom is the table, or low enough."""
    cell = (box[1] - box[0]).max() / CELLS
    low = bounds[0] < box[0] + cell
    low[2] = False
    return low, bounds[1] > box[1] - cell


def mask_photos(photos, region):
    """Sets the photos' masks. @return (agreement of each, box (low, high) of the object: the user's, or what the masks
    have in common with a margin)."""
    box = region.low.copy(), region.high.copy()
    for _ in range(1 if region.is_given else MAX_ROUNDS):
        masks, bounds = find_masks(photos, box, region.points, region.low[2] == 0)
        low, high = touched(box, bounds)
        if not (low.any() or high.any()):
            break
        growth = GROWTH * (box[1] - box[0]).max()
        box = box[0] - growth * low, box[1] + growth * high
    for photo, mask in zip(photos, masks):
        photo.mask = mask.image
    require(any(photo.mask.any() for photo in photos), 'the object was not told from its background: give --box, or put it '
            'before a background of another colour')
    agreements = [mask.agreement for mask in masks]
    if region.is_given:
        return agreements, (region.low, region.high)
    margin = MARGIN * (bounds[1] - bounds[0]).max()
    return agreements, (np.maximum(bounds[0] - margin, box[0]), np.minimum(bounds[1] + margin, box[1]))
