#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of objects in photos that are cut out: no table is known."""
import os
import tempfile
import unittest

import cv2
import numpy as np

import scenes
from photos import colmap, dataset, intake, object_masks, object_region
from photos.common import InputError
from photos.reconstruction import Camera


class CutOuts(unittest.TestCase):
    """Photos whose masks the user gives: all of them."""

    def setUp(self):
        self.poses = scenes.rounds(8)
        self.model = scenes.reconstruction(self.poses, noise_px=0)
        self.photos = [dataset.PosedPhoto(f'view_{i}', f'{i}.jpg', scenes.render(pose), scenes.camera(), *pose,
                                          cut_out=scenes.true_mask(pose)) for i, pose in enumerate(self.poses)]

    def test_the_object_is_what_the_masks_show(self):
        region = object_region.on_cut_outs(self.model, self.photos, np.zeros(16, bool))
        R = region.reconstruction.R[0].T @ self.model.R[0]
        np.testing.assert_allclose(R[2], (0, 0, 1), atol=1e-6)  # z is up
        self.assertAlmostEqual(np.ptp(region.points[:, 2]), scenes.BOX[2], delta=0.02)  # without the table
        self.assertAlmostEqual(region.low[2], -0.12 * 0.2, delta=0.005)  # the object may reach below its points
        for photo, R, t in zip(self.photos, region.reconstruction.R, region.reconstruction.t):
            photo.R, photo.t = R, t
        _, (low, high) = object_masks.mask_photos(self.photos, region)
        surplus = high - low - scenes.BOX  # one photo may err, and cameras look down: more is left below
        self.assertTrue(np.all(surplus > -0.002) and np.all(surplus < (0.06, 0.06, 0.12)), surplus)
        for photo, pose in zip(self.photos, self.poses):
            np.testing.assert_array_equal(photo.mask, scenes.true_mask(pose))

    def test_one_that_is_wrong(self):
        # Most of it was taken for the background: the others outvote it, and the box stays whole.
        region = object_region.on_cut_outs(self.model, self.photos, np.zeros(16, bool))
        for photo, R, t in zip(self.photos, region.reconstruction.R, region.reconstruction.t):
            photo.R, photo.t = R, t
        true = self.photos[3].cut_out
        rows = np.flatnonzero(true.any(axis=1))
        self.photos[3].cut_out = true.copy()
        self.photos[3].cut_out[:rows[0] + 6 * len(rows) // 10] = 0
        agreements, (low, high) = object_masks.mask_photos(self.photos, region)
        self.assertGreater(high[2] - low[2], scenes.BOX[2] - 0.002)
        self.assertLess(agreements[3], 0.5)
        self.assertGreater(min(agreements[:3] + agreements[4:]), 0.85)
        self.assertGreater(np.mean(self.photos[3].mask[true > 0] > 0), 0.95)

    def test_an_object_whose_lower_part_has_no_points(self):
        region = object_region.on_cut_outs(self.model.of_points((self.model.xyz[:, 2] > 0.1) | (self.model.xyz[:, 2] == 0)),
                                           self.photos, np.zeros(16, bool))
        for photo, R, t in zip(self.photos, region.reconstruction.R, region.reconstruction.t):
            photo.R, photo.t = R, t
        _, (low, high) = object_masks.mask_photos(self.photos, region)
        self.assertGreater(high[2] - low[2], scenes.BOX[2] - 0.002)

    def test_photos_that_were_turned(self):
        clockwise = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # x to the right becomes y down
        turned = np.arange(16) % 3 == 0
        self.model.R[turned] = clockwise @ self.model.R[turned]
        np.testing.assert_allclose(object_region.upwards(self.model, turned), (0, 0, 1), atol=1e-6)

    def test_photos_along_one_arc(self):
        poses = [scenes.around(20, elevation) for elevation in (10, 25, 40, 55)]
        model = scenes.reconstruction(poses, noise_px=0)
        x = np.array([-np.sin(np.radians(20)), np.cos(np.radians(20)), 0])  # the only axis that is level in all
        up = object_region.upwards(model, np.zeros(4, bool))
        self.assertAlmostEqual(up @ x, 0, delta=1e-6)
        self.assertGreater(up[2], 0.8)

    def test_masks_of_other_photos(self):
        shown = [photo.cut_out for photo in self.photos]
        for i, photo in enumerate(self.photos):
            photo.cut_out = np.roll(shown[(i + 5) % 16], 120, axis=1)
        with self.assertRaisesRegex(InputError, 'masks contradict each other'):
            object_region.on_cut_outs(self.model, self.photos, np.zeros(16, bool))


class Copies(unittest.TestCase):
    """From a PNG with alpha to the mask of the undistorted photo."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def write(self, name, shape, box=(10, 20, 60, 90)):
        """A grey image, opaque in rows and columns (first, first, last, last)."""
        image = np.full((*shape, 4), 90, np.uint8)
        image[:, :, 3] = 0
        image[box[0]:box[2], box[1]:box[3], 3] = 255
        cv2.imwrite(os.path.join(self.folder, name), image)
        return os.path.join(self.folder, name)

    def test_masks_are_turned_and_undistorted_as_photos_are(self):
        paths = [self.write(f'{i}.png', shape) for i, shape in enumerate(((120, 160), (160, 120), (120, 160)))]
        copies, _ = intake.copy_photos(paths, self.folder, 160)
        self.assertEqual([copy.turned for copy in copies], [False, True, False])
        camera = Camera(160, 120, np.array([150, 150, 80, 60, -0.3, 0.05, 0, 0.0]))
        photos = []
        for copy in copies:
            alpha = cv2.imread(os.path.join(self.folder, 'alpha', copy.name + '.png'), cv2.IMREAD_GRAYSCALE)
            self.assertEqual(alpha.shape, (120, 160))
            expected = (slice(20, 90), slice(100, 150)) if copy.turned else (slice(10, 60), slice(20, 90))
            self.assertTrue(alpha[expected].all())
            self.assertEqual(np.count_nonzero(alpha), 50 * 70)
            image, pinhole = dataset.undistorted(os.path.join(self.folder, copy.name), camera)
            photos.append(dataset.PosedPhoto(copy.name, copy.source, image, pinhole, np.eye(3), np.zeros(3), copy=copy.name,
                                             taken_by=camera))
        object_masks.take_cut_outs(photos, self.folder)
        middle = cv2.undistortPoints(np.array([[[20.0, 10.0]]]), camera.matrix(), camera.parameters[4:], P=camera.matrix())[0, 0]
        rows, columns = (np.flatnonzero(photos[0].cut_out.any(axis=axis)) for axis in (1, 0))
        np.testing.assert_allclose([columns[0], rows[0]], middle, atol=2)
        self.assertGreater(np.hypot(columns[0] - 20, rows[0] - 10), 5)  # far from where the lens showed it

    def test_what_is_no_cut_out(self):
        nearly_opaque = self.write('corner.png', (120, 160), (0, 0, 119, 160))
        self.assertIsNone(intake.load_cut_out(nearly_opaque, 160))
        cv2.imwrite(os.path.join(self.folder, 'a.jpg'), np.full((120, 160, 3), 90, np.uint8))
        self.assertIsNone(intake.load_cut_out(os.path.join(self.folder, 'a.jpg'), 160))
        with self.assertRaisesRegex(InputError, 'transparent everywhere'):
            intake.load_cut_out(self.write('empty.png', (120, 160), (0, 0, 0, 0)), 160)
        image, mask = intake.load_cut_out(self.write('square.png', (161, 160)), 80)
        self.assertEqual((image.shape[:2], mask.shape), ((80, 80), (80, 80)))

    def test_features_of_the_object_alone_if_all_are_cut_out(self):
        paths = [self.write(f'{i}.png', (120, 160)) for i in range(3)]
        intake.copy_photos(paths, self.folder, 160)
        self.assertTrue(colmap.all_cut_out(self.folder, 1))
        os.remove(os.path.join(self.folder, 'alpha', 'camera_0', 'view_0001.jpg.png'))
        self.assertFalse(colmap.all_cut_out(self.folder, 1))


if __name__ == '__main__':
    unittest.main()
