# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of camera_info."""
import rospy

from faults.images import changed, refused_images
from faults.rows import row
from nerf_pose_refiner.msg import RefinementStatus as Status

REFUSED = 'refused with a reason within 1 s; right poses within 2 s after it'


@row('camera_info without intrinsics', '`REASON_UNCALIBRATED` within 1 s; right poses within 2 s after it', fast=True)
def uncalibrated(world):
    refused_images(world, lambda _, info: setattr(info, 'K', [0.0] * 9), Status.REASON_UNCALIBRATED)


@row('NaN in the intrinsics', REFUSED)
def nan_intrinsics(world):
    refused_images(world, lambda _, info: setattr(info, 'K', [float('nan')] * 9), reason=None)


@row('NaN in the distortion', REFUSED)
def nan_distortion(world):
    refused_images(world, lambda _, info: setattr(info, 'D', [float('nan')] * 5), reason=None)


@row('a distortion model that nobody knows', '`REASON_BAD_CAMERA_INFO` within 1 s; right poses within 2 s after it')
def unknown_distortion(world):
    def change(_, info):
        info.distortion_model, info.D = 'no_such_model', [0.1] * 5
    refused_images(world, change, Status.REASON_BAD_CAMERA_INFO)


@row('two coefficients of distortion where the model has five', '`REASON_BAD_CAMERA_INFO` within 1 s; right poses '
     'within 2 s after it')
def short_distortion(world):
    def change(_, info):
        info.distortion_model, info.D = 'plumb_bob', [0.1] * 2
    refused_images(world, change, Status.REASON_BAD_CAMERA_INFO)


def focal_length(factor):
    def change(_, info):
        info.K = [info.K[0] * factor, 0, info.K[2], 0, info.K[4] * factor, info.K[5], 0, 0, 1]
    return change


BAD_CAMERA_INFO = '`REASON_BAD_CAMERA_INFO` within 1 s; right poses within 2 s after it'


@row('focal length 10^-6 of the true one', BAD_CAMERA_INFO)
def tiny_focal_length(world):
    refused_images(world, focal_length(1e-6), Status.REASON_BAD_CAMERA_INFO, text='focal length')


@row('focal length 10^9 times the true one', BAD_CAMERA_INFO)
def vast_focal_length(world):
    refused_images(world, focal_length(1e9), Status.REASON_BAD_CAMERA_INFO, text='focal length')


@row('focal length 200 times the true one for 1 s, as of a telescope', 'no wrong pose; right poses within 2 s after it, '
     'with a new initial pose')
def long_focal_length(world):
    with world.player.altered(changed(focal_length(200)), visible=False):
        world.wait(1)
    world.track()
    world.expect_back()


@row('a distortion that folds the image', 'no pose, or right ones; right poses within 2 s after it')
def vast_distortion(world):
    with world.player.altered(changed(lambda _, info: setattr(info, 'D', [1e6, -1e6, 1e3, 1e3, 1e6])), visible=False):
        world.wait(1)
    world.expect_back()


@row('binning and a region of interest that do not fit the image', REFUSED)
def bad_region(world):
    def change(_, info):
        info.binning_x = info.binning_y = 2**32 - 1
        info.roi.width = info.roi.height = info.roi.x_offset = 2**32 - 1
    refused_images(world, change, reason=None)


@row('no camera_info for 3 s', 'the status says within 3 s that it is missing; right poses within 2 s after it',
     fast=True)
def no_camera_info(world):
    with world.player.altered(lambda image, _: [(image, None)]):
        world.expect(text='camera_info', within=3.5)
    world.expect_back()


@row('camera_info with other stamps than the images for 3 s', 'the status says so within 3 s; right poses within 2 s '
     'after it')
def other_stamps(world):
    def change(_, info):
        info.header.stamp += rospy.Duration.from_sec(0.003)
    with world.player.altered(changed(change)):
        world.expect(text='camera_info', within=3.5)
    world.expect_back()
