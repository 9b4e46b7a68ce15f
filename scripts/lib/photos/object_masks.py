# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Masks of a job's photos in a box that is found with them: it grows while the object reaches its sides."""
import os

import cv2
import numpy as np

from photos.common import InputError, in_threads, require
from photos.image_header import read_header
from photos.intake import CUT_OUTS
from photos.intake import ENDINGS as PHOTO_ENDINGS
from photos.mask_volume import CELLS
from photos.masks import MIN_AGREEMENT, SIDE, Mask, first_volume, refined, view_of, views_of
from photos.outline import outlined
from photos.plane_match import partners_of
from photos.table_pixels import Table

VERSION = 6      # of how masks are found: those of another version are found anew
MAX_GROWTHS = 3
GROWTH = 0.3     # of the longest side, where the object reaches a side
MARGIN = 0.03    # of the object's longest side, around the final box
MIN_DRAWN_AGREEMENT = 0.5  # of a mask that was drawn, with what all masks have in common


def drawn_masks(folder):
    """Paths of the masks that a user drew."""
    require(os.path.isdir(folder), f"there is no folder '{folder}'")
    paths = [os.path.join(folder, name) for name in sorted(os.listdir(folder)) if name.lower().endswith(PHOTO_ENDINGS)]
    for path in paths:
        require(path.lower().endswith('.png'), f"'{path}' is no PNG: masks are, for other formats blur their edges")
    require(paths, f"'{folder}' holds no masks (.png)")
    return paths


def photos_by_name(photos):
    """{name without an ending: the photos that it may mean}: names of the dataset's copies, and those of the user's photos.
    Frames of a video have no name of their own."""
    by_name = {}
    for photo in photos:
        stem, ending = os.path.splitext(photo.source)
        for name in {photo.name, stem} if ending.lower() in PHOTO_ENDINGS else {photo.name}:
            by_name.setdefault(name, []).append(photo)
    return by_name


def take_drawn_masks(photos, paths):
    """Gives photos the masks that a user drew: named like those of the dataset, or like the user's photos."""
    by_name = photos_by_name(photos)
    for path in paths:
        meant = by_name.get(os.path.splitext(os.path.basename(path))[0])
        require(meant, f"'{path}' is named like no photo with a pose: name it like the one in dataset/masks that it corrects")
        require(len(meant) == 1, f"'{path}' may be of '{meant[0].source}' or of '{meant[-1].source}': name it '{meant[0].name}"
                f".png' or '{meant[-1].name}.png'")
        photo = meant[0]
        require(photo.drawn is None, f"'{path}' is the second mask of '{photo.source}': keep one of them")
        header, (height, width) = read_header(path), photo.image.shape[:2]  # before a large image is decoded
        require((header.width, header.height) == (width, height), f"'{path}' has {header.width} x {header.height} pixels, "
                f'the photo in dataset/images {width} x {height}: draw on that one')
        mask = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        if mask is None:
            raise InputError(f"'{path}' is damaged: it cannot be decoded")
        photo.drawn = np.where(mask >= 128, 255, 0).astype(np.uint8)
        require(photo.drawn.any(), f"'{path}' shows no object: it is black")


def take_cut_outs(photos, folder):
    """Gives photos the masks that their alpha says. @param folder of the copies"""
    for photo in photos:
        path = os.path.join(folder, CUT_OUTS, photo.copy + '.png')
        if not os.path.exists(path):
            continue
        mask = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        if mask is None:
            raise InputError(f"cannot read '{path}'")
        if np.any(photo.taken_by.parameters[4:]):
            mask = cv2.undistort(mask, photo.taken_by.matrix(), photo.taken_by.parameters[4:])
        if np.any(mask >= 128):  # undistorted, a small object at the border may be gone
            photo.cut_out = np.where(mask >= 128, 255, 0).astype(np.uint8)


def touched(box, bounds, has_bottom):
    """Which sides of the box the bounds reach: ([3], [3]) of bool, low and high. @param has_bottom the bottom is the table,
    or low enough"""
    cell = (box[1] - box[0]).max() / CELLS
    low = bounds[0] < box[0] + cell
    low[2] &= not has_bottom
    return low, bounds[1] > box[1] - cell


def found_volume(photos, region):
    """The volume of rough masks in the region's box, which grows while they reach its sides."""
    box = region.low.copy(), region.high.copy()
    volume = first_volume(photos, box, region)
    for _ in range(0 if region.is_given else MAX_GROWTHS):
        low, high = touched(box, volume.bounds() or box, region.has_bottom)
        if not (low.any() or high.any()):
            break
        growth = GROWTH * (box[1] - box[0]).max()
        box = box[0] - growth * low, box[1] + growth * high
        volume = first_volume(photos, box, region)
    return volume if volume.occupied.any() else first_volume(photos, box, region, SIDE)


def with_outlines(photos, found, views, volume, box):
    """The found masks, better at their outlines, where the table tells. @param views at which they were found; box of the object"""
    covered = in_threads(lambda pair: cv2.bitwise_or(pair[0].reduced(pair[1].image), volume.silhouette(pair[0])),
                         zip(views, found))
    table = Table(views, box, np.empty((0, 3)), covered)

    full = [view_of(photo, max(photo.image.shape)) for photo in photos]
    partners = partners_of(views, box)

    def better(i):
        background = table, [full[j] for j in partners[i]]
        return Mask(outlined(full[i], background, found[i].image, volume), found[i].agreement)
    return in_threads(better, range(len(full)))


def mask_photos(photos, region):
    """Sets the photos' masks. @return (agreement of each, box (low, high) of the object: the user's, or what the masks
    have in common with a margin)."""
    volume = found_volume(photos, region)
    box = volume.low, volume.high
    views = views_of(photos, box, region, SIDE)
    masks = refined(views, volume, region)
    bounds = volume.bounds() or box
    if region.table_is_known:
        masks = with_outlines(photos, masks, views, volume, bounds)
    agreements = [mask.agreement for mask in masks]
    against = [photo.source for photo, share in zip(photos, agreements)
               if photo.drawn is not None and share < MIN_DRAWN_AGREEMENT]
    require(not against, f"the masks drawn for {', '.join(against)} contradict those of the other photos. White is the object, "
            'and each mask must be of the photo that it is named like')
    for photo, mask in zip(photos, masks):
        photo.mask = mask.image if photo.drawn is None else photo.drawn
        if photo.drawn is None and photo.cut_out is not None and mask.agreement >= MIN_AGREEMENT:
            photo.mask = photo.cut_out
    require(any(np.any(photo.mask >= 128) for photo in photos), 'the object was not told from its background: give --box, or put it '
            'before a background of another colour')
    if region.is_given:
        return agreements, (region.low, region.high)
    margin = MARGIN * (bounds[1] - bounds[0]).max()
    return agreements, (np.maximum(bounds[0] - margin, box[0]), np.minimum(bounds[1] + margin, box[1]))
