#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The demo's bag gives the same poses, bit for bit, when the truth is taken out of it.

Plays its first frames in step with the node: an image is sent when the one before it is done.
"""
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest

import rosbag
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, CompressedImage
from tf2_msgs.msg import TFMessage

from nerf_pose_refiner.msg import PoseHypothesisArray, RefinementStatus
from nerf_pose_refiner.srv import RegisterObject, RegisterObjectRequest

DEMO = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), 'demo')
BAG = os.path.join(DEMO, 'toy_kiosk.bag')
TOPICS = {'/camera/image/compressed': CompressedImage, '/camera/camera_info': CameraInfo,
          '/initial_pose': PoseStamped, '/ground_truth/object_pose': PoseStamped, '/tf': TFMessage}
FRAMES = 3
TRAINING_S = 10  # a coarse model will do: what matters is that both runs use the same
PATIENCE_S = 90
STEP_S = 0.2


class WithoutTruth(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.changed = threading.Condition()  # guards what is below
        self.hypotheses, self.statuses, self.last_status = {}, {}, None
        self.clock = rospy.Publisher('/clock', Clock, queue_size=1)
        self.publishers = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in TOPICS.items()}
        rospy.Subscriber('/pose_refiner/hypotheses', PoseHypothesisArray, self.on_hypotheses)
        rospy.Subscriber('/pose_refiner/status', RefinementStatus, self.on_status)
        self.transforms = tf2_ros.Buffer(debug=False)
        self.listener = tf2_ros.TransformListener(self.transforms)

    def tearDown(self):
        shutil.rmtree(self.folder)

    def on_hypotheses(self, message):
        with self.changed:
            self.hypotheses[message.header.stamp] = message.hypotheses

    def on_status(self, message):
        with self.changed:
            self.last_status = message
            if message.latency_s > 0:  # of an image, not of a change of state
                self.statuses[message.header.stamp] = message
            self.changed.notify_all()

    def register(self):
        rospy.wait_for_service('/pose_refiner/register_object', PATIENCE_S)
        register = rospy.ServiceProxy('/pose_refiner/register_object', RegisterObject)
        response = register(RegisterObjectRequest(name='toy_kiosk', dataset='toy_kiosk', max_seconds=TRAINING_S))
        self.assertTrue(response.success, response.message)

    def wait_for_listeners(self):
        wanted = [self.publishers[topic] for topic in ('/camera/image/compressed', '/camera/camera_info',
                                                       '/initial_pose', '/tf')] + [self.clock]
        for _ in range(PATIENCE_S * 10):
            if all(publisher.get_num_connections() > 0 for publisher in wanted):
                return
            rospy.rostime.wallsleep(0.1)
        self.fail('the node does not listen')

    def play(self, path):
        """The hypotheses of each image."""
        with self.changed:
            self.hypotheses.clear()
            self.statuses.clear()
        played = []
        with rosbag.Bag(path) as bag:
            for topic, message, stamp in bag.read_messages(topics=list(TOPICS)):
                if topic == '/camera/camera_info' and len(played) == FRAMES:
                    break
                # Each message is sent when what must come before it has arrived: the time, then the
                # initial pose and camera_info.
                self.clock.publish(stamp)
                rospy.rostime.wallsleep(STEP_S)
                self.publishers[topic].publish(message)
                rospy.rostime.wallsleep(STEP_S)
                if topic == '/camera/image/compressed':
                    played.append(message.header.stamp)
                    self.wait_for_result(message.header.stamp)
        with self.changed:
            return [self.hypotheses[stamp] for stamp in played]

    def wait_for_result(self, stamp):
        with self.changed:
            self.assertTrue(self.changed.wait_for(lambda: stamp in self.statuses, PATIENCE_S),
                            'no result for the image of %s; the last status:\n%s' % (stamp, self.last_status))

    def go_back_in_time(self):
        """Makes the node forget all that it saw."""
        self.clock.publish(rospy.Time(1))
        with self.changed:
            self.assertTrue(self.changed.wait_for(
                lambda: self.last_status.reason == RefinementStatus.REASON_CLOCK_JUMPED, PATIENCE_S))

    def truth_is_known(self):
        return self.transforms.can_transform('camera_optical', 'ground_truth_object', rospy.Time())

    def test_same_poses(self):
        stripped = os.path.join(self.folder, 'without_truth.bag')
        subprocess.check_call([sys.executable, os.path.join(DEMO, 'make_bag.py'), 'strip', BAG, stripped])
        self.register()
        self.wait_for_listeners()
        without = self.play(stripped)
        self.assertFalse(self.truth_is_known())
        self.go_back_in_time()
        with_truth = self.play(BAG)
        self.assertTrue(self.truth_is_known())
        self.assertEqual(len(without), FRAMES)
        for a, b in zip(without, with_truth):
            self.assertGreater(len(a), 0)
            self.assertEqual(a, b)
        self.assertNotEqual(without[0], without[-1])


if __name__ == '__main__':
    rospy.init_node('test_without_truth')
    rostest.rosrun('nerf_pose_refiner', 'test_without_truth', WithoutTruth)
