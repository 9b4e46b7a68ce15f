# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Which pixels surely show the table: where it has texture, and a photo shows what the other photos show in that place. An
object of the table's colours is told from it so (a black one on a board)."""
import cv2
import numpy as np

GRID = 384              # of the table as seen from above [px]
BEYOND = 0.5            # around the box, of its size
VIEWS = 24              # that the table is put together from
FEW_VIEWS = 6
SAME = 30               # grey levels: the photo shows the table
STEADY = 15             # median deviation between the photos: all show the table, nothing stands there
TEXTURE = 18            # standard deviation in a window: agreement is no chance
WINDOW = 9
FOOT = 0.15             # of the box's size: gaps between the object's points from above that belong to it


def median_over_views(values, unknown):
    """Over the first axis, without NaN. (numpy.nanmedian takes five times as long.)"""
    values = np.sort(values, axis=0)  # NaN are last
    count = np.isfinite(values).sum(axis=0, keepdims=True)
    low, high = (np.take_along_axis(values, np.maximum(i, 0), axis=0)[0] for i in ((count - 1) // 2, count // 2))
    return np.where(count[0] > 0, 0.5 * (low + high), unknown).astype(np.float32)


class Table:
    """The table's plane z = 0 from above, put together from all views. @param views see masks.View; box (low, high);
    points of the object, below which nothing is the table."""

    def __init__(self, views, box, points):
        side = (1 + 2 * BEYOND) * float((box[1] - box[0])[:2].max())
        corner = 0.5 * (box[0] + box[1])[:2] - 0.5 * side
        self.to_plane = np.array([[side / GRID, 0, corner[0]], [0, side / GRID, corner[1]], [0, 0, 1]])
        chosen = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, min(VIEWS, len(views))).astype(int))]
        above = [self.from_above(view) for view in chosen]
        shown = np.array([image for image, _ in above], np.float32)
        shown[np.array([inside for _, inside in above]) == 0] = np.nan
        self.colour = median_over_views(shown, unknown=0)
        deviation = median_over_views(np.abs(shown - self.colour).max(axis=3), unknown=255)
        grey = self.colour.mean(axis=2)
        mean = cv2.blur(grey, (WINDOW, WINDOW))
        texture = np.sqrt(np.maximum(0, cv2.blur(grey * grey, (WINDOW, WINDOW)) - mean * mean))
        seen = np.isfinite(shown[:, :, :, 0]).sum(axis=0)
        known = (deviation < STEADY) & (texture > TEXTURE) & (seen >= FEW_VIEWS) & (self.foot(points) == 0)
        self.known = np.where(known, 255, 0).astype(np.uint8)

    def homography(self, view):
        """Pixels from above to pixels of a view. Pixels' centres are at whole numbers in both."""
        half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
        return np.linalg.inv(half) @ view.K @ np.column_stack((view.R[:, :2], view.t)) @ self.to_plane @ half

    def from_above(self, view):
        H, flags = self.homography(view), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        inside = cv2.warpPerspective(np.full(view.shape, 255, np.uint8), H, (GRID, GRID), flags=flags)
        return cv2.warpPerspective(view.image, H, (GRID, GRID), flags=flags), inside == 255

    def foot(self, points):
        """Where the object's points lie from above, without gaps."""
        image = np.zeros((GRID, GRID), np.uint8)
        pixel = np.floor((points[:, :2] - self.to_plane[:2, 2]) / self.to_plane[0, 0]).astype(int)
        inside = np.all((pixel >= 0) & (pixel < GRID), axis=1)
        image[pixel[inside, 1], pixel[inside, 0]] = 255
        width = int(FOOT * GRID / (1 + 2 * BEYOND)) | 1
        return cv2.morphologyEx(image, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width)))

    def pixels(self, view):
        """255 where a view surely shows the table."""
        H, size = self.homography(view), view.shape[::-1]
        known = cv2.warpPerspective(self.known, H, size, flags=cv2.INTER_NEAREST)
        colour = cv2.warpPerspective(self.colour, H, size, flags=cv2.INTER_LINEAR)
        same = np.abs(view.image.astype(np.float32) - colour).max(axis=2) < SAME
        shown = np.where(same & (known > 0), 255, 0).astype(np.uint8)
        return cv2.morphologyEx(shown, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
