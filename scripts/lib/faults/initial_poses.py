# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of initial poses."""
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped

from faults.graph import of_process
from faults.rows import row
from faults.world import require
from nerf_pose_refiner.msg import RefinementStatus as Status


def refused_pose(world, change, reason):
    """An initial pose that `change` spoils is refused; a good one is used then."""
    world.reset()
    pose = world.player.frame().initial_pose(world.player.stamp())
    change(pose)
    world.initial_poses.publish(pose)
    world.expect(reason)
    world.track()
    world.expect_back()


def said(name):
    return '`%s` within 1 s; a good one is used then' % name


@row('NaN in the position', said('REASON_PRIOR_NOT_FINITE'), fast=True)
def nan_pose(world):
    refused_pose(world, lambda pose: setattr(pose.pose.position, 'x', float('nan')), Status.REASON_PRIOR_NOT_FINITE)


@row('infinity in the quaternion', said('REASON_PRIOR_NOT_FINITE'))
def infinite_quaternion(world):
    refused_pose(world, lambda pose: setattr(pose.pose.orientation, 'w', float('inf')),
                 Status.REASON_PRIOR_NOT_FINITE)


@row('a quaternion of zeros', said('REASON_PRIOR_NOT_UNIT'))
def zero_quaternion(world):
    def change(pose):
        q = pose.pose.orientation
        q.x = q.y = q.z = q.w = 0.0
    refused_pose(world, change, Status.REASON_PRIOR_NOT_UNIT)


@row('a frame that TF does not know', said('REASON_PRIOR_NO_FRAME'))
def unknown_frame(world):
    refused_pose(world, lambda pose: setattr(pose.header, 'frame_id', 'no_such_frame'), Status.REASON_PRIOR_NO_FRAME)


@row('a header without a frame', said('REASON_PRIOR_NO_FRAME'))
def no_frame(world):
    refused_pose(world, lambda pose: setattr(pose.header, 'frame_id', ''), Status.REASON_PRIOR_NO_FRAME)


@row('an hour old', said('REASON_PRIOR_TOO_OLD'))
def too_old(world):
    def change(pose):
        pose.header.stamp -= rospy.Duration(3600)
    refused_pose(world, change, Status.REASON_PRIOR_TOO_OLD)


@row('an hour ahead', said('REASON_PRIOR_IN_FUTURE'))
def in_future(world):
    def change(pose):
        pose.header.stamp += rospy.Duration(3600)
    refused_pose(world, change, Status.REASON_PRIOR_IN_FUTURE)


def far(metres):
    def provoke(world):
        world.reset()
        before = of_process(world.pid(), 'VmHWM')
        pose = world.player.frame().initial_pose(world.player.stamp())
        pose.pose.position.x = metres
        world.initial_poses.publish(pose)
        world.expect(Status.REASON_NO_OVERLAP, within=2)
        world.expect_no_pose(0.5)
        taken = (of_process(world.pid(), 'VmHWM') - before) / 1024
        require(taken < 100, 'the node has taken %.0f MiB' % taken)
        world.track()
        world.expect_back()
    return provoke


@row('10 m beside the image', '`REASON_NO_OVERLAP` within 2 s; a good one is used then')
def outside(world):
    far(10.0)(world)


@row('10^200 m away', '`REASON_NO_OVERLAP` within 2 s, without taking memory; a good one is used then')
def out_of_this_world(world):
    far(1e200)(world)


@row('20 cm beside the object', 'no wrong pose; right poses within 2 s after a good one', setup='camera')
def beside(world):
    world.reset()
    pose = world.player.frame().initial_pose(world.player.stamp())
    pose.pose.position.x += 0.2
    world.initial_poses.publish(pose)
    world.wait(1)
    world.track()
    world.expect_back()


@row('turned by half a turn', 'no wrong pose; right poses within 2 s after a good one', setup='camera')
def turned(world):
    world.reset()
    pose = world.player.frame().initial_pose(world.player.stamp())
    q = pose.pose.orientation
    q.x, q.y, q.z, q.w = -q.y, q.x, q.w, -q.z
    world.initial_poses.publish(pose)
    world.wait(1)
    world.reset()
    world.track()
    world.expect_back()


def covariance(change, reason):
    def provoke(world):
        world.reset()
        good = world.player.frame().initial_pose(world.player.stamp())
        pose = PoseWithCovarianceStamped(header=good.header)
        pose.pose.pose = good.pose
        pose.pose.covariance = [0.0] * 36
        change(pose.pose.covariance)
        world.initial_poses_with_covariance.publish(pose)
        world.expect(reason)
        world.track()
        world.expect_back()
    return provoke


@row('a negative variance', said('REASON_PRIOR_BAD_COVARIANCE'))
def negative_variance(world):
    covariance(lambda c: c.__setitem__(0, -1.0), Status.REASON_PRIOR_BAD_COVARIANCE)(world)


@row('a variance of 10^300', said('REASON_PRIOR_BAD_COVARIANCE'))
def vast_variance(world):
    covariance(lambda c: c.__setitem__(0, 1e300), Status.REASON_PRIOR_BAD_COVARIANCE)(world)


@row('1000 of them in a second while the object is tracked', 'tracking goes on')
def flood(world):
    for _ in range(1000):
        world.send_initial_pose()
    world.expect_back()
