#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of photos/pairs.py: which photos are compared."""
import unittest

import numpy as np

import scenes  # noqa: F401 (the path)
from photos import pairs


class Pairs(unittest.TestCase):
    def test_photos_of_the_same_are_paired(self):
        random = np.random.default_rng(1)
        shared = [random.integers(0, 255, (60, 128)).astype(np.uint8) for _ in range(2)]
        keypoints = random.uniform(1, 9, (60, 6)).astype(np.float32)
        features = [(keypoints, shared[i % 2]) for i in range(6)]
        table = pairs.scores(features)
        self.assertEqual(table[0].tolist()[1:], [0, 60, 0, 60, 0])
        self.assertEqual(pairs.likely_pairs(table), [(0, 2), (0, 4), (1, 3), (1, 5), (2, 4), (3, 5)])

    def test_no_more_than_the_best_partners(self):
        table = np.full((40, 40), 5)
        np.fill_diagonal(table, 0)
        chosen = pairs.likely_pairs(table)
        self.assertTrue(40 * pairs.PARTNERS / 2 <= len(chosen) <= 40 * pairs.PARTNERS)

    def test_photos_without_features(self):
        nothing = np.zeros((0, 6), np.float32), np.zeros((0, 128), np.uint8)
        self.assertEqual(pairs.scores([nothing, nothing]).tolist(), [[0, 0], [0, 0]])


if __name__ == '__main__':
    unittest.main()
