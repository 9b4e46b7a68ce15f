# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The package's own form of posed photos: transforms_train.json, transforms_test.json, images and masks."""
import dataclasses
import os

import cv2
import numpy as np

from photos.common import InputError, in_threads, require, whole_folder, write_json
from photos.reconstruction import Camera

TEST_INTERVAL = 8  # of every so many photos one is held out
JPEG_QUALITY = 95


@dataclasses.dataclass
class PosedPhoto:
    name: str             # without an ending
    source: str           # the user's file
    image: np.ndarray     # undistorted, BGR
    camera: Camera        # a pinhole
    R: np.ndarray         # world to camera
    t: np.ndarray
    mask: np.ndarray = None
    drawn: np.ndarray = None  # the mask that the user drew, if there is one
    cut_out: np.ndarray = None  # the mask that the photo's alpha says, if it says one
    copy: str = ''            # the copy that it was made of, below the folder of copies
    taken_by: Camera = None   # with its distortion


def undistorted(path, camera):
    """(image, camera) of a photo as a pinhole with the same focal length takes it."""
    image = cv2.imread(path, cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"cannot read '{path}'")
    require((image.shape[1], image.shape[0]) == (camera.width, camera.height),
            f"'{path}' has {image.shape[1]} x {image.shape[0]} pixels, its camera {camera.width} x {camera.height}")
    pinhole = dataclasses.replace(camera, parameters=np.concatenate((camera.parameters[:4], np.zeros(4))))
    if np.any(camera.parameters[4:]):
        image = cv2.undistort(image, camera.matrix(), camera.parameters[4:])
    return image, pinhole


def posed_photos(reconstruction, folder, sources):
    """All photos of a reconstruction, undistorted. @param folder of the copies; sources {name of a copy: user's file}."""
    def posed(i):
        name, camera = reconstruction.names[i], reconstruction.cameras[reconstruction.camera_of[i]]
        image, pinhole = undistorted(os.path.join(folder, name), camera)
        stem = os.path.splitext(name)[0].replace(os.sep, '_')
        return PosedPhoto(stem, sources[name], image, pinhole, reconstruction.R[i], reconstruction.t[i], copy=name,
                          taken_by=camera)

    return in_threads(posed, range(len(reconstruction.names)))


def camera_to_world(photo):
    """4 x 4 with OpenGL axes: x right, y up, z back."""
    T = np.eye(4)
    T[:3, :3] = photo.R.T * (1, -1, -1)
    T[:3, 3] = -photo.R.T @ photo.t
    return T


def frame_of(photo):
    fx, fy, cx, cy = photo.camera.parameters[:4]
    return {'file_path': f'images/{photo.name}.jpg', 'mask_path': f'masks/{photo.name}.png', 'source': photo.source,
            'w': photo.camera.width, 'h': photo.camera.height, 'fl_x': fx, 'fl_y': fy, 'cx': cx, 'cy': cy,
            'transform_matrix': camera_to_world(photo).tolist()}


def is_held_out(index):
    return index % TEST_INTERVAL == TEST_INTERVAL // 2


def write_photo(photo, folder):
    """@return whether image and mask were written"""
    path = os.path.join(folder, 'images', photo.name + '.jpg')
    return (cv2.imwrite(path, photo.image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]) and
            cv2.imwrite(os.path.join(folder, 'masks', photo.name + '.png'), photo.mask))


def write_dataset(photos, box, metres_per_unit, folder):
    """@param box (low, high) of the object in the poses' units; metres_per_unit None: unknown."""
    common = {'object_aabb': [list(map(float, corner)) for corner in box]}
    if metres_per_unit:
        common['metres_per_unit'] = metres_per_unit
    with whole_folder(folder) as new:
        for kind in ('images', 'masks'):
            os.mkdir(os.path.join(new, kind))
        written = in_threads(lambda photo: write_photo(photo, new), photos)
        require(all(written), f"cannot write below '{new}'")
        for part, held_out in (('train', False), ('test', True)):
            frames = [frame_of(photo) for i, photo in enumerate(photos) if is_held_out(i) == held_out]
            write_json(os.path.join(new, f'transforms_{part}.json'), {**common, 'frames': frames})
