# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of the camera's images."""
import copy

import numpy as np
import rospy

from faults.rows import row
from faults.world import require
from nerf_pose_refiner.msg import RefinementStatus as Status


def changed(change):
    """Publishes each pair as `change` leaves it."""
    def alter(image, info):
        change(image, info)
        return [(image, info)]
    return alter


def shrink(image, picture_size=2):
    """Every second pixel."""
    picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)[::picture_size, ::picture_size]
    image.height, image.width = picture.shape[:2]
    image.step, image.data = 3 * image.width, picture.tobytes()


def refused_images(world, change, reason=Status.REASON_BAD_IMAGE, text=''):
    """While images are changed, the status says why they are refused; then all is as before."""
    with world.player.altered(changed(change)):
        world.expect(reason, text=text)
        world.expect_no_pose(0.5)
    world.expect_back()


BAD_IMAGE = '`REASON_BAD_IMAGE` within 1 s; right poses within 2 s after it'


@row('images of half the size, camera_info as before', '`REASON_BAD_CAMERA_INFO` within 1 s; right poses within 2 s '
     'after it', fast=True)
def size_without_info(world):
    refused_images(world, lambda image, info: shrink(image), Status.REASON_BAD_CAMERA_INFO)


@row('images and camera_info change to half the size and back', 'right poses all the time')
def size_with_info(world):
    def change(image, info):
        shrink(image)
        info.height, info.width = image.height, image.width
        info.K = [v / 2 for v in info.K[:8]] + [1]
        info.P = [v / 2 for v in info.P[:10]] + [1, 0]
    with world.player.altered(changed(change)):
        world.expect_right_poses(1.5)
    world.expect_back()


@row('half of the data is missing', BAD_IMAGE, fast=True)
def truncated_data(world):
    def change(image, _):
        image.data = image.data[:len(image.data) // 2]
    refused_images(world, change)


@row('no data at all', BAD_IMAGE)
def empty_data(world):
    def change(image, _):
        image.data = b''
    refused_images(world, change)


@row('images and camera_info of 0 x 0 pixels', 'refused with a reason within 1 s; right poses within 2 s after it')
def zero_size(world):
    def change(image, info):
        image.height = image.width = image.step = info.height = info.width = 0
        image.data = b''
    with world.player.altered(changed(change)):
        world.wait(0.5)
        require(world.watcher.last().reason != Status.REASON_NONE, 'nothing is said')
    world.expect_back()


@row('an encoding that nobody knows', BAD_IMAGE)
def unknown_encoding(world):
    refused_images(world, lambda image, _: setattr(image, 'encoding', 'no\x00such\xff'))


@row('an encoding that is not supported: 32FC1', BAD_IMAGE)
def unsupported_encoding(world):
    def change(image, _):
        image.encoding, image.width, image.step = '32FC1', image.width // 4 * 4, image.width // 4 * 16
    refused_images(world, change, reason=None)


@row('Bayer images', '`REASON_BAD_IMAGE`, which names image_proc, within 1 s; right poses within 2 s after it')
def bayer_encoding(world):
    def change(image, _):
        image.encoding, image.step = 'bayer_rggb8', image.width
        image.data = image.data[:image.width * image.height]
    refused_images(world, change, text='image_proc')


@row('a header of 4 x 10^9 pixels in a row, with the data of an image', BAD_IMAGE + '; no memory is taken for it')
def enormous_header(world):
    def change(image, info):
        image.width = info.width = 2**32 - 1
        image.height = info.height = 2**31
        image.step = 2**32 - 1
    refused_images(world, change, reason=None)


@row('a step shorter than a row', BAD_IMAGE)
def short_step(world):
    refused_images(world, lambda image, _: setattr(image, 'step', 1))


@row('200 images a second', 'tracking goes on', fast=True)
def two_hundred_hz(world):
    def alter(image, info):
        pairs = []
        for i in range(20):
            copies = copy.copy(image), copy.copy(info)
            for message in copies:
                message.header = copy.deepcopy(message.header)
                message.header.stamp += rospy.Duration.from_sec(i * 0.005)
            pairs.append(copies)
        return pairs
    with world.player.altered(alter):
        world.expect_right_poses(1.5)
    world.expect_back()


@row('the lens is covered: black images for 1 s', 'no pose; right poses within 2 s after it', fast=True)
def black(world):
    def change(image, _):
        image.data = bytes(len(image.data))
    with world.player.altered(changed(change), visible=False):
        world.wait(1)
    world.expect_back()


@row('noise for 1 s', 'no pose; right poses within 2 s after it')
def noise(world):
    random = np.random.default_rng(1)

    def change(image, _):
        image.data = random.integers(0, 256, len(image.data), np.uint8).tobytes()
    with world.player.altered(changed(change), visible=False):
        world.wait(1)
    world.expect_back()


@row('mirrored images for 1 s: seen from the front, the object looks nearly as its mirror image', 'no wrong pose with '
     '`trust_score` or more: what is tracked there has a lower score; right poses within 2 s after it')
def mirrored(world):
    def change(image, _):
        picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
        image.data = picture[:, ::-1].tobytes()
    with world.player.altered(changed(change), visible=False):
        world.wait(1)
    world.expect_back()
    world.excuse_doubtful_poses()


@row('no images for 3 s', '`REASON_NO_IMAGES` 1 s after `~image_timeout_s`; right poses within 2 s after it')
def no_images(world):
    world.player.camera_on = False
    try:
        world.expect(Status.REASON_NO_IMAGES, within=3.5)
    finally:
        world.player.camera_on = True
    world.expect_back()


@row('all images have the same stamp', 'the status says within 1 s that stamps stand still; right poses within 2 s '
     'after it', fast=True)
def equal_stamps(world):
    stamp = world.player.stamp()

    def change(image, info):
        image.header.stamp = info.header.stamp = stamp
    with world.player.altered(changed(change)):
        world.expect(text='stamp', within=2)
    world.expect_back()


@row('every second image is 0.3 s late', 'right poses of the others', setup='camera')
def late_images(world):
    def change(image, info):
        if world.player.position % 2:
            image.header.stamp = info.header.stamp = image.header.stamp - rospy.Duration.from_sec(0.3)
    with world.player.altered(changed(change)):
        world.expect_right_poses(1.5)
    world.expect_back()


def one_stamp_moved(world, seconds):
    """One image's stamp is wrong."""
    moved = []

    def change(image, info):
        if not moved:
            moved.append(True)
            image.header.stamp = info.header.stamp = image.header.stamp + rospy.Duration.from_sec(seconds)
    with world.player.altered(changed(change)):
        world.wait(0.3)
    world.expect_back()


@row('one image is stamped 2 s back', 'tracking goes on: right poses within 2 s', fast=True)
def one_stamp_back(world):
    one_stamp_moved(world, -2)


@row('one image is stamped a day ahead', 'tracking goes on: right poses within 2 s', fast=True)
def one_stamp_ahead(world):
    one_stamp_moved(world, 86400)


@row('images without a stamp for 0.5 s', 'no crash; right poses within 2 s after it, with a new initial pose')
def zero_stamps(world):
    def change(image, info):
        image.header.stamp = info.header.stamp = rospy.Time()
    with world.player.altered(changed(change)):
        world.wait(0.5)
    world.track()
    world.expect_back()


@row('the stamps of all images go back by an hour', '`REASON_CLOCK_JUMPED` within 1 s; right poses with a new '
     'initial pose')
def all_stamps_back(world):
    def change(image, info):
        image.header.stamp = info.header.stamp = image.header.stamp - rospy.Duration(3600)
    with world.player.altered(changed(change)):
        world.expect(Status.REASON_CLOCK_JUMPED)
    world.track()
    world.expect_back()


@row('the frame of the images changes', 'the status names the new frame within 1 s; right poses with a new initial '
     'pose', setup='camera')
def another_frame(world):
    def change(image, info):
        image.header.frame_id = info.header.frame_id = 'another_camera'
    with world.player.altered(changed(change)):
        world.expect(Status.REASON_RESET, text='another_camera')
    world.track()
    world.expect_back()


@row('an ignore_mask of another size than the images', '`REASON_BAD_MASK` within 1 s; right poses within 2 s after a '
     'good one')
def wrong_ignore_mask(world):
    mask = world.player.frame().messages(rospy.Time())[0]
    mask.encoding, mask.step, mask.data = 'mono8', mask.width, bytes(mask.width * mask.height)
    good = copy.copy(mask)
    mask.height, mask.data = mask.height // 2, mask.data[:mask.width * (mask.height // 2)]
    try:
        world.ignore_masks.publish(mask)
        world.expect(Status.REASON_BAD_MASK)
    finally:
        world.ignore_masks.publish(good)
    world.expect_back()


@row('an ignore_mask that covers the whole image', 'no pose; right poses within 2 s after an empty one')
def full_ignore_mask(world):
    mask = world.player.frame().messages(rospy.Time())[0]
    mask.encoding, mask.step, mask.data = 'mono8', mask.width, b'\xff' * (mask.width * mask.height)
    world.ignore_masks.publish(mask)
    world.wait(0.3)
    world.expect_no_pose(0.7)
    mask.data = bytes(mask.width * mask.height)
    world.ignore_masks.publish(mask)
    world.expect_back()
