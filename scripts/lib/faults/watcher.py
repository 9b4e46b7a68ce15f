# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What the node says, and whether its poses are right."""
import threading
import time
from collections import namedtuple

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped

from faults.graph import NODE
from faults.recording import matrix
from nerf_pose_refiner.msg import RefinementStatus

# A pose is right within these: what the score is the probability of.
RIGHT_DEG, RIGHT_DIAMETERS = 5.0, 0.05

# `at`: time.monotonic() of the arrival.
Judged = namedtuple('Judged', 'stamp_ns right text at')

STATES = {value: name for name, value in vars(RefinementStatus).items() if name.startswith('STATE_')}
REASONS = {value: name for name, value in vars(RefinementStatus).items() if name.startswith('REASON_')}


def in_words(status):
    """A status on one line."""
    if status is None:
        return 'none'
    return '%s %s "%s"' % (STATES[status.state], REASONS[status.reason], status.message)


class Watcher:
    """Gathers statuses, poses and diagnostics. Callbacks run in rospy's threads."""

    def __init__(self, player, target):
        self.player = player
        self.target = target
        self.changed = threading.Condition()  # guards all below
        self.statuses = []  # (status, time.monotonic() of the arrival)
        self.poses = []  # Judged
        self.diagnostics = {}  # name -> DiagnosticStatus
        rospy.Subscriber(NODE + '/status', RefinementStatus, self.on_status)
        rospy.Subscriber(NODE + '/pose', PoseStamped, self.on_pose)
        rospy.Subscriber('/diagnostics', DiagnosticArray, self.on_diagnostics)

    def on_status(self, message):
        with self.changed:
            self.statuses.append((message, time.monotonic()))
            self.changed.notify_all()

    def on_diagnostics(self, message):
        with self.changed:
            for status in message.status:
                self.diagnostics[status.name.split(': ')[-1]] = (status, time.monotonic())
            self.changed.notify_all()

    def on_pose(self, message):
        stamp_ns = message.header.stamp.to_nsec()
        with self.player.lock:
            frame, tf_offset = self.player.shown.get(stamp_ns, (None, None))
        right, text = False, 'no object was in the image'
        if frame is not None:
            T_C_O = matrix(message.pose)
            if message.header.frame_id == 'world':  # the object's true frame
                T_C_O = frame.T_C_O @ np.linalg.inv(tf_offset) @ T_C_O
            degrees, diameters, _ = self.target.errors(T_C_O, frame.T_C_O)
            right = degrees <= RIGHT_DEG and diameters <= RIGHT_DIAMETERS
            text = '%.1f degrees, %.1f %% of the diameter' % (degrees, 100 * diameters)
        with self.changed:
            self.poses.append(Judged(stamp_ns, right, text, time.monotonic()))
            self.changed.notify_all()

    def last(self):
        """The newest status, or None."""
        with self.changed:
            return self.statuses[-1][0] if self.statuses else None

    def wait(self, condition, timeout_s):
        """@param condition called with the watcher's lock held. @return whether it held in time."""
        with self.changed:
            return self.changed.wait_for(condition, timeout_s)

    def forget(self):
        """Starts anew, for the next row."""
        with self.changed:
            self.statuses, self.poses, self.diagnostics = self.statuses[-1:], [], {}
