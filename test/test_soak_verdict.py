#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks what scripts/soak concludes from its measurements."""
import os
import sys
import unittest

import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
import soak_verdict  # noqa: E402 (after the path)

COUNTS = {'arrived images': 1000, 'images lost before': 2, 'images with camera_info': 1000, 'refused images': 0,
          'skipped images': 300, 'refined images': 690, 'dropped images': 10, 'published': 1002}
SCATTER = [8, -9, 3, 0, -4, 9, -6, 5, -1, -7, 4, 2]  # MiB, without a trend


def cycles(**series):
    """Twelve cycles in which nothing grows, but for the series that are given."""
    steady = {'memory [MiB]': 270 + np.array(SCATTER), 'allocated [MiB]': 12 * [76], 'descriptors': 12 * [60],
              'threads': 12 * [51], 'wrong': 12 * [0], 'registered': range(1, 13)}
    return [dict(zip(steady, values)) for values in zip(*{**steady, **series}.values())]


class Verdict(unittest.TestCase):
    def test_a_steady_run_passes(self):
        self.assertEqual(soak_verdict.verdict(cycles(), COUNTS), [])

    def test_allocated_memory_that_grows_a_little_is_seen(self):
        # A mebibyte a cycle: from the median of cycles 3 to 5 to that of 9 to 11 it is six.
        self.assertEqual(soak_verdict.verdict(cycles(**{'allocated [MiB]': range(76, 88)}), COUNTS),
                         ['allocated [MiB] has grown by 6.0'])

    def test_resident_memory_must_rise_beyond_its_scatter(self):
        rising = 270 + np.array(SCATTER) + 4 * np.arange(12)
        self.assertEqual(len(soak_verdict.verdict(cycles(**{'memory [MiB]': rising}), COUNTS)), 1)
        # One step to more, in the middle of scatter, is no trend.
        self.assertFalse(soak_verdict.rises([277, 261, 276, 291, 295, 287, 286, 293]))
        self.assertTrue(soak_verdict.rises([261, 266, 276, 281, 287, 286, 293, 295]))
        self.assertFalse(soak_verdict.rises([295, 293, 286, 287, 281, 276, 266, 261]))

    def test_what_else_grows_or_is_wrong(self):
        for series, problem in (({'threads': [51] * 8 + [52] * 4}, 'threads have grown from 51 to 52'),
                                ({'descriptors': range(60, 72)}, 'descriptors have grown from 63 to 69'),
                                ({'wrong': [0, 2] + 10 * [0]}, '2 wrong poses'),
                                ({'registered': 12 * [0]}, 'no object could be registered beside tracking')):
            self.assertEqual(soak_verdict.verdict(cycles(**series), COUNTS), [problem])
        self.assertIn('too short', soak_verdict.verdict(cycles()[:3], COUNTS)[0])

    def test_each_image_is_accounted_for(self):
        for change, problem in (({'published': 1003}, '1003'), ({'refined images': 689}, '999 images'),
                                ({'images with camera_info': 900, 'skipped images': 200}, '900 with camera_info')):
            found = soak_verdict.verdict(cycles(), {**COUNTS, **change})
            self.assertEqual(len(found), 1, found)
            self.assertIn(problem, found[0])


if __name__ == '__main__':
    unittest.main()
