# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Scenes of the BOP benchmark (bop_toolkit, docs/bop_datasets_format.md), its results file, and errors of poses in it."""
import collections
import json
import os

import numpy as np

# An object in an image. `K` 3 x 3; `truth` T_C_O, 4 x 4 [m], or None where the data set keeps it secret; `depth` the
# path of the depth image and the length that 1 stands for in it [m], or None where depth was not asked for.
Target = collections.namedtuple('Target', 'scene image object path K truth depth')
# What was found of it. `T_C_O` 4 x 4 [m]; `seconds` of the whole image; `with_depth`, whether depth took part.
Result = collections.namedtuple('Result', 'target score T_C_O seconds with_depth')

ENDINGS = ('.png', '.jpg', '.jpeg', '.tif')
HEADER = 'scene_id,im_id,obj_id,score,R,t,time'


class BopError(Exception):
    """The folder cannot be used. The text names it."""


def read_json(folder, name):
    path = os.path.join(folder, name)
    try:
        with open(path, encoding='utf-8') as file:
            return json.load(file)
    except (OSError, ValueError) as error:
        raise BopError(f"cannot read '{path}': {error}") from error


def image_path(folder, image):
    for kind in ('rgb', 'gray'):
        for ending in ENDINGS:
            path = os.path.join(folder, kind, f'{image:06d}{ending}')
            if os.path.isfile(path):
                return path
    raise BopError(f"'{folder}' has no image {image:06d} in rgb or gray")


def depth_of(folder, image, camera):
    """(path, length that 1 stands for [m]) of an image's depth. @param camera its entry in scene_camera.json"""
    path = os.path.join(folder, 'depth', f'{image:06d}.png')
    if not os.path.isfile(path):
        raise BopError(f"'{folder}' has no depth image {image:06d}.png in depth")
    if 'depth_scale' not in camera:
        raise BopError(f"'{folder}', image {image}: scene_camera.json states no depth_scale")
    scale = float(camera['depth_scale'])
    if not 0 < scale < float('inf'):
        raise BopError(f"'{folder}', image {image}: depth_scale is {scale:g}, not above 0")
    return path, scale / 1000


def pose_of(entry):
    T = np.eye(4)
    T[:3, :3] = np.reshape(entry['cam_R_m2c'], (3, 3))
    T[:3, 3] = np.array(entry['cam_t_m2c']) / 1000
    return T


def scene_folders(folder):
    """Folders of scenes: the folder itself, or those in it. Scenes are numbered by their names."""
    inside = [folder] + [os.path.join(folder, name) for name in sorted(os.listdir(folder))]
    scenes = [path for path in inside if os.path.isfile(os.path.join(path, 'scene_camera.json'))]
    if not scenes:
        raise BopError(f"'{folder}' is no scene of BOP and holds none (scene_camera.json)")
    return scenes


def targets_of(folder, object_id, with_depth=False):
    """What is to be found in one scene: the object in all images that show it, or may, where no truth is told.
    @param with_depth each of these images must have depth. @throws BopError naming what is missing or not as in BOP."""
    name = os.path.basename(os.path.abspath(folder))
    if not name.isdigit():
        raise BopError(f"'{folder}': scenes are named by their numbers")
    cameras = read_json(folder, 'scene_camera.json')
    told = os.path.isfile(os.path.join(folder, 'scene_gt.json'))
    truths = read_json(folder, 'scene_gt.json') if told else {}
    targets = []
    try:
        for image, camera in sorted(cameras.items(), key=lambda item: int(item[0])):
            entries = [entry for entry in truths.get(image, ()) if entry['obj_id'] == object_id] if told else [None]
            for entry in entries:
                depth = depth_of(folder, int(image), camera) if with_depth else None
                targets.append(Target(int(name), int(image), object_id, image_path(folder, int(image)),
                                      np.reshape(camera['cam_K'], (3, 3)), entry and pose_of(entry), depth))
    except (KeyError, ValueError, TypeError) as error:
        raise BopError(f"'{folder}': scene_camera.json or scene_gt.json is not as BOP has it ({error!r})") from error
    return targets


def line_of(result):
    """A line of BOP's results file: R row by row, t in millimetres, time in seconds."""
    target, T = result.target, result.T_C_O
    numbers = [' '.join(f'{value:.9g}' for value in values) for values in (T[:3, :3].ravel(), 1000 * T[:3, 3])]
    return f'{target.scene},{target.image},{target.object},{result.score:.6g},{numbers[0]},{numbers[1]},{result.seconds:.4f}'


def results_text(results):
    return '\n'.join([HEADER] + [line_of(result) for result in results]) + '\n'


def errors_of(result, centre_O, diameter):
    """(angle [deg], offset of the object's middle [diameters], its part along the line of sight) against the truth."""
    found, true = result.T_C_O, result.target.truth
    cosine = 0.5 * (np.trace(found[:3, :3].T @ true[:3, :3]) - 1)
    middle = np.append(centre_O, 1)
    away, sight = ((found - true) @ middle)[:3], (true @ middle)[:3]
    return (float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))), float(np.linalg.norm(away) / diameter),
            float(abs(away @ sight) / np.linalg.norm(sight) / diameter))


def rotation(x, y, z, w):
    q = np.array([w, x, y, z]) / np.linalg.norm((w, x, y, z))
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def matrix_of(pose):
    """4 x 4 of x y z qx qy qz qw."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(*pose[3:]), pose[:3]
    return T


def pose_numbers(T):
    """x y z qx qy qz qw of a 4 x 4."""
    R = T[:3, :3]
    q = np.linalg.eigh(np.array([
        [R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
        [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
        [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
        [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]]]))[1][:, 3]
    return [*T[:3, 3].tolist(), *q.tolist()]
