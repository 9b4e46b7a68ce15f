# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A box around the object that a person chooses: the box, what there is to see around it, and datasets that get it.

All is in one frame, that in which the numbers of the box are used: here that of the dataset's file. box_of_output.py
has the same for what photos_to_object made.
"""
import dataclasses
import os

import cv2
import numpy as np

from photos.common import InputError, count, read_json, require, say, text_of, write_texts
from photos.geometry import focus
from photos.image_header import read_header
from photos.intake import load, thinned
from photos.point_cloud import with_points
from photos.reconstruction import Camera, Reconstruction

FILES = ('transforms.json', 'transforms_train.json', 'transforms_val.json', 'transforms_test.json')
IMAGES = ('', '.png', '.jpg', '.jpeg')  # file_path may leave the extension out
LENSES = ('k1', 'k2', 'k3', 'k4', 'p1', 'p2', 'distortion_params')
MIN_SIDE = 0.001        # of the photographed scene: a box that is thinner was not meant
NEW_BOX = 0.25          # half the side of a first box, of the cameras' distance
MAX_POINTS = 30000      # that are shown
SEARCHED_PHOTOS = 32    # for points, where there is no reconstruction
SEARCHED_SIDE = 640     # [px]
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
EDGES = [(i, j) for i in range(8) for j in range(i) if np.abs(CORNERS[i] - CORNERS[j]).sum() == 1]


@dataclasses.dataclass
class Cameras:
    R: np.ndarray           # [n][3][3] world to camera, z forward
    centre: np.ndarray      # [n][3] in the world

    def centres(self):
        return self.centre

    def directions(self):
        return self.R[:, 2]


@dataclasses.dataclass
class Choice:
    folder: str
    cameras: Cameras
    points: np.ndarray      # [n][3]
    low: np.ndarray         # of the box at the beginning
    high: np.ndarray
    present: np.ndarray     # [8][3] corners of the present box, which may be tilted; [0][3]: there is none
    size: float             # of the photographed scene
    up: np.ndarray          # [3] from the table
    made_with: object = None  # Options of photos_to_object; None: something else made the dataset


# Boxes

def corners_of(low, high):
    """[8][3], in the order of CORNERS."""
    return np.where(CORNERS, high, low)


def sorted_box(first, second):
    """(low, high) of two opposite corners, in either order."""
    return np.minimum(first, second), np.maximum(first, second)


def refusal(box, size):
    """Why a box cannot be used; '' if it can. @param size of the photographed scene."""
    low, high = box
    if not np.isfinite(corners_of(low, high)).all():
        return 'the box is refused: a corner is not a number'
    for axis, side in zip('xyz', high - low):
        if side < MIN_SIDE * size:
            return (f'the box is refused: along {axis} it is {side:.3g} thick, less than a thousandth of the '
                    f'photographed scene ({size:.3g}): move its corners apart')
    return ''


def first_box(cameras):
    """(low, high) around what the cameras look at, where there is no box yet."""
    middle = cameras.centre[0] + cameras.directions()[0]
    if len(cameras.centre) > 1:
        middle = focus(cameras)
    half = NEW_BOX * float(np.median(np.linalg.norm(cameras.centre - middle, axis=1)))
    require(np.isfinite(half) and half > 0, 'all photos were taken from one place: no box can be shown before them')
    return middle - half, middle + half


def upright(up):
    """Rotation from a frame whose z is upwards: its axes as columns, x as near as can be to that of the other frame."""
    z = up / np.linalg.norm(up)
    x = np.eye(3)[0] - z[0] * z if abs(z[0]) < 0.9 else np.eye(3)[1] - z[1] * z
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))


def quaternion(R):
    """x y z w."""
    turn = cv2.Rodrigues(R)[0].ravel()
    angle = float(np.linalg.norm(turn))
    return [*(0.5 * np.sinc(0.5 * angle / np.pi) * turn), np.cos(0.5 * angle)]


def choice_of(folder, cameras, points, present, up=None):
    """@param present [8][3] corners of the present box, or [0][3]; up [3], None: where the cameras are."""
    low, high = (present.min(axis=0), present.max(axis=0)) if len(present) else first_box(cameras)
    size = float(np.ptp(np.concatenate((cameras.centre, [low, high])), axis=0).max())
    if len(points) > MAX_POINTS:
        points = points[np.random.default_rng(1).permutation(len(points))[:MAX_POINTS]]
    if up is None or not np.any(up):
        up = cameras.centre.mean(axis=0) - 0.5 * (low + high)
    return Choice(folder, cameras, points, low, high, present, size, up)


# Datasets

def transforms_in(folder):
    """{name: content} of the dataset's files."""
    paths = {name: os.path.join(folder, name) for name in FILES}
    found = {name: read_json(path) for name, path in paths.items() if os.path.exists(path)}
    for name, content in found.items():
        frames = content.get('frames') if isinstance(content, dict) else None
        require(isinstance(frames, list) and frames and all(isinstance(frame, dict) for frame in frames),
                f"'{paths[name]}' lists no frames")
    return found


def cameras_in(folder, contents):
    """Of all frames of a dataset, whose matrices are camera to world with OpenGL's axes: x right, y up, z back."""
    R, centres = [], []
    for name, content in contents.items():
        for i, frame in enumerate(content['frames']):
            try:
                T = np.array(frame['transform_matrix'], dtype=float)[:3].reshape(3, 4)
                require(np.isfinite(T).all() and abs(np.linalg.det(T[:, :3])) > 1e-6, 'not a pose')
            except (KeyError, ValueError, TypeError, InputError) as error:
                raise InputError(f"'{os.path.join(folder, name)}', frame {i}: transform_matrix: {error}") from error
            axes = T[:, :3] / np.linalg.norm(T[:, :3], axis=0)
            R.append((axes * (1, -1, -1)).T)
            centres.append(T[:, 3])
    return Cameras(np.array(R), np.array(centres))


def present_box(folder, contents):
    """[8][3] corners of the box that `train` would read, [0][3] without one."""
    name, content = next(iter(contents.items()))
    box = content.get('object_aabb', content.get('aabb'))
    if box is None:
        return np.zeros((0, 3))
    try:
        low, high = np.array(box, dtype=float).reshape(2, 3)
    except (ValueError, TypeError) as error:
        raise InputError(f"'{os.path.join(folder, name)}': its box is not [[min], [max]]") from error
    return corners_of(low, high)


def pinhole_of(content, frame, image):
    """A Camera for the image, reduced to SEARCHED_SIDE; None where the lens is not a pinhole or not known."""
    described = {**content, **frame}
    if any(np.any(described.get(key, 0)) for key in LENSES) or described.get('is_fisheye'):
        return None
    h, w = image.shape[:2]
    try:
        width = float(described.get('w', w))
        fx = float(described['fl_x']) if 'fl_x' in described else width / 2 / np.tan(described['camera_angle_x'] / 2)
        middle = described.get('cx', width / 2), described.get('cy', described.get('h', h * width / w) / 2)
        parameters = np.array([fx, described.get('fl_y', fx), *middle], dtype=float) * w / width
    except (KeyError, ValueError, TypeError):
        return None
    return Camera(w, h, np.concatenate((parameters, np.zeros(4))))


def read_reduced(folder, frame):
    """A photo of a dataset, None where it is none, or lies outside of the dataset's folder."""
    path = os.path.join(folder, str(frame.get('file_path')))
    path = next((path + ending for ending in IMAGES if os.path.isfile(path + ending)), None)
    if not path or os.path.commonpath(list(map(os.path.realpath, (path, folder)))) != os.path.realpath(folder):
        return None
    try:
        return load(path, read_header(path), SEARCHED_SIDE)
    except InputError as error:
        say(str(error))
        return None


def points_of_photos(folder, contents, cameras):
    """[n][3] points that a dataset's photos show, [0][3] where nothing can be found in them."""
    frames = [(content, frame) for content in contents.values() for frame in content['frames']]
    images, pinholes, kept = [], [], []
    for i in thinned(list(range(len(frames))), SEARCHED_PHOTOS) if hasattr(cv2, 'SIFT_create') else ():
        image = read_reduced(folder, frames[i][1])
        camera = None if image is None else pinhole_of(*frames[i], image)
        if camera:
            images, pinholes, kept = images + [image], pinholes + [camera], kept + [i]
    if len(kept) < 2:
        return np.zeros((0, 3))
    say(f'there is no reconstruction: points are looked for in {count(len(kept), "photo")} ..')
    R, none = cameras.R[kept], np.zeros(0, int)
    return with_points(Reconstruction(pinholes, [str(i) for i in kept], np.arange(len(kept)), R,
                                      -np.einsum('nij,nj->ni', R, cameras.centre[kept]), np.zeros((0, 3)), none, none,
                                      np.zeros((0, 2))), images).xyz


def choice_of_dataset(folder):
    contents = transforms_in(folder)
    require(contents, f"'{folder}' holds neither options.json, which photos_to_object writes, nor transforms.json or "
            'transforms_train.json')
    cameras = cameras_in(folder, contents)
    return choice_of(folder, cameras, points_of_photos(folder, contents, cameras), present_box(folder, contents),
                     np.array([0, 0, 1.0]))


def write_box(folder, box):
    """Puts the box into all files of a dataset as they are now. @return their paths."""
    contents = transforms_in(folder)
    require(contents, f"'{folder}' holds no transforms.json or transforms_train.json any more")
    texts = {}
    for name, content in contents.items():
        content['object_aabb'] = [list(map(float, corner)) for corner in box]
        texts[os.path.join(folder, name)] = text_of(content)
    write_texts(texts)
    return list(texts)
