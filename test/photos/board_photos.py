#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Writes photos of a box on a printed board, in a folder for each of some objects, and prints the board as the option
--board of photos_to_object takes it. The photos are rendered once; those of the other objects are darker.

    board_photos.py FOLDER COUNT
"""
import os
import sys

import cv2
import numpy as np

import scenes
from photos.board import Board, text_of

BOARD = Board(12, 12, 40.0, 30.0, '4X4_100')
CAMERA = scenes.Camera(480, 360, np.array([465.0, 465, 240, 180, 0, 0, 0, 0]))
POSES = scenes.rounds(5, (35, 60))
UPRIGHT = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # every third photo, or the principal point cannot be told
DARKEST = 0.9  # darker, the box would lose its texture
JPEG_QUALITY = 90


def photos():
    painted = scenes.on_board(BOARD)
    return [scenes.render((UPRIGHT @ R, UPRIGHT @ t) if i % 3 == 0 else (R, t), CAMERA, painted)
            for i, (R, t) in enumerate(POSES)]


def main(folder, count):
    taken = photos()
    for i, gain in enumerate(np.linspace(1, DARKEST, count)):
        photos_of_one = os.path.join(folder, f'object_{i:02d}')
        os.makedirs(photos_of_one)
        for j, image in enumerate(taken):
            cv2.imwrite(os.path.join(photos_of_one, f'{j:02d}.jpg'), cv2.convertScaleAbs(image, alpha=gain),
                        [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    print(text_of(BOARD))


if __name__ == '__main__':
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]))
