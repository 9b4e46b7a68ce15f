# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Cameras and poses from a board in the photos, without structure from motion: intrinsics and all poses are found
together, by bundle adjustment from what OpenCV begins with (Zhang 2000)."""
import collections

import cv2
import numpy as np

from photos.bundle import Observed, adjusted, projected
from photos.common import count, require
from photos.reconstruction import Camera, Reconstruction

# `reconstruction` has the board's corners as points, in its frame [m]; `error_px` is the RMS; `left_out` {photo: reason}.
BoardPoses = collections.namedtuple('BoardPoses', 'reconstruction error_px left_out')

MIN_PHOTOS = 5
OUTLIER = 3.0            # times the median photo's error
MIN_OUTLIER_PX = 1.0
MAX_ERROR_PX = 3.0
# With what OpenCV begins: all that is not needed is fixed, for without priors what is free and not seen goes astray.
SIMPLE = (cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K2 |
          cv2.CALIB_FIX_K3)
GIVEN = (cv2.CALIB_FIX_FOCAL_LENGTH | cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 |
         cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_TANGENT_DIST)
MIN_SIGMA_PX = 0.05


def calibrated(corners, points, camera, flags):
    """One call of OpenCV's. @param corners [{number: xy}] of photos; camera, where it begins, and what `flags` fix.
    @return (RMS [px], parameters, [(R, t)], [error of each photo])."""
    objects = [np.array([points[number] for number in found], np.float32) for found in corners]
    pixels = [np.array(list(found.values()), np.float32) - 0.5 for found in corners]
    rms, K, distortion, rotations, translations, _, _, errors = cv2.calibrateCameraExtended(
        objects, pixels, (camera.width, camera.height), camera.matrix(), np.append(camera.parameters[4:], 0),
        flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS)
    parameters = np.array([K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, *distortion.ravel()[:4]])
    return rms, parameters, [(cv2.Rodrigues(r)[0], t.ravel()) for r, t in zip(rotations, translations)], errors.ravel()


def observed(corners, points):
    return Observed(len(corners), np.repeat(np.arange(len(corners)), [len(found) for found in corners]),
                    np.array([points[number] for found in corners for number in found]),
                    np.array([xy for found in corners for xy in found.values()], dtype=float))


def solved(corners, points, camera):
    """The same as `calibrated`, with the lens that is likeliest. @param camera {width, height, parameters: given ones or
    None}"""
    width, height = camera['width'], camera['height']
    if camera['parameters'] is not None:
        return calibrated(corners, points, Camera(width, height, np.array(camera['parameters'], dtype=float)), GIVEN)
    focal = float(max(width, height))
    start = Camera(width, height, np.array([focal, focal, width / 2, height / 2, 0, 0, 0, 0]))
    rms, parameters, poses, _ = calibrated(corners, points, start, SIMPLE)
    seen = observed(corners, points)
    best, poses = adjusted(seen, Camera(width, height, parameters), poses, max(MIN_SIGMA_PX, rms / np.sqrt(2)))
    squares = ((projected(seen, best, poses) - seen.xy) ** 2).sum(axis=1)
    of_photos = np.bincount(seen.photo, squares) / np.bincount(seen.photo)
    return float(np.sqrt(squares.mean())), best.parameters, poses, np.sqrt(of_photos)


def poses_from_board(names, corners, points, camera):
    """Poses of all photos of one camera. @param names of photos; corners [{number: xy}], empty where the board was not
    found; points {number: point [m]}; camera {width, height, parameters: fixed ones or None}."""
    left_out = {name: 'the board is not seen' for name, found in zip(names, corners) if not found}
    kept = [i for i, found in enumerate(corners) if found]
    while True:
        require(len(kept) >= MIN_PHOTOS, f'the board was found in {count(len(kept), "photo")}: at least {MIN_PHOTOS} are '
                'needed. Is it the board that --board names, flat, sharp and not covered?')
        error_px, parameters, poses, errors = solved([corners[i] for i in kept], points, camera)
        limit = max(MIN_OUTLIER_PX, OUTLIER * float(np.median(errors)))
        if np.all(errors <= limit):
            break
        for i, error in zip(kept, errors):
            if error > limit:
                left_out[names[i]] = f'its corners lie {error:.1f} px beside the board'
        kept = [i for i, error in zip(kept, errors) if error <= limit]
    require(error_px < MAX_ERROR_PX, f'the corners lie {error_px:.1f} px beside the board: it is not flat, or not the one '
            'that --board names')
    return BoardPoses(assembled([names[i] for i in kept], [corners[i] for i in kept], points,
                                (Camera(camera['width'], camera['height'], parameters), poses)), float(error_px),
                      left_out)


def assembled(names, corners, points, solution):
    camera, poses = solution
    numbers = sorted(points)
    observed = [(photo, numbers.index(number), xy) for photo, found in enumerate(corners) for number, xy in found.items()]
    photo_of, point_of, xy = zip(*observed)
    return Reconstruction([camera], names, np.zeros(len(names), int), np.array([R for R, _ in poses]),
                          np.array([t for _, t in poses]), np.array([points[number] for number in numbers]),
                          np.array(photo_of), np.array(point_of), np.array(xy))
