# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Bundle adjustment of one camera's photos of known points: poses and lens together, by Levenberg-Marquardt.

Every lens parameter is free, held by a prior: what photos show of it counts, and where they show little it stays as lenses
usually are. To fix what is not zero makes poses wrong (a principal point that is 1 px off turns cameras by 0.05 degrees at
1000 px of focal length); to free what is not seen makes them noisy.
"""
import dataclasses

import numpy as np

from photos.geometry import exp_so3
from photos.reconstruction import Camera

# Standard deviations: focal lengths' ratio, principal point from the middle [of the width], k1, k2, p1, p2.
ASPECT_SIGMA, MIDDLE_SIGMA = 0.002, 0.006
DISTORTION_SIGMA = np.array([0.3, 0.3, 0.001, 0.001])
STEPS = 60
HUBER = 2.5          # times the corners' deviation
STEP = 1e-6          # of numeric derivatives


@dataclasses.dataclass
class Observed:
    """Corners of all photos: photo [n], points [n][3] and pixels [n][2]; `photos` many."""
    photos: int
    photo: np.ndarray
    points: np.ndarray
    xy: np.ndarray


def moved(pose, change):
    """(R, t) after a small turn and shift of the camera's frame. @param change [6]"""
    R, t = pose
    turn = exp_so3(change[:3])
    return turn @ R, turn @ t + change[3:]


def projected(observed, camera, poses):
    R, t = np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])
    in_camera = np.einsum('nij,nj->ni', R[observed.photo], observed.points) + t[observed.photo]
    return camera.pixels(in_camera)


def with_parameters(camera, parameters):
    return Camera(camera.width, camera.height, parameters)


def derivatives(observed, camera, poses):
    """[n][2][6] by each photo's pose and [n][2][8] by the lens, by central differences."""
    by_pose, by_lens = np.zeros((len(observed.xy), 2, 6)), np.zeros((len(observed.xy), 2, 8))
    for i in range(6):
        change = STEP * np.eye(6)[i]
        ahead = projected(observed, camera, [moved(pose, change) for pose in poses])
        by_pose[:, :, i] = (ahead - projected(observed, camera, [moved(pose, -change) for pose in poses])) / (2 * STEP)
    for i in range(8):
        step = STEP * (camera.width if i < 4 else 1)
        change = step * np.eye(8)[i]
        ahead = projected(observed, with_parameters(camera, camera.parameters + change), poses)
        behind = projected(observed, with_parameters(camera, camera.parameters - change), poses)
        by_lens[:, :, i] = (ahead - behind) / (2 * step)
    return by_pose, by_lens


def prior(camera):
    """(A, b): the sum of squares |A x - b|^2 holds the lens' parameters x."""
    width = camera.width
    rows = [(np.array([1, -1, 0, 0, 0, 0, 0, 0]), 0, ASPECT_SIGMA * camera.focal),
            (np.eye(8)[2], width / 2, MIDDLE_SIGMA * width), (np.eye(8)[3], camera.height / 2, MIDDLE_SIGMA * width)]
    rows += [(np.eye(8)[4 + i], 0, sigma) for i, sigma in enumerate(DISTORTION_SIGMA)]
    return np.array([row / sigma for row, _, sigma in rows]), np.array([value / sigma for _, value, sigma in rows])


def cost(observed, state, sigma):
    """(sum, offsets [n][2] px, weights [n] of a robust loss); infinite where a point is behind its camera."""
    camera, poses = state
    offset = observed.xy - projected(observed, camera, poses)
    ratio = np.linalg.norm(offset, axis=1) / sigma
    with np.errstate(invalid='ignore', divide='ignore'):
        loss = np.where(ratio <= HUBER, ratio ** 2, 2 * HUBER * ratio - HUBER ** 2).sum()
        weights = np.minimum(1, HUBER / np.maximum(ratio, 1e-12))
    A, b = prior(camera)
    total = loss + ((A @ camera.parameters - b) ** 2).sum()
    return (total if np.isfinite(total) else np.inf), offset, weights


def normal_equations(observed, state, found, sigma):
    """(H of each pose [photos][6][6], H between pose and lens [photos][6][8], H of the lens, g of poses, g of the lens)."""
    camera, poses = state
    _, offset, weights = found
    by_pose, by_lens = derivatives(observed, camera, poses)
    weight = weights / sigma ** 2
    n = observed.photos
    H, mixed, g = np.zeros((n, 6, 6)), np.zeros((n, 6, 8)), np.zeros((n, 6))
    np.add.at(H, observed.photo, np.einsum('n,nki,nkj->nij', weight, by_pose, by_pose))
    np.add.at(mixed, observed.photo, np.einsum('n,nki,nkj->nij', weight, by_pose, by_lens))
    np.add.at(g, observed.photo, np.einsum('n,nki,nk->ni', weight, by_pose, offset))
    A, b = prior(camera)
    lens = np.einsum('n,nki,nkj->ij', weight, by_lens, by_lens) + A.T @ A
    g_lens = np.einsum('n,nki,nk->i', weight, by_lens, offset) + A.T @ (b - A @ camera.parameters)
    return H, mixed, lens, g, g_lens


def step_of(equations, damping):
    """Solution of the damped equations: changes of all poses and of the lens, by the Schur complement of the poses."""
    H, mixed, lens, g, g_lens = equations
    damped = H + damping * H * np.eye(6)
    inverse = np.linalg.inv(damped)
    reduced = lens + damping * lens * np.eye(8) - np.einsum('pji,pjk,pkl->il', mixed, inverse, mixed)
    change = np.linalg.solve(reduced, g_lens - np.einsum('pji,pjk,pk->i', mixed, inverse, g))
    return np.einsum('pij,pj->pi', inverse, g - mixed @ change), change


def middle_sigma(observed, state, sigma):
    """Standard deviation of the principal point [px], the larger of its two."""
    H, mixed, lens, _, _ = normal_equations(observed, state, cost(observed, state, sigma), sigma)
    reduced = lens - np.einsum('pji,pjk,pkl->il', mixed, np.linalg.inv(H), mixed)
    return float(np.sqrt(np.diag(np.linalg.inv(reduced))[2:4].max()))


def adjusted(observed, camera, poses, sigma, is_lens_given=False):
    """@param camera, poses to begin with; sigma of the corners [px]. @return (camera, poses)"""
    state, damping = (camera, poses), 1e-3
    best = cost(observed, state, sigma)
    for _ in range(STEPS):
        equations = normal_equations(observed, state, best, sigma)
        if is_lens_given:
            equations = equations[0], 0 * equations[1], np.eye(8), equations[3], np.zeros(8)
        by_pose, by_lens = step_of(equations, damping)
        trial = (with_parameters(state[0], state[0].parameters + by_lens),
                 [moved(pose, change) for pose, change in zip(state[1], by_pose)])
        found = cost(observed, trial, sigma)
        if found[0] <= best[0]:
            done = best[0] - found[0] < 1e-9 * best[0]
            state, best, damping = trial, found, max(1e-9, damping / 5)
            if done:
                break
        else:
            damping *= 8
            if damping > 1e8:
                break
    return state
