# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""AprilTags (Olson 2011) in the scene: tags of one known size, lying anywhere. All of them give the scale, the first one
the frame: origin in its middle, x along its upper edge, y up, z out of the paper."""
import collections
import re

import cv2
import numpy as np

from photos.board import aruco_dictionary
from photos.common import InputError, count, require
from photos.geometry import similarity
from photos.scale import Scale, corner_points

# Tags of `size_mm` (the black square's side) of one of OpenCV's families; `numbers`: which of them count, the first one
# having the frame.
Tags = collections.namedtuple('Tags', 'family size_mm numbers')

EXAMPLE = 'apriltag:36h11:40:0,1'
FAMILIES = ('16h5', '25h9', '36h10', '36h11')
SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))
MAX_UNLIKE = 0.05    # of the size: tags of more different sides are not of one size


def is_tags(text):
    return text.startswith('apriltag:')


def parse_tags(text):
    """'apriltag:FAMILY:SIZE_MM:NUMBER,NUMBER..'"""
    match = re.fullmatch(r'apriltag:(\w+):([\d.]+):(\d+(?:,\d+)*)', text)
    try:
        tags = Tags(match[1], float(match[2]), [int(number) for number in match[3].split(',')])
    except (TypeError, ValueError) as error:
        raise InputError(f"'{text}' names no tags: write them as {EXAMPLE} (family, side of the black square [mm], numbers, "
                         'the first one having the frame)') from error
    require(hasattr(cv2, 'aruco'), 'this OpenCV has no aruco module: install python3-opencv')
    require(tags.family in FAMILIES, f"'{text}': the families are {', '.join(FAMILIES)}")
    require(tags.size_mm > 0, f"'{text}': the size is not positive")
    limit = aruco_dictionary('APRILTAG_' + tags.family).bytesList.shape[0]
    require(max(tags.numbers) < limit, f"'{text}': {tags.family} has the numbers 0 to {limit - 1}")
    return tags


def tag_points(tags):
    """{4 * number + i: corner of the first tag in its frame [m]}, clockwise from the upper left."""
    half = tags.size_mm / 2000
    corners = ((-half, half), (half, half), (half, -half), (-half, -half))
    return {4 * tags.numbers[0] + i: np.array([x, y, 0.0]) for i, (x, y) in enumerate(corners)}


def find_tags(tags, image):
    """{4 * number + i: (x, y)} [px from the image's corner] of the corners that are seen."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    dictionary = aruco_dictionary('APRILTAG_' + tags.family)
    made = getattr(cv2.aruco, 'DetectorParameters_create', None) or cv2.aruco.DetectorParameters
    parameters = made()
    # Lines are fitted to the sides, ten times as exact as corners alone. It counts pixels from the image's corner.
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    if hasattr(cv2.aruco, 'ArucoDetector'):
        quads, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(grey)
    else:
        quads, numbers, _ = cv2.aruco.detectMarkers(grey, dictionary, parameters=parameters)
    return {4 * number + i: tuple(corner) for number, quad in zip([] if numbers is None else numbers.ravel().tolist(), quads)
            if number in tags.numbers for i, corner in enumerate(quad[0].astype(float).tolist())}


def measured_sides(points, numbers):
    """Lengths of the sides of all tags whose corners are known. @param points {4 * number + i: point}"""
    return np.array([np.linalg.norm(points[4 * number + a] - points[4 * number + b]) for number in numbers
                     for a, b in SIDES if 4 * number + a in points and 4 * number + b in points])


def scale_from_tags(reconstruction, corners, tags):
    """@param corners [(photo, {number: xy})]. @return Scale. @throws InputError if the tags are not seen enough, or are of
    other sizes."""
    found = corner_points(reconstruction, corners)
    first = tag_points(tags)
    require(all(number in found for number in first),
            f'the tag {tags.numbers[0]} was not found in three photos with a pose (tags in '
            f'{count(len(corners), "photo")}): is it of the family {tags.family}, sharp, with its white border?')
    sides = measured_sides(found, tags.numbers)
    unlike = float(np.ptp(sides) / np.median(sides))
    require(unlike < MAX_UNLIKE, f'the sides of the tags differ by {100 * unlike:.0f} %: they are not all of one size, or '
            'were moved or bent')
    scale = tags.size_mm / 1000 / float(np.mean(sides))
    numbers = sorted(first)
    _, R, _ = similarity(np.array([found[number] for number in numbers]), np.array([first[number] for number in numbers]))
    middle = np.mean([found[number] for number in numbers], axis=0)
    sigma = float(np.std(sides) / np.mean(sides) / np.sqrt(len(sides)))
    return Scale(scale, sigma, R, -scale * R @ middle, len(found))
