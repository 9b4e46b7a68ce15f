# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What of each photo is the object: GrabCut (Rother et al. 2004), seeded by the object's points and box, made
consistent between the photos by the volume that their masks have in common above the table."""
import collections
import copy

import cv2
import numpy as np

from photos.common import in_threads
from photos.geometry import nearest
from photos.mask_volume import Volume, disc
from photos.plane_match import partners_of, shows_plane
from photos.table_pixels import Table

# A mask of uint8, 255 on the object, of the photo's size; `agreement` is its intersection over union with what all
# photos together say, before it was made to agree.
Mask = collections.namedtuple('Mask', 'image agreement')

ROUGH_SIDE = 256         # of a photo, at which the first masks are found [px]
SIDE = 512               # at this size they are made to agree
ITERATIONS = 2           # of GrabCut
RING = 0.3               # around the box, of its size: what the background looks like there
SEED_RADIUS = 0.006      # around a point of the object, of SIDE: surely the object
ROUNDS = 3               # after the first masks
BAND = 0.04              # of the object's size in the photo: how far its outline may move in a further round
OUTER_BAND = 0.012       # in the end it may lie so far outside of what the photos agree on: seeds make bumps
INNER_BAND = 0.04        # .. and so far inside
NEIGHBOURS = 12          # of a point
OFF_SURFACE = 0.4        # times their mean distance, from the plane through them: a wrong match
MIN_AGREEMENT = 0.75     # less: the mask is what the other photos say


class View:
    """A photo at the size at which masks are found. @param camera a pinhole; R, t world to camera; drawn the user's
    mask of it, if there is one."""

    def __init__(self, image, camera, pose, drawn=None, side=SIDE):
        self.full_shape = image.shape[:2]
        scale = min(1, side / max(self.full_shape))
        size = round(image.shape[1] * scale), round(image.shape[0] * scale)
        self.image = image if scale == 1 else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        self.shape = size[1], size[0]
        self.R, self.t = pose
        self.K = np.diag((size[0] / image.shape[1], size[1] / image.shape[0], 1)) @ np.array(
            [[camera.parameters[0], 0, camera.parameters[2]], [0, camera.parameters[1], camera.parameters[3]], [0, 0, 1]])
        self.focal = self.K[0, 0]
        self.table = np.zeros(self.shape, np.uint8)  # 255 where the table is surely seen
        self.hidden = np.zeros(self.shape, np.uint8)  # .. and where something before it is
        self.beyond = np.zeros(self.shape, np.uint8)  # .. and where nothing is known of what is behind
        self.drawn = None
        if drawn is not None:
            self.drawn = self.reduced(drawn)
        self.added = self.drawn  # .. what of it the other photos do not show without it
        self.cut_out = None  # the mask that the photo's alpha says: as good as GrabCut's, not as the user's

    def part(self, rows, columns):
        """Of the same photo: what the slices hold, as a view of its own."""
        result = copy.copy(self)
        for name in ('image', 'table', 'hidden', 'beyond'):
            setattr(result, name, np.ascontiguousarray(getattr(self, name)[rows, columns]))
        result.shape = result.image.shape[:2]
        result.K = self.K - np.array([[0, 0, columns.start], [0, 0, rows.start], [0, 0, 0]])
        return result

    def numbers_of(self, points):
        """The number of each point's pixel, row by row; beside the image that after the last pixel's."""
        P = (self.K @ np.column_stack((self.R, self.t))).astype(np.float32)
        points = np.asarray(points, np.float32)
        x, y, depth = (points @ row[:3] + row[3] for row in P)
        front = depth > 0
        depth[~front] = 1
        x, y = x / depth, y / depth
        inside = front & (x >= 0) & (x < self.shape[1]) & (y >= 0) & (y < self.shape[0])
        x[~inside], y[~inside] = 0, self.shape[0]  # the first pixel below the last row
        return y.astype(np.int32) * self.shape[1] + x.astype(np.int32)

    def pixels_of(self, points):
        """(which points are in the image [n] of bool, their columns, their rows)."""
        numbers = self.numbers_of(points)
        inside = numbers < self.shape[0] * self.shape[1]
        y, x = np.divmod(numbers[inside], self.shape[1])
        return inside, x, y

    def reduced(self, mask):
        """A mask of the photo's size at the size of the view."""
        small = cv2.resize(mask, self.shape[::-1], interpolation=cv2.INTER_AREA)
        return np.where(small >= 128, 255, 0).astype(np.uint8)

    def full(self, mask):
        """A mask at the size of the photo."""
        large = cv2.resize(mask, self.full_shape[::-1], interpolation=cv2.INTER_LINEAR)
        return np.where(large >= 128, 255, 0).astype(np.uint8)


def extent(mask):
    """Width or height of what is set, the larger one [px]."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1 if len(rows) else 0


def solid(mask):
    """The largest piece of a mask, without small holes."""
    pieces, labels, statistics, _ = cv2.connectedComponentsWithStats((mask > 0).astype(np.uint8))
    if pieces < 2:
        return mask
    sizes = statistics[:, cv2.CC_STAT_AREA]
    kept = sizes >= 0.1 * sizes[1:].max()
    kept[0] = False  # the background
    result = np.where(kept, 255, 0).astype(np.uint8)[labels]
    width = max(3, extent(result) // 50 | 1)
    return cv2.morphologyEx(result, cv2.MORPH_CLOSE, disc(width))


def of_object(trimap):
    """Which pixels are the object's, surely or probably."""
    return (trimap == cv2.GC_FGD) | (trimap == cv2.GC_PR_FGD)


def grab_cut(view, trimap):
    """@param trimap GC_BGD, GC_FGD, GC_PR_BGD, GC_PR_FGD. Only what surrounds the open part is looked at."""
    trimap = np.where(view.table > 0, cv2.GC_BGD, trimap).astype(np.uint8)
    rows, columns = np.flatnonzero((trimap != cv2.GC_BGD).any(axis=1)), np.flatnonzero((trimap != cv2.GC_BGD).any(axis=0))
    result = np.zeros(view.shape, np.uint8)
    if len(rows) < 4 or len(columns) < 4:
        return result
    ring = int(RING * max(rows[-1] - rows[0], columns[-1] - columns[0])) + 2
    window = (slice(max(0, rows[0] - ring), rows[-1] + ring), slice(max(0, columns[0] - ring), columns[-1] + ring))
    cut = np.ascontiguousarray(trimap[window])
    is_object = of_object(cut)
    if is_object.any() and not is_object.all():
        cv2.setRNGSeed(1)
        cv2.grabCut(np.ascontiguousarray(view.image[window]), cut, None, np.zeros((1, 65)), np.zeros((1, 65)), ITERATIONS,
                    cv2.GC_INIT_WITH_MASK)
    result[window] = np.where(of_object(cut), 255, 0)
    return result


def first_trimap(view, volume, object_points):
    """From the box and the points. All points of the object project onto it, hidden ones too."""
    trimap = np.full(view.shape, cv2.GC_BGD, np.uint8)
    box = volume.silhouette(view)
    seeds = np.zeros(view.shape, np.uint8)
    _, x, y = view.pixels_of(object_points)
    seeds[y, x] = 255
    seeds[box == 0] = 0
    body = cv2.morphologyEx(seeds, cv2.MORPH_CLOSE, disc(max(3, extent(seeds) // 5 | 1)))
    trimap[box > 0] = cv2.GC_PR_BGD if seeds.any() else cv2.GC_PR_FGD
    trimap[body > 0] = cv2.GC_PR_FGD
    radius = max(1, round(SEED_RADIUS * max(view.shape)))
    trimap[cv2.dilate(seeds, disc(2 * radius + 1)) > 0] = cv2.GC_FGD
    trimap[(view.hidden > 0) & (box > 0)] = cv2.GC_FGD
    return trimap


def band_trimap(view, silhouette, band, seeds):
    """From a silhouette whose outline is right but for `band`, a share of its size. @param seeds points of the object,
    which lie inside: else parts of the table's colour would go, a little with each round."""
    trimap = np.full(silhouette.shape, cv2.GC_BGD, np.uint8)
    width = 2 * max(1, round(band * extent(silhouette))) + 1
    outer, inner = cv2.dilate(silhouette, disc(width)), cv2.erode(silhouette, disc(width))
    trimap[outer > 0] = cv2.GC_PR_BGD
    trimap[silhouette > 0] = cv2.GC_PR_FGD
    trimap[inner > 0] = cv2.GC_FGD
    _, x, y = view.pixels_of(seeds)
    within = outer[y, x] > 0
    trimap[y[within], x[within]] = cv2.GC_FGD
    trimap[(view.hidden > 0) & (outer > 0)] = cv2.GC_FGD
    return trimap


def on_surface(points):
    """The points near the plane through their neighbours. Others are wrong matches, and may lie beside the object."""
    count = min(NEIGHBOURS, len(points) - 1)
    if count < 3:
        return points
    distances, numbers = nearest(points, count)
    around = points[numbers] - points[numbers].mean(axis=1, keepdims=True)
    normals = np.linalg.svd(around, full_matrices=False)[2][:, 2]
    heights = np.abs(np.einsum('ni,ni->n', points - points[numbers].mean(axis=1), normals))
    return points[heights < OFF_SURFACE * distances.mean(axis=1)]


def agreement(a, b):
    """Intersection over union."""
    union = np.count_nonzero((a > 0) | (b > 0))
    return np.count_nonzero((a > 0) & (b > 0)) / union if union else 0.0


def agreed(view, mask, silhouette):
    """The mask within a band around the silhouette, in it without the table. No photo alone may cut away what the others
    see: a volume is cut by each silhouette."""
    share = agreement(mask, silhouette)
    if share < MIN_AGREEMENT:
        return silhouette, share
    outer, inner = (2 * max(1, round(band * extent(silhouette))) + 1 for band in (OUTER_BAND, INNER_BAND))
    within = cv2.bitwise_and(mask, cv2.dilate(silhouette, disc(outer)))
    core = cv2.erode(silhouette, disc(inner))
    result = solid(cv2.bitwise_or(within, core))
    return cv2.bitwise_and(result, 255 - cv2.bitwise_and(view.table, 255 - core)), share


def mask_of(view, trimap):
    """The user's mask, that of the photo's alpha, or what GrabCut makes of a trimap."""
    given = view.cut_out if view.drawn is None else view.drawn
    return solid(grab_cut(view, trimap)) if given is None else given


def view_of(photo, side):
    view = View(photo.image, photo.camera, (photo.R, photo.t), photo.drawn, side)
    if photo.cut_out is not None:
        view.cut_out = view.reduced(photo.cut_out)
    return view


def views_of(photos, box, region, side):
    """The photos at the size at which masks are found [px], with what the table tells. @param photos undistorted"""
    views = in_threads(lambda photo: view_of(photo, side), photos)
    if region.table_is_known:
        partners = partners_of(views, box)
        for view, shown in zip(views, in_threads(lambda i: shows_plane(views[i], [views[j] for j in partners[i]]),
                                                 range(len(views)))):
            given = view.cut_out if view.drawn is None else view.drawn
            view.table = shown if given is None else cv2.bitwise_and(shown, 255 - given)
        table = Table(views, box, region.points)
        for view, (hidden, beyond) in zip(views, in_threads(table.hidden_in, views)):
            view.hidden, view.beyond = hidden, beyond
    return views


def first_volume(photos, box, region, side=ROUGH_SIDE):
    """What rough masks have in common, from the box and the points alone. @param photos undistorted; box (low, high) of the
    object in the world, which may be larger than the object; region see object_region: its points, and whether the table
    is known, count here"""
    views, volume = views_of(photos, box, region, side), Volume(*box)
    for view in views:
        view.added = np.zeros(view.shape, np.uint8)  # not known yet
    volume.vote(views, in_threads(lambda view: mask_of(view, first_trimap(view, volume, region.points)), views))
    return volume


def refined(views, volume, region):
    """Masks that agree, of volume's silhouettes. @param volume of first_volume, which is changed to what they have in common
    @return list of Mask"""
    seeds, masks = on_surface(region.points), []
    for view in views:
        if view.drawn is not None:
            found = volume.silhouette(view)
            view.added = cv2.bitwise_and(view.drawn, 255 - cv2.dilate(found, disc(2 * max(1, round(BAND * extent(found))) + 1)))
    for _ in range(ROUNDS):
        masks = in_threads(lambda view: mask_of(view, band_trimap(view, volume.silhouette(view), BAND, seeds)), views)
        volume.vote(views, masks)
        if not volume.occupied.any():
            break
    results = in_threads(lambda pair: agreed(pair[0], pair[1], volume.silhouette(pair[0])), zip(views, masks))
    return [Mask(view.full(mask), share) for view, (mask, share) in zip(views, results)]
