# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Sharp frames of a video: of each stretch of it the sharpest one."""
import os

import cv2

from photos.common import InputError, require, say
from photos.intake import Copy, JPEG_QUALITY, sharpness

ENDINGS = ('.mp4', '.mov', '.avi', '.mkv', '.webm', '.m4v')
FRAMES = 80               # that are taken
MIN_FRAMES = 20
COMPARED = 6              # frames of a stretch that are compared


def is_video(path):
    return path.lower().endswith(ENDINGS)


def open_video(path):
    video = cv2.VideoCapture(path)
    if not video.isOpened():
        raise InputError(f"'{path}' cannot be decoded: convert it to H.264 (ffmpeg -i IN -c:v libx264 OUT.mp4)")
    return video


def frames_of(path):
    """How many there are: counted, for headers lie."""
    video, frames = open_video(path), 0
    while video.grab():
        frames += 1
    video.release()
    return frames


def compared_frames(total, stretches):
    """{number of a frame: stretch}: of each stretch of equal length, some frames around its middle, evenly spread."""
    length = total / stretches
    chosen = {}
    for stretch in range(stretches):
        for i in range(COMPARED):
            chosen[int((stretch + (i + 0.5) / COMPARED) * length)] = stretch
    return chosen


def reduced(image, max_side):
    scale = max_side / max(image.shape)
    if scale >= 1:
        return image
    size = (round(image.shape[1] * scale), round(image.shape[0] * scale))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def extract_frames(path, folder, max_side):
    """Writes the frames in their order. One frame is held at a time. @return (copies, cameras) as copy_photos."""
    total = frames_of(path)
    require(total >= MIN_FRAMES, f"'{path}' has {total} frames: film 20 to 60 seconds around the object")
    chosen = compared_frames(total, min(FRAMES, total // 2))
    os.makedirs(os.path.join(folder, 'camera_0'))
    best = {}
    video = open_video(path)
    size = None
    for number in range(total):
        if not video.grab():
            break
        if number not in chosen:
            continue
        read, image = video.retrieve()
        if not read:
            continue
        full = max(image.shape)
        image = reduced(image, max_side)
        size, scale = (image.shape[1], image.shape[0]), max(image.shape) / full
        stretch, sharp = chosen[number], sharpness(image)
        if stretch not in best or sharp > best[stretch].sharpness:
            name = os.path.join('camera_0', f'view_{stretch:04d}.jpg')
            require(cv2.imwrite(os.path.join(folder, name), image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]),
                    f"cannot write '{name}'")
            best[stretch] = Copy(name, f'{os.path.basename(path)}, frame {number}', 0, False, scale, sharp)
    video.release()
    require(best, f"'{path}' holds no frame that can be decoded")
    say(f'{len(best)} of {total} frames are taken: the sharpest of each stretch')
    return [best[stretch] for stretch in sorted(best)], [{'width': size[0], 'height': size[1], 'focal_px': None}]
