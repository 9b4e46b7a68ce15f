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
MIN_PARALLAX = 2.5       # pixels, of the box's top before the table: a flat object's top must look different, too
MIN_MATCHES = 3          # partners that agree
RIM = 3                  # pixels: a window on the object's outline shows both
HALF = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])  # from pixels whose centres are at whole numbers
HALF_BACK = np.linalg.inv(HALF)


def parallax(views, box):
    """[n][n]: how far the middle of the box's top lies, in photo j, from the place of the table that photo i shows there
    [px of photo j]."""
    top = np.array([*(0.5 * (box[0] + box[1])[:2]), box[1][2], 1])
    shifts = np.zeros((len(views), len(views)))
    at_top = [view.K @ np.column_stack((view.R, view.t)) @ top for view in views]
    for i, view in enumerate(views):
        below = np.linalg.solve(plane_to_pixels(view), HALF_BACK @ at_top[i])
        for j, other in enumerate(views):
            pixels = [p[:2] / p[2] for p in (plane_to_pixels(other) @ below, HALF_BACK @ at_top[j])]
            shifts[i, j] = np.linalg.norm(pixels[0] - pixels[1])
    return shifts


def partners_of(views, box):
    """For each view the indices of those to compare it with. @param views see masks.View; box of the object"""
    directions = np.array([-view.R.T @ view.t - 0.5 * (box[0] + box[1]) for view in views])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    cosines, shifts, partners = directions @ directions.T, parallax(views, box), []
    for row, shift in zip(cosines, shifts):
        chosen = []
        for j in np.argsort(-row, kind='stable'):
            told_apart = row[j] < APART and shift[j] > MIN_PARALLAX
            if len(chosen) < PARTNERS and told_apart and np.all(cosines[j, chosen] < BETWEEN):
                chosen.append(j)
        partners.append(chosen)
    return partners


def plane_to_pixels(view):
    """Homography of the table's plane z = 0 to a view's pixels. Their centres are at whole numbers."""
    return HALF_BACK @ view.K @ np.column_stack((view.R[:, :2], view.t))


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


def agrees(a, moments_of_a, b):
    """Where two images, of float32, are alike but for brightness and contrast."""
    (mean_a, variance_a), (mean_b, variance_b) = moments_of_a, moments(b)
    covariance = cv2.boxFilter(a * b, -1, (WINDOW, WINDOW)) - mean_a * mean_b
    least = MIN_DEVIATION ** 2
    return ((variance_a > least) & (variance_b > least)
            & (covariance > MIN_CORRELATION * np.sqrt(np.maximum(variance_a * variance_b, 1))))


def shows_plane(view, partners):
    """255 where a view surely shows the table. @param partners views, of any size"""
    to_plane, grey = np.linalg.inv(plane_to_pixels(view)), grey_of(view)
    own, matches = moments(grey), np.zeros(view.shape, np.uint8)
    is_corner = cv2.cornerMinEigenVal(grey, WINDOW) > MIN_CORNER
    for partner in partners:
        there = cv2.warpPerspective(grey_of(partner), plane_to_pixels(partner) @ to_plane, view.shape[::-1],
                                    flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        matches += is_corner & agrees(grey, own, there)
    shown = np.where((matches >= MIN_MATCHES) & below_horizon(view), 255, 0).astype(np.uint8)
    rim = np.ones((RIM, RIM), np.uint8)
    return cv2.erode(cv2.morphologyEx(shown, cv2.MORPH_CLOSE, rim), rim)
