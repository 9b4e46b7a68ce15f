#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Evaluates the demo's bag as a user does: model and bag to a table, a summary and a page, and to the trust in poses.

    test_evaluate_bag.py FOLDER_FOR_FILES TRAIN RENDER EVALUATE_BAG CHECK_TRUST [unittest arguments]
"""
import csv
import json
import os
import subprocess
import sys
import unittest

import cv2
import rosbag
import rospy
from sensor_msgs.msg import CameraInfo, Image

FOLDER, TRAIN, RENDER, EVALUATE, CHECK_TRUST = sys.argv[1:6]
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'test', 'support'))
from kiosk_model import put_kiosk_model  # noqa: E402

BAG = os.path.join(TOP, 'demo', 'toy_kiosk.bag')
TRUTH = ('--truth', '/ground_truth/object_pose')
IMAGE = '/camera/image/compressed'
# A narrow search from a start that is a little wrong: quick.
QUICK = ('--preset', 'track', '--search-rotation', '3', '--search-translation', '0.02',
         '--start-rotation', '3', '--start-translation', '0.02', '--points', '200')
# Few images, and the narrow search here, too.
BRIEF = ('--json', '--runs', '1', '--images', '1', '--before', '1', '--preset', 'track', '--start-rotation', '3',
         '--start-translation', '0.02')


def run(*arguments):
    return subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True,
                          timeout=300)


def path(name):
    return os.path.join(FOLDER, name)


def read(folder):
    with open(os.path.join(folder, 'frames.csv'), newline='', encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    with open(os.path.join(folder, 'summary.json'), encoding='utf-8') as file:
        return rows, json.load(file)


def without_latency(rows, summary):
    rows = [{key: value for key, value in row.items() if key != 'latency_s'} for row in rows]
    return rows, {key: value for key, value in summary.items() if key != 'latency_s'}


MODEL = path('toy_kiosk.safetensors')


def setUpModule():
    put_kiosk_model(TRAIN, FOLDER, MODEL)


class Evaluation(unittest.TestCase):
    def evaluate(self, name, *options):
        folder = path(name)
        result = run(EVALUATE, MODEL, BAG, '-o', folder, *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return read(folder), result.stdout

    def test_same_bag_and_seed_same_numbers(self):
        options = TRUTH + QUICK + ('--every', '30')
        (rows, summary), text = self.evaluate('once', *options)
        self.assertEqual([row['frame'] for row in rows], ['0', '30', '60'])
        self.assertEqual(rows[1]['stamp'], '1700000003.000000000')
        self.assertIn('3 images, 3 poses', text)
        offsets = sorted(float(row['offset_diameters']) for row in rows)
        self.assertLess(offsets[-1], 0.2)
        self.assertAlmostEqual(summary['errors']['offset_diameters']['median'], offsets[1], 8)
        right = [float(row['offset_diameters']) <= 0.05 and float(row['rotation_deg']) <= 5 for row in rows]
        self.assertAlmostEqual(summary['recall']['5 deg and 5 %'], sum(right) / 3)
        self.assertEqual(summary['surface_points'], 200)
        self.assertAlmostEqual(summary['duration_s'], 6)
        self.assertEqual(summary['settings']['seed'], 1)
        again, _ = self.evaluate('again', *options, '--no-plots')
        self.assertEqual(without_latency(rows, summary), without_latency(*again))
        self.assertFalse(os.path.exists(path('again/index.html')))
        with open(path('once/index.html'), encoding='utf-8') as file:
            page = file.read()
        for picture in ('error.png', 'recall.png', 'latency.png'):
            self.assertIn(picture, page)
            self.assertGreater(os.path.getsize(path('once/' + picture)), 1000)
        (rows, _), _ = self.evaluate('other', *options, '--no-plots', '--seed', '2', '--frames', '1')
        self.assertNotEqual(rows[0]['start_rotation_deg'], again[0][0]['start_rotation_deg'])

    def test_symmetries_are_said(self):
        options = QUICK + TRUTH + ('--frames', '1', '--no-plots')
        (_, summary), text = self.evaluate('plain', *options)
        self.assertEqual(summary['settings']['modulo_symmetries'], '')
        self.assertNotIn('symmetries', text)
        metadata = os.path.splitext(MODEL)[0] + '.yaml'
        self.addCleanup(os.remove, metadata)
        # A half turn about z, which changes nothing: the truth is that of the model's frame.
        with open(metadata, 'w', encoding='utf-8') as file:
            file.write('frame_in_model: {orientation: [0, 0, 1, 0]}\n'
                       'symmetries: {discrete: [{axis: [0, 0, 1], fold: 2}]}\n')
        (rows, summary), text = self.evaluate('turned', *options)
        self.assertEqual(summary['settings']['modulo_symmetries'], '1 motion')
        self.assertIn('errors are modulo symmetries: 1 motion', text)
        self.assertLess(float(rows[0]['start_rotation_deg']), 6)

    def test_tracking_from_the_recorded_initial_pose(self):
        (rows, summary), _ = self.evaluate('track', '--truth-frame', 'ground_truth_object', '--track', *QUICK,
                                           '--start', 'recorded', '--initial-pose', '/initial_pose', '--frames',
                                           '2', '--min-score', '0', '--trust-score', '0', '--no-plots')
        self.assertEqual([row['from_last'] for row in rows], ['0', '1'])
        self.assertGreater(float(rows[0]['start_rotation_deg']), 10)  # as demo/make_bag.py made it
        # The camera moves by less than a degree: what was found is where the next search starts.
        self.assertAlmostEqual(float(rows[1]['start_rotation_deg']), float(rows[0]['rotation_deg']), delta=2)
        self.assertEqual(summary['skipped'], {})

    def test_the_third_image_is_looked_for_where_two_point_to(self):
        options = (*TRUTH, '--track', *QUICK, '--frames', '3', '--min-score', '0', '--trust-score', '0', '--no-plots')
        predicted = without_latency(*self.evaluate('predicted', *options)[0])[0]
        around_last = without_latency(*self.evaluate('around_last', *options, '--no-prediction')[0])[0]
        self.assertEqual(predicted[0], around_last[0])
        self.assertEqual(predicted[1]['start_rotation_deg'], around_last[1]['start_rotation_deg'],
                         'until then nobody knows how it moves')
        self.assertNotEqual(predicted[2]['start_rotation_deg'], around_last[2]['start_rotation_deg'])

    def test_images_without_an_initial_pose_are_skipped(self):
        (rows, summary), _ = self.evaluate('skip', *TRUTH, *QUICK, '--start', 'recorded', '--initial-pose',
                                           '/initial_pose', '--every', '10', '--frames', '3', '--no-plots')
        self.assertEqual([row['frame'] for row in rows], ['0', '10'])
        self.assertEqual(summary['skipped'], {'no initial pose': 1})

    def test_errors_name_the_topic(self):
        result = run(EVALUATE, MODEL, BAG, '-o', path('x'), '--truth', '/no/such/topic')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('/no/such/topic', result.stderr)
        result = run(EVALUATE, MODEL, BAG, '-o', path('x'), '--truth-frame', 'nowhere', '--frames', '2')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('2: no true pose', result.stderr)
        result = run(EVALUATE, MODEL, BAG, '-o', path('x'))
        self.assertEqual(result.returncode, 2, result)


def write_part(name, first, last):
    """The images with these numbers, and all else."""
    number = 0
    with rosbag.Bag(BAG) as bag, rosbag.Bag(name, 'w') as part:
        for topic, message, stamp in bag.read_messages():
            number += topic == IMAGE
            if topic != IMAGE or first <= number - 1 <= last:
                part.write(topic, message, stamp)


def render_depth(truth, info, name):
    """The model's depth at a pose, 16 bit. @param truth of geometry_msgs. @param info of its camera."""
    position, turn = truth.position, truth.orientation
    numbers = [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w]
    result = run(RENDER, MODEL, '--pose', *map(str, numbers), '--intrinsics',
                 *(str(info.K[i]) for i in (0, 4, 2, 5)), '--size', str(info.width), str(info.height), '--depth',
                 '-o', name + '.png')
    assert result.returncode == 0, result.stderr
    return cv2.imread(name + '_depth.png', cv2.IMREAD_UNCHANGED)


def write_with_depth(name, images, factor=1, frame=None):
    """The bag's first images, with the model's depth beside them, as a camera of the same frame takes it; or of another
    frame, as far as it is named."""
    number, infos = 0, {}
    with rosbag.Bag(BAG) as bag, rosbag.Bag(name, 'w') as part:
        for topic, message, stamp in bag.read_messages():
            if topic == '/camera/camera_info':
                infos[stamp] = message
            if topic == IMAGE:
                number += 1
            if topic != IMAGE or number <= images:
                part.write(topic, message, stamp)
            if topic != TRUTH[1] or number > images:
                continue
            depth = render_depth(message.pose, infos[stamp], path('depth_%d' % number))
            picture, info = Image(), CameraInfo(**{key: getattr(infos[stamp], key) for key in CameraInfo.__slots__})
            picture.header = info.header
            picture.header.frame_id = frame or info.header.frame_id
            picture.height, picture.width = depth.shape
            picture.encoding, picture.step = '16UC1', 2 * depth.shape[1]
            picture.data = (depth * factor).astype('<u2').tobytes()
            later = stamp + rospy.Duration.from_sec(0.001)
            part.write('/depth/image', picture, later)
            part.write('/depth/camera_info', info, later)


class Depth(unittest.TestCase):
    """Keyframes, with depth that agrees with them and with depth that does not."""

    OPTIONS = (*TRUTH, '--track', '--frames', '4', '--start-rotation', '2', '--start-translation', '0.02', '--points',
               '200', '--min-score', '0', '--trust-score', '0', '--no-plots', '--image', IMAGE)

    def evaluate(self, name, bag, *options):
        result = run(EVALUATE, MODEL, bag, '-o', path(name), *self.OPTIONS, *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return without_latency(*read(path(name)))

    def test_depth_of_a_bag_takes_part(self):
        write_with_depth(path('deep.bag'), 4)
        rows, summary = self.evaluate('deep', path('deep.bag'), '--depth', '/depth/image')
        self.assertEqual(summary['with_depth'], 4, summary['depth_refused'])
        self.assertEqual(summary['settings']['depth'], '/depth/image')
        alone, _ = self.evaluate('flat', path('deep.bag'))
        self.assertNotEqual(rows, alone)

    def test_depth_of_another_unit_is_refused_and_changes_nothing(self):
        write_with_depth(path('tenths.bag'), 4, 10)
        rows, summary = self.evaluate('tenths', path('tenths.bag'), '--depth', '/depth/image')
        self.assertEqual(summary['with_depth'], 0)
        self.assertEqual(sum(summary['depth_refused'].values()), 4)
        self.assertTrue(all('times the distance' in why for why in summary['depth_refused']), summary['depth_refused'])
        alone, _ = self.evaluate('alone', path('tenths.bag'))
        self.assertEqual(rows, alone)

    def test_depth_whose_place_or_time_does_not_fit_is_left_out(self):
        write_with_depth(path('nowhere.bag'), 4, frame='nowhere')
        rows, summary = self.evaluate('nowhere', path('nowhere.bag'), '--depth', '/depth/image')
        self.assertEqual(summary['with_depth'], 0)
        self.assertEqual(summary['depth_refused'], {'TF does not know its place': 4})
        alone, _ = self.evaluate('without', path('nowhere.bag'))
        self.assertEqual(rows, alone)
        with rosbag.Bag(path('nowhere.bag')) as bag, rosbag.Bag(path('rare.bag'), 'w') as rare:
            seen = set()
            for topic, message, stamp in bag.read_messages():
                if topic != '/depth/image' or topic not in seen:  # the first of its images
                    rare.write(topic, message, stamp)
                seen.add(topic)
        _, summary = self.evaluate('rare', path('rare.bag'), '--depth', '/depth/image')
        self.assertEqual(summary['depth_refused'], {'TF does not know its place': 1, 'no image near in time': 3})

    def test_a_topic_that_is_missing_is_named(self):
        result = run(EVALUATE, MODEL, BAG, '-o', path('none'), *self.OPTIONS, '--depth', '/no/depth')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('/no/depth', result.stderr)


class Trust(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.part = path('part.bag')
        write_part(cls.part, 20, 22)

    def check(self, *options):
        result = run(CHECK_TRUST, MODEL, BAG, *TRUTH, *BRIEF, *options)
        return result, json.loads(result.stdout) if result.stdout else None

    def test_an_object_that_stays_is_never_lost(self):
        result, report = self.check('--trust-score', '0', '--min-score', '0', '--gone', self.part, '--limit', '2')
        self.assertEqual(report['stays']['toy_kiosk.bag'],
                         {'images': 1, 'right': 1, 'published': 1, 'published_right': 1})
        self.assertEqual(report['goes']['part.bag'],
                         {'runs': 1, 'tracked': 1, 'lost_soon': 0, 'images_until_lost': 0, 'published': 2})
        self.assertFalse(report['holds'])
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('less than was asked for', result.stderr)

    def test_right_poses_must_be_published(self):
        result, report = self.check('--trust-score', '1')
        self.assertEqual(report['stays']['toy_kiosk.bag'],
                         {'images': 1, 'right': 1, 'published': 0, 'published_right': 0})
        self.assertEqual(result.returncode, 1, result)
        result, report = self.check('--trust-score', '0', '--min-score', '0')
        self.assertTrue(report['holds'])
        self.assertEqual(result.returncode, 0, result)

    def test_recordings_must_have_enough_in_common(self):
        result, _ = self.check('--gone', self.part, '--limit', '5')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('too few images', result.stderr)


if __name__ == '__main__':
    sys.exit(unittest.main(argv=sys.argv[:1] + sys.argv[6:]))
