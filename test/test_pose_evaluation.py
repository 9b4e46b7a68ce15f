#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks the demo's judge: errors worked out by hand, and verdicts that fail."""
import csv
import math
import os
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), 'scripts', 'lib'))
import pose_evaluation as evaluation  # noqa: E402

INTRINSICS = [100, 0, 50, 0, 100, 40, 0, 0, 1]
TARGET = evaluation.Target([[-0.1, -0.1, 0.0], [0.1, 0.1, 0.2]], diameter=0.5, intrinsics=INTRINSICS)


def pose(translation=(0, 0, 1.9), angle=0.0):
    """Turned about the camera's z axis; the object's centre is 0.1 in front of its frame."""
    T = np.eye(4)
    T[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    T[:3, 3] = translation
    return T


def row(deg=0.5, diameters=0.005):
    return {'frame': 0, 'stamp_s': '0.000', 'start_deg': 3.0, 'start_diameters': 0.1, 'start_px': 9.0,
            'deg': deg, 'diameters': diameters, 'px': 0.4, 'score': 0.9, 'latency_s': 0.6}


class Errors(unittest.TestCase):
    def test_no_error(self):
        self.assertEqual(TARGET.errors(pose(), pose()), (0, 0, 0))

    def test_moved_sideways(self):
        degrees, diameters, pixels = TARGET.errors(pose((0.01, 0, 1.9)), pose())
        self.assertAlmostEqual(degrees, 0)
        self.assertAlmostEqual(diameters, 0.01 / 0.5)
        # Half of the corners are at z = 1.9, the others at 2.1.
        self.assertAlmostEqual(pixels, (100 * 0.01 / 1.9 + 100 * 0.01 / 2.1) / 2)

    def test_turned_about_the_centre(self):
        for angle in (1e-4, math.radians(2), math.radians(120), math.radians(179)):
            degrees, diameters, pixels = TARGET.errors(pose(angle=angle), pose())
            self.assertAlmostEqual(degrees, math.degrees(angle), places=6)
            self.assertAlmostEqual(diameters, 0)  # the centre is on the axis
            self.assertGreater(pixels, 0)

    def test_behind_the_camera(self):
        self.assertEqual(TARGET.errors(pose((0, 0, -1)), pose())[2], math.inf)


class Verdict(unittest.TestCase):
    def test_all_good(self):
        self.assertTrue(evaluation.verdict([row()] * 20)[0])

    def test_too_few_frames(self):
        self.assertFalse(evaluation.verdict([row()] * 19)[0])
        self.assertFalse(evaluation.verdict([])[0])

    def test_share(self):
        bad = row(deg=2.1)
        self.assertTrue(evaluation.verdict([row()] * 18 + [bad] * 2)[0])
        self.assertFalse(evaluation.verdict([row()] * 17 + [bad] * 3)[0])

    def test_what_is_bad(self):
        self.assertTrue(evaluation.good(row(deg=2.0, diameters=0.02)))
        for bad in (row(deg=2.01), row(diameters=0.0201), row(deg=math.inf, diameters=math.inf),
                    row(deg=math.nan)):
            self.assertFalse(evaluation.good(bad))


class Output(unittest.TestCase):
    def test_table(self):
        lines = evaluation.table([row(), row(deg=2.5), row(deg=math.inf)]).split('\n')
        self.assertEqual(len(lines), 2 + 3 + 1)
        self.assertNotIn('!', lines[2])
        self.assertIn('!', lines[3])
        self.assertIn('2.50', lines[5])  # the median
        self.assertEqual(len({line.index('|') for line in lines[1:]}), 1)

    def test_csv(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'poses.csv')
            evaluation.write_csv([row(), row(deg=2.5)], path)
            with open(path, encoding='utf-8') as file:
                rows = list(csv.DictReader(file))
        self.assertEqual([float(r['deg']) for r in rows], [0.5, 2.5])


if __name__ == '__main__':
    unittest.main()
