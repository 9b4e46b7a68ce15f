# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What is printed and lies in the scene to give scale and frame: a ChArUco board, or AprilTags. What --board names."""
from photos import apriltags, board
from photos.scale import scale_from_board


def parse_target(text):
    return apriltags.parse_tags(text) if apriltags.is_tags(text) else board.parse_board(text)


def find_corners(target, image):
    """{number: (x, y)} [px from the image's corner] of what is seen of it."""
    return (apriltags.find_tags if isinstance(target, apriltags.Tags) else board.find_corners)(target, image)


def scale_from_target(reconstruction, corners, target):
    """@param corners [(photo, {number: xy})]. @return Scale, whose frame is the target's."""
    if isinstance(target, apriltags.Tags):
        return apriltags.scale_from_tags(reconstruction, corners, target)
    return scale_from_board(reconstruction, corners, board.corner_points(target))
