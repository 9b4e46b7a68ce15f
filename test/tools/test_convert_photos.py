#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs convert_photos as a user does.

    test_convert_photos.py FOLDER_FOR_FILES CONVERT_PHOTOS [unittest arguments]
"""
import json
import os
import shutil
import subprocess
import sys
import unittest

FOLDER, CONVERT = sys.argv[1:3]
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PHOTOS = os.path.join(TOP, 'demo', 'data', 'toy_kiosk')
TEST_VIEWS = os.path.join(PHOTOS, 'transforms_test.json')


def convert(*arguments):
    return subprocess.run((CONVERT, *arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=300)


def scene(folder):
    with open(os.path.join(folder, 'transforms.json'), encoding='utf-8') as file:
        return json.load(file)


class Convert(unittest.TestCase):
    def setUp(self):
        shutil.rmtree(FOLDER, ignore_errors=True)
        os.makedirs(FOLDER)

    def path(self, name):
        return os.path.join(FOLDER, name)

    def test_what_was_written_converts_to_the_same(self):
        first, second = self.path('first'), self.path('second')
        result = convert(TEST_VIEWS, '-o', first, '--box', '-1', '-2', '-3', '1', '2', '3', '--metres-per-unit', '0.5')
        self.assertEqual(result.returncode, 0, result)
        self.assertIn(first, result.stdout)
        written = scene(first)
        self.assertEqual(written['metres_per_unit'], 0.5)
        self.assertEqual(written['aabb'], [[-1, -2, -3], [1, 2, 3]])
        with open(TEST_VIEWS, encoding='utf-8') as file:
            original = json.load(file)
        self.assertEqual(len(written['frames']), len(original['frames']))
        for frame, from_frame in zip(written['frames'], original['frames']):
            for row, from_row in zip(frame['transform_matrix'], from_frame['transform_matrix']):
                for value, from_value in zip(row, from_row):
                    self.assertAlmostEqual(value, from_value, places=5)
        self.assertEqual(convert(first, '-o', second).returncode, 0)
        self.assertEqual(sorted(os.listdir(first)), sorted(os.listdir(second)))
        for name in os.listdir(first):
            if name.endswith('.png'):
                with open(os.path.join(first, name), 'rb') as a, open(os.path.join(second, name), 'rb') as b:
                    self.assertEqual(a.read(), b.read(), name)

    def test_what_is_there_stays(self):
        os.makedirs(self.path('mug'))
        result = convert(TEST_VIEWS, '-o', self.path('mug'))
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('there already', result.stderr)
        self.assertEqual(os.listdir(FOLDER), ['mug'])

    def test_limits(self):
        for option, text in (('--max-photos', 'frames, at most 1'), ('--max-megapixels', '1000000 pixels together')):
            result = convert(PHOTOS, '-o', self.path('mug'), option, '1')
            self.assertEqual(result.returncode, 1, result)
            self.assertIn(text, result.stderr)
        self.assertEqual(convert(PHOTOS, '-o', self.path('mug'), '--max-photos', '0').returncode, 2)
        self.assertEqual(os.listdir(FOLDER), [])

    def test_help(self):
        result = convert('--help')
        self.assertEqual(result.returncode, 0)
        for word in ('Example', '--object-id', '--max-megabytes'):
            self.assertIn(word, result.stdout)


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
