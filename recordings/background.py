# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The room behind the object: rendered once as a panorama, then looked up for every direction of the camera.

The camera turns in the middle of the room, so its images have no parallax among themselves and the look-up is exact.
"""
import math

import cv2
import numpy as np

import motion

LATITUDE = 0.75  # rad above and below the horizon that the camera can see
COLUMNS = 4096   # of the full circle: as many pixels a radian as the camera has
SIZE = (COLUMNS, round(COLUMNS * 2 * LATITUDE / (2 * math.pi)))


class Panorama:
    def __init__(self, path):
        self.image = cv2.imread(path)
        if self.image is None:
            raise SystemExit("cannot read " + path)
        u, v = np.meshgrid(np.arange(motion.WIDTH), np.arange(motion.HEIGHT))
        self.rays_C = np.stack([(u - motion.CX) / motion.FOCAL_PX, (v - motion.CY) / motion.FOCAL_PX,
                                np.ones(u.shape)], -1)

    def seen_from(self, T_W_C):
        """The image of a camera in the room's middle, uint8 [h][w][3]."""
        ray = self.rays_C @ T_W_C[:3, :3].T
        longitude = np.arctan2(ray[..., 1], ray[..., 0])
        latitude = np.arctan2(ray[..., 2], np.hypot(ray[..., 0], ray[..., 1]))
        column = (0.5 - longitude / (2 * math.pi)) * SIZE[0] - 0.5
        row = (0.5 - latitude / (2 * LATITUDE)) * SIZE[1] - 0.5
        return cv2.remap(self.image, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR,
                         borderMode=cv2.BORDER_WRAP)


def set_panoramic(camera):
    """Makes a Blender camera take this module's panorama; it must look along the world's +x with z upwards."""
    camera.type = "PANO"
    camera.cycles.panorama_type = "EQUIRECTANGULAR"
    camera.cycles.latitude_min, camera.cycles.latitude_max = -LATITUDE, LATITUDE
    camera.cycles.longitude_min, camera.cycles.longitude_max = -math.pi, math.pi


def composed(rgba, behind):
    """An image with straight alpha over another; values are 0..255."""
    alpha = rgba[..., 3:].astype(np.float32) / 255
    return rgba[..., :3] * alpha + np.minimum(behind, 255) * (1 - alpha)
