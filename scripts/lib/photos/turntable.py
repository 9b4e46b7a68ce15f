# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The model turning before the eyes: renderings from around it side by side in one picture, which a page shows one after
the other without any script."""
import os
import tempfile

import cv2
import numpy as np

from photos.common import InputError, require, write_json
from photos.dataset import PosedPhoto, camera_to_world
from photos.reconstruction import Camera
from photos.tools import run_tool

FRAMES = 24
SIDE = 240             # of a rendering [px]
ELEVATION_DEG = 25
FOCAL = 2.2            # over the image's side
MARGIN = 1.04          # around the sphere that holds the box
GREY = 236
SECONDS = 5            # of a turn
STYLE = f'''.turntable {{ width: {SIDE}px; height: {SIDE}px; animation: turn {SECONDS}s steps({FRAMES}) infinite; }}
@keyframes turn {{ to {{ background-position-x: -{FRAMES * SIDE}px; }} }}
@media (prefers-reduced-motion) {{ .turntable {{ animation: none; }} }}
'''


def poses_around(low, high):
    """[(R, t)] of cameras that look at the middle of a box and see all of it; z is up."""
    middle, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    distance = MARGIN * radius * float(np.sqrt(1 + (2 * FOCAL) ** 2))
    poses = []
    for azimuth in np.radians(np.arange(FRAMES) * 360 / FRAMES):
        e = np.radians(ELEVATION_DEG)
        z = -np.array([np.cos(azimuth) * np.cos(e), np.sin(azimuth) * np.cos(e), np.sin(e)])
        x = np.cross(z, (0, 0, 1.0)) / np.cos(e)
        R = np.array([x, np.cross(z, x), z])
        poses.append((R, -R @ (middle - distance * z)))
    return poses


def write_views(folder, low, high):
    """A dataset without content, for the poses alone: its photos are blank. @return the path of its transforms.json"""
    camera = Camera(SIDE, SIDE, np.array([FOCAL * SIDE, FOCAL * SIDE, SIDE / 2, SIDE / 2, 0, 0, 0, 0]))
    frames = []
    for i, (R, t) in enumerate(poses_around(low, high)):
        name = f'turn_{i:03d}.png'
        require(cv2.imwrite(os.path.join(folder, name), np.full((SIDE, SIDE, 4), 255, np.uint8)),
                f"cannot write below '{folder}'")
        photo = PosedPhoto(name, name, None, camera, R, t)
        frames.append({'file_path': name, 'transform_matrix': camera_to_world(photo).tolist()})
    fx, fy, cx, cy = camera.parameters[:4]
    path = os.path.join(folder, 'transforms.json')
    write_json(path, {'w': SIDE, 'h': SIDE, 'fl_x': fx, 'fl_y': fy, 'cx': cx, 'cy': cy,
                      'object_aabb': [low.tolist(), high.tolist()], 'frames': frames})
    return path


def render_strip(tool, model, box, path):
    """Writes the picture of all renderings side by side. @param tool `render`; box (low, high) of the object"""
    with tempfile.TemporaryDirectory(dir=os.path.dirname(path), prefix='.turntable.') as folder:
        rendered = os.path.join(folder, 'rendered')
        os.mkdir(rendered)
        low, high = (np.array(corner, dtype=float) for corner in box)
        run_tool(tool[0], [model, '--transforms', write_views(folder, low, high), '-o', rendered,
                           '--background', *(3 * [GREY / 255]), *tool[1:]])
        pictures = [cv2.imread(os.path.join(rendered, f'turn_{i:03d}.png'), cv2.IMREAD_COLOR) for i in range(FRAMES)]
        if any(picture is None for picture in pictures):
            raise InputError(f"a rendering is missing in '{rendered}'")
        require(cv2.imwrite(path, np.hstack(pictures), [cv2.IMWRITE_JPEG_QUALITY, 82]), f"cannot write '{path}'")
    return True


def html_of(data):
    """@param data URL of the picture."""
    return (f'<div class="turntable" role="img" aria-label="The model, turning" style="background-image: url({data})">'
            '</div>')
