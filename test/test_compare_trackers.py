#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Counts the poses of a tracker that was made by hand: its errors, its resets and a symmetry that comes and goes."""
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest

import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
import recorded_trial  # noqa: E402

# Drifts by 0.03 m to the right at every image, from where it was set last, and takes 2 ms. Says what it is asked.
DRIFTING = r'''
import sys
log = open(sys.argv[1], "w")
for line in sys.stdin:
    verb, *words = line.split()
    print(verb, *words[:1] if verb == "track" else [], file=log, flush=True)
    if verb == "reset":
        pose = [float(word) for word in words]
        print("ok", flush=True)
    else:
        pose[3] += 0.03
        print("pose", *pose, 0.002, flush=True)
'''


def turned_z(degrees):
    T = np.eye(4)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    T[:2, :2] = [[c, -s], [s, c]]
    return T


def turned_x(degrees):
    T = turned_z(degrees)
    order = [1, 2, 0, 3]
    return T[np.ix_(np.argsort(order), np.argsort(order))]


class Trials(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.log = os.path.join(self.folder.name, 'log')
        self.program = os.path.join(self.folder.name, 'drifting.py')
        with open(self.program, 'w', encoding='utf-8') as file:
            file.write(DRIFTING)

    def tearDown(self):
        self.folder.cleanup()

    def recording(self, labels=(True,) * 6):
        """An object of 1 m that stands still at 2 m."""
        pose = np.eye(4)
        pose[2, 3] = 2
        frames = [{'file': 'frames/frame_%03d.jpg' % i, 'T_C_O': pose.tolist(), 'label_visible': label}
                  for i, label in enumerate(labels)]
        about = {'width': 640, 'height': 480, 'fx': 650, 'fy': 650, 'cx': 319.5, 'cy': 239.5, 'diameter': 1.0,
                 'centre_O': [0, 0, 0.1], 'frames': frames}
        with open(os.path.join(self.folder.name, 'sequence.json'), 'w', encoding='utf-8') as file:
            json.dump(about, file)
        return recorded_trial.Recording(self.folder.name)

    def rows(self, **options):
        recording = self.recording()
        with recorded_trial.Tracker([sys.executable, self.program, self.log]) as tracker:
            return recorded_trial.run(recording, tracker, **options)

    def asked(self):
        with open(self.log, encoding='utf-8') as file:
            return [line.split()[0] for line in file]

    def test_a_wrong_pose_is_followed_by_the_truth(self):
        # 3 cm, right; 6 cm, wrong and reset; 3; 6; 3
        rows = self.rows()
        self.assertEqual([row['right'] for row in rows], [True, False, True, False, True])
        self.assertEqual([row['index'] for row in rows], [1, 2, 3, 4, 5])
        np.testing.assert_allclose([row['diameters'] for row in rows], [0.03, 0.06, 0.03, 0.06, 0.03])
        self.assertEqual(self.asked(), ['reset', 'track', 'reset'] + ['track', 'track', 'reset'] * 2 + ['track'])

    def test_without_resets_it_stays_wrong(self):
        self.assertEqual([row['right'] for row in self.rows(resets=False)], [True] + [False] * 4)

    def test_frames_can_be_left_out(self):
        self.assertEqual([row['index'] for row in self.rows(every=2)], [2, 4])

    def test_the_summary(self):
        found = recorded_trial.summary(self.rows())
        self.assertAlmostEqual(found['right'], 0.6)
        self.assertAlmostEqual(found['diameters'], 0.03)
        self.assertAlmostEqual(found['median_ms'], 2)

    def test_turns_are_free_while_the_label_is_hidden(self):
        recording = self.recording(labels=(True, False))
        truth = recording.truth[0]
        self.assertAlmostEqual(recording.errors(0, truth @ turned_z(40))[0], 40, places=6)
        self.assertAlmostEqual(recording.errors(1, truth @ turned_z(40))[0], 0, places=6)
        self.assertAlmostEqual(recording.errors(1, truth @ turned_x(7) @ turned_z(40))[0], 7, places=6)
        self.assertAlmostEqual(recording.errors(1, truth @ turned_z(40))[1], 0, places=9)  # the centre is on the axis

    def test_the_offset_is_the_centres(self):
        recording = self.recording()  # 10 cm above the origin: a turn by 90 degrees moves it by 14.1 cm
        self.assertAlmostEqual(recording.errors(0, recording.truth[0] @ turned_x(90))[1], 0.1 * math.sqrt(2), places=9)

    def test_the_script_prints_a_row_a_recording(self):
        self.recording()
        command = '%s %s %s' % (sys.executable, self.program, self.log)
        result = subprocess.run([sys.executable, os.path.join(TOP, 'scripts', 'compare_trackers'), '--tracker', command,
                                 self.folder.name], stdout=subprocess.PIPE, universal_newlines=True, timeout=60)
        self.assertEqual(result.returncode, 0)
        self.assertRegex(result.stdout.splitlines()[-1], r'\| 5 \| 0\.600 \| 0\.00 \| 3\.00 \| 2\.0 \| 2\.0 \|')


if __name__ == '__main__':
    unittest.main()
