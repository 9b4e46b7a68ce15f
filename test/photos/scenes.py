# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A box on a table, photographed from all around: as tracks of points with known poses, and as images."""
import dataclasses
import os
import sys

import cv2
import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
from photos import board_drawing  # noqa: E402 (after the path)
from photos.geometry import exp_so3  # noqa: E402
from photos.reconstruction import Camera, Reconstruction  # noqa: E402

BOX = np.array([0.2, 0.12, 0.16])   # of the object, on z = 0 around the origin
DISTANCE = 0.8
TABLE = 0.5                         # half its side
WIDTH, HEIGHT, FOCAL = 320, 240, 330.0


def camera(focal=FOCAL, distortion=(0, 0, 0, 0)):
    return Camera(WIDTH, HEIGHT, np.array([focal, focal, WIDTH / 2, HEIGHT / 2, *distortion], dtype=float))


def looking_at(centre, target):
    """(R, t) of a camera that is upright."""
    z = target - centre
    z = z / np.linalg.norm(z)
    x = np.cross(z, (0, 0, 1.0))
    x /= np.linalg.norm(x)
    R = np.array([x, np.cross(z, x), z])
    return R, -R @ centre


def around(azimuth_deg, elevation_deg, distance=DISTANCE):
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    centre = distance * np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)]) + (0, 0, 0.06)
    return looking_at(centre, np.array([0, 0, 0.06]))


def rounds(n, elevations=(25, 50)):
    """Poses of n cameras in each of some rounds."""
    return [around(360 * i / n + 10 * level, elevation) for level, elevation in enumerate(elevations) for i in range(n)]


def scene_points(random, on_table=400, on_box=400):
    """(points, outward normals) on the table and on the five visible sides of the box."""
    table = np.column_stack((random.uniform(-TABLE, TABLE, (on_table, 2)), np.zeros(on_table)))
    table = table[np.any(np.abs(table[:, :2]) > BOX[:2] / 2, axis=1)]
    points, normals = [table], [np.tile((0, 0, 1.0), (len(table), 1))]
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1)):
        side = random.uniform(-0.5, 0.5, (on_box // 5, 3)) * BOX
        side[:, axis] = sign * BOX[axis] / 2
        points.append(side + (0, 0, BOX[2] / 2))
        normals.append(np.tile(sign * np.eye(3)[axis], (len(side), 1)))
    return np.concatenate(points), np.concatenate(normals)


def reconstruction(poses=None, seed=1, noise_px=0.3, cameras=None):
    """Tracks of the scene: each camera sees the points that face it. @param cameras one, or one for each pose."""
    random = np.random.default_rng(seed)
    poses = rounds(14) if poses is None else poses
    cameras = [camera()] if cameras is None else cameras
    camera_of = np.arange(len(poses)) if len(cameras) > 1 else np.zeros(len(poses), int)
    xyz, normals = scene_points(random)
    photo_of, point_of, xy = [], [], []
    for i, (R, t) in enumerate(poses):
        pixels = cameras[camera_of[i]].pixels(xyz @ R.T + t)
        facing = np.einsum('ni,ni->n', normals, -R.T @ t - xyz) > 0
        seen = np.flatnonzero(facing & (pixels >= 0).all(axis=1) & (pixels < (WIDTH, HEIGHT)).all(axis=1))
        photo_of.append(np.full(len(seen), i))
        point_of.append(seen)
        xy.append(pixels[seen] + random.normal(0, noise_px, (len(seen), 2)))
    made = Reconstruction(cameras, [f'camera_0/view_{i:04d}.jpg' for i in range(len(poses))], camera_of,
                          np.array([R for R, _ in poses]), np.array([t for _, t in poses]), xyz, np.concatenate(photo_of),
                          np.concatenate(point_of), np.concatenate(xy))
    return made.of_points(made.photos_of_points() >= 2)


def turned(reconstruction_, photo, degrees):
    """The same with a wrong pose: the camera is turned about its place."""
    R, t = reconstruction_.R.copy(), reconstruction_.t.copy()
    turn = exp_so3(np.radians(degrees) * np.array([0.6, 0.8, 0]))
    R[photo], t[photo] = turn @ R[photo], turn @ t[photo]
    return R, t


def folded(n=24, shared=0.3, seed=3):
    """A model in which the cameras of the far side were put onto the near side: the far ones see points of their own,
    and those of the near ones (the same artwork on both sides) that are shared.
    @param shared part of the points, or a function of them [n][3] that says which"""
    random = np.random.default_rng(seed)
    azimuths = np.linspace(-80, 80, n // 2)
    near = reconstruction([around(a, e) for a in azimuths for e in (25,)], seed=seed)
    far = reconstruction([around(a + 2, e) for a in azimuths for e in (25,)], seed=seed)
    own = ~shared(far.xyz) if callable(shared) else random.uniform(size=len(far.xyz)) > shared
    number = np.where(own, len(near.xyz) + np.arange(len(far.xyz)), np.arange(len(far.xyz)))
    both = dataclasses.replace(
        near, names=[f'{i}.jpg' for i in range(2 * len(near.names))], camera_of=np.zeros(2 * len(near.names), int),
        R=np.concatenate((near.R, far.R)), t=np.concatenate((near.t, far.t)), xyz=np.concatenate((near.xyz, far.xyz)),
        photo_of=np.concatenate((near.photo_of, far.photo_of + len(near.names))),
        point_of=np.concatenate((near.point_of, number[far.point_of])), xy=np.concatenate((near.xy, far.xy)))
    return both, len(near.names)


# Images

def texture(seed, hue):
    """Blotches of one hue, 256 x 256."""
    random = np.random.default_rng(seed)
    noise = sum(cv2.resize(random.uniform(0, 1, (n, n)).astype(np.float32), (256, 256), interpolation=cv2.INTER_CUBIC)
                for n in (8, 24, 64)) / 3
    value = np.clip(60 + 180 * noise, 0, 255).astype(np.uint8)
    saturation = np.full_like(value, 190)
    return cv2.cvtColor(cv2.merge([np.full_like(value, hue), saturation, value]), cv2.COLOR_HSV2BGR)


def detailed(paint, seed):
    """The same with small spots of its hue, dark and light, which structure from motion can hold on to."""
    random = np.random.default_rng(100 + seed)
    spotted = cv2.resize(paint, (1024, 1024), interpolation=cv2.INTER_CUBIC)
    hue = paint.reshape(-1, 3).mean(axis=0) / paint.max()
    for x, y, radius, value in random.integers((0, 0, 4, 60), (1024, 1024, 16, 300), (900, 4)).tolist():
        cv2.circle(spotted, (x, y), radius, (value * hue).tolist(), -1, cv2.LINE_AA)
    return spotted


def quads():
    """(corners [4][3], texture) of the table and of the sides of the box; counter-clockwise from outside."""
    s, (x, y, z) = TABLE, BOX * (0.5, 0.5, 1)
    yield np.array([(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)]), texture(1, 100)
    for i, side in enumerate((((x, -y, 0), (x, y, 0), (x, y, z), (x, -y, z)), ((-x, y, 0), (-x, -y, 0), (-x, -y, z), (-x, y, z)),
                              ((x, y, 0), (-x, y, 0), (-x, y, z), (x, y, z)), ((-x, -y, 0), (x, -y, 0), (x, -y, z), (-x, -y, z)),
                              ((-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)))):
        yield np.array(side), texture(2 + i, 5)


def on_board(board):
    """The same with a printed board instead of the table, its middle below the box: [(corners, texture)]."""
    printed = cv2.cvtColor(board_drawing.picture(board, 3), cv2.COLOR_GRAY2BGR)
    half = 0.0005 * board.square_mm * np.array([board.columns + 1, board.rows + 1])
    corners = np.array([(-half[0], -half[1], 0), (half[0], -half[1], 0), (half[0], half[1], 0), (-half[0], half[1], 0)])
    return [(corners, printed)] + [(side, detailed(paint, i)) for i, (side, paint) in enumerate(quads()) if i]


def render(pose, of=None, painted=None):
    """An image of the scene by a camera without distortion. @param painted [(corners, texture)] instead of quads()."""
    of = of or camera()
    R, t = pose
    centre = -R.T @ t
    image = np.full((of.height, of.width, 3), 90, np.uint8)
    for corners, paint in painted or quads():
        normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
        if normal @ (centre - corners[0]) <= 0:
            continue
        pixels = of.pixels(corners @ R.T + t) - 0.5
        h, w = paint.shape[:2]
        H = cv2.getPerspectiveTransform(np.float32([(0, h), (w, h), (w, 0), (0, 0)]) - 0.5, pixels.astype(np.float32))
        size = (of.width, of.height)
        drawn = cv2.warpPerspective(paint, H, size, flags=cv2.INTER_AREA)
        inside = cv2.warpPerspective(np.full((h, w), 255, np.uint8), H, size)
        image = np.where(inside[:, :, None] > 127, drawn, image)
    return image


def true_mask(pose, of=None):
    """255 where the box is."""
    white = np.full((8, 8, 3), 255, np.uint8)
    black = np.zeros((8, 8, 3), np.uint8)
    painted = [(corners, white if i else black) for i, (corners, _) in enumerate(quads())]
    return np.where(render(pose, of, painted)[:, :, 0] > 127, 255, 0).astype(np.uint8)
