# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of the clock."""
import time

from faults.rows import row
from nerf_pose_refiner.msg import RefinementStatus as Status


@row('clock and images go back by 10 s, as in a bag that loops', '`REASON_CLOCK_JUMPED` within 1 s; right poses with a '
     'new initial pose', fast=True)
def loop(world):
    world.player.jump(-10)
    world.expect(Status.REASON_CLOCK_JUMPED)
    world.track()
    world.expect_back()


@row('the initial pose at the start of a bag that loops comes before the clock has jumped', 'right poses within 2 s',
     setup='camera')
def loop_with_initial_pose(world):
    with world.player.lock:
        pose = world.player.frame().initial_pose(world.player.stamp(-10))
        world.initial_poses.publish(pose)
        time.sleep(0.2)  # the image before the jump is refined with it
        world.player.publish_images()
        time.sleep(0.2)
        world.player.jump(-10)
    world.expect_back()


@row('the clock stands for 3 s', 'right poses within 2 s after it')
def pause(world):
    world.player.paused = True
    time.sleep(3)
    world.player.paused = False
    world.expect_back()


@row('the clock jumps ahead by an hour', '`REASON_NO_IMAGES`, or tracking goes on; right poses with a new initial pose')
def ahead(world):
    world.player.jump(3600)
    world.wait(0.5)
    world.track()
    world.expect_back()


@row('a simulator is reset: the clock begins at 0 again', '`REASON_CLOCK_JUMPED` within 1 s; right poses with a new '
     'initial pose')
def reset(world):
    now_s = world.player.now_s
    world.player.jump(-now_s)
    world.expect(Status.REASON_CLOCK_JUMPED)
    world.track()
    world.expect_back()
    world.player.jump(now_s)
    world.wait(0.5)
    world.track()
