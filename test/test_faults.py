#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks that docs/faults.md lists the faults of scripts/faults, and provokes those that are fast.

Usage: test_faults.py BUILD FOLDER"""
import os
import subprocess
import sys
import unittest

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LEAST_ROWS = 40
PATIENCE = 5  # several tests share the machine


def faults(*options):
    return subprocess.run([os.path.join(TOP, 'scripts', 'faults'), '--no-build', '--build', BUILD, *options],
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, universal_newlines=True, check=False)


class Faults(unittest.TestCase):
    def test_the_document_lists_them_all(self):
        with open(os.path.join(TOP, 'docs', 'faults.md'), encoding='utf-8') as file:
            document = file.read()
        table = faults('--table').stdout
        self.assertGreaterEqual(table.count('\n| `'), LEAST_ROWS)
        self.assertTrue(document.rstrip().endswith(table.strip()), 'print the table anew: scripts/faults --table')

    def test_the_fast_ones_pass(self):
        done = faults('--fast', '--out', FOLDER, '--patience', str(PATIENCE), '--train', '10')
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn(' 0 failed', done.stdout)


if __name__ == '__main__':
    BUILD, FOLDER = sys.argv[1:]
    unittest.main(argv=sys.argv[:1])
