# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A camera that plays frames forth and back by a clock of its own, which may be paused and moved."""
import contextlib
import threading
import time
from collections import namedtuple

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

START_S = 1.7e9

# Of the clock, whose steps are `step_s` long; of the images; and of the frames that are played in them.
Rate = namedtuple('Rate', 'step_s steps_per_image images_per_frame')
AS_RECORDED = Rate(0.02, 5, 1)  # 10 Hz
SIXTY_HZ = Rate(1 / 60, 1, 6)


def transform(T, stamp, parent, child):
    """@param T 4 x 4, takes points from the child to the parent [m]."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    t, q = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = T[:3, 3]
    w = np.sqrt(max(0.0, 1 + np.trace(T[:3, :3]))) / 2
    R = T[:3, :3]
    if w > 0.1:
        q.w, q.x, q.y, q.z = w, *((np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])) / (4 * w))
    else:  # near half a turn: by the axis, the column of R + 1 that is longest
        columns = R + np.eye(3)
        axis = columns[:, np.argmax(np.linalg.norm(columns, axis=0))]
        q.x, q.y, q.z = axis / np.linalg.norm(axis)
        q.w = w
    return message


class Player:
    """Publishes /clock, camera/image, camera/camera_info and TF from `world` (the object) to the camera."""

    def __init__(self, frames, speed, rate=AS_RECORDED):
        """@param speed of the clock, compared with the wall's."""
        self.frames = frames
        self.speed = speed
        self.rate = rate
        self.lock = threading.RLock()  # guards what the thread shares with its callers
        self.now_s = START_S
        self.paused = False
        self.camera_on = True
        self.tf_on = True
        self.tf_offset = np.eye(4)  # moves the camera in the world [m]
        self.alter = None  # takes and gives lists of (Image, CameraInfo or None)
        self.visible = True  # whether the object is in altered images
        self.shown = {}  # stamp [ns] -> frame whose object is in the image (or None), and tf_offset
        self.sequence = 0  # of the last image that was sent to anybody
        self.position = 0
        self.clock = rospy.Publisher('/clock', Clock, queue_size=1)
        self.images = rospy.Publisher('/camera/image', Image, queue_size=20)
        self.infos = rospy.Publisher('/camera/camera_info', CameraInfo, queue_size=20)
        self.tf = rospy.Publisher('/tf', TFMessage, queue_size=20)
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def frame(self):
        """The newest frame that was played."""
        n = len(self.frames)
        i = self.position // self.rate.images_per_frame % (2 * n - 2)
        return self.frames[i if i < n else 2 * n - 2 - i]

    def stamp(self, offset_s=0.0):
        # In steps of the clock: the same time has the same stamp.
        return rospy.Time.from_sec(round((self.now_s + offset_s) / self.rate.step_s) * self.rate.step_s)

    @contextlib.contextmanager
    def altered(self, alter, visible=True):
        """Changes what is published: `alter` takes an Image and a CameraInfo and gives a list of pairs."""
        with self.lock:
            self.alter, self.visible = alter, visible
        try:
            yield
        finally:
            with self.lock:
                self.alter, self.visible = None, True

    def as_usual(self):
        """Undoes what a row that failed has left."""
        with self.lock:
            self.paused, self.camera_on, self.tf_on, self.alter, self.visible = False, True, True, None, True
            self.tf_offset = np.eye(4)

    def jump(self, seconds):
        """Moves the clock."""
        with self.lock:
            self.now_s += seconds

    def publish_images(self):
        """One frame, or what is made of it."""
        with self.lock:
            self.position += 1
            stamp = self.stamp()
            pairs = [self.frame().messages(stamp)]
            if self.tf_on:
                T_W_C = self.tf_offset @ np.linalg.inv(self.frame().T_C_O)
                self.tf.publish(TFMessage([transform(T_W_C, stamp, 'world', pairs[0][0].header.frame_id)]))
            if self.alter:
                pairs = self.alter(*pairs[0])
            for image, info in pairs:
                frame = self.frame() if self.visible else None
                # tf2 leaves out what is not a number.
                tf_offset = self.tf_offset.copy() if np.isfinite(self.tf_offset).all() else np.eye(4)
                self.shown[image.header.stamp.to_nsec()] = frame, tf_offset
                if info is not None:
                    self.infos.publish(info)
                self.images.publish(image)  # which gives it its number, unless nobody listens
                self.sequence = image.header.seq or self.sequence

    def _run(self):
        step, due = 0, time.monotonic()
        while not rospy.is_shutdown():
            due = max(due + self.rate.step_s / self.speed, time.monotonic() - 1)
            time.sleep(max(0.0, due - time.monotonic()))
            with self.lock:
                if self.paused:
                    continue
                self.now_s += self.rate.step_s
                self.clock.publish(Clock(self.stamp()))
                step += 1
                if self.camera_on and step % self.rate.steps_per_image == 0:
                    self.publish_images()
