# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Cameras, poses, points and their observations, in numpy arrays; read from COLMAP's binary or text files."""
import dataclasses
import os
import struct

import numpy as np

from photos.common import InputError, require

# COLMAP's models that are pinholes with OpenCV's distortion k1 k2 p1 p2, in the order of their numbers from 0 on: where
# each parameter goes to in (fx, fy, cx, cy, k1, k2, p1, p2).
RELIABLE_VIEWS = 3  # that see a point
MODELS = {'SIMPLE_PINHOLE': ((0, 1), 2, 3), 'PINHOLE': (0, 1, 2, 3), 'SIMPLE_RADIAL': ((0, 1), 2, 3, 4),
          'RADIAL': ((0, 1), 2, 3, 4, 5), 'OPENCV': (0, 1, 2, 3, 4, 5, 6, 7)}


@dataclasses.dataclass
class Camera:
    width: int
    height: int
    parameters: np.ndarray  # fx, fy, cx, cy [px from the image's corner], k1, k2, p1, p2

    @property
    def focal(self):
        return float(np.sqrt(self.parameters[0] * self.parameters[1]))

    def matrix(self):
        """K for OpenCV, whose pixels have integer centres."""
        fx, fy, cx, cy = self.parameters[:4]
        return np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])

    def pixels(self, points_C):
        """Projections of points in the camera's frame, [n][2]. What is behind the camera is not finite."""
        with np.errstate(divide='ignore', invalid='ignore'):
            x = np.where(points_C[:, 2:] > 0, points_C[:, :2] / points_C[:, 2:], np.nan)
        fx, fy, cx, cy, k1, k2, p1, p2 = self.parameters
        u, v = x[:, 0], x[:, 1]
        r2 = u * u + v * v
        radial = 1 + k1 * r2 + k2 * r2 * r2
        du = 2 * p1 * u * v + p2 * (r2 + 2 * u * u)
        dv = p1 * (r2 + 2 * v * v) + 2 * p2 * u * v
        return np.column_stack((fx * (u * radial + du) + cx, fy * (v * radial + dv) + cy))


@dataclasses.dataclass
class Reconstruction:
    cameras: list               # of Camera
    names: list                 # of photos
    camera_of: np.ndarray       # [photos] index of a camera
    R: np.ndarray               # [photos][3][3] world to camera
    t: np.ndarray               # [photos][3]
    xyz: np.ndarray             # [points][3]
    photo_of: np.ndarray        # [observations] index of a photo
    point_of: np.ndarray        # [observations] index of a point
    xy: np.ndarray              # [observations][2] px

    def centres(self):
        """Of the cameras, in the world: [photos][3]."""
        return -np.einsum('nji,nj->ni', self.R, self.t)

    def directions(self):
        """Optical axes in the world: [photos][3]."""
        return self.R[:, 2]

    def projected(self, photo, points):
        """Points of the world as a photo shows them, [n][2] px."""
        return self.cameras[self.camera_of[photo]].pixels(points @ self.R[photo].T + self.t[photo])

    def errors(self):
        """Distance of each observation from its point's projection [px]; infinite behind the camera."""
        errors = np.full(len(self.xy), np.inf)
        for photo in range(len(self.names)):
            of_photo = self.photo_of == photo
            offset = self.projected(photo, self.xyz[self.point_of[of_photo]]) - self.xy[of_photo]
            errors[of_photo] = np.nan_to_num(np.linalg.norm(offset, axis=1), nan=np.inf)
        return errors

    def photos_of_points(self):
        """How many photos see each point."""
        return np.bincount(self.point_of, minlength=len(self.xyz))

    def reliable_points(self):
        """[n][3] points that several photos see."""
        views = self.photos_of_points()
        return self.xyz[views >= min(RELIABLE_VIEWS, views.max(initial=0))]

    def of_photos(self, kept):
        """The same with some photos alone, and points that two of them see at least. @param kept indices, in order."""
        number = np.full(len(self.names), -1)
        number[kept] = np.arange(len(kept))
        held = number[self.photo_of] >= 0
        seen = np.bincount(self.point_of[held], minlength=len(self.xyz)) >= 2
        return dataclasses.replace(
            self, names=[self.names[i] for i in kept], camera_of=self.camera_of[kept], R=self.R[kept], t=self.t[kept],
            photo_of=number[self.photo_of[held]], point_of=self.point_of[held], xy=self.xy[held]).of_points(seen)

    def of_points(self, kept):
        """The same with some points alone. @param kept [points] of bool."""
        number = np.cumsum(kept) - 1
        held = kept[self.point_of]
        return dataclasses.replace(self, xyz=self.xyz[kept], photo_of=self.photo_of[held],
                                   point_of=number[self.point_of[held]], xy=self.xy[held])

    def moved(self, scale, R, t):
        """In another world: a point x of this one is scale * R x + t there."""
        turned = self.R @ R.T
        return dataclasses.replace(self, R=turned, t=scale * self.t - turned @ t, xyz=scale * self.xyz @ R.T + t)


def rotation(w, x, y, z):
    q = np.array([w, x, y, z], dtype=float)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def camera_of_model(model, width, height, values):
    require(model in MODELS, f'the camera model {model} is not read here: reconstruct with RADIAL or OPENCV')
    parameters = np.zeros(8)
    for value, places in zip(values, MODELS[model]):
        parameters[list(places) if isinstance(places, tuple) else places] = value
    return Camera(int(width), int(height), parameters)


def assembled(cameras, images, points):
    """@param cameras {id: Camera}; images [(name, q, t, camera id, xy, point ids)]; points {id: xyz}."""
    images = sorted(images, key=lambda image: image[0])
    require(images and points, 'the reconstruction is empty')
    camera_ids, point_ids = sorted(cameras), np.array(sorted(points))
    photo_of, point_of, xy = [], [], []
    for i, (_, _, _, _, pixels, ids) in enumerate(images):
        held = np.isin(ids, point_ids)
        photo_of.append(np.full(held.sum(), i))
        point_of.append(np.searchsorted(point_ids, ids[held]))
        xy.append(pixels[held])
    return Reconstruction(
        [cameras[i] for i in camera_ids], [image[0] for image in images],
        np.array([camera_ids.index(image[3]) for image in images]), np.array([rotation(*image[1]) for image in images]),
        np.array([image[2] for image in images], dtype=float), np.array([points[i] for i in point_ids], dtype=float),
        np.concatenate(photo_of), np.concatenate(point_of), np.concatenate(xy))


# Binary files

def read_cameras_binary(data):
    cameras, position = {}, 8
    for _ in range(struct.unpack_from('<Q', data)[0]):
        camera, model, width, height = struct.unpack_from('<iiQQ', data, position)
        name = dict(enumerate(MODELS)).get(model, f'number {model}')
        values = struct.unpack_from(f'<{len(MODELS.get(name, ()))}d', data, position + 24)
        cameras[camera] = camera_of_model(name, width, height, values)
        position += 24 + 8 * len(values)
    return cameras


def read_images_binary(data):
    images, position = [], 8
    observation = np.dtype([('xy', '<f8', 2), ('point', '<i8')])
    for _ in range(struct.unpack_from('<Q', data)[0]):
        numbers = struct.unpack_from('<i7di', data, position)
        end = data.index(b'\0', position + 64)
        name = data[position + 64:end].decode()
        count, = struct.unpack_from('<Q', data, end + 1)
        observed = np.frombuffer(data, observation, count, end + 9)
        images.append((name, numbers[1:5], numbers[5:8], numbers[8], observed['xy'], observed['point']))
        position = end + 9 + 24 * count
    return images


def read_points_binary(data):
    points, position = {}, 8
    for _ in range(struct.unpack_from('<Q', data)[0]):
        point, x, y, z = struct.unpack_from('<Q3d', data, position)
        length, = struct.unpack_from('<Q', data, position + 43)
        points[point] = (x, y, z)
        position += 51 + 8 * length
    return points


def cameras_binary_with(data, principal_points):
    data, position = bytearray(data), 8
    for _ in range(struct.unpack_from('<Q', data)[0]):
        camera, model = struct.unpack_from('<ii', data, position)
        places = list(MODELS.values())[model]
        for place, value in zip((2, 3), principal_points[camera]):
            struct.pack_into('<d', data, position + 24 + 8 * places.index(place), value)
        position += 24 + 8 * len(places)
    return bytes(data)


# Text files

def lines_of(data):
    return [line for line in data.decode().splitlines() if not line.startswith('#')]


def read_cameras_text(data):
    cameras = {}
    for words in (line.split() for line in lines_of(data) if line.strip()):
        cameras[int(words[0])] = camera_of_model(words[1], words[2], words[3], [float(word) for word in words[4:]])
    return cameras


def cameras_text_with(data, principal_points):
    cameras = [line.split() for line in lines_of(data) if line.strip()]
    for words in cameras:
        for place, value in zip((2, 3), principal_points[int(words[0])]):
            words[4 + MODELS[words[1]].index(place)] = f'{value:.17g}'
    return ''.join(' '.join(words) + '\n' for words in cameras).encode()


def read_images_text(data):
    images, lines = [], lines_of(data)
    for first, second in zip(lines[::2], lines[1::2]):
        words = first.split(maxsplit=9)
        numbers = np.array(second.split(), dtype=float).reshape(-1, 3)
        images.append((words[9], [float(word) for word in words[1:5]], [float(word) for word in words[5:8]],
                       int(words[8]), numbers[:, :2], numbers[:, 2].astype(int)))
    return images


def read_points_text(data):
    return {int(words[0]): [float(word) for word in words[1:4]]
            for words in (line.split() for line in lines_of(data) if line.strip())}


READERS = {'.bin': (read_cameras_binary, read_images_binary, read_points_binary),
           '.txt': (read_cameras_text, read_images_text, read_points_text)}


WRITERS = {'.bin': cameras_binary_with, '.txt': cameras_text_with}


def move_principal_points(folder, points):
    """Writes the file of the cameras anew. @param points [cameras][2] px from the image's corner, in the order of the
    cameras of the Reconstruction that is read from this folder."""
    ending = next(ending for ending in READERS if os.path.isfile(os.path.join(folder, 'cameras' + ending)))
    path = os.path.join(folder, 'cameras' + ending)
    with open(path, 'rb') as file:
        data = file.read()
    numbers = sorted(READERS[ending][0](data))
    with open(path, 'wb') as file:
        file.write(WRITERS[ending](data, dict(zip(numbers, points))))


def read_reconstruction(folder):
    """A folder with cameras, images and points3D, as COLMAP writes them."""
    for ending, readers in READERS.items():
        if not os.path.isfile(os.path.join(folder, 'images' + ending)):
            continue
        try:
            contents = []
            for name, read in zip(('cameras', 'images', 'points3D'), readers):
                with open(os.path.join(folder, name + ending), 'rb') as file:
                    contents.append(read(file.read()))
            return assembled(*contents)
        except (OSError, ValueError, IndexError, KeyError, struct.error) as error:
            raise InputError(f"cannot read the reconstruction in '{folder}': {error}") from error
    raise InputError(f"'{folder}' holds no reconstruction (images.bin or images.txt)")
