# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of processes."""
import os
import signal
import subprocess
import time

import rosgraph

from faults.graph import NODE, program, stop, wait_until
from faults.rows import row
from faults.world import require


@row('the process is killed (kill -9) while it tracks, and starts again', 'right poses with a new initial pose',
     restarts=True)
def killed(world):
    world.kill()
    world.start('world')
    world.ready()
    world.track()
    world.expect_back()


@row('SIGINT while it tracks', 'the process ends within 5 s with exit code 0', restarts=True)
def terminated(world):
    world.graph.node.send_signal(signal.SIGINT)
    code = world.graph.node.wait(5 * world.patience)
    require(code == 0, 'exit code %d' % code)
    world.start('world')
    world.ready()
    world.track()


@row('SIGINT while it loads its model', 'the process ends within 5 s', restarts=True)
def interrupted(world):
    world.start('world')
    wait_until(lambda: NODE in rosgraph.Master('faults').getSystemState()[0].__str__(), 10)
    world.graph.node.send_signal(signal.SIGINT)
    try:
        world.graph.node.wait(5 * world.patience)
    except subprocess.TimeoutExpired:
        require(False, 'the process does not end')
    world.setup = None


@row('the process stands still for 3 s (SIGSTOP)', 'right poses within 2 s after it, or with a new initial pose')
def stopped(world):
    world.graph.node.send_signal(signal.SIGSTOP)
    time.sleep(3)
    world.graph.node.send_signal(signal.SIGCONT)
    world.track()
    world.expect_back()


@row('a subscriber of the overlay does not read for 3 s', 'tracking goes on; its images do not pile up')
def slow_subscriber(world):
    echo = world.graph.run('echo', [program('rostopic', 'rostopic'), 'echo', '--noarr', NODE + '/overlay/image_raw'])
    try:
        time.sleep(1)
        echo.send_signal(signal.SIGSTOP)
        world.expect_right_poses(3)
    finally:
        echo.send_signal(signal.SIGCONT)
        stop(echo, signal.SIGKILL)
    world.expect_back()


@row('a subscriber is killed (kill -9) while it receives, ten times', 'tracking goes on')
def killed_subscribers(world):
    for _ in range(3):
        echoes = [world.graph.run('echo%d' % i, [program('rostopic', 'rostopic'), 'echo', NODE + '/status'])
                  for i in range(3)]
        time.sleep(1)
        for echo in echoes:
            stop(echo, signal.SIGKILL)
    world.expect_back()


@row('a second refiner publishes the same TF frame', 'a warning that names the frame within 5 s; tracking goes on')
def same_tf_frame(world):
    second = world.graph.run('second', [program('nerf_pose_refiner', 'pose_refiner'), '__name:=second',
                                        'image:=camera/image', 'second/initial_pose:=pose_refiner/initial_pose',
                                        '_object:=toy_kiosk', '_model_root:=' + world.models])
    try:
        def warned():
            world.send_initial_pose()
            time.sleep(0.3)
            return any('toy_kiosk' in line and 'also published' in line
                       for name in ('node', 'second', 'manager') if os.path.exists(world.graph.log_of(name))
                       for line in open(world.graph.log_of(name), encoding='utf-8', errors='replace'))
        require(wait_until(warned, 10 * world.patience), 'no warning')
    finally:
        stop(second)
    world.expect_back()


@row('two nodes with one `~model_root`', 'both list its models; tracking goes on')
def same_model_root(world):
    second = world.graph.run('second', [program('nerf_pose_refiner', 'pose_refiner'), '__name:=second',
                                        'image:=nothing', '_publish_tf:=false', '_object:=toy_kiosk',
                                        '_model_root:=' + world.models])
    try:
        listed = world.objects()
        require(any(o.name == 'toy_kiosk' and o.tracked for o in listed.objects), 'the object is not listed')
        world.expect_right_poses()
    finally:
        stop(second)
    world.expect_back()


@row('the master ends', 'tracking goes on: connections that exist need no master', last=True)
def master_ends(world):
    stop(world.graph.master)
    world.expect_right_poses(2)


@row('the master starts again, empty', 'tracking goes on; what connects later does not find the node, which must be '
     'restarted (a limit of ROS 1)', last=True)
def master_restarts(world):
    stop(world.graph.master)
    world.graph.start_master()
    world.expect_right_poses(2)
    require(rosgraph.Master('faults').getSystemState()[2] == [], 'the node has registered again: mend the statement')
