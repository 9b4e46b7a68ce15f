# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Plays the demo's bag in step with the node: each message is sent when the node has said what became of the one that
must come before it. Nothing is timed.
"""
import os
import threading
import unittest

import rosbag
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage

from nerf_pose_refiner.msg import PoseHypothesisArray, RefinementStatus
from nerf_pose_refiner.srv import RegisterObject, RegisterObjectRequest

DEMO = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), 'demo')
BAG, COMPANIONS = (os.path.join(DEMO, name) for name in ('toy_kiosk.bag', 'toy_kiosk_companions.bag'))
IMAGE = '/camera/image/compressed'
TOPICS = {IMAGE: CompressedImage, '/camera/camera_info': CameraInfo, '/initial_pose': PoseStamped,
          '/ground_truth/object_pose': PoseStamped, '/tf': TFMessage}
FURTHER_TOPICS = {'/camera/depth/image': Image, '/camera/depth/camera_info': CameraInfo,
                  '/side_camera/image/compressed': CompressedImage, '/side_camera/camera_info': CameraInfo}
TRAINING_S = 120  # at most: the steps decide, unless other programs keep the cores busy
PATIENCE_S = 90


class SteppedDemo(unittest.TestCase):
    topics = TOPICS  # what is played

    def setUp(self):
        self.changed = threading.Condition()  # guards what is below
        self.hypotheses, self.statuses, self.last_status = {}, {}, None
        self.node_time, self.seen_transforms = rospy.Time(), set()
        self.clock = rospy.Publisher('/clock', Clock, queue_size=1, latch=True)
        self.publishers = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in self.topics.items()}
        rospy.Subscriber('/pose_refiner/hypotheses', PoseHypothesisArray, self.on_hypotheses)
        rospy.Subscriber('/pose_refiner/status', RefinementStatus, self.on_status)
        rospy.Subscriber('/diagnostics', DiagnosticArray, self.on_diagnostics)
        rospy.Subscriber('/tf', TFMessage, self.on_transforms)

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
        wanted = {topic: 2 if topic == '/tf' else 1 for topic in self.topics if topic != '/ground_truth/object_pose'}
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
        elif topic == IMAGE:
            stamp = message.header.stamp
            self.wait_for('the image of %s' % stamp, lambda: stamp in self.statuses and stamp in self.hypotheses)

    def play(self, path, frames):
        """Plays the first images, each after all that has its time. Returns their stamps."""
        with self.changed:
            self.hypotheses.clear()
            self.statuses.clear()
        with rosbag.Bag(path) as bag:
            end = [stamp for _, _, stamp in bag.read_messages(topics=[IMAGE])][frames - 1]
            messages = sorted(bag.read_messages(topics=list(self.topics), end_time=end),
                              key=lambda entry: (entry.timestamp, entry.topic == IMAGE))
        self.set_time(messages[0].timestamp)  # from then on time runs on by little, and nothing waits for it
        for topic, message, stamp in messages:
            self.clock.publish(stamp)
            self.send(topic, message)
        return [message.header.stamp for topic, message, _ in messages if topic == IMAGE]
