#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The message that the node reads without its package is vision_msgs/Detection2DArray, byte for byte. Here its Python class
is made from the fields of the definitions of vision_msgs 0.0.1 (ROS 1), of which detections.hex is an instance."""
import io
import os
import re
import unittest

from genpy.dynamic import generate_dynamic

HERE = os.path.dirname(os.path.abspath(__file__))
HEADER = os.path.join(HERE, '..', '..', 'src', 'ros', 'conversions', 'detection_boxes.h')
NAME = 'vision_msgs/Detection2DArray'
PARTS = {
    'vision_msgs/Detection2D': 'Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n'
                               'vision_msgs/BoundingBox2D bbox\nsensor_msgs/Image source_img',
    'vision_msgs/ObjectHypothesisWithPose': 'int64 id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose',
    'vision_msgs/BoundingBox2D': 'geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y',
    'std_msgs/Header': 'uint32 seq\ntime stamp\nstring frame_id',
    'geometry_msgs/Pose2D': 'float64 x\nfloat64 y\nfloat64 theta',
    'geometry_msgs/PoseWithCovariance': 'geometry_msgs/Pose pose\nfloat64[36] covariance',
    'geometry_msgs/Pose': 'geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation',
    'geometry_msgs/Point': 'float64 x\nfloat64 y\nfloat64 z',
    'geometry_msgs/Quaternion': 'float64 x\nfloat64 y\nfloat64 z\nfloat64 w',
    'sensor_msgs/Image': 'Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n'
                         'uint8[] data'}


def classes():
    text = 'Header header\nvision_msgs/Detection2D[] detections\n'
    for name, fields in PARTS.items():
        text += '=' * 80 + f'\nMSG: {name}\n{fields}\n'
    return generate_dynamic(NAME, text)


def example():
    """Two boxes; what test_detection_boxes.cpp expects of them."""
    made = classes()
    array = made[NAME]()
    array.header.seq, array.header.frame_id = 7, 'camera_optical'
    array.header.stamp.secs, array.header.stamp.nsecs = 12, 500
    for centre, size, hypotheses in (((40.5, 30), (20, 10), [(3, 0.5), (5, 0.25)]), ((60, 48.25), (12, 16), [(5, 0.75)])):
        box = made['vision_msgs/Detection2D']()
        box.header.frame_id = 'own'
        box.bbox.center.x, box.bbox.center.y = centre
        box.bbox.size_x, box.bbox.size_y = size
        for number, score in hypotheses:
            one = made['vision_msgs/ObjectHypothesisWithPose']()
            one.id, one.score = number, score
            box.results.append(one)
        box.source_img.encoding, box.source_img.data = 'mono8', bytes(range(9))
        box.source_img.width = box.source_img.height = box.source_img.step = 3
        array.detections.append(box)
    return array


class DetectionDefinition(unittest.TestCase):
    def test_sum_of_the_definition(self):
        with open(HEADER, encoding='utf-8') as f:
            text = f.read()
        self.assertEqual(re.search(r'"([0-9a-f]{32})"', text).group(1), classes()[NAME]._md5sum)
        self.assertIn(f'"{NAME}"', text)

    def test_bytes_of_the_example(self):
        written = io.BytesIO()
        example().serialize(written)
        with open(os.path.join(HERE, 'detections.hex'), encoding='ascii') as f:
            self.assertEqual(f.read().split(), [written.getvalue().hex()])


if __name__ == '__main__':
    unittest.main()
