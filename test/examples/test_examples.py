#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs the programs of examples/ as docs/cpp.md shows them: learns the demo's object with few steps, finds it in the
first frame of the demo's video, and tracks it through some more.

Usage: test_examples.py FOLDER_OF_PROGRAMS WORK_FOLDER
"""
import json
import os
import re
import subprocess
import sys
import unittest

import cv2
import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAMS = sys.argv[1]
WORK = sys.argv[2]
STEPS = 300  # enough to be found in every frame
FRAMES = 6
CAMERA = ['500', '500', '239.5', '179.5']
MAX_OFFSET_M = 0.006  # 3 % of the object's diameter: the model is a rough one


def run(name, *arguments):
    return subprocess.run([os.path.join(PROGRAMS, name), *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=600, check=False)


def pose_of_docs():
    """The initial pose that docs/cpp.md gives for the demo's video."""
    with open(os.path.join(TOP, 'docs', 'cpp.md'), encoding='utf-8') as file:
        text = file.read()
    return re.search(r'track_video .*?\\\n\s+((?:-?[\d.]+\s+){7})', text).group(1).split()


def true_positions():
    with open(os.path.join(TOP, 'demo', 'data', 'toy_kiosk_sequence', 'sequence.json'), encoding='utf-8') as file:
        return [np.array(frame['T_C_O'])[:3, 3] for frame in json.load(file)['frames']]


class Form(unittest.TestCase):
    def test_examples_are_short_and_use_the_public_headers_alone(self):
        folder = os.path.join(TOP, 'examples')
        sources = [name for name in os.listdir(folder) if name.endswith('.cpp')]
        self.assertEqual(sorted(sources), ['refine_image.cpp', 'register_object.cpp', 'track_video.cpp'])
        for name in sources:
            with open(os.path.join(folder, name), encoding='utf-8') as file:
                lines = file.read().splitlines()
            self.assertLessEqual(len(lines), 100, name)
            for line in lines:
                include = re.match(r'#include [<"](.*)[>"]', line)
                if include and '/' in include.group(1):
                    self.assertRegex(include.group(1), r'^(nerf_pose_refiner/\w+\.h|Eigen/\w+|opencv2/\w+\.hpp)$', name)


class Examples(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        os.makedirs(WORK, exist_ok=True)
        cls.model = os.path.join(WORK, 'kiosk.safetensors')
        cls.registered = run('register_object', os.path.join(TOP, 'demo', 'data', 'toy_kiosk'), cls.model, str(STEPS))
        video = cv2.VideoCapture(os.path.join(TOP, 'demo', 'toy_kiosk.mp4'))
        cls.frames = [video.read()[1] for _ in range(FRAMES)]

    def assert_near(self, position, truth):
        self.assertLess(np.linalg.norm(np.array(position, float) - truth), MAX_OFFSET_M, position)

    def test_register_object(self):
        self.assertEqual(self.registered.returncode, 0, self.registered.stderr)
        self.assertRegex(self.registered.stdout, r'kiosk.safetensors: diameter 0.2\d+ m, PSNR \d+')

    def test_refine_image(self):
        image, overlay = os.path.join(WORK, 'frame.png'), os.path.join(WORK, 'overlay.png')
        cv2.imwrite(image, self.frames[0])
        result = run('refine_image', self.model, image, overlay, *CAMERA, *pose_of_docs())
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_near(re.search(r'position (\S+) (\S+) (\S+),', result.stdout).groups(), true_positions()[0])
        drawn = cv2.imread(overlay)
        self.assertEqual(drawn.shape, self.frames[0].shape)
        self.assertGreater(np.count_nonzero(drawn != self.frames[0]), 1000)

    def write_video(self):
        video = os.path.join(WORK, 'short.avi')
        size = self.frames[0].shape[1::-1]
        writer = cv2.VideoWriter(video, cv2.VideoWriter_fourcc(*'MJPG'), 10, size)
        for frame in self.frames:
            writer.write(frame)
        writer.release()
        return video

    def test_an_output_that_cannot_be_written_is_said(self):
        image, nowhere = os.path.join(WORK, 'first.png'), os.path.join(WORK, 'nowhere')
        cv2.imwrite(image, self.frames[0])
        pose = [*CAMERA, *pose_of_docs()]
        for call in (['refine_image', self.model, image, nowhere + '/overlay.png', *pose],
                     ['track_video', self.model, self.write_video(), *pose, nowhere + '/tracked.avi']):
            result = run(*call)
            self.assertEqual(result.returncode, 1, call[0])
            self.assertIn(nowhere, result.stderr)

    def test_track_video(self):
        video, output = self.write_video(), os.path.join(WORK, 'tracked.avi')
        result = run('track_video', self.model, video, *CAMERA, *pose_of_docs(), output)
        self.assertEqual(result.returncode, 0, result.stderr)
        lines = re.findall(r'^ *(\d+) tracking: (\S+) (\S+) (\S+), score', result.stdout, re.MULTILINE)
        self.assertEqual([int(line[0]) for line in lines], list(range(FRAMES)), result.stdout)
        for line, truth in zip(lines, true_positions()):
            self.assert_near(line[1:], truth)
        self.assertEqual(int(cv2.VideoCapture(output).get(cv2.CAP_PROP_FRAME_COUNT)), FRAMES)

    def test_what_is_wrong_is_said(self):
        for program, arguments in (('register_object', ['nowhere', os.path.join(WORK, 'none.safetensors')]),
                                   ('refine_image', ['nowhere', 'frame.png', 'out.png'] + ['1'] * 11),
                                   ('track_video', ['nowhere', 'video.avi'] + ['1'] * 11 + ['out.avi'])):
            result = run(program, *arguments)
            self.assertEqual(result.returncode, 1, program)
            self.assertTrue(result.stderr.strip(), program)
            self.assertEqual(run(program).returncode, 2, program)
        words = run('refine_image', 'nowhere', 'frame.png', 'out.png', *['1'] * 10, 'x')
        self.assertIn("'x' is not a number", words.stderr)
        no_turn = run('refine_image', 'nowhere', 'frame.png', 'out.png', *['1'] * 7, *['0'] * 4)
        self.assertIn('the quaternion has no length', no_turn.stderr)


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1])
