#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of objects in photos that are cut out: no table is known."""
import unittest

import numpy as np

import scenes
from photos import dataset, object_masks, object_region
from photos.common import InputError


class CutOuts(unittest.TestCase):
    """Photos whose masks the user gives: all of them."""

    def setUp(self):
        self.poses = scenes.rounds(8)
        self.model = scenes.reconstruction(self.poses, noise_px=0)
        self.photos = [dataset.PosedPhoto(f'view_{i}', f'{i}.jpg', scenes.render(pose), scenes.camera(), *pose,
                                          drawn=scenes.true_mask(pose)) for i, pose in enumerate(self.poses)]

    def test_the_object_is_what_the_masks_show(self):
        region = object_region.on_cut_outs(self.model, self.photos, np.zeros(16, bool))
        R = region.reconstruction.R[0].T @ self.model.R[0]
        np.testing.assert_allclose(R[2], (0, 0, 1), atol=1e-6)  # z is up
        self.assertAlmostEqual(np.ptp(region.points[:, 2]), scenes.BOX[2], delta=0.02)  # without the table
        self.assertAlmostEqual(region.low[2], -0.12 * 0.2, delta=0.005)  # the object may reach below its points
        for photo, R, t in zip(self.photos, region.reconstruction.R, region.reconstruction.t):
            photo.R, photo.t = R, t
        _, (low, high) = object_masks.mask_photos(self.photos, region)
        surplus = high - low - scenes.BOX  # cameras look down: more is left below
        self.assertTrue(np.all(surplus > -0.002) and np.all(surplus < (0.04, 0.04, 0.06)), surplus)
        for photo in self.photos:
            np.testing.assert_array_equal(photo.mask, photo.drawn)

    def test_photos_that_were_turned(self):
        clockwise = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # x to the right becomes y down
        turned = np.arange(16) % 3 == 0
        self.model.R[turned] = clockwise @ self.model.R[turned]
        np.testing.assert_allclose(object_region.upwards(self.model, turned), (0, 0, 1), atol=1e-6)

    def test_masks_of_other_photos(self):
        for photo, other in zip(self.photos, self.photos[5:] + self.photos[:5]):
            photo.drawn = np.roll(other.mask if other.mask is not None else other.drawn, 120, axis=1)
        with self.assertRaisesRegex(InputError, 'masks contradict each other'):
            object_region.on_cut_outs(self.model, self.photos, np.zeros(16, bool))


if __name__ == '__main__':
    unittest.main()
