# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What scripts/make_photo_set knows of its photos, and how far found cameras are from it.

T_A_B takes points from frame B to frame A. C: camera (x right, y down, z forward), W: the world of truth.json, B: the
board, whose frame is the object's where a board was found.
"""
import dataclasses
import os

import cv2
import numpy as np

from photos.common import read_json, require
from photos.geometry import angle_deg, similarity
from photos.reconstruction import Camera

OPENGL = np.diag((1.0, -1.0, -1.0, 1.0))


@dataclasses.dataclass
class Truth:
    folder: str
    camera: Camera
    T_C_W: dict          # by the photo's file
    T_W_B: np.ndarray    # or None
    box: np.ndarray      # of the object in W, [2][3] m
    board: str

    def mask(self, file):
        return cv2.imread(os.path.join(self.folder, 'masks', os.path.splitext(file)[0] + '.png'), cv2.IMREAD_GRAYSCALE)


@dataclasses.dataclass
class Found:
    """A photo of a dataset that photos_to_object wrote."""
    file: str            # the user's
    name: str            # of image, mask and rendering
    K: np.ndarray        # pixels counted from the image's corner
    size: tuple          # width, height
    T_F_C: np.ndarray    # F: the object's frame
    held_out: bool


def read_truth(folder):
    said = read_json(os.path.join(folder, 'truth.json'))
    parameters = np.array([said['fx'], said['fy'], said['cx'] + 0.5, said['cy'] + 0.5, *said['distortion']])
    return Truth(folder, Camera(said['width'], said['height'], parameters),
                 {photo['file']: np.array(photo['T_C_W']) for photo in said['photos']},
                 None if said['T_W_B'] is None else np.array(said['T_W_B']), np.array(said['bounding_box']), said['board'])


def read_found(dataset):
    """All photos of a dataset, by name."""
    found = []
    for part in ('train', 'test'):
        for frame in read_json(os.path.join(dataset, f'transforms_{part}.json'))['frames']:
            K = np.array([[frame['fl_x'], 0, frame['cx']], [0, frame['fl_y'], frame['cy']], [0, 0, 1]])
            name = os.path.splitext(os.path.basename(frame['file_path']))[0]
            found.append(Found(frame['source'], name, K, (frame['w'], frame['h']),
                               np.array(frame['transform_matrix']) @ OPENGL, part == 'test'))
    require(found, f"'{dataset}' has no photos")
    return sorted(found, key=lambda photo: photo.name)


def pose_errors(truth, found):
    """How far the found cameras are from the true ones, after the similarity that fits their centres best and, where
    there is a board, in its frame without any fit.
    @return (errors, aligned): errors of the cameras as arrays and the scale's; [T_W_C] of the found ones, aligned."""
    true = [np.linalg.inv(truth.T_C_W[photo.file]) for photo in found]
    centres = np.array([T[:3, 3] for T in true])
    scale, R, t = similarity(np.array([photo.T_F_C[:3, 3] for photo in found]), centres)
    aligned = []
    for photo in found:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R @ photo.T_F_C[:3, :3], scale * R @ photo.T_F_C[:3, 3] + t
        aligned.append(T)
    errors = {'scale': abs(scale - 1), 'turn_deg': turns(aligned, true), 'shift_m': shifts(aligned, true)}
    if truth.T_W_B is not None:
        in_board = [truth.T_W_B @ photo.T_F_C for photo in found]
        errors.update(board_turn_deg=turns(in_board, true), board_shift_m=shifts(in_board, true))
    return errors, aligned


def turns(found, true):
    return angle_deg(np.array([a[:3, :3].T @ b[:3, :3] for a, b in zip(found, true)]))


def shifts(found, true):
    return np.array([np.linalg.norm(a[:3, 3] - b[:3, 3]) for a, b in zip(found, true)])


def mask_as_found(truth, photo, T_W_C):
    """The true mask as the found, undistorted camera shows it: each of its pixels is looked up along its ray.
    @param T_W_C of the found camera, aligned."""
    width, height = photo.size
    pixels = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), -1).reshape(-1, 2)
    rays = np.column_stack((pixels, np.ones(len(pixels)))) @ np.linalg.inv(photo.K).T
    rays = rays @ (truth.T_C_W[photo.file][:3, :3] @ T_W_C[:3, :3]).T
    seen = (truth.camera.pixels(rays / rays[:, 2:]) - 0.5).reshape(height, width, 2).astype(np.float32)
    return cv2.remap(truth.mask(photo.file), seen[..., 0], seen[..., 1], cv2.INTER_LINEAR)
