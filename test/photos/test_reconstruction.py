#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of photos/reconstruction.py and photos/geometry.py with numbers that are worked out by hand."""
import os
import struct
import tempfile
import unittest

import numpy as np

import scenes
from photos import geometry
from photos.common import InputError
from photos.reconstruction import Camera, move_principal_points, read_reconstruction

TEXT = {'cameras.txt': '# comment\n3 SIMPLE_RADIAL 640 480 500 320 240 0.1\n',
        'images.txt': '# comment\n7 1 0 0 0 0 0 2 3 b c.jpg\n10 20 5 30 40 -1\n'
                      '9 0.5 0.5 0.5 0.5 1 2 3 3 a.jpg\n50 60 5\n',
        'points3D.txt': '5 0 0 1 10 20 30 0.5 7 0 9 0\n8 1 1 1 0 0 0 0.5 7 1\n'}


def binary_files():
    """The same content, by COLMAP's specification of its binary files."""
    cameras = struct.pack('<Q', 1) + struct.pack('<iiQQ4d', 3, 2, 640, 480, 500, 320, 240, 0.1)
    images = struct.pack('<Q', 2)
    images += struct.pack('<i7di', 7, 1, 0, 0, 0, 0, 0, 2, 3) + b'b c.jpg\0'
    images += struct.pack('<Qddqddq', 2, 10, 20, 5, 30, 40, -1)
    images += struct.pack('<i7di', 9, 0.5, 0.5, 0.5, 0.5, 1, 2, 3, 3) + b'a.jpg\0' + struct.pack('<Qddq', 1, 50, 60, 5)
    points = struct.pack('<Q', 2)
    points += struct.pack('<Q3d3Bd', 5, 0, 0, 1, 10, 20, 30, 0.5) + struct.pack('<Q4i', 2, 7, 0, 9, 0)
    points += struct.pack('<Q3d3Bd', 8, 1, 1, 1, 0, 0, 0, 0.5) + struct.pack('<Q2i', 1, 7, 1)
    return {'cameras.bin': cameras, 'images.bin': images, 'points3D.bin': points}


class Files(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def read(self, files):
        for name, content in files.items():
            with open(os.path.join(self.folder.name, name), 'wb') as file:
                file.write(content if isinstance(content, bytes) else content.encode())
        return read_reconstruction(self.folder.name)

    def check(self, model):
        self.assertEqual(model.names, ['a.jpg', 'b c.jpg'])  # by name
        np.testing.assert_allclose(model.cameras[0].parameters, [500, 500, 320, 240, 0.1, 0, 0, 0])
        # (0.5, 0.5, 0.5, 0.5) turns by 120 degrees about (1, 1, 1): x to y, y to z, z to x.
        np.testing.assert_allclose(model.R[0], [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
        np.testing.assert_allclose(model.centres()[0], [-2, -3, -1], atol=1e-12)
        np.testing.assert_allclose(model.centres()[1], [0, 0, -2], atol=1e-12)
        self.assertEqual([model.photo_of.tolist(), model.point_of.tolist()], [[0, 1], [0, 0]])
        np.testing.assert_allclose(model.xy, [[50, 60], [10, 20]])

    def test_text(self):
        self.check(self.read(TEXT))

    def test_binary(self):
        self.check(self.read(binary_files()))

    def test_principal_points_are_moved(self):
        for files in (TEXT, binary_files()):
            self.read(files)
            move_principal_points(self.folder.name, [(321.5, 239.25)])
            model = read_reconstruction(self.folder.name)
            np.testing.assert_array_equal(model.cameras[0].parameters, [500, 500, 321.5, 239.25, 0.1, 0, 0, 0])
            self.assertEqual((model.cameras[0].width, model.cameras[0].height), (640, 480))
            for name in os.listdir(self.folder.name):
                os.unlink(os.path.join(self.folder.name, name))

    def test_damaged_files_are_named(self):
        whole = binary_files()
        for name, content in (('cameras.bin', whole['cameras.bin'][:-1]), ('images.bin', whole['images.bin'][:90]),
                              ('cameras.bin', whole['cameras.bin'].replace(struct.pack('<ii', 3, 2), struct.pack('<ii', 3, 99)))):
            with self.assertRaisesRegex(InputError, self.folder.name + '|number 99'):
                self.read({**whole, name: content})
        with tempfile.TemporaryDirectory() as empty, self.assertRaisesRegex(InputError, 'no reconstruction'):
            read_reconstruction(empty)


class Projection(unittest.TestCase):
    def test_pinhole_and_distortion(self):
        points = np.array([[0.0, 0, 2], [1, 0, 2], [0, 1, 2], [0, 0, -1]])
        plain = Camera(640, 480, np.array([500.0, 400, 320, 240, 0, 0, 0, 0])).pixels(points)
        np.testing.assert_allclose(plain[:3], [[320, 240], [570, 240], [320, 440]])
        self.assertFalse(np.isfinite(plain[3]).any())
        # At x = 0.5: r2 = 0.25; k1 = 0.4, k2 = 1.6: 1 + 0.1 + 0.1; p2 = 0.1: 0.1 (0.25 + 0.5); p1 = 0.2: 0.2 * 0.25.
        bent = Camera(640, 480, np.array([500.0, 400, 320, 240, 0.4, 1.6, 0.2, 0.1])).pixels(points[1:2])
        np.testing.assert_allclose(bent, [[320 + 500 * (0.6 + 0.075), 240 + 400 * 0.05]])

    def test_rays_undo_the_projection(self):
        camera = Camera(640, 480, np.array([500.0, 510, 320, 240, -0.2, 0.05, 0.003, -0.002]))
        points = np.array([[0.3, -0.2, 1], [-0.5, 0.4, 1], [0, 0, 1]])
        np.testing.assert_allclose(geometry.rays(camera, camera.pixels(points)), points, atol=1e-7)


class Parts(unittest.TestCase):
    def test_of_photos_keeps_tracks_of_two(self):
        model = scenes.reconstruction(scenes.rounds(6), noise_px=0)
        part = model.of_photos([0, 1, 5])
        self.assertEqual(part.names, [model.names[i] for i in (0, 1, 5)])
        self.assertGreaterEqual(part.photos_of_points().min(), 2)
        self.assertLess(part.errors().max(), 1e-9)

    def test_moved_shows_the_same_pixels(self):
        model = scenes.reconstruction(scenes.rounds(6), noise_px=0)
        moved = model.moved(2.5, geometry.exp_so3(np.array([0.1, 0.4, -0.7])), np.array([1, -2, 3.0]))
        self.assertLess(moved.errors().max(), 1e-9)
        # The cameras move with the points.
        scale, _, _ = geometry.similarity(model.centres(), moved.centres())
        self.assertAlmostEqual(scale, 2.5)


class Geometry(unittest.TestCase):
    def test_the_nearest_others_of_each_point(self):
        points = 1e3 + np.array([[0, 0, 0], [3, 0, 0], [0, 4, 0], [0, 0, 12.0]])
        distances, numbers = geometry.nearest(points, 2)
        np.testing.assert_array_equal(numbers, [[1, 2], [0, 2], [0, 1], [0, 1]])
        np.testing.assert_allclose(distances, [[3, 4], [3, 5], [4, 5], [12, 153 ** 0.5]], rtol=1e-6)

    def test_similarity(self):
        source = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
        R = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
        scale, found, t = geometry.similarity(source, 3 * source @ R.T + (1, 2, 3))
        self.assertAlmostEqual(scale, 3)
        np.testing.assert_allclose(found, R, atol=1e-12)
        np.testing.assert_allclose(t, [1, 2, 3], atol=1e-12)

    def test_similarity_is_no_mirror(self):
        source = np.random.default_rng(1).normal(size=(20, 3))
        _, R, _ = geometry.similarity(source, source * (1, 1, -1))
        self.assertAlmostEqual(np.linalg.det(R), 1)

    def test_nearest_point_of_two_crossing_lines(self):
        point, distances = geometry.nearest_point(np.array([[0.0, 0, 1], [2, 0, -1]]), np.array([[1.0, 0, 0], [0, 0, 1]]))
        np.testing.assert_allclose(point, [2, 0, 1], atol=1e-9)
        np.testing.assert_allclose(distances, 0, atol=1e-9)

    def test_focus_ignores_a_camera_that_looks_away(self):
        poses = scenes.rounds(8) + [scenes.looking_at(np.array([0.5, 0, 0.5]), np.array([3, 1, 0.5]))]
        model = scenes.reconstruction(poses)
        np.testing.assert_allclose(geometry.focus(model), [0, 0, 0.06], atol=1e-6)


if __name__ == '__main__':
    unittest.main()
