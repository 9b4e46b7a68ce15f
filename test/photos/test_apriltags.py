#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of AprilTags in the scene: found in images, and what scale and frame they give."""
import unittest

import cv2
import numpy as np

import scenes
from photos import apriltags, targets
from photos.board import aruco_dictionary
from photos.common import InputError
from photos.geometry import angle_deg, exp_so3
from photos.reconstruction import Camera

TAGS = apriltags.parse_tags('apriltag:36h11:60:3,11')
CAMERA = Camera(640, 480, np.array([640.0, 640, 320, 240, 0, 0, 0, 0]))
PLACES = {3: (0.05, -0.02, 0.4), 11: (-0.08, 0.06, -1.1)}   # x, y [m], turn [rad] on the table
BORDER = 0.125                                               # of white around a tag, of its side


def drawn(number, side_px=320):
    draw = getattr(cv2.aruco, 'generateImageMarker', None) or cv2.aruco.drawMarker
    tag = draw(aruco_dictionary('APRILTAG_36h11'), number, side_px)
    border = int(BORDER * side_px)
    tag = cv2.copyMakeBorder(tag, border, border, border, border, cv2.BORDER_CONSTANT, value=255)
    return cv2.cvtColor(tag, cv2.COLOR_GRAY2BGR)


def painted(size=0.06):
    """Both tags as quads for scenes.render."""
    for number, (x, y, turn) in PLACES.items():
        half = 0.5 * size * (1 + 2 * BORDER)
        corners = np.array([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)])
        yield corners @ exp_so3(np.array([0, 0, turn])).T + (x, y, 0), drawn(number)


def seen(size_of_11=0.06):
    """(reconstruction without points, corners as found in its rendered photos)."""
    poses = [scenes.around(a, e, 0.5) for a, e in zip(range(0, 360, 36), 5 * (45, 65))]
    quads = list(painted())
    quads[1] = list(painted(size_of_11))[1]
    model = scenes.reconstruction(poses, cameras=[CAMERA])
    corners = []
    for i, pose in enumerate(poses):
        found = targets.find_corners(TAGS, scenes.render(pose, CAMERA, quads))
        if found:
            corners.append((i, found))
    return model, corners


class Tags(unittest.TestCase):
    def test_scale_and_frame_of_the_first_tag(self):
        model, corners = seen()
        self.assertEqual(len(corners), 10)
        turn, shift, factor = exp_so3(np.array([0.3, -0.8, 0.2])), np.array([1, 2, -3.0]), 3.7
        found = targets.scale_from_target(model.moved(factor, turn, shift), corners, TAGS)
        self.assertAlmostEqual(found.metres_per_unit * factor, 1, delta=0.001)
        self.assertLess(found.sigma, 0.003)
        # The frame of the first tag, in the world of the scene: R, t take that world into the tag's.
        x, y, angle = PLACES[3]
        R = found.R @ turn
        self.assertLess(angle_deg(R @ exp_so3(np.array([0, 0, angle]))), 0.2)
        origin = found.metres_per_unit * found.R @ (factor * turn @ np.array([x, y, 0]) + shift) + found.t
        np.testing.assert_allclose(origin, 0, atol=0.0002)

    def test_tags_of_two_sizes_are_refused(self):
        model, corners = seen(0.05)
        with self.assertRaisesRegex(InputError, 'not all of one size'):
            targets.scale_from_target(model, corners, TAGS)

    def test_a_tag_that_is_not_there(self):
        model, _ = seen()
        with self.assertRaisesRegex(InputError, 'the tag 3 was not found'):
            targets.scale_from_target(model, [], TAGS)

    def test_names(self):
        self.assertEqual(TAGS, apriltags.Tags('36h11', 60.0, [3, 11]))
        for text in ('apriltag:36h11:60', 'apriltag:36h11:x:1', 'apriltag:36h11:60:', 'apriltag:37h1:60:0',
                     'apriltag:36h11:0:0', 'apriltag:16h5:60:30'):
            with self.subTest(text=text), self.assertRaisesRegex(InputError, text):
                apriltags.parse_tags(text)


if __name__ == '__main__':
    unittest.main()
