# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The demo's recording as messages, and where the object is in each of them."""
import copy

import cv2
import numpy as np
import rosbag
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Image

IMAGE_TOPIC, INFO_TOPIC = '/camera/image/compressed', '/camera/camera_info'
TRUTH_TOPIC = '/ground_truth/object_pose'


def matrix(pose):
    """4 x 4, of a geometry_msgs/Pose [m]."""
    x, y, z, w = (getattr(pose.orientation, axis) for axis in 'xyzw')
    T = np.eye(4)
    T[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    T[:3, 3] = pose.position.x, pose.position.y, pose.position.z
    return T


class Frame:
    """An image, its camera_info, and the object's pose in the camera [m]."""

    def __init__(self, compressed, info, truth):
        picture = cv2.imdecode(np.frombuffer(compressed.data, np.uint8), cv2.IMREAD_COLOR)
        self.picture = picture
        self.info = info
        self.truth = truth
        self.T_C_O = matrix(truth.pose)
        self.bytes = picture.tobytes()

    def messages(self, stamp):
        """Image and CameraInfo that the caller may change."""
        image = Image(height=self.picture.shape[0], width=self.picture.shape[1], encoding='bgr8',
                      step=3 * self.picture.shape[1], data=self.bytes)
        info = copy.deepcopy(self.info)
        image.header.frame_id, image.header.stamp, info.header.stamp = info.header.frame_id, stamp, stamp
        return image, info

    def initial_pose(self, stamp):
        """The truth, moved by 1 cm: what a user would give."""
        pose = PoseStamped(pose=copy.deepcopy(self.truth.pose))
        pose.header.frame_id, pose.header.stamp = self.info.header.frame_id, stamp
        pose.pose.position.x += 0.01
        return pose


def read_frames(path):
    """The recording's frames, in order."""
    images, infos, truths = {}, {}, {}
    kinds = {IMAGE_TOPIC: images, INFO_TOPIC: infos, TRUTH_TOPIC: truths}
    with rosbag.Bag(path) as bag:
        for topic, message, _ in bag.read_messages(topics=list(kinds)):
            kinds[topic][message.header.stamp] = message
    return [Frame(images[stamp], infos[stamp], truths[stamp]) for stamp in sorted(images)]
