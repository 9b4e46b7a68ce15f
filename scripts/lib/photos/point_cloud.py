# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Points of a scene from photos with known poses: SIFT features of neighbouring views, where they agree with the poses."""
import dataclasses

import cv2
import numpy as np

from photos.geometry import focus

FEATURES = 2000
NEIGHBOURS = 4
MIN_ANGLE_DEG, MAX_ANGLE_DEG = 4, 35
RATIO = 0.8             # to the second best match (Lowe 2004)
MAX_ERROR_PX = 1.5


def features(image):
    """(pixels [n][2] from the image's corner, descriptors)."""
    found, descriptors = cv2.SIFT_create(nfeatures=FEATURES).detectAndCompute(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), None)
    return np.array([feature.pt for feature in found]).reshape(-1, 2) + 0.5, descriptors


def neighbour_pairs(reconstruction):
    """Pairs of photos that look from near directions, but not from one."""
    to_camera = reconstruction.centres() - focus(reconstruction)
    to_camera /= np.linalg.norm(to_camera, axis=1, keepdims=True)
    angle = np.degrees(np.arccos(np.clip(to_camera @ to_camera.T, -1, 1)))
    pairs = set()
    for i, row in enumerate(angle):
        usable = np.flatnonzero((row > MIN_ANGLE_DEG) & (row < MAX_ANGLE_DEG))
        pairs.update((min(i, j), max(i, j)) for j in usable[np.argsort(row[usable])][:NEIGHBOURS])
    return sorted(pairs)


def matched(first, second):
    """Pairs of indices of features that are each other's best."""
    if first[1] is None or second[1] is None or min(len(first[0]), len(second[0])) < 2:
        return np.zeros((0, 2), int)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    forward = {a.queryIdx: a.trainIdx for a, b in (m for m in matcher.knnMatch(first[1], second[1], k=2) if len(m) == 2)
               if a.distance < RATIO * b.distance}
    backward = {m.queryIdx: m.trainIdx for m in matcher.match(second[1], first[1])}
    return np.array([(i, j) for i, j in forward.items() if backward.get(j) == i], int).reshape(-1, 2)


def points_of_pair(reconstruction, pair, pixels):
    """Points of matched pixels [2][n][2] of two undistorted photos, and which of them agree with the poses."""
    projections = []
    for photo in pair:
        camera = reconstruction.cameras[reconstruction.camera_of[photo]]
        projections.append(camera.matrix() @ np.column_stack((reconstruction.R[photo], reconstruction.t[photo])))
    homogeneous = cv2.triangulatePoints(*projections, *[(p - 0.5).T.astype(float) for p in pixels])
    with np.errstate(divide='ignore', invalid='ignore'):
        points = (homogeneous[:3] / homogeneous[3]).T
    good = np.isfinite(points).all(axis=1)
    for photo, observed in zip(pair, pixels):
        offset = np.linalg.norm(reconstruction.projected(photo, points) - observed, axis=1)
        good &= np.nan_to_num(offset, nan=np.inf) < MAX_ERROR_PX
    return points, good


def with_points(reconstruction, images):
    """The reconstruction with the points that its photos show. @param images undistorted, of pinholes."""
    found = [features(image) for image in images]
    xyz, photo_of, point_of, xy = [], [], [], []
    for pair in neighbour_pairs(reconstruction):
        matches = matched(found[pair[0]], found[pair[1]])
        if not len(matches):
            continue
        pixels = [found[photo][0][matches[:, side]] for side, photo in enumerate(pair)]
        points, good = points_of_pair(reconstruction, pair, pixels)
        numbers = len(xyz) + np.arange(good.sum())
        xyz.extend(points[good])
        for photo, observed in zip(pair, pixels):
            photo_of.extend([photo] * len(numbers))
            point_of.extend(numbers)
            xy.extend(observed[good])
    return dataclasses.replace(reconstruction, xyz=np.array(xyz).reshape(-1, 3), photo_of=np.array(photo_of, int),
                               point_of=np.array(point_of, int), xy=np.array(xy).reshape(-1, 2))

