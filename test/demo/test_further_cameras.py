#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""demo.launch with depth:=true and side_camera:=true: both take part in the poses of the demo's recording."""
import os
import subprocess
import sys
import tempfile

import rospy
import rostest

from nerf_pose_refiner.msg import RefinementStatus
from stepped_demo import BAG, COMPANIONS, DEMO, FURTHER_TOPICS, TOPICS, SteppedDemo

FRAMES = 6


class FurtherCameras(SteppedDemo):
    topics = {**TOPICS, **FURTHER_TOPICS}

    def test_depth_and_side_camera_are_used(self):
        self.register()  # finds the model that another test has learnt, if one has
        self.set_time(rospy.Time(1))  # and makes the node forget what that has played
        self.wait_for_listeners()
        with tempfile.TemporaryDirectory() as folder:
            joined, stripped = (os.path.join(folder, name) for name in ('joined.bag', 'without_truth.bag'))
            make_bag = [sys.executable, os.path.join(DEMO, 'make_bag.py')]
            subprocess.check_call(make_bag + ['join', BAG, COMPANIONS, joined])
            subprocess.check_call(make_bag + ['strip', joined, stripped])
            stamps = self.play(stripped, FRAMES)
        with self.changed:
            statuses = [self.statuses[stamp] for stamp in stamps]
        for status in statuses[1:]:  # the first is a search
            self.assertEqual(status.depth, RefinementStatus.DEPTH_USED, status)
            self.assertEqual(status.cameras, 2, status)
            self.assertEqual(status.cameras_used.split(), ['image', 'side_camera/image'])
            self.assertEqual(status.depth_message + status.cameras_message, '')


if __name__ == '__main__':
    rospy.init_node('test_further_cameras')
    rostest.rosrun('nerf_pose_refiner', 'test_further_cameras', FurtherCameras)
