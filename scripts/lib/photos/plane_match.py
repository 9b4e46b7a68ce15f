# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Where a photo shows the table: what other photos show in that place of its plane is the same, from other directions
too (one plane of a sweep, Collins 1996). What stands on the table looks different there from each side. This needs no
idea of where the object is, and tells the table in its hollows, below an awning, say, where few photos look."""
import cv2
import numpy as np

PARTNERS = 10            # photos to compare a photo with: the nearest ones ..
APART = float(np.cos(np.radians(15)))   # .. but so far from its direction, for what stands on the table to look different
BETWEEN = float(np.cos(np.radians(4)))  # .. and so far from each other: neighbours of a video are alike
WINDOW = 5               # pixels of SIDE (photos.masks): larger ones let a board's squares beside the object decide
MIN_CORRELATION = 0.9    # in it
MIN_DEVIATION = 8        # grey levels in it: agreement is no chance
MIN_CORNER = 3.0         # least eigenvalue of the gradients' second moments in it: a straight edge may match by chance
MIN_MATCHES = 3          # partners that agree
RIM = 3                  # pixels: a window on the object's outline shows both


def partners_of(views, middle):
    """For each view the indices of those to compare it with. @param views see masks.View; middle of the object"""
    directions = np.array([-view.R.T @ view.t - middle for view in views])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    cosines, partners = directions @ directions.T, []
    for row in cosines:
        chosen = []
        for j in np.argsort(-row, kind='stable'):
            if len(chosen) < PARTNERS and row[j] < APART and np.all(cosines[j, chosen] < BETWEEN):
                chosen.append(j)
        partners.append(chosen)
    return partners


def plane_to_pixels(view):
    """Homography of the table's plane z = 0 to a view's pixels. Their centres are at whole numbers."""
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    return np.linalg.inv(half) @ view.K @ np.column_stack((view.R[:, :2], view.t))


def below_horizon(view):
    """Which pixels' rays meet the plane: the others would meet it behind the camera."""
    row = np.linalg.inv(plane_to_pixels(view))[2]  # a pixel's third coordinate is one over the place's depth
    rows, columns = np.indices(view.shape, dtype=np.float32)
    return row[0] * columns + row[1] * rows + row[2] > 0


def grey_of(view):
    return cv2.cvtColor(view.image, cv2.COLOR_BGR2GRAY).astype(np.float32)


def moments(image):
    """(mean, variance) in the window around each pixel."""
    mean = cv2.boxFilter(image, -1, (WINDOW, WINDOW))
    return mean, cv2.boxFilter(image * image, -1, (WINDOW, WINDOW)) - mean * mean


def agrees(a, b):
    """Where two images, of float32, are alike but for brightness and contrast."""
    (mean_a, variance_a), (mean_b, variance_b) = moments(a), moments(b)
    covariance = cv2.boxFilter(a * b, -1, (WINDOW, WINDOW)) - mean_a * mean_b
    least = MIN_DEVIATION ** 2
    return ((variance_a > least) & (variance_b > least)
            & (covariance > MIN_CORRELATION * np.sqrt(np.maximum(variance_a * variance_b, 1))))


def shows_plane(view, partners):
    """255 where a view surely shows the table. @param partners views, of any size"""
    to_plane = np.linalg.inv(plane_to_pixels(view))
    grey, matches = grey_of(view), np.zeros(view.shape, np.uint8)
    is_corner = cv2.cornerMinEigenVal(grey, WINDOW) > MIN_CORNER
    for partner in partners:
        matches += is_corner & agrees(grey, cv2.warpPerspective(grey_of(partner), plane_to_pixels(partner) @ to_plane, view.shape[::-1],
                                                    flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP))
    shown = np.where((matches >= MIN_MATCHES) & below_horizon(view), 255, 0).astype(np.uint8)
    rim = np.ones((RIM, RIM), np.uint8)
    return cv2.erode(cv2.morphologyEx(shown, cv2.MORPH_CLOSE, rim), rim)
