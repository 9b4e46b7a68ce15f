#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of the board: its drawing to size, its corners in images, cameras from it alone, and the scale it gives."""
import os
import re
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np

import scenes
from photos import board, board_drawing, board_poses, scale
from photos.common import InputError
from photos.geometry import angle_deg, exp_so3
from photos.reconstruction import Camera

BOARD = board.Board(5, 4, 40.0, 30.0, '4X4_50')
PRINTED = board.parse_board(board.DEFAULT)
MAKE_BOARD = os.path.join(scenes.TOP, 'scripts', 'make_board')
CAMERA = Camera(640, 480, np.array([620.0, 625, 322, 238, -0.12, 0.03, 0.001, -0.001]))


def photo(pose, camera=CAMERA, noise=3.0, seed=0):
    """The board on grey ground, through a lens with distortion, with noise."""
    pixels_per_mm = 6
    drawn = board_drawing.picture(PRINTED, pixels_per_mm)
    R, t = pose
    # Pixel of the drawing -> paper [mm] -> board's frame [m] -> camera.
    half = 0.5 * PRINTED.square_mm
    to_board = np.array([[1 / pixels_per_mm, 0, 0.5 / pixels_per_mm - half - 0.5 * PRINTED.columns * PRINTED.square_mm],
                         [0, -1 / pixels_per_mm, -0.5 / pixels_per_mm + half + 0.5 * PRINTED.rows * PRINTED.square_mm],
                         [0, 0, 1000]]) / 1000
    H = camera.matrix() @ np.column_stack((R[:, 0], R[:, 1], t)) @ to_board
    large = 2  # drawn larger and reduced, against steps at edges
    S = np.array([[large, 0, 0.5 * (large - 1)], [0, large, 0.5 * (large - 1)], [0, 0, 1]])
    size = camera.width, camera.height
    plain = cv2.warpPerspective(drawn, S @ H, (large * size[0], large * size[1]), flags=cv2.INTER_AREA, borderValue=150)
    plain = cv2.resize(plain, size, interpolation=cv2.INTER_AREA)
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    pixels = np.column_stack((u.ravel(), v.ravel())).astype(np.float32).reshape(-1, 1, 2)
    flat = cv2.undistortPoints(pixels, camera.matrix(), camera.parameters[4:], P=camera.matrix())
    bent = cv2.remap(plain, flat.reshape(size[1], size[0], 2), None, cv2.INTER_LINEAR, borderValue=150)
    noisy = bent + np.random.default_rng(seed).normal(0, noise, bent.shape)
    return np.clip(cv2.GaussianBlur(noisy, (3, 3), 0.6), 0, 255).astype(np.uint8)


def poses(n=14):
    return [scenes.looking_at(0.5 * np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)]), np.zeros(3))
            for a, e in zip(np.linspace(0, 2 * np.pi, n, endpoint=False), np.tile(np.radians([50, 75, 60]), n)[:n])]


class Drawing(unittest.TestCase):
    def test_rectangles_have_the_size_that_was_asked_for(self):
        found = list(board.rectangles(BOARD))
        squares = [r for r in found if r[2] == 40]
        self.assertEqual(len(squares), 10)
        self.assertEqual(squares[0], (0, 0, 40, 40))         # the first one is black
        self.assertEqual(squares[3], (40, 40, 40, 40))       # the second of the second row
        markers = [r for r in found if r[2] != 40]
        # 4 x 4 bits and a border: 6 cells of 5 mm; the first marker is in the second square, 5 mm inside.
        self.assertTrue(all(width == height == 5 for _, _, width, height in markers))
        self.assertEqual(markers[0][:2], (45, 5))

    def test_picture(self):
        image = board_drawing.picture(BOARD, 2)
        self.assertEqual(image.shape, (2 * (160 + 40), 2 * (200 + 40)))
        np.testing.assert_array_equal(image[:40], 255)              # half a square is white around it
        np.testing.assert_array_equal(image[40:120, 40:120], 0)
        self.assertEqual(image[45, 125], 255)

    def test_pdf_and_svg_are_to_scale(self):
        with tempfile.TemporaryDirectory() as folder:
            for ending in ('pdf', 'svg', 'png'):
                path = os.path.join(folder, 'b.' + ending)
                result = subprocess.run([sys.executable, MAKE_BOARD, path, '--board', board.text_of(BOARD), '--page', 'A3'],
                                        stdout=subprocess.PIPE, check=True, universal_newlines=True)
                self.assertIn('200 x 160 mm', result.stdout)
                self.assertIn('--board charuco:5x4:40:30:4X4_50', result.stdout)
            with open(os.path.join(folder, 'b.svg'), encoding='utf-8') as file:
                text = file.read()
            self.assertIn('width="297mm" height="420mm" viewBox="0 0 297 420"', text)
            self.assertIn('<rect x="48.5000" y="123.0000" width="40.0000" height="40.0000"/>', text)
            with open(os.path.join(folder, 'b.pdf'), 'rb') as file:
                data = file.read()
            self.assertIn(b'/MediaBox [0 0 841.8898 1190.5512]', data)  # A3 at 72 points an inch
            self.assertIn(b'2.83464567 0 0 2.83464567 0 0 cm', data)
            start = int(re.search(rb'startxref\n(\d+)', data).group(1))
            self.assertEqual(data[start:start + 4], b'xref')
            for number, offset in enumerate(re.findall(rb'(\d{10}) 00000 n', data), 1):
                self.assertTrue(data[int(offset):].startswith(b'%d 0 obj' % number))
            self.assertEqual(sorted(os.listdir(folder)), ['b.pdf', 'b.png', 'b.svg'])

    def test_wrong_boards(self):
        for text, message in (('charuco:5x4', 'is no board'), ('charuco:5x4:30:40:4X4_50', 'smaller than squares'),
                              ('charuco:5x4:40:30:9X9', 'no dictionary'), ('charuco:20x20:40:30:4X4_50', 'fewer than 200')):
            with self.assertRaisesRegex(InputError, message):
                board.parse_board(text)
        with self.assertRaisesRegex(InputError, 'does not fit on A4'):
            board_drawing.svg(BOARD._replace(columns=9), 'A4')


class Corners(unittest.TestCase):
    def test_numbers_and_frame(self):
        points = board.corner_points(BOARD)
        self.assertEqual(len(points), 12)
        # 200 x 160 mm: the first inner corner is 40 mm from the upper left one, which is at (-100, 80) mm.
        np.testing.assert_allclose(points[0], [-0.06, 0.04, 0])
        np.testing.assert_allclose(points[11], [0.06, -0.04, 0])

    def test_found_to_a_fraction_of_a_pixel(self):
        errors = []
        for i, pose in enumerate(poses(5)):
            found = board.find_corners(PRINTED, photo(pose, seed=i))
            self.assertGreaterEqual(len(found), 40)
            points = board.corner_points(PRINTED)
            for number, xy in found.items():
                expected = CAMERA.pixels((pose[0] @ points[number] + pose[1])[None])[0]
                errors.append(np.linalg.norm(expected - xy))
        self.assertLess(np.median(errors), 0.1)
        self.assertLess(max(errors), 0.4)

    def test_no_board(self):
        self.assertEqual(board.find_corners(PRINTED, np.full((100, 100), 128, np.uint8)), {})


class Poses(unittest.TestCase):
    """Of photos with noise of 3 grey levels, from 0.5 m: a median of 0.5 mm and 0.1 degrees, none twice as far off."""

    @classmethod
    def setUpClass(cls):
        cls.true = poses()
        cls.corners = [board.find_corners(PRINTED, photo(pose, seed=i)) for i, pose in enumerate(cls.true)]
        cls.names = [f'{i}.jpg' for i in range(len(cls.true))]

    def solve(self, corners):
        return board_poses.poses_from_board(self.names, corners, board.corner_points(PRINTED),
                                            {'width': 640, 'height': 480, 'parameters': CAMERA.parameters})

    def check(self, found):
        kept = [self.names.index(name) for name in found.reconstruction.names]
        R, t = np.array([self.true[i][0] for i in kept]), np.array([self.true[i][1] for i in kept])
        centres = -np.einsum('nji,nj->ni', R, t)
        for limit, errors in ((0.1, angle_deg(found.reconstruction.R @ R.transpose(0, 2, 1))),
                              (0.0005, np.linalg.norm(found.reconstruction.centres() - centres, axis=1))):
            self.assertLess(np.median(errors), limit)
            self.assertLess(errors.max(), 2 * limit)

    def test_known_lens(self):
        found = self.solve(self.corners)
        self.assertLess(found.error_px, 0.2)
        self.check(found)

    def test_a_photo_of_another_place_is_left_out(self):
        corners = list(self.corners)
        corners[3] = {number: (x + 30 * np.sin(number), y) for number, (x, y) in corners[3].items()}
        corners[5] = {}
        found = self.solve(corners)
        self.assertEqual(sorted(found.left_out), ['3.jpg', '5.jpg'])
        self.assertEqual(found.left_out['5.jpg'], 'the board is not seen')
        self.check(found)

    def test_unknown_lens(self):
        found = board_poses.poses_from_board(self.names, self.corners, board.corner_points(PRINTED),
                                             {'width': 640, 'height': 480, 'parameters': None})
        self.assertAlmostEqual(found.reconstruction.cameras[0].focal, CAMERA.focal, delta=0.01 * CAMERA.focal)

    def test_too_few(self):
        with self.assertRaisesRegex(InputError, 'found in 2 photos'):
            self.solve(self.corners[:2] + [{}] * (len(self.names) - 2))


class Scale(unittest.TestCase):
    def setUp(self):
        self.points = board.corner_points(BOARD)
        self.model = scenes.reconstruction(noise_px=0)

    def corners(self, points, noise_px=0.1):
        random = np.random.default_rng(1)
        found = []
        for photo_ in range(0, len(self.model.names), 2):
            pixels = self.model.projected(photo_, np.array(list(points.values())))
            found.append((photo_, dict(zip(points, pixels + random.normal(0, noise_px, pixels.shape)))))
        return found

    def test_scale_and_frame(self):
        corners = self.corners(self.points)
        R, t = exp_so3(np.array([0.2, 0.5, -1])), np.array([1.0, 2, 3])
        self.model = self.model.moved(4, R, t)  # a unit is now 0.25 m
        found = scale.scale_from_board(self.model, corners, self.points)
        self.assertAlmostEqual(found.metres_per_unit, 0.25, delta=0.003 * 0.25)
        self.assertLess(found.sigma, 0.003)
        moved = self.model.moved(found.metres_per_unit, found.R, found.t)
        np.testing.assert_allclose(moved.centres(), scenes.reconstruction(noise_px=0).centres(), atol=0.002)

    def test_another_board(self):
        corners = self.corners({number: point * (1, 1.2, 1) for number, point in self.points.items()})
        with self.assertRaisesRegex(InputError, 'not the one that --board names'):
            scale.scale_from_board(self.model, corners, self.points)

    def test_too_few_corners(self):
        with self.assertRaisesRegex(InputError, 'at least 6 corners'):
            scale.scale_from_board(self.model, self.corners({0: self.points[0], 1: self.points[1]}), self.points)

    def test_known_length(self):
        ends = np.array([[0.1, 0, 0.05], [-0.1, 0, 0.05]])
        marks = [(photo_, *self.model.projected(photo_, ends)) for photo_ in (0, 4, 9)]
        self.assertAlmostEqual(scale.scale_from_length(self.model, 0.5, marks), 2.5, places=6)
        with self.assertRaisesRegex(InputError, 'in two photos'):
            scale.scale_from_length(self.model, 0.5, marks[:1])


if __name__ == '__main__':
    unittest.main()
