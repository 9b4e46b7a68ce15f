#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Configures the package where something is missing.

    test_configure.py CMAKE FOLDER_FOR_FILES [unittest arguments]
"""
import os
import shutil
import subprocess
import sys
import unittest

CMAKE, FOLDER = sys.argv[1:3]
TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def configure(*options):
    """Runs CMake in an empty folder, without ROS. Returns the result and the targets there are."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    result = subprocess.run(
        [CMAKE, '-S', TOP, '-B', FOLDER, '-DCMAKE_DISABLE_FIND_PACKAGE_catkin=ON',
         '-DNERF_POSE_REFINER_CUDA=OFF', *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=300)
    targets = subprocess.run([CMAKE, '--build', FOLDER, '--target', 'help'],
                             stdout=subprocess.PIPE, universal_newlines=True, timeout=60)
    names = [line.split()[1] for line in targets.stdout.splitlines() if line.startswith('... ')]
    return result, names


class WithoutCli11(unittest.TestCase):
    """As on Ubuntu 20.04, which has no package of it."""

    def test_the_tools_are_left_out_and_all_else_is_there(self):
        result, targets = configure('-DCMAKE_DISABLE_FIND_PACKAGE_CLI11=ON')
        self.assertEqual(result.returncode, 0, result.stderr)
        message = ' '.join(result.stderr.split())
        self.assertIn('CLI11 was not found', message)
        self.assertIn('train, render and refine are left out', message)
        self.assertNotIn('nerf_pose_refiner_train', targets)
        self.assertIn('nerf_pose_refiner', targets)
        self.assertIn('nerf_pose_refiner_draw_figure2', targets)
        self.assertIn('nerf_pose_refiner_test_refine_case', targets)

    def test_the_benchmarks_say_what_they_need(self):
        result, _ = configure('-DCMAKE_DISABLE_FIND_PACKAGE_CLI11=ON',
                              '-DNERF_POSE_REFINER_BENCHMARKS=ON')
        self.assertNotEqual(result.returncode, 0)
        self.assertIn('need CLI11', result.stderr)


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
