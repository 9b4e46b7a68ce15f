#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs the command-line tools as a user does: photos to a model, pictures, a refined pose.

    test_tools.py FOLDER_FOR_FILES TRAIN RENDER REFINE [unittest arguments]
"""
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import time
import unittest

FOLDER, TRAIN, RENDER, REFINE = sys.argv[1:5]
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PHOTOS = os.path.join(TOP, 'demo', 'data', 'toy_kiosk')
TEST_VIEWS = os.path.join(PHOTOS, 'transforms_test.json')
STEPS = 60  # of training: enough to find a pose again, in seconds


def run(*arguments):
    return subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=300)


def path(name):
    return os.path.join(FOLDER, name)


def png_header(file_name):
    """Width, height, bit depth, colour type (0: grey, 2: RGB, 6: RGBA)."""
    with open(file_name, 'rb') as file:
        return struct.unpack('>IIBB', file.read(26)[16:26])


class CommandLine(unittest.TestCase):
    def test_help_explains_with_an_example(self):
        for tool in (TRAIN, RENDER, REFINE):
            result = run(tool, '--help')
            self.assertEqual(result.returncode, 0)
            self.assertIn('Example', result.stdout)
            self.assertIn('Exit code', result.stdout)

    def check_usage_error(self, *arguments):
        result = run(*arguments)
        self.assertEqual(result.returncode, 2, result)
        self.assertEqual(result.stdout, '')
        self.assertIn('--help', result.stderr)

    def test_wrong_usage(self):
        self.check_usage_error(TRAIN)
        self.check_usage_error(TRAIN, PHOTOS, '-o', path('x.safetensors'), '--profile', 'huge')
        self.check_usage_error(TRAIN, PHOTOS, '-o', path('x.safetensors'), '--steps', '-5')
        self.check_usage_error(RENDER, path('no_such_model'))
        self.check_usage_error(REFINE, '--unknown-option')

    def test_what_is_no_dataset(self):
        empty = path('empty')
        os.makedirs(empty, exist_ok=True)
        result = run(TRAIN, empty, '-o', path('x.safetensors'))
        self.assertEqual(result.returncode, 1, result)
        self.assertIn(empty, result.stderr)
        self.assertFalse(os.path.exists(path('x.safetensors')))

    def test_a_folder_that_does_not_exist_is_seen_before_training(self):
        result = run(TRAIN, PHOTOS, '-o', path('missing/x.safetensors'))
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('missing', result.stderr)

    def test_interrupt(self):
        model = path('interrupted.safetensors')
        process = subprocess.Popen([TRAIN, PHOTOS, '-o', model], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, universal_newlines=True)
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 1, error)
        self.assertIn('stopped', error)
        self.assertFalse(os.path.exists(model))


class WholePath(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = path('kiosk.safetensors')
        result = run(TRAIN, PHOTOS, '-o', cls.model, '--steps', str(STEPS), '--json')
        assert result.returncode == 0, result.stderr
        cls.trained = json.loads(result.stdout)

    def test_train_reports(self):
        self.assertEqual(self.trained['steps'], STEPS)
        self.assertEqual(self.trained['name'], 'kiosk')
        self.assertEqual(self.trained['metres_per_unit'], 1)  # as the dataset says
        self.assertGreater(self.trained['psnr_db'], 20)
        self.assertAlmostEqual(self.trained['diameter'], 0.205, delta=0.03)

    def test_render_views(self):
        out = path('views')
        shutil.rmtree(out, ignore_errors=True)
        os.makedirs(out)
        result = run(RENDER, self.model, '--transforms', TEST_VIEWS, '--max-size', '80', '--psnr',
                     '--depth', '-o', out, '--json')
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads(result.stdout)
        self.assertEqual(len(report['views']), 8)
        mean = sum(view['psnr_db'] for view in report['views']) / 8
        self.assertAlmostEqual(report['mean_psnr_db'], mean, places=6)
        self.assertGreater(mean, 20)
        self.assertEqual(png_header(os.path.join(out, 'view_003.png')), (80, 80, 8, 6))
        self.assertEqual(png_header(os.path.join(out, 'view_003_depth.png')), (80, 80, 16, 0))

    def test_render_a_pose_on_a_background(self):
        picture = path('picture.png')
        result = run(RENDER, self.model, '--pose', '0', '0', '0.6', '1', '0', '0', '0',
                     '--intrinsics', '100', '100', '31.5', '23.5', '--size', '64', '48',
                     '--background', '1', '1', '1', '-o', picture)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(png_header(picture), (64, 48, 8, 2))

    def test_refine_a_view(self):
        result = run(REFINE, self.model, '--transforms', TEST_VIEWS, '--view', 'view_003', '--json')
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads(result.stdout)
        self.assertEqual(report['outcome'], 'refined')
        self.assertEqual(len(report['pose']), 7)
        self.assertLess(report['error']['rotation_deg'], 3)
        self.assertLess(report['error']['diameters'], 0.05)
        self.assertGreater(report['error_at_start']['rotation_deg'], 3)

    def test_refine_an_image_from_a_pose(self):
        view = run(REFINE, self.model, '--transforms', TEST_VIEWS, '--view', 'view_003',
                   '--start-rotation', '0', '--start-translation', '0', '--preset', 'track',
                   '--json')
        truth = json.loads(view.stdout)
        with open(TEST_VIEWS, encoding='utf-8') as file:
            camera = json.load(file)
        intrinsics = [camera['fl_x'], camera['fl_y'], camera['cx'] - 0.5, camera['cy'] - 0.5]
        result = run(REFINE, self.model, os.path.join(PHOTOS, 'test', 'view_003.png'),
                     '--intrinsics', *map(str, intrinsics),
                     '--pose', *map(str, truth['pose']), '--preset', 'track', '--json')
        self.assertEqual(result.returncode, 0, result.stderr)
        for found, expected in zip(json.loads(result.stdout)['pose'], truth['pose']):
            self.assertAlmostEqual(found, expected, delta=0.05)

    def test_a_start_outside_of_the_image_is_a_failure(self):
        result = run(REFINE, self.model, os.path.join(PHOTOS, 'test', 'view_003.png'),
                     '--intrinsics', '640', '640', '159.5', '159.5',
                     '--pose', '5', '0', '0.6', '1', '0', '0', '0', '--json')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('no overlap', json.loads(result.stdout)['outcome'])

    def test_a_truncated_model_is_refused(self):
        cut = path('cut.safetensors')
        with open(self.model, 'rb') as whole, open(cut, 'wb') as file:
            file.write(whole.read()[:10000])
        result = run(RENDER, cut, '--transforms', TEST_VIEWS, '--psnr')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('cut.safetensors', result.stderr)


if __name__ == '__main__':
    os.makedirs(FOLDER, exist_ok=True)
    unittest.main(argv=sys.argv[:1] + sys.argv[5:])
