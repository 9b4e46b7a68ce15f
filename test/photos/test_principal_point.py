#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of photos/principal_point.py: against the whole system of equations, and on photos that leave a coordinate open."""
import copy
import unittest

import numpy as np

import scenes
from photos import bundle, principal_point
from photos.geometry import exp_so3
from photos.reconstruction import Camera

SIGMA = bundle.MIDDLE_SIGMA * scenes.WIDTH
MIDDLE = np.array([scenes.WIDTH / 2, scenes.HEIGHT / 2])
NOISE = 0.3  # px, of scenes.reconstruction


def one_height():
    return scenes.reconstruction([scenes.around(30 * i, 40) for i in range(12)], noise_px=NOISE)


def turned_cameras():
    """Two heights, every third camera turned by 90 degrees."""
    turn = exp_so3([0, 0, np.pi / 2])
    poses = [(turn @ R, turn @ t) if i % 3 == 0 else (R, t) for i, (R, t) in enumerate(scenes.rounds(8))]
    return scenes.reconstruction(poses, noise_px=NOISE)


def with_lens(reconstruction, camera, parameters):
    result = copy.copy(reconstruction)
    result.cameras = list(result.cameras)
    result.cameras[camera] = Camera(scenes.WIDTH, scenes.HEIGHT, np.asarray(parameters, dtype=float))
    return result


def numeric_jacobian(model):
    """[2 observations][n] by all that is unknown: poses, lenses and points, by central differences of the projections."""
    lens_columns = ((0, 1), (2,), (3,), (4,), (5,))

    def pixels(R, t, cameras, xyz):
        points = np.einsum('nij,nj->ni', R[model.photo_of], xyz[model.point_of]) + t[model.photo_of]
        found = np.zeros_like(model.xy)
        for i, camera in enumerate(cameras):
            own = model.camera_of[model.photo_of] == i
            found[own] = camera.pixels(points[own])
        return found.ravel()

    def at(kind, index, k, step):
        R, t, cameras, xyz = model.R.copy(), model.t.copy(), model.cameras, model.xyz.copy()
        if kind == 'pose':
            R[index], t[index] = bundle.moved((R[index], t[index]), step * np.eye(6)[k])
        elif kind == 'lens':
            values = cameras[index].parameters.copy()
            values[list(lens_columns[k])] += step
            cameras = [Camera(c.width, c.height, values) if i == index else c for i, c in enumerate(cameras)]
        else:
            xyz[index, k] += step
        return pixels(R, t, cameras, xyz)

    unknowns = [('pose', i, k, 1e-6) for i in range(len(model.names)) for k in range(6)]
    unknowns += [('lens', i, k, 1e-3 if k < 3 else 1e-6) for i in range(len(model.cameras)) for k in range(5)]
    unknowns += [('point', i, k, 1e-6) for i in range(len(model.xyz)) for k in range(3)]
    return np.column_stack([(at(*u[:3], u[3]) - at(*u[:3], -u[3])) / (2 * u[3]) for u in unknowns])


class Covariance(unittest.TestCase):
    def test_it_is_that_of_the_whole_system(self):
        poses = [scenes.around(40 * i, 30 + 10 * (i % 2)) for i in range(4)]
        model = scenes.reconstruction(poses, cameras=[scenes.camera(), scenes.camera(350, (0.05, 0.02, 0, 0))] * 2)
        model.cameras, model.camera_of = model.cameras[:2], np.array([0, 1, 0, 1])
        model = model.of_points(np.arange(len(model.xyz)) % 12 == 0)
        J = numeric_jacobian(model)
        lenses = 6 * len(poses)
        variance = np.mean(model.errors() ** 2) / 2
        whole = J.T @ J / variance
        prior = principal_point.lens_prior(model)
        whole[lenses:lenses + 10, lenses:lenses + 10] += np.diag(prior)
        middles = lenses + np.array([1, 2, 6, 7])
        # The place, turn and scale of everything are open: the inverse without them.
        expected = np.linalg.pinv(whole, rcond=1e-13, hermitian=True)[np.ix_(middles, middles)]
        np.testing.assert_allclose(principal_point.covariance(model), expected, rtol=0.01, atol=0.01 * expected.max())

    def test_a_point_that_a_photo_sees_twice_counts_twice(self):
        model = turned_cameras()
        twice = copy.copy(model)
        for name in ('photo_of', 'point_of', 'xy'):
            setattr(twice, name, np.concatenate((getattr(model, name), getattr(model, name))))
        # Without the prior's share, half the variance.
        def observed(m):
            return np.linalg.inv(np.linalg.inv(principal_point.covariance(m)) - np.eye(2) / SIGMA ** 2)
        np.testing.assert_allclose(observed(twice), observed(model) / 2, rtol=0.05)

    def test_many_points_are_sampled(self):
        model = turned_cameras()
        whole = principal_point.covariance(model)
        limit, principal_point.MAX_POINTS = principal_point.MAX_POINTS, len(model.xyz) // 3
        self.addCleanup(setattr, principal_point, 'MAX_POINTS', limit)
        np.testing.assert_allclose(principal_point.covariance(model), whole, rtol=0.3, atol=0.1 * whole.max())


class Likely(unittest.TestCase):
    def test_what_photos_show_counts(self):
        held = turned_cameras()
        free = with_lens(held, 0, [scenes.FOCAL, scenes.FOCAL, *(MIDDLE + (6, -4)), 0, 0, 0, 0])
        np.testing.assert_allclose(principal_point.likely(held, free) - MIDDLE, [[6, -4]], atol=0.2)

    def test_what_photos_do_not_show_stays_in_the_middle(self):
        held = one_height()
        self.assertAlmostEqual(np.sqrt(principal_point.covariance(held)[1, 1]), SIGMA, delta=0.02 * SIGMA)
        # The adjustment puts the open coordinate anywhere.
        free = with_lens(held, 0, [scenes.FOCAL, scenes.FOCAL, *(MIDDLE + (3, 25)), 0, 0, 0, 0])
        (across, along), = principal_point.likely(held, free) - MIDDLE
        self.assertAlmostEqual(across, 3, delta=0.4)
        self.assertLess(abs(along), 1.5)

    def test_a_lens_that_comes_out_as_another_is_not_believed(self):
        held = turned_cameras()
        free = with_lens(held, 0, [1.3 * scenes.FOCAL, 1.3 * scenes.FOCAL, *(MIDDLE + (6, -4)), 0, 0, 0, 0])
        np.testing.assert_array_equal(principal_point.likely(held, free), [MIDDLE])


if __name__ == '__main__':
    unittest.main()
