#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The demo's bags hold what its README says: three cameras with equal stamps, and a truth that can be taken out."""
import os
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import rosbag

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DEMO = os.path.join(TOP, 'demo')
BAG, COMPANIONS = (os.path.join(DEMO, name) for name in ('toy_kiosk.bag', 'toy_kiosk_companions.bag'))
sys.path.insert(0, DEMO)
import depth_sensor  # noqa: E402

IMAGES = 76
CAMERAS = {'/camera/image/compressed': '/camera/camera_info', '/camera/depth/image': '/camera/depth/camera_info',
           '/side_camera/image/compressed': '/side_camera/camera_info'}
TRUTH = '/ground_truth/object_pose'
PLACES = {'camera_optical': 'room', 'side_camera_optical': 'room', 'depth_optical': 'camera_optical'}


def read(path):
    """Messages by topic, and stamps of TF by (parent, child)."""
    messages, transforms = {}, {}
    with rosbag.Bag(path) as bag:
        for topic, message, _ in bag.read_messages():
            messages.setdefault(topic, []).append(message)
            for transform in message.transforms if topic == '/tf' else ():
                key = transform.header.frame_id, transform.child_frame_id
                transforms.setdefault(key, []).append(transform.header.stamp)
    return messages, transforms


def stamps(messages):
    return [message.header.stamp for message in messages]


def make_bag(*arguments):
    subprocess.check_call([sys.executable, os.path.join(DEMO, 'make_bag.py'), *arguments])


class Recording(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.joined = os.path.join(cls.folder.name, 'joined.bag')
        make_bag('join', BAG, COMPANIONS, cls.joined)
        cls.messages, cls.transforms = read(cls.joined)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_joined_bag_has_all_in_the_order_of_time(self):
        with rosbag.Bag(self.joined) as joined, rosbag.Bag(BAG) as first, rosbag.Bag(COMPANIONS) as second:
            stamps = [stamp for _, _, stamp in joined.read_messages()]
            self.assertEqual(stamps, sorted(stamps))
            self.assertEqual(len(stamps), first.get_message_count() + second.get_message_count())

    def test_cameras_have_equal_stamps(self):
        expected = stamps(self.messages[TRUTH])
        self.assertEqual(len(expected), IMAGES)
        for image, info in CAMERAS.items():
            self.assertEqual(stamps(self.messages[image]), expected, image)
            self.assertEqual(stamps(self.messages[info]), expected, info)
            frames = {message.header.frame_id for topic in (image, info) for message in self.messages[topic]}
            self.assertEqual(len(frames), 1, image)

    def test_depth_is_in_millimetres(self):
        info = self.messages['/camera/depth/camera_info'][0]
        for message in self.messages['/camera/depth/image']:
            self.assertEqual((message.encoding, message.width, message.height), ('16UC1', info.width, info.height))
            depth_mm = np.frombuffer(message.data, '<u2')
            self.assertTrue(0.05 < (depth_mm == 0).mean() < 0.3)
            self.assertTrue(300 < np.median(depth_mm) < 900)

    def test_places_of_the_cameras_are_known_at_each_stamp(self):
        for child, parent in PLACES.items():
            self.assertEqual(self.transforms[parent, child], stamps(self.messages[TRUTH]))

    def test_without_the_truth_nothing_tells_of_the_object(self):
        path = os.path.join(self.folder.name, 'without_truth.bag')
        make_bag('strip', self.joined, path)
        messages, transforms = read(path)
        self.assertEqual(set(transforms), {(parent, child) for child, parent in PLACES.items()})
        self.assertEqual(set(self.messages) - set(messages), {TRUTH})
        for topic in set(messages) - {'/tf'}:
            self.assertEqual(messages[topic], self.messages[topic], topic)

    def test_size(self):
        for path in (BAG, COMPANIONS):
            self.assertLess(os.path.getsize(path), 4 * 2**20, path)


class DepthSensor(unittest.TestCase):
    """A wall at 1 m, and a card at 0.5 m before it."""

    FOCAL_PX = 200.0

    def setUp(self):
        self.truth_m = np.full((60, 120), 1.0, np.float32)
        self.truth_m[20:40, 60:80] = 0.5
        self.depth_m = depth_sensor.measured_mm(self.truth_m, self.FOCAL_PX, 1) / 1000

    def test_same_seed_same_image(self):
        again, other = (depth_sensor.measured_mm(self.truth_m, self.FOCAL_PX, seed) / 1000 for seed in (1, 2))
        self.assertTrue((again == self.depth_m).all())
        self.assertFalse((other == self.depth_m).all())

    def test_noise_grows_with_the_square_of_distance(self):
        errors = [(self.depth_m - self.truth_m)[(self.truth_m == at) & (abs(self.depth_m - self.truth_m) < 0.1)]
                  for at in (0.5, 1.0)]
        near, far = (np.std(e) for e in errors)
        self.assertAlmostEqual(far, 0.002 / 0.6**2, delta=0.002)
        self.assertAlmostEqual(far / near, 4, delta=1.5)

    def test_the_card_hides_the_wall_on_its_left(self):
        shadow_px = int(self.FOCAL_PX * depth_sensor.BASELINE_M * (1 / 0.5 - 1 / 1.0))
        self.assertTrue((self.depth_m[21:39, 59 - shadow_px:59] == 0).all())
        self.assertLess((self.depth_m[21:39, 82:100] == 0).mean(), 0.5)

    def test_nothing_is_a_hole(self):
        self.assertTrue((depth_sensor.measured_mm(np.zeros((60, 120)), self.FOCAL_PX, 1) == 0).all())


if __name__ == '__main__':
    unittest.main()
