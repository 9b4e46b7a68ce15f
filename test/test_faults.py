#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Provokes the fast ones of scripts/faults, and checks that docs/faults.md lists them all.

Usage: test_faults.py BUILD"""
import os
import subprocess
import sys
import unittest

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LEAST_ROWS = 40


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


    def test_what_must_happen_does(self):
        """Times are those of a machine that does other things beside it."""
        result = faults('--fast', '--patience', '3', '--out', os.path.join(BUILD, 'faults'))
        self.assertEqual(result.returncode, 0, result.stdout)
        self.assertIn(' 0 failed, 0 skipped', result.stdout)


if __name__ == '__main__':
    BUILD, = sys.argv[1:]
    unittest.main(argv=sys.argv[:1])
