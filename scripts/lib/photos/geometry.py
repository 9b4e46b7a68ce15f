# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Similarities, triangulation and rotations, in numpy."""
import cv2
import numpy as np


def exp_so3(w):
    """Rotation of a rotation vector [rad]; Rodrigues."""
    angle = np.linalg.norm(w)
    K = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    if angle < 1e-8:
        return np.eye(3) + K
    return np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle ** 2 * K @ K


def angle_deg(R):
    """Angle of a rotation, or of each of an array [..][3][3]."""
    cosine = 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def nearest(points, count):
    """(distances, numbers) of the other points that are nearest to each: [n][count], nearest first."""
    centred = np.ascontiguousarray(points - points.mean(axis=0), np.float32)
    distances, numbers = cv2.batchDistance(centred, centred, cv2.CV_32F, K=count + 1)
    return distances[:, 1:], numbers[:, 1:]  # without itself


def similarity(source, target):
    """(scale, R, t) with target = scale * R source + t in the least squares (Umeyama 1991). Rows are points."""
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    a, b = source - source_mean, target - target_mean
    U, S, Vt = np.linalg.svd(b.T @ a)
    sign = np.array([1, 1, np.sign(np.linalg.det(U @ Vt))])
    R = U * sign @ Vt
    scale = (S * sign).sum() / (a * a).sum()
    return scale, R, target_mean - scale * R @ source_mean


def rays(camera, xy):
    """Directions through pixels, undistorted, at depth 1 in the camera's frame: [n][3]."""
    fx, fy, cx, cy, k1, k2, p1, p2 = camera.parameters
    distorted = (xy - (cx, cy)) / (fx, fy)
    x = distorted.copy()
    for _ in range(20):
        u, v = x[:, 0], x[:, 1]
        r2 = u * u + v * v
        offset = np.column_stack((2 * p1 * u * v + p2 * (r2 + 2 * u * u), p1 * (r2 + 2 * v * v) + 2 * p2 * u * v))
        x = (distorted - offset) / (1 + k1 * r2 + k2 * r2 * r2)[:, None]
    return np.column_stack((x, np.ones(len(x))))


def nearest_point(origins, directions, weights=None):
    """The point nearest to lines in the least squares. @return (point, distances of the lines from it)."""
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    weights = np.ones(len(origins)) if weights is None else weights
    A = np.einsum('n,nij->ij', weights, across)
    point = np.linalg.solve(A + 1e-12 * np.eye(3), np.einsum('n,nij,nj->i', weights, across, origins))
    return point, np.linalg.norm(np.einsum('nij,nj->ni', across, point - origins), axis=1)


def focus(reconstruction):
    """Where the cameras look: the point nearest to the optical axes, without those that look elsewhere."""
    origins, axes = reconstruction.centres(), reconstruction.directions()
    point, distances = nearest_point(origins, axes)
    for _ in range(5):
        limit = 2 * np.median(distances) + 1e-9
        point, distances = nearest_point(origins, axes, (distances <= limit).astype(float))
    return point


def triangulated(reconstruction, photos, xy):
    """A point seen at xy[i] of photos[i]: the nearest to the rays. @return (point, median distance from the rays)."""
    directions, origins = [], reconstruction.centres()[photos]
    for photo, pixel in zip(photos, xy):
        camera = reconstruction.cameras[reconstruction.camera_of[photo]]
        directions.append(reconstruction.R[photo].T @ rays(camera, np.array([pixel]))[0])
    point, distances = nearest_point(origins, np.array(directions))
    return point, float(np.median(distances))
