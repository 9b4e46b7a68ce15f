# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""How well a model shows its photos: renderings beside them, and PSNR on the object."""
import math
import os

import cv2
import numpy as np

from photos.common import InputError, in_threads, read_json
from photos.outline import is_unsure

MAX_PSNR_DB = 60
RENDERED_SIDE = 960    # of renderings [px]; compared at half of it
SURE = 250             # of 255: the whole pixel shows the object
MIN_PIXELS = 50        # of the object, from which a gain is taken
REWEIGHTINGS = 6
GAIN_PIXELS = 5000     # of the object, from which it is taken at most
MIN_RESIDUAL = 5.0     # of 255


def read_rendering(folder, name):
    """A rendering with straight alpha at half its size. Its pixels are single rays; those of a photo are means over an area,
    and so are these. @param name without an ending"""
    rendering = cv2.imread(os.path.join(folder, name + '.png'), cv2.IMREAD_UNCHANGED)
    if rendering is None or rendering.ndim != 3 or rendering.shape[2] != 4:
        raise InputError(f"there is no rendering '{name}.png' with alpha in '{folder}'")
    size = max(1, rendering.shape[1] // 2), max(1, rendering.shape[0] // 2)
    alpha = rendering[:, :, 3:].astype(np.float32) / 255
    premultiplied = cv2.resize(rendering[:, :, :3] * alpha, size, interpolation=cv2.INTER_AREA)
    alpha = cv2.resize(alpha, size, interpolation=cv2.INTER_AREA)[:, :, None]
    colour = premultiplied / np.maximum(alpha, 1 / 255)
    return np.clip(np.round(np.concatenate((colour, 255 * alpha), axis=2)), 0, 255).astype(np.uint8)


def blended(image, alpha):
    """On black: float [h][w][3], 0..1."""
    return image.astype(np.float32) / 255 * (alpha.astype(np.float32) / 255)[:, :, None]


def psnr_db(error_squares):
    return float(min(MAX_PSNR_DB, -10 * math.log10(max(1e-9, float(np.mean(error_squares))))))


def with_gain(photo, rendering, inside):
    """The photo with a gain and a bias for each channel that make it like the rendering on the object: where photos differ
    in exposure, the model shows that of the median one. Robust: what is wrong in the model counts little."""
    changed = photo.astype(float)
    pixels = np.flatnonzero(inside)
    pixels = pixels[::len(pixels) // GAIN_PIXELS + 1]
    for channel in range(3):
        x, y = (image[:, :, channel].ravel()[pixels].astype(float) for image in (photo, rendering))
        lines, weights = np.column_stack((x, np.ones(len(x)))), np.ones(len(x))
        for _ in range(REWEIGHTINGS):
            root = np.sqrt(weights)
            gain, bias = np.linalg.lstsq(lines * root[:, None], y * root, rcond=None)[0]
            residual = np.abs(gain * x + bias - y)
            weights = (1 + (residual / max(MIN_RESIDUAL, 2 * np.median(residual))) ** 2) ** -2
        changed[:, :, channel] = gain * photo[:, :, channel] + bias
    return np.clip(np.round(changed), 0, 255).astype(np.uint8)


def compared(rendering, photo, mask, sure=True):
    """Of a rendering with alpha and a photo with its mask: {psnr_object_db, psnr_db, alpha_outside, alpha_inside}.
    psnr_object_db is on the pixels that lie in the mask as a whole: those on its outline show what is behind it, too.
    psnr_db is on all; both on black. @param sure where it is known what the photo shows: the rest does not count"""
    shown, truth = blended(rendering[:, :, :3], rendering[:, :, 3]), blended(photo, mask)
    squares, sure = (shown - truth) ** 2, np.broadcast_to(sure, mask.shape)
    alpha, inside = rendering[:, :, 3] / 255.0, (mask >= SURE) & sure
    if not inside.any():
        inside = (mask >= 128) & sure  # a thin object
    far = (cv2.dilate(mask, np.ones((9, 9), np.uint8)) == 0) & sure
    return {'psnr_object_db': psnr_db(squares[inside]) if inside.any() else None,
            'psnr_db': psnr_db(squares[sure]) if sure.any() else None,
            'alpha_inside': float(alpha[inside].mean()) if inside.any() else None,
            'alpha_outside': float(alpha[far].mean()) if far.any() else 0.0}


def read_image(path, flags=cv2.IMREAD_COLOR):
    image = cv2.imread(path, flags)
    if image is None:
        raise InputError(f"cannot read '{path}': it is missing or damaged")
    return image


def measure(dataset, renderings, are_equal=True):
    """Each frame of the dataset's two files against its rendering. @param renderings folder with the frames' names; are_equal:
    the photos have one exposure, else each gets a gain first.
    @return [{name, source, held_out, ..}] in the order of the names."""
    def row(part, frame):
        name = os.path.splitext(os.path.basename(frame['file_path']))[0]
        rendering = read_rendering(renderings, name)
        size = rendering.shape[1], rendering.shape[0]
        photo = cv2.resize(read_image(os.path.join(dataset, frame['file_path'])), size, interpolation=cv2.INTER_AREA)
        full = read_image(os.path.join(dataset, frame['mask_path']), cv2.IMREAD_GRAYSCALE)
        mask, unsure = (cv2.resize(part, size, interpolation=cv2.INTER_AREA)
                        for part in (np.where(full >= 128, full, 0).astype(np.uint8), np.float32(is_unsure(full))))
        inside = (mask >= SURE) & (unsure == 0) & (rendering[:, :, 3] >= SURE)
        if not are_equal and np.count_nonzero(inside) >= MIN_PIXELS:
            photo = with_gain(photo, rendering, inside)
        return {'name': name, 'source': frame['source'], 'held_out': part == 'test', **compared(rendering, photo, mask, unsure == 0)}

    frames = [(part, frame) for part in ('train', 'test')
              for path in [os.path.join(dataset, f'transforms_{part}.json')] if os.path.exists(path)
              for frame in read_json(path)['frames']]
    return sorted(in_threads(lambda pair: row(*pair), frames), key=lambda row: row['name'])
