#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of photos/pose_checks.py: models that are right raise no alarm, and what was spoiled is found and named."""
import dataclasses
import unittest

import numpy as np

import scenes
from photos import pose_checks
from photos.geometry import angle_deg


class GoodModels(unittest.TestCase):
    def test_no_false_alarm(self):
        kinds = {'two rounds': scenes.rounds(14), 'one round': scenes.rounds(30, (30,)),
                 'half a round': [scenes.around(a, e) for e in (20, 45) for a in range(0, 180, 12)],
                 'near and far': [scenes.around(a, 30, d) for d in (0.6, 1.1) for a in range(0, 360, 24)],
                 'few photos': scenes.rounds(5)}
        for name, poses in kinds.items():
            for seed in range(3):
                findings = pose_checks.check(scenes.reconstruction(poses, seed=seed), is_sequence=name == 'one round')
                self.assertTrue(findings.is_good(), f'{name}, {seed}: {findings}')


class WrongPoses(unittest.TestCase):
    def spoiled(self, photos=(3, 11, 20), degrees=8):
        model = scenes.reconstruction(scenes.rounds(14))
        true = model.R.copy()
        for photo in photos:
            R, t = scenes.turned(model, photo, degrees)
            model = dataclasses.replace(model, R=R, t=t)
        return model, true

    def test_a_tenth_of_the_photos_is_named(self):
        model, _ = self.spoiled()
        findings = pose_checks.check(model)
        self.assertEqual(sorted(findings.wrong), [3, 11, 20])
        self.assertIn('px beside', findings.wrong[3])

    def test_they_are_solved_again(self):
        model, true = self.spoiled()
        fixed, solved, left_out = pose_checks.repaired(model, pose_checks.check(model).wrong)
        self.assertEqual((sorted(solved), left_out), ([3, 11, 20], []))
        self.assertLess(angle_deg(fixed.R @ true.transpose(0, 2, 1)).max(), 0.2)
        self.assertTrue(pose_checks.check(fixed).is_good())

    def test_a_photo_of_something_else_is_left_out(self):
        model = scenes.reconstruction(scenes.rounds(14))
        of_it = model.photo_of == 5
        xy = model.xy.copy()
        xy[of_it] = np.random.default_rng(1).uniform((0, 0), (scenes.WIDTH, scenes.HEIGHT), (of_it.sum(), 2))
        model = dataclasses.replace(model, xy=xy)
        findings = pose_checks.check(model)
        self.assertEqual(list(findings.wrong), [5])
        fixed, solved, left_out = pose_checks.repaired(model, findings.wrong)
        self.assertEqual((solved, left_out), ([], [5]))
        self.assertNotIn(model.names[5], fixed.names)

    def test_too_few_observations(self):
        model = scenes.reconstruction(scenes.rounds(14))
        of_it = np.flatnonzero(model.photo_of == 2)
        kept = np.ones(len(model.xy), bool)
        kept[of_it[10:]] = False
        model = dataclasses.replace(model, photo_of=model.photo_of[kept], point_of=model.point_of[kept], xy=model.xy[kept])
        self.assertEqual(pose_checks.check(model).wrong, {2: 'only 10 points of the others seen'})

    def test_a_jump_in_a_video(self):
        model = scenes.reconstruction(scenes.rounds(30, (30,)))
        t = model.t.copy()
        t[12] -= model.R[12] @ np.array([0.0, 0, 2])  # its centre is 2 higher; neighbours are 0.15 apart
        self.assertEqual(list(pose_checks.jumps(dataclasses.replace(model, t=t))), [12])
        self.assertEqual(pose_checks.jumps(model), {})


class FocalLengths(unittest.TestCase):
    def test_one_for_each_photo(self):
        random = np.random.default_rng(1)
        poses = scenes.rounds(10)
        cameras = [scenes.camera(scenes.FOCAL * (1 + 0.1 * random.uniform(-1, 1))) for _ in poses]
        findings = pose_checks.check(scenes.reconstruction(poses, cameras=cameras))
        self.assertGreater(findings.focal_spread, 0.1)
        self.assertFalse(findings.is_good())

    def test_the_spread_is_of_photos_of_one_size(self):
        model = scenes.reconstruction(scenes.rounds(5), cameras=[scenes.camera(100), scenes.camera(110)] * 5)
        self.assertAlmostEqual(pose_checks.focal_spread(model), 10 / 105)
        model.cameras[1::2] = [dataclasses.replace(camera, width=100) for camera in model.cameras[1::2]]
        self.assertEqual(pose_checks.focal_spread(model), 0)


class Folds(unittest.TestCase):
    def test_both_sides_are_found(self):
        for shared in (0.0, 0.15):
            model, n = scenes.folded(shared=shared)
            groups = pose_checks.check(model).groups
            self.assertEqual([sorted(group) for group in sorted(groups)], [list(range(n)), list(range(n, 2 * n))], shared)

    def test_sides_that_differ_in_one_place_are_found(self):
        """A carton on a plain table: front and back share their points, the sides beside them are others."""
        model, n = scenes.folded(shared=lambda points: np.abs(points[:, 1]) < scenes.BOX[1] / 2 - 1e-6)
        model = model.of_points(model.xyz[:, 2] > 1e-6)
        findings = pose_checks.check(model)
        self.assertFalse(findings.is_good())
        self.assertTrue(findings.contradictions)
        for i, j in findings.contradictions:
            self.assertTrue(i < n <= j, (i, j))  # one of each side
        said = list(pose_checks.sentences(findings, model.names))
        self.assertRegex(said[-1], r"^it is folded: \d+\.jpg and \d+\.jpg show different things in the same place$")

    def test_a_good_model_has_no_contradictions(self):
        for poses in (scenes.rounds(14), scenes.rounds(22, (12, 24))):
            model = scenes.reconstruction(poses)
            for some in (model, model.of_points(model.xyz[:, 2] > 1e-6)):
                self.assertTrue(pose_checks.check(some).is_good())

    def test_components(self):
        self.assertEqual(pose_checks.components(6, [(0, 1), (1, 2), (4, 5)]), [[0, 1, 2], [4, 5], [3]])


if __name__ == '__main__':
    unittest.main()
