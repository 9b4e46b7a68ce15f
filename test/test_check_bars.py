#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs check_bars with a program that stands in for bench/recorded_tracking, and judges figures made by hand."""
import os
import subprocess
import sys
import tempfile
import unittest

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
import bars  # noqa: E402

LINE = ('bottle_regular_1             right %s of 300, lost 3; trusted 0.980, wrong ones 0; median 0.120 deg 0.210 %%; '
        'error^2/6 1.02; wall median 6.20 p95 15.40 p99 17.10 ms; processor median 6.0 mean 7.9 ms')


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, 'w', encoding='utf-8') as file:
        file.write(text)


class Figures(unittest.TestCase):
    def test_of_tracking(self):
        figures = bars.read_tracking(LINE % '0.990' + '\n')
        self.assertEqual([figures[key] for key in ('right', 'degrees', 'percent', 'squared_error', 'p95_ms', 'p99_ms')],
                         [0.99, 0.12, 0.21, 1.02, 15.4, 17.1])
        with self.assertRaises(ValueError):
            bars.read_tracking('nothing')

    def test_of_the_demo(self):
        # Found in frame 2 of 0 to 6; frame 4 was dropped, frame 5 is wrong: 3 of 5 are right.
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'poses.csv')
            write(path, 'frame,deg,diameters\n0,inf,inf\n2,0.1,0.001\n3,0.3,0.002\n5,2.1,0.001\n6,0.2,0.003\n')
            figures = bars.read_demo(path, 7)
            self.assertAlmostEqual(figures['right'], 3 / 5)
            self.assertAlmostEqual(figures['degrees'], 0.2)
            self.assertAlmostEqual(figures['percent'], 0.2)
            write(path, 'frame,deg,diameters\n0,inf,inf\n')
            with self.assertRaises(ValueError):
                bars.read_demo(path, 7)

    def test_bounds_are_kept_where_they_are_met(self):
        for value, kept in ((0.69, False), (0.7, True), (1.4, True), (1.41, False), (float('nan'), False)):
            self.assertEqual(bars.keeps(bars.Bar('x', 0.7, 1.4), value), kept, value)

    def test_what_was_not_measured_is_missed(self):
        row = bars.Measurement('x', ['/nowhere'], bars.read_tracking, [bars.Bar('right', 0.5, None)])
        lines, missed = bars.report(row, *bars.measure(row, 5))
        self.assertEqual(missed, 1)
        self.assertIn('MISSED', lines[0])


class Command(unittest.TestCase):
    def run_with(self, right, *options, learned=True):
        """check_bars on one recording whose every figure is `right`. @param learned there is a model of its object."""
        with tempfile.TemporaryDirectory() as folder:
            program = os.path.join(folder, 'build', 'bench', 'recorded_tracking')
            write(program, '#!/bin/sh\necho "%s"\n' % (LINE % right))
            os.chmod(program, 0o755)
            write(os.path.join(folder, 'data', 'bottle_regular_1', 'sequence.json'), '{}')
            model = os.path.join(folder, 'data', 'bottle.safetensors')
            if learned:
                write(model, '')
            train = os.path.join(folder, 'build', 'devel', 'lib', 'nerf_pose_refiner', 'train')
            write(train, '#!/bin/sh\n[ $# = 3 ] && [ "$2" = --output ] && touch "$3"\n')
            os.chmod(train, 0o755)
            return subprocess.run([os.path.join(TOP, 'scripts', 'check_bars'), os.path.join(folder, 'data'),
                                   '--build', os.path.join(folder, 'build'), '--no-demo'] + list(options),
                                  stdout=subprocess.PIPE, universal_newlines=True, check=False)

    def test_says_that_all_is_well(self):
        done = self.run_with('0.990')
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn('8 of 8 bars kept', done.stdout)

    def test_says_what_is_missed(self):
        done = self.run_with('0.900')
        self.assertEqual(done.returncode, 1)
        self.assertIn('6 of 8 bars kept', done.stdout)
        self.assertEqual(done.stdout.count('MISSED'), 2)

    def test_learns_an_object_first(self):
        done = self.run_with('0.990', learned=False)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn('learning bottle', done.stdout)
        self.assertIn('9 of 9 bars kept', done.stdout)

    def test_judges_a_gpu_by_its_99th_percentile(self):
        done = self.run_with('0.990', '--backend', 'cuda')
        missed = [line for line in done.stdout.splitlines() if 'MISSED' in line]
        self.assertIn('17.1', ' '.join(line for line in missed if 'p99_ms' in line), done.stdout)

    def test_wants_recordings(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([os.path.join(TOP, 'scripts', 'check_bars'), folder, '--build', folder],
                                  stderr=subprocess.PIPE, universal_newlines=True, check=False)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn('make_recordings', done.stderr)


if __name__ == '__main__':
    unittest.main()
