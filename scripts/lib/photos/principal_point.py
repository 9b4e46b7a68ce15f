# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Where the principal points of the cameras most likely are: what photos show of them, weighed against where lenses have them.

Photos that were all held upright at one height say nothing of one of the two coordinates: a bundle adjustment that leaves it
free puts it anywhere (20 to 30 px beside the middle, at 480 px of width), and turns all cameras by degrees.
"""
import numpy as np

from photos import bundle

MAX_POINTS = 4000        # that are looked at: of more, each second, third ..
FOCAL_SIGMA = 0.5        # priors of what else is free in COLMAP's RADIAL: focal length's ratio, k1 and k2
RADIAL_SIGMA = 0.5
MAX_FOCAL_CHANGE = 0.2   # [log] that freeing the principal points may cause; beyond it the photos say nothing of the lens
GAUGE = 1e-9             # of the poses' information: the place, turn and scale of all together are open
# A lens' free parameters f, cx, cy, k1, k2 as columns of those of a Camera.
FREE = np.eye(8)[:, [0, 2, 3, 4, 5]]
FREE[1, 0] = 1
MIDDLE = slice(1, 3)


def likely(held, free):
    """[cameras][2] px from the image's corner: the mean of the posterior, of observations and of a normal prior around the
    middle. @param held, free a reconstruction adjusted with its principal points in the middle, and with free ones."""
    middle = np.array([(camera.width / 2, camera.height / 2) for camera in held.cameras])
    ratios = [new.focal / old.focal for new, old in zip(free.cameras, held.cameras)]
    if max(np.abs(np.log(ratios))) > MAX_FOCAL_CHANGE:
        return middle
    offset = np.array([camera.parameters[2:4] for camera in free.cameras]) - middle
    variance = np.repeat([(bundle.MIDDLE_SIGMA * camera.width) ** 2 for camera in held.cameras], 2)
    return middle + offset - (covariance(held) @ (offset.ravel() / variance)).reshape(-1, 2)


def covariance(reconstruction):
    """[2 cameras][2 cameras] px^2: posterior covariance of the principal points; all else is unknown, too."""
    photos, lenses = len(reconstruction.names), len(reconstruction.cameras)
    information = information_of(reconstruction) + np.diag(np.concatenate((np.zeros(6 * photos), lens_prior(reconstruction))))
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    information *= scale[:, None] * scale
    information[:6 * photos, :6 * photos] += GAUGE * np.eye(6 * photos)
    of_poses, mixed, of_lenses = (information[:6 * photos, :6 * photos], information[:6 * photos, 6 * photos:],
                                  information[6 * photos:, 6 * photos:])
    found = np.linalg.inv(of_lenses - mixed.T @ np.linalg.solve(of_poses, mixed))
    found *= scale[6 * photos:, None] * scale[6 * photos:]
    kept = np.arange(5 * lenses).reshape(lenses, 5)[:, MIDDLE].ravel()
    return found[np.ix_(kept, kept)]


def lens_prior(reconstruction):
    """[5 cameras] inverse variances of each camera's f, cx, cy, k1, k2."""
    return np.concatenate([1 / np.square((FOCAL_SIGMA * camera.focal, bundle.MIDDLE_SIGMA * camera.width,
                                          bundle.MIDDLE_SIGMA * camera.width, RADIAL_SIGMA, RADIAL_SIGMA))
                           for camera in reconstruction.cameras])


def information_of(reconstruction):
    """[n][n] of n = 6 photos + 5 cameras: J^T J / sigma^2 of all observations, once the points are eliminated (their Schur
    complement). The observations' sigma is what is left of their errors."""
    by_pose, by_lens, by_point = jacobians(reconstruction)
    photos, size = len(reconstruction.names), 6 * len(reconstruction.names) + 5 * len(reconstruction.cameras)
    errors = reconstruction.errors()
    variance = np.mean(errors[np.isfinite(errors)] ** 2) / 2
    order = np.argsort(reconstruction.point_of, kind='stable')
    tracks = np.split(order, np.flatnonzero(np.diff(reconstruction.point_of[order])) + 1)
    step = -(-len(tracks) // MAX_POINTS)
    total = np.zeros((size, size))
    for track in tracks[::step]:
        # A photo can see a point twice, and a camera takes many photos: each is one block of columns.
        photo, own_photo = np.unique(reconstruction.photo_of[track], return_inverse=True)
        camera, own_camera = np.unique(reconstruction.camera_of[reconstruction.photo_of[track]], return_inverse=True)
        n, rows = len(track), np.arange(len(track))
        pose_blocks, lens_blocks = np.zeros((n, len(photo), 2, 6)), np.zeros((n, len(camera), 2, 5))
        pose_blocks[rows, own_photo], lens_blocks[rows, own_camera] = by_pose[track], by_lens[track]
        J = np.hstack([blocks.transpose(0, 2, 1, 3).reshape(2 * n, -1) for blocks in (pose_blocks, lens_blocks)])
        Q, _ = np.linalg.qr(by_point[track].reshape(2 * n, 3))
        J -= Q @ (Q.T @ J)
        columns = np.concatenate(((6 * photo[:, None] + np.arange(6)).ravel(),
                                  (6 * photos + 5 * camera[:, None] + np.arange(5)).ravel()))
        total[np.ix_(columns, columns)] += J.T @ J
    return total * step / variance


def jacobians(reconstruction):
    """[observations][2][6], [..][2][5] and [..][2][3]: of the projections by their photo's pose, their lens, their point."""
    count = len(reconstruction.xy)
    by_pose, by_lens = np.zeros((count, 2, 6)), np.zeros((count, 2, 5))
    poses = list(zip(reconstruction.R, reconstruction.t))
    for i, camera in enumerate(reconstruction.cameras):
        own = np.flatnonzero(reconstruction.camera_of[reconstruction.photo_of] == i)
        observed = bundle.Observed(len(poses), reconstruction.photo_of[own], reconstruction.xyz[reconstruction.point_of[own]],
                                   reconstruction.xy[own])
        by_pose[own], all_of_lens = bundle.derivatives(observed, camera, poses)
        by_lens[own] = all_of_lens @ FREE
    # A point moves as its camera's frame does, turned into the world.
    return by_pose, by_lens, by_pose[:, :, 3:] @ reconstruction.R[reconstruction.photo_of]
