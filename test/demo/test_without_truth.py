#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The demo's bag gives the same poses, bit for bit, when the truth is taken out of it.

Plays its first frames in step with the node: each message is sent when the node has said what became of the one that
must come before it. Nothing is timed.
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
from diagnostic_msgs.msg import DiagnosticArray
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
TRAINING_S = 120  # at most: the steps decide, unless other programs keep the cores busy
PATIENCE_S = 90


class WithoutTruth(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.changed = threading.Condition()  # guards what is below
        self.hypotheses, self.statuses, self.last_status = {}, {}, None
        self.node_time, self.seen_transforms = rospy.Time(), set()
        self.clock = rospy.Publisher('/clock', Clock, queue_size=1, latch=True)
        self.publishers = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in TOPICS.items()}
        rospy.Subscriber('/pose_refiner/hypotheses', PoseHypothesisArray, self.on_hypotheses)
        rospy.Subscriber('/pose_refiner/status', RefinementStatus, self.on_status)
        rospy.Subscriber('/diagnostics', DiagnosticArray, self.on_diagnostics)
        rospy.Subscriber('/tf', TFMessage, self.on_transforms)
        self.transforms = tf2_ros.Buffer(debug=False)
        self.listener = tf2_ros.TransformListener(self.transforms)

    def tearDown(self):
        shutil.rmtree(self.folder)

    def on_hypotheses(self, message):
        with self.changed:
            self.hypotheses[message.header.stamp] = message.hypotheses
            self.changed.notify_all()

    def on_status(self, message):
        with self.changed:
            self.last_status = message
            if message.latency_s > 0:  # of an image, not of a change of state
                self.statuses[message.header.stamp] = message
            self.changed.notify_all()

    def on_diagnostics(self, message):
        """The node sends them by the wall clock, stamped with what it takes for the time."""
        with self.changed:
            self.node_time = message.header.stamp
            self.changed.notify_all()

    def on_transforms(self, message):
        with self.changed:
            self.seen_transforms.update(
                (transform.child_frame_id, transform.header.stamp) for transform in message.transforms)
            self.changed.notify_all()

    def wait_for(self, what, holds):
        with self.changed:
            self.assertTrue(self.changed.wait_for(holds, PATIENCE_S),
                            '%s: waited in vain; the last status:\n%s' % (what, self.last_status))

    def register(self):
        rospy.wait_for_service('/pose_refiner/register_object', PATIENCE_S)
        register = rospy.ServiceProxy('/pose_refiner/register_object', RegisterObject)
        response = register(RegisterObjectRequest(name='toy_kiosk', dataset='toy_kiosk', max_seconds=TRAINING_S))
        self.assertTrue(response.success, response.message)

    def wait_for_listeners(self):
        """Of every topic that the node and its helper take in; of /tf this program is one more."""
        wanted = {'/camera/image/compressed': 1, '/camera/camera_info': 1, '/initial_pose': 1, '/tf': 2}
        for _ in range(PATIENCE_S * 10):
            if all(self.publishers[topic].get_num_connections() >= count for topic, count in wanted.items()):
                return
            rospy.rostime.wallsleep(0.1)
        self.fail('the node does not listen')

    def set_time(self, stamp):
        self.clock.publish(stamp)
        self.wait_for('the time of the node', lambda: self.node_time == stamp)

    def send(self, topic, message):
        """Returns when it has arrived, where something is to come after it."""
        self.publishers[topic].publish(message)
        if topic == '/initial_pose':
            self.wait_for('the initial pose',
                          lambda: self.last_status and 'received an initial pose' in self.last_status.message)
        elif topic == '/tf':
            sent = {(transform.child_frame_id, transform.header.stamp) for transform in message.transforms}
            self.wait_for('a transform', lambda: sent <= self.seen_transforms)
        elif topic == '/camera/image/compressed':
            stamp = message.header.stamp
            self.wait_for('the image of %s' % stamp, lambda: stamp in self.statuses and stamp in self.hypotheses)

    def play(self, path):
        """The hypotheses of each image."""
        with self.changed:
            self.hypotheses.clear()
            self.statuses.clear()
        played, started = [], False
        with rosbag.Bag(path) as bag:
            for topic, message, stamp in bag.read_messages(topics=list(TOPICS)):
                if topic == '/camera/camera_info' and len(played) == FRAMES:
                    break
                if not started:
                    self.set_time(stamp)  # from then on time runs on by little, and nothing waits for it
                    started = True
                self.clock.publish(stamp)
                self.send(topic, message)
                if topic == '/camera/image/compressed':
                    played.append(message.header.stamp)
        with self.changed:
            return [self.hypotheses[stamp] for stamp in played]

    def go_back_in_time(self):
        """Makes the node forget all that it saw."""
        self.set_time(rospy.Time(1))
        self.wait_for('the jump back',
                      lambda: self.last_status.reason == RefinementStatus.REASON_CLOCK_JUMPED)

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
