#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The demo's bag gives the same poses, bit for bit, when the truth is taken out of it."""
import os
import shutil
import subprocess
import sys
import tempfile

import rospy
import rostest
import tf2_ros

from nerf_pose_refiner.msg import RefinementStatus
from stepped_demo import BAG, DEMO, SteppedDemo

FRAMES = 3


class WithoutTruth(SteppedDemo):
    def setUp(self):
        super().setUp()
        self.folder = tempfile.mkdtemp()
        self.transforms = tf2_ros.Buffer(debug=False)
        self.listener = tf2_ros.TransformListener(self.transforms)

    def tearDown(self):
        shutil.rmtree(self.folder)

    def go_back_in_time(self):
        """Makes the node forget all that it saw."""
        self.set_time(rospy.Time(1))
        self.wait_for('the jump back',
                      lambda: self.last_status.reason == RefinementStatus.REASON_CLOCK_JUMPED)

    def truth_is_known(self):
        return self.transforms.can_transform('camera_optical', 'ground_truth_object', rospy.Time())

    def hypotheses_of(self, path):
        stamps = self.play(path, FRAMES)
        with self.changed:
            return [self.hypotheses[stamp] for stamp in stamps]

    def test_same_poses(self):
        stripped = os.path.join(self.folder, 'without_truth.bag')
        subprocess.check_call([sys.executable, os.path.join(DEMO, 'make_bag.py'), 'strip', BAG, stripped])
        self.register()
        self.wait_for_listeners()
        without = self.hypotheses_of(stripped)
        self.assertFalse(self.truth_is_known())
        self.go_back_in_time()
        with_truth = self.hypotheses_of(BAG)
        self.assertTrue(self.truth_is_known())
        self.assertEqual(len(without), FRAMES)
        for a, b in zip(without, with_truth):
            self.assertGreater(len(a), 0)
            self.assertEqual(a, b)
        self.assertNotEqual(without[0], without[-1])


if __name__ == '__main__':
    rospy.init_node('test_without_truth')
    rostest.rosrun('nerf_pose_refiner', 'test_without_truth', WithoutTruth)
