#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs the tool detect as a user does: a model and an image to the poses of the object in it.

    test_detect.py FOLDER_FOR_FILES TRAIN RENDER DETECT [unittest arguments]
"""
import json
import math
import os
import shutil
import subprocess
import sys
import unittest

FOLDER, TRAIN, RENDER, DETECT = sys.argv[1:5]
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'test', 'support'))
from kiosk_model import put_kiosk_model  # noqa: E402

POSE = (0.03, -0.02, 0.6, 0.63, 0.58, -0.36, 0.37)  # x y z qx qy qz qw
INTRINSICS = ('--intrinsics', '500', '500', '159.5', '119.5')


def run(*arguments):
    return subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=600)


def path(name):
    return os.path.join(FOLDER, name)


def angle_between(a, b):
    """Of two unit quaternions [rad]."""
    return 2 * math.acos(min(1, abs(sum(x * y for x, y in zip(a, b)))))


class Detect(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model, cls.image = path('kiosk.safetensors'), path('image.png')
        _, cls.landmarks_of_photos = put_kiosk_model(TRAIN, FOLDER, cls.model)
        length = math.sqrt(sum(number * number for number in POSE[3:]))
        cls.pose = POSE[:3] + tuple(number / length for number in POSE[3:])
        result = run(RENDER, cls.model, '--pose', *map(str, cls.pose), *INTRINSICS, '--size', '320', '240',
                     '--background', '0.4', '0.5', '0.3', '-o', cls.image)
        assert result.returncode == 0, result.stderr

    def detect(self, *arguments):
        result = run(DETECT, self.model, self.image, *INTRINSICS, '--json', *arguments)
        return result, json.loads(result.stdout)

    def test_finds_the_object_and_draws_it(self):
        overlay = path('overlay.png')
        result, report = self.detect('--overlay', overlay)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(report['unit'], 'm')
        self.assertEqual(len(report['detections']), 1)
        found = report['detections'][0]
        for number, expected in zip(found['pose'][:3], self.pose[:3]):
            self.assertAlmostEqual(number, expected, delta=0.005)
        self.assertLess(angle_between(found['pose'][3:], self.pose[3:]), math.radians(2))
        self.assertGreaterEqual(found['score'], 0.9)
        self.assertTrue(os.path.exists(overlay))

    def test_keeps_the_landmarks_beside_the_model(self):
        self.detect()
        landmarks = path('kiosk.landmarks')
        made = os.stat(landmarks).st_mtime_ns
        self.detect()
        self.assertEqual(os.stat(landmarks).st_mtime_ns, made)

    def test_landmarks_of_photos_are_made_by_train(self):
        model, landmarks = path('own.safetensors'), path('own.landmarks')
        shutil.copy(self.model, model)
        shutil.copy(self.landmarks_of_photos, landmarks)
        with open(landmarks, 'rb') as file:
            made = file.read()
        self.assertGreater(len(made), 100000)
        run(DETECT, model, self.image, *INTRINSICS)
        with open(landmarks, 'rb') as file:
            self.assertEqual(file.read(), made)  # of renderings alone there would be fewer

    def test_looks_where_it_is_told(self):
        for arguments in (('--box', '0', '0', '40', '40'), ('--distance', '3')):
            with self.subTest(arguments=arguments):
                result, report = self.detect(*arguments)
                self.assertEqual(result.returncode, 1)
                self.assertEqual(report['detections'], [])
                self.assertIn('not found', result.stderr)
        self.assertEqual(self.detect('--distance', '0.6')[0].returncode, 0)

    def test_depth_takes_part(self):
        result = run(RENDER, self.model, '--pose', *map(str, self.pose), *INTRINSICS, '--size', '320', '240',
                     '--background', '0', '0', '0', '--depth', '-o', path('deep.png'))
        self.assertEqual(result.returncode, 0, result.stderr)
        depth = path('deep_depth.png')
        for unit, use in (('0.001', 'used'), ('0.01', 'refused')):
            report = self.detect('--depth', depth, '--depth-unit', unit)[1]
            self.assertEqual([found['depth']['use'] for found in report['detections']], [use], report)
        result = run(DETECT, self.model, self.image, *INTRINSICS, '--depth', self.image)
        self.assertEqual(result.returncode, 1)
        self.assertIn("image.png': it is not a PNG of 16-bit grey", result.stderr)

    def test_a_box_outside_of_the_image_is_explained(self):
        result, report = self.detect('--box', '1000', '1000', '1100', '1100')
        self.assertEqual(result.returncode, 1)
        self.assertIn('too little of the image', report['message'])

    def test_wrong_usage(self):
        for arguments in (('--max-instances', '0'), ('--distance', '-1'), ('--unknown',)):
            result = run(DETECT, self.model, self.image, *INTRINSICS, *arguments)
            self.assertEqual(result.returncode, 2, result)
            self.assertEqual(result.stdout, '')
        self.assertEqual(run(DETECT, self.model, self.image).returncode, 2)  # without a camera

    def test_help_explains_with_an_example(self):
        result = run(DETECT, '--help')
        self.assertEqual(result.returncode, 0)
        self.assertIn('Example', result.stdout)
        self.assertIn('Exit code', result.stdout)


if __name__ == '__main__':
    os.makedirs(FOLDER, exist_ok=True)
    unittest.main(argv=sys.argv[:1] + sys.argv[5:])
