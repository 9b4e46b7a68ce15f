# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of TF."""
import contextlib

import numpy as np
from tf2_msgs.msg import TFMessage

from faults.player import transform
from faults.rows import row
from nerf_pose_refiner.msg import RefinementStatus as Status


@contextlib.contextmanager
def without_tf(world):
    world.player.tf_on = False
    try:
        yield
    finally:
        world.player.tf_on = True


@row('no transform of the camera for 1 s', '`REASON_NO_TRANSFORM` within 1 s, no pose; right poses within 2 s after '
     'it')
def missing(world):
    with without_tf(world):
        world.expect(Status.REASON_NO_TRANSFORM)
        world.expect_no_pose(0.5)
    world.expect_back()


@row('transforms come 0.5 s late for 1 s', 'no wrong pose; right poses within 2 s after it')
def late(world):
    held = []

    def delay(image, info):
        T_W_C = np.linalg.inv(world.player.frame().T_C_O)
        held.append(transform(T_W_C, image.header.stamp, 'world', image.header.frame_id))
        if len(held) > 5:
            world.player.tf.publish(TFMessage([held.pop(0)]))
        return [(image, info)]
    with without_tf(world), world.player.altered(delay):
        world.wait(1)
    world.expect_back()


@row('the camera jumps by 1 m for 0.3 s', 'no wrong pose; right poses within 2 s after it')
def jump(world):
    world.player.tf_offset[0, 3] = 1
    world.wait(0.3)
    world.player.tf_offset[0, 3] = 0
    world.expect_back()


@row('NaN in a transform for 0.5 s', 'no wrong pose; right poses within 2 s after it')
def nan(world):
    world.player.tf_offset[0, 3] = float('nan')
    world.wait(0.5)
    world.player.tf_offset[0, 3] = 0
    world.expect_back()


@row('a quaternion of zeros in a transform for 0.5 s', 'no wrong pose; right poses within 2 s after it')
def zero_quaternion(world):
    def spoil(image, info):
        message = transform(np.eye(4), image.header.stamp, 'world', image.header.frame_id)
        message.transform.rotation.w = 0
        world.player.tf.publish(TFMessage([message]))
        return [(image, info)]
    with without_tf(world), world.player.altered(spoil):
        world.wait(0.5)
    world.expect_back()
