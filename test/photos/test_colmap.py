#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The real COLMAP on rendered photos: its options and files are those that photos/colmap.py counts on. Skipped where it is
not installed."""
import os
import shutil
import sys
import tempfile
import unittest

import cv2
import numpy as np

import scenes
from photos import colmap, colmap_database
from photos.geometry import angle_deg, similarity

SKIPPED = 77


class Real(unittest.TestCase):
    def test_poses_of_rendered_photos(self):
        poses = [scenes.around(azimuth, 40) for azimuth in range(0, 120, 10)]
        camera = scenes.Camera(480, 360, np.array([500.0, 500, 240, 180, 0, 0, 0, 0]))
        with tempfile.TemporaryDirectory() as top:
            photos = os.path.join(top, 'photos')
            os.makedirs(os.path.join(photos, 'camera_0'))
            painted = [(corners, scenes.detailed(paint, i)) for i, (corners, paint) in enumerate(scenes.quads())]
            for i, pose in enumerate(poses):
                cv2.imwrite(os.path.join(photos, 'camera_0', f'view_{i:04d}.jpg'), scenes.render(pose, camera, painted))
            program = colmap.Colmap(os.path.join(top, 'log.txt'), 600)
            database, parts = os.path.join(top, 'database.db'), os.path.join(top, 'parts')
            colmap.find_features(program, database, photos, [{'width': 480, 'height': 360, 'focal_px': 480}])
            self.assertGreater(min(colmap_database.feature_counts(database).values()), 100)
            colmap.match(program, database, False)
            self.assertGreaterEqual(min(colmap_database.partner_counts(database).values()), 2)
            colmap.map_photos(program, database, parts, (photos, None))
            found, _ = colmap.largest_part(parts)
        self.assertGreaterEqual(len(found.names), 11)
        kept = [int(name[-8:-4]) for name in found.names]
        R, t = np.array([poses[i][0] for i in kept]), np.array([poses[i][1] for i in kept])
        scale, turn, shift = similarity(found.centres(), -np.einsum('nji,nj->ni', R, t))
        moved = found.moved(scale, turn, shift)
        self.assertLess(np.median(angle_deg(moved.R @ R.transpose(0, 2, 1))), 0.5)
        self.assertLess(np.median(found.errors()), 1)
        self.assertEqual(len(found.cameras), 1)


if __name__ == '__main__':
    if not shutil.which(colmap.PROGRAM):
        print('skipped: COLMAP is not installed')
        sys.exit(SKIPPED)
    unittest.main()
