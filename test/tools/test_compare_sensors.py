#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Compares sensors on the last images of the demo's recording: depth, depth alone, a second camera, past images.

    test_compare_sensors.py FOLDER_FOR_FILES TRAIN EVALUATE_BAG [unittest arguments]
"""
import csv
import json
import os
import re
import shutil
import subprocess
import sys
import unittest

import rosbag
from rospy import Time

FOLDER, TRAIN, EVALUATE = sys.argv[1:4]
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'test', 'support'))
from kiosk_model import put_kiosk_model  # noqa: E402

PROGRAM = os.path.join(TOP, 'scripts', 'compare_sensors')
IMAGE, DEPTH, SIDE = '/camera/image/compressed', '/camera/depth/image', '/side_camera/image/compressed'
FIRST_S, LAST_S, IMAGES = 1700000006.55, 1700000007.35, 8  # by this time the hastily learned model fits well
# Says how long the table is by now, and what it was called with, and fails.
FAILS = '''#!/usr/bin/env python3
import os, sys
table = os.path.join(os.path.dirname(sys.argv[sys.argv.index('-o') + 1]), 'table.md')
lines = len(open(table).readlines()) if os.path.exists(table) else 0
sys.exit(f'{lines} lines, a|b, {sys.argv[sys.argv.index("--image") + 1:]}\\nmore')
'''
# The model is learned in seconds: its poses need not be trusted.
QUICK = ('--', '--points', '100', '--start-rotation', '5', '--start-translation', '0.05', '--min-score', '0',
         '--trust-score', '0', '--max-failures', '100')


def path(name):
    return os.path.join(FOLDER, name)


MODEL, BAG = path('toy_kiosk.safetensors'), path('excerpt.bag')


def write_excerpt():
    """Some images of the recording with their depth and the second camera's."""
    messages = []
    for name in ('toy_kiosk.bag', 'toy_kiosk_companions.bag'):
        with rosbag.Bag(os.path.join(TOP, 'demo', name)) as bag:
            for topic, message, stamp in bag.read_messages(start_time=Time(FIRST_S), end_time=Time(LAST_S)):
                messages.append((stamp, len(messages), topic, message))
    with rosbag.Bag(BAG, 'w') as excerpt:
        for stamp, _, topic, message in sorted(messages, key=lambda item: item[:2]):
            excerpt.write(topic, message, stamp)


def setUpModule():
    put_kiosk_model(TRAIN, FOLDER, MODEL)
    write_excerpt()


def compare(name, *words, tools=os.path.dirname(EVALUATE)):
    command = [sys.executable, PROGRAM, MODEL, BAG, '-o', path(name), '--tools', tools, *words]
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=300,
                          check=False)


def cells_of(table):
    return [[cell.strip() for cell in re.split(r'(?<!\\)\|', line.strip('|'))] for line in table.splitlines()]


class Comparison(unittest.TestCase):
    def test_each_set_of_sensors(self):
        result = compare('all', '--truth-frame', 'ground_truth_object', '--image', IMAGE, '--depth', DEPTH, '--cameras',
                         SIDE, '--fixed-frame', 'room', '--window', '2', *QUICK, '--window-apart', '2')
        self.assertEqual(result.returncode, 0, result.stderr)
        rows = cells_of(result.stdout)
        names = ['colours', 'colours and depth', 'depth alone', '2 cameras', '2 cameras and depth', 'window of 2']
        self.assertEqual([row[0] for row in rows], ['sensors', '---', *names])
        by_name = {row[0]: dict(zip(rows[0], row)) for row in rows[2:]}
        for name, row in by_name.items():
            self.assertEqual(row['images'], str(IMAGES), name)
            self.assertTrue(re.fullmatch(r'\d+\.\d\d', row['along the view [%]']), (name, row))
        self.assertEqual(by_name['colours']['took part'], '')
        self.assertEqual(float(by_name['colours']['5 deg and 5 %']), 1)
        self.assertLess(float(by_name['colours']['along the view [%]']), 5)
        for name, part in (('2 cameras', 'cameras'), ('2 cameras and depth', 'cameras'), ('window of 2', 'window')):
            self.assertIn(part, by_name[name]['took part'], by_name[name])
        self.check_files(names, result.stdout)

    def check_files(self, names, table):
        with open(path('all/table.md'), encoding='utf-8') as file:
            self.assertEqual(file.read(), table)
        self.assertGreater(os.path.getsize(path('all/sensors.png')), 5000)
        for name in names:
            folder = path(os.path.join('all', name.replace(' ', '_')))
            with open(os.path.join(folder, 'frames.csv'), newline='', encoding='utf-8') as file:
                frames = list(csv.DictReader(file))
            with open(os.path.join(folder, 'summary.json'), encoding='utf-8') as file:
                summary = json.load(file)
            errors = [[float(frame[key]) for key in ('offset_m', 'along_m', 'across_m', 'along_dev_m')]
                      for frame in frames if frame['offset_m']]
            for whole, along, across, deviation in errors:
                self.assertAlmostEqual(whole ** 2, along ** 2 + across ** 2, 8)
                self.assertGreater(deviation, 0)
            self.assertEqual(summary['settings']['cameras'], [SIDE] if '2 cameras' in name else [])
            self.assertEqual(summary['settings']['window'], 2 if 'window' in name else 0)
            self.assertEqual(summary['settings']['image'], DEPTH if name == 'depth alone' else IMAGE)

    def test_topics_that_are_missing_are_left_out(self):
        result = compare('colours', '--truth', '/ground_truth/object_pose', '--image', IMAGE, *QUICK, '--frames', '2')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(result.stdout.splitlines()), 3)

    def test_what_cannot_be_used(self):
        truth = ('--truth', '/ground_truth/object_pose', '--image', IMAGE)
        result = compare('none', *truth, '--cameras', '/no/camera', *QUICK, '--frames', '1')
        self.assertEqual(result.returncode, 1)
        self.assertIn('2 cameras: ', result.stderr)
        self.assertIn('/no/camera', result.stderr)
        result = compare('none', *truth, '--window', '2')
        self.assertEqual(result.returncode, 2)
        self.assertIn('--window needs --fixed-frame', result.stderr)
        result = compare('none', *truth, tools=path('none'))
        self.assertIn("'evaluate_bag' of this package was not found", result.stderr)
        self.assertEqual((result.returncode, result.stdout), (1, ''))

    def test_a_set_that_fails_is_a_row(self):
        result = compare('one', '--truth', '/ground_truth/object_pose', '--image', IMAGE, '--cameras', '/no/camera',
                         '--fixed-frame', 'room', '--window', '1', *QUICK, '--frames', '2')
        self.assertEqual(result.returncode, 1)
        rows = cells_of(result.stdout)[2:]
        self.assertEqual([(row[0], row[1], len(row)) for row in rows],
                         [('colours', '2', 11), ('2 cameras', '', 11), ('window of 1', '2', 11)])
        self.assertTrue(rows[1][2].startswith('failed: evaluate_bag: ') and '/no/camera' in rows[1][2], rows[1])
        begun = [line for line in result.stderr.splitlines() if line.endswith(' of 3)')]
        self.assertEqual(begun, ['colours (1 of 3)', '2 cameras (2 of 3)', 'window of 1 (3 of 3)'])
        with open(path('one/table.md'), encoding='utf-8') as file:
            self.assertEqual(file.read(), result.stdout)
        self.assertGreater(os.path.getsize(path('one/sensors.png')), 5000)

    def test_the_table_grows_and_depth_alone_takes_no_options_of_colours(self):
        shutil.rmtree(path('fails'), ignore_errors=True)  # a table of another run
        os.makedirs(path('fails'))
        with open(path('fails/evaluate_bag'), 'w', encoding='utf-8') as file:
            file.write(FAILS)
        os.chmod(path('fails/evaluate_bag'), 0o755)
        result = compare('fails', '--truth', '/true', '--image', IMAGE, '--depth', DEPTH, '--', '--mask', '/mask',
                         '--seed', '2', '--camera-info=/info', tools=path('fails'))
        self.assertEqual(result.returncode, 1, result.stderr)
        of_colours = [IMAGE, '--mask', '/mask', '--seed', '2', '--camera-info=/info']
        self.assertEqual([row[2] for row in cells_of(result.stdout)[2:]], [
            f'failed: 0 lines, a\\|b, {of_colours}',
            f"failed: 3 lines, a\\|b, {[IMAGE, '--depth', DEPTH, *of_colours[1:]]}",
            f"failed: 4 lines, a\\|b, {[DEPTH, '--seed', '2']}"])
        self.assertFalse(os.path.exists(path('fails/sensors.png')))


if __name__ == '__main__':
    os.makedirs(FOLDER, exist_ok=True)
    sys.exit(unittest.main(argv=sys.argv[:1] + sys.argv[4:]))
