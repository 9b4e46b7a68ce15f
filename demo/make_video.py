#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Writes the images of a bag into a video, for programs that know no ROS (docs/cpp.md)."""
import argparse

import cv2
import numpy as np
import rosbag


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bag')
    parser.add_argument('video', help='.mp4')
    parser.add_argument('--topic', default='/camera/image/compressed')
    parser.add_argument('--rate', type=float, default=10, help='images a second')
    arguments = parser.parse_args()
    writer = None
    with rosbag.Bag(arguments.bag) as bag:
        for _, message, _ in bag.read_messages(topics=[arguments.topic]):
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
            if writer is None:
                writer = cv2.VideoWriter(arguments.video, cv2.VideoWriter_fourcc(*'mp4v'), arguments.rate,
                                         (image.shape[1], image.shape[0]))
            writer.write(image)
    if writer is None:
        raise SystemExit(f'{arguments.bag}: no images on {arguments.topic}')
    writer.release()


if __name__ == '__main__':
    main()
