#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of the comparison of renderings with photos."""
import os
import tempfile
import unittest

import cv2
import numpy as np

import scenes  # noqa: F401 (for the path)
from photos import quality
from photos.common import InputError, write_json

SIDE = 64


def rendering(seed=1):
    """Colours from 60 to 180 in a square, with alpha."""
    colours = np.random.default_rng(seed).integers(60, 180, (SIDE, SIDE, 3)).astype(np.uint8)
    alpha = np.zeros((SIDE, SIDE, 1), np.uint8)
    alpha[16:48, 16:48] = 255
    return np.concatenate((colours, alpha), axis=2)


class Renderings(unittest.TestCase):
    def test_a_pixel_is_the_mean_of_its_rays(self):
        shown = np.zeros((4, 4, 4), np.uint8)
        shown[:, ::2] = (200, 100, 0, 255)  # stripes as fine as a ray, on nothing
        shown[2:, 1::2] = (100, 100, 100, 255)
        with tempfile.TemporaryDirectory() as folder:
            cv2.imwrite(os.path.join(folder, 'a.png'), shown)
            reduced = quality.read_rendering(folder, 'a')
            with self.assertRaisesRegex(InputError, "no rendering 'b.png'"):
                quality.read_rendering(folder, 'b')
        np.testing.assert_array_equal(reduced[0], np.tile((200, 100, 0, 128), (2, 1)))
        np.testing.assert_array_equal(reduced[1], np.tile((150, 100, 50, 255), (2, 1)))


    def test_pixels_on_the_outline_are_not_the_object(self):
        photo, mask = np.full((20, 20, 3), 100, np.uint8), np.zeros((20, 20), np.uint8)
        mask[5:15, 5:15] = 255
        mask[5, 5:15] = 140  # half of it shows the table
        shown = np.dstack((photo, mask))
        shown[5, :, :3] = 0
        self.assertEqual(quality.compared(shown, photo, mask)['psnr_object_db'], 60)
        shown[6, :, :3] = 0
        self.assertLess(quality.compared(shown, photo, mask)['psnr_object_db'], 20)
        thin = np.where(mask == 140, mask, 0).astype(np.uint8)  # no pixel is the object's as a whole
        self.assertIsNotNone(quality.compared(shown, photo, thin)['psnr_object_db'])


class Gains(unittest.TestCase):
    def test_another_exposure_is_undone(self):
        shown = rendering()
        inside = shown[:, :, 3] == 255
        photo = np.clip(shown[:, :, :3] * (1.25, 0.8, 1.1) + (4, -6, 0), 0, 255).astype(np.uint8)
        photo[20:24, 20:30] = 255  # a highlight, which the model does not know
        back = quality.with_gain(photo, shown, inside)
        inside[20:24, 20:30] = False
        self.assertLess(np.abs(back.astype(int) - shown[:, :, :3])[inside].max(), 4)

    def test_only_where_exposures_differ(self):
        shown = rendering()
        with tempfile.TemporaryDirectory() as folder:
            for name in ('images', 'masks', 'renderings'):
                os.mkdir(os.path.join(folder, name))
            cv2.imwrite(os.path.join(folder, 'renderings', 'a.png'), shown)
            cv2.imwrite(os.path.join(folder, 'images', 'a.png'), np.clip(1.2 * shown[:, :, :3], 0, 255).astype(np.uint8))
            cv2.imwrite(os.path.join(folder, 'masks', 'a.png'), shown[:, :, 3])
            write_json(os.path.join(folder, 'transforms_test.json'), {'frames': [
                {'file_path': 'images/a.png', 'mask_path': 'masks/a.png', 'source': 'a.jpg'}]})
            rows = [quality.measure(folder, os.path.join(folder, 'renderings'), equal)[0] for equal in (True, False)]
        # Off by a fifth of 120 of 255 on the average: 20 dB.
        self.assertAlmostEqual(rows[0]['psnr_object_db'], 20, delta=1)
        self.assertGreater(rows[1]['psnr_object_db'], 45)
        self.assertEqual(rows[0]['alpha_outside'], 0)


if __name__ == '__main__':
    unittest.main()
