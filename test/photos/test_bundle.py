#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of bundle adjustment: poses and lens from corners with noise."""
import unittest

import numpy as np

import scenes
from photos import bundle
from photos.geometry import angle_deg, exp_so3
from photos.reconstruction import Camera

LENS = Camera(1280, 960, np.array([1060.0, 1060.5, 636, 484, 0.05, -0.03, 2e-4, -2e-4]))
PLAIN = Camera(1280, 960, np.array([1090.0, 1090, 640, 480, 0, 0, 0, 0]))
SIGMA = 0.1


def scene(photos=24, sigma=SIGMA, seed=4):
    """(what is observed of a flat grid, true poses)."""
    random = np.random.default_rng(seed)
    grid = np.array([(0.025 * i - 0.075, 0.025 * j - 0.1, 0) for i in range(7) for j in range(9)])
    upright = [scenes.around(360 * i / photos, (40, 62)[i % 2], 0.45) for i in range(photos)]
    # Photos that are all upright say little of the principal point: every third one is turned.
    poses = [bundle.moved(pose, np.array([0, 0, np.pi / 2 * (i % 3 == 0), 0, 0, 0])) for i, pose in enumerate(upright)]
    photo, points, xy = [], [], []
    for i, (R, t) in enumerate(poses):
        pixels = LENS.pixels(grid @ R.T + t)
        seen = np.all((pixels > 0) & (pixels < (1280, 960)), axis=1)
        photo += [i] * seen.sum()
        points += list(grid[seen])
        xy += list(pixels[seen] + random.normal(0, sigma, (seen.sum(), 2)))
    return bundle.Observed(photos, np.array(photo), np.array(points), np.array(xy)), poses


def observed_upright():
    """(observed, (camera, poses)) of photos that are all upright."""
    poses = [scenes.around(15 * i, (40, 62)[i % 2], 0.45) for i in range(24)]
    grid = np.array([(0.025 * i - 0.075, 0.025 * j - 0.1, 0) for i in range(7) for j in range(9)])
    photo, points = np.repeat(np.arange(24), len(grid)), np.tile(grid, (24, 1))
    observed = bundle.Observed(24, photo, points, np.zeros((len(points), 2)))
    observed.xy[:] = bundle.projected(observed, LENS, poses)
    return observed, (LENS, poses)


def disturbed(poses, seed=9):
    random = np.random.default_rng(seed)
    return [bundle.moved(pose, random.normal(0, 0.02, 6)) for pose in poses]


def errors(found, true):
    """(median angle [deg], median distance of the cameras [m])."""
    turns = [angle_deg(a[0].T @ b[0]) for a, b in zip(found, true)]
    shifts = [np.linalg.norm(a[0].T @ a[1] - b[0].T @ b[1]) for a, b in zip(found, true)]
    return np.median(turns), np.median(shifts)


class Bundle(unittest.TestCase):
    def test_derivatives_are_those_of_the_projection(self):
        observed, poses = scene(3)
        by_pose, by_lens = bundle.derivatives(observed, LENS, poses)
        # By hand: a shift along x moves the pixel of a point at depth z by about f / z.
        R, t = poses[0]
        depth = (observed.points[0] @ R.T + t)[2]
        self.assertAlmostEqual(by_pose[0, 0, 3], 1060 / depth, delta=0.03 * 1060 / depth)
        np.testing.assert_allclose(by_lens[0, :, 2:4], np.eye(2), atol=1e-6)

    def test_poses_and_lens_are_found(self):
        observed, true = scene()
        camera, poses = bundle.adjusted(observed, PLAIN, disturbed(true), SIGMA)
        turn, shift = errors(poses, true)
        self.assertLess(turn, 0.1)
        self.assertLess(shift, 0.0008)
        np.testing.assert_allclose(camera.parameters[:4], LENS.parameters[:4], atol=4)

    def test_without_noise_the_answer_is_exact_but_for_the_priors(self):
        observed, true = scene(sigma=0)
        camera, poses = bundle.adjusted(observed, PLAIN, disturbed(true), 0.01)
        turn, shift = errors(poses, true)
        self.assertLess(turn, 0.005)
        self.assertLess(shift, 0.00005)
        np.testing.assert_allclose(camera.parameters[:4], LENS.parameters[:4], atol=0.2)

    def test_wrong_corners_count_little(self):
        observed, true = scene()
        observed.xy[::40] += 30
        _, poses = bundle.adjusted(observed, PLAIN, disturbed(true), SIGMA)
        self.assertLess(errors(poses, true)[0], 0.2)

    def test_a_given_lens_stays(self):
        observed, true = scene()
        camera, poses = bundle.adjusted(observed, LENS, disturbed(true), SIGMA, is_lens_given=True)
        np.testing.assert_array_equal(camera.parameters, LENS.parameters)
        turn, shift = errors(poses, true)
        self.assertLess(turn, 0.05)
        self.assertLess(shift, 0.0003)

    def test_the_prior_holds_what_is_not_seen(self):
        observed, true = scene(photos=2)
        camera, _ = bundle.adjusted(observed, PLAIN, true, SIGMA)
        self.assertLess(np.abs(camera.parameters[2:4] - (640, 480)).max(), 3 * bundle.MIDDLE_SIGMA * 1280)


    def test_photos_that_are_all_upright_leave_the_principal_point_open(self):
        observed, true = scene()
        turned = bundle.middle_sigma(observed, (LENS, true), SIGMA)
        upright = observed_upright()
        self.assertLess(turned, 1)
        self.assertGreater(bundle.middle_sigma(*upright, SIGMA), 2)


class Turns(unittest.TestCase):
    def test_a_change_turns_the_camera(self):
        R, t = bundle.moved((np.eye(3), np.array([0, 0, 1.0])), np.array([0, 0, 0.1, 0, 0, 0.5]))
        np.testing.assert_allclose(R, exp_so3(np.array([0, 0, 0.1])))
        np.testing.assert_allclose(t, (0, 0, 1.5))


if __name__ == '__main__':
    unittest.main()
