# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Photos of users as copies that structure from motion and training can take: upright, of bounded size, one shape for
each camera."""
import collections
import os
import shutil

import cv2
import numpy as np

from photos.common import InputError, count, require, say
from photos.image_header import read_header

# A photo's copy: `name` below the folder of copies; `source`, the user's file; `camera`, index of its camera; `turned`,
# whether it was turned by 90 degrees clockwise to be as high and wide as the others of its camera; `scale`, its size
# over that of the user's file; `sharpness`, see below.
Copy = collections.namedtuple('Copy', 'name source camera turned scale sharpness')

CUT_OUTS = 'alpha'         # folder below the copies: NAME.png, white on the object
MIN_TRANSPARENT = 0.01     # of a PNG: less is no cut-out
ENDINGS = ('.jpg', '.jpeg', '.png', '.heic', '.heif', '.avif')
MIN_PHOTOS = 3
MAX_PHOTOS = 200           # more are thinned: matching all pairs grows with their square
MAX_PIXELS = 1 << 29       # of a JPEG: 512 MP, which are decoded at an eighth
MAX_DECODED_PIXELS = 1 << 26
JPEG_QUALITY = 95
SHARPNESS_SIDE = 640       # sharpness is compared at this size [px]


def list_photos(folder):
    require(os.path.isdir(folder), f"there is no folder '{folder}'")
    names = sorted(name for name in os.listdir(folder) if name.lower().endswith(ENDINGS) and name[0] != '.')
    require(names, f"'{folder}' holds no photos ({', '.join(ENDINGS[:3])}) and no video")
    require(len(names) >= MIN_PHOTOS, f"'{folder}' holds {count(len(names), 'photo')}: take 40 to 100 from all sides")
    return [os.path.join(folder, name) for name in names]


def thinned(items, limit):
    """At most `limit` of them, evenly spread."""
    return [items[i * len(items) // limit] for i in range(limit)] if len(items) > limit else items


def sharpness(image):
    """Variance of the Laplacian of the grey image at one size: comparable between photos of one scene."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    scale = SHARPNESS_SIDE / max(grey.shape)
    if scale < 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(grey, cv2.CV_32F).var())


def reduction(header, max_side):
    """By how much a JPEG is reduced while it is decoded: 1, 2, 4 or 8, and never below max_side."""
    return max(factor for factor in (1, 2, 4, 8) if factor == 1 or max(header.width, header.height) // factor >= max_side)


def require_bounded(path, header, max_side):
    """@return by how much a photo is reduced while it is decoded. @throws InputError if it takes too much memory even so"""
    require(header.width * header.height <= MAX_PIXELS,
            f"'{path}' has {header.width} x {header.height} pixels: at most {MAX_PIXELS >> 20} million are read")
    factor = reduction(header, max_side) if path.lower().endswith(('.jpg', '.jpeg')) else 1
    pixels = header.width * header.height // factor ** 2
    require(pixels <= MAX_DECODED_PIXELS,
            f"'{path}' has {header.width} x {header.height} pixels: make it smaller, or a JPEG")
    return factor


def load(path, header, max_side):
    """The photo upright, max_side px high or wide at most. What it takes of memory is bounded."""
    factor = require_bounded(path, header, max_side)
    flag = {1: cv2.IMREAD_COLOR, 2: cv2.IMREAD_REDUCED_COLOR_2, 4: cv2.IMREAD_REDUCED_COLOR_4,
            8: cv2.IMREAD_REDUCED_COLOR_8}[factor]
    image = cv2.imread(path, flag)
    if image is None:
        raise InputError(f"'{path}' is damaged: it cannot be decoded")
    scale = max_side / max(image.shape)
    if scale < 1:
        size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return image


def load_cut_out(path, max_side):
    """(photo, mask: white where it is opaque), max_side px high or wide at most; None if the file is no PNG, or opaque but for
    corners, say. Both are as they are stored: no orientation is applied."""
    image = cv2.imread(path, cv2.IMREAD_UNCHANGED) if path.lower().endswith('.png') else None
    if image is None or image.ndim != 3 or image.shape[2] != 4:
        return None
    image = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
    scale = min(1, max_side / max(image.shape))
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    mask = np.where(image[:, :, 3] >= 128, 255, 0).astype(np.uint8)
    if np.mean(mask == 0) < MIN_TRANSPARENT:
        return None
    require(mask.any(), f"'{path}' is transparent everywhere: it shows no object")
    return np.ascontiguousarray(image[:, :, :3]), mask


def write_cut_out(mask, folder, name):
    path = os.path.join(folder, CUT_OUTS, name + '.png')
    os.makedirs(os.path.dirname(path), exist_ok=True)
    require(cv2.imwrite(path, mask), f"cannot write '{path}'")


def upright_size(width, height):
    return max(width, height), min(width, height)


class Cameras:
    """Cameras told apart by what EXIF says of them and by their photos' size. All photos of one share intrinsics."""

    def __init__(self):
        self.keys, self.shapes, self.focal_35mm = [], [], []

    def index(self, header, size):
        key = (header.camera, header.focal_35mm, upright_size(header.width, header.height))
        if key not in self.keys:
            self.keys.append(key)
            self.shapes.append(size)
            self.focal_35mm.append(header.focal_35mm)
        return self.keys.index(key)

    def focal_px(self, camera):
        """As EXIF says, or None [px]."""
        focal = self.focal_35mm[camera]
        return focal / 36 * max(self.shapes[camera]) if focal else None


def write_copy(image, source, path):
    """Without a loss where nothing was changed."""
    if image is None:
        shutil.copyfile(source, path)
    else:
        require(cv2.imwrite(path, image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]), f"cannot write '{path}'")


def copy_photo(path, name, folder, context):
    """One photo; (cameras, max_side) is the context."""
    cameras, max_side = context
    header = read_header(path)
    require_bounded(path, header, max_side)
    image, mask = load_cut_out(path, max_side) or (load(path, header, max_side), None)
    size = image.shape[1], image.shape[0]
    camera = cameras.index(header, size)
    turned = cameras.shapes[camera] != size
    if turned:
        image = cv2.rotate(image, cv2.ROTATE_90_CLOCKWISE)
    sharp = sharpness(image)
    name = os.path.join(f'camera_{camera}', name + '.jpg')
    os.makedirs(os.path.join(folder, f'camera_{camera}'), exist_ok=True)
    unchanged = not turned and header.orientation == 1 and size == (header.width, header.height)
    as_is = unchanged and path.lower().endswith(('.jpg', '.jpeg'))
    write_copy(None if as_is else image, path, os.path.join(folder, name))
    if mask is not None:
        write_cut_out(cv2.rotate(mask, cv2.ROTATE_90_CLOCKWISE) if turned else mask, folder, name)
    scale = max(size) / max(header.width, header.height)
    return Copy(name, os.path.basename(path), camera, turned, scale, sharp)


def pixel_of_copy(copy, camera, xy):
    """A pixel of the user's upright photo in its copy. @param camera {width, height} of the copy."""
    x, y = copy.scale * xy[0], copy.scale * xy[1]
    return (camera['width'] - y, x) if copy.turned else (x, y)


def copy_photos(paths, folder, max_side):
    """Copies all photos. @return (copies, cameras: list of {width, height, focal_px or None})."""
    if len(paths) > MAX_PHOTOS:
        say(f'{len(paths)} photos: {MAX_PHOTOS} of them are taken, evenly spread')
    cameras = Cameras()
    copies = [copy_photo(path, f'view_{i:04d}', folder, (cameras, max_side))
              for i, path in enumerate(thinned(paths, MAX_PHOTOS))]
    described = [{'width': shape[0], 'height': shape[1], 'focal_px': cameras.focal_px(i)}
                 for i, shape in enumerate(cameras.shapes)]
    return copies, described
