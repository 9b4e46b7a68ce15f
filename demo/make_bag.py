#!/usr/bin/python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Packs a rendered sequence into a ROS bag, or takes the truth out of such a bag.

    make_bag.py pack SEQUENCE_DIR --object object.json --out demo.bag
    make_bag.py strip IN.bag OUT.bag

T_A_B takes points from frame B to frame A. C: camera_optical (x right, y down, z forward), O: the object.
"""
import argparse
import json
import os
import sys

import cv2
import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import PoseStamped, TransformStamped
from sensor_msgs.msg import CameraInfo, CompressedImage
from tf2_msgs.msg import TFMessage

CAMERA_FRAME = "camera_optical"
TRUTH_FRAME = "ground_truth_object"
IMAGE_TOPIC = "/camera/image/compressed"
INFO_TOPIC = "/camera/camera_info"
START_TOPIC = "/initial_pose"
TRUTH_TOPIC = "/ground_truth/object_pose"
TRUTH_TOPICS = (TRUTH_TOPIC, "/tf")
FIRST_STAMP_S = 1700000000
START_LEAD_S = 0.01  # the initial pose is recorded this long before the image that it belongs to


def rotation(axis_angle):
    return cv2.Rodrigues(np.asarray(axis_angle, float))[0]


def quaternion(R):
    """x, y, z, w of a rotation, by its matrix's largest diagonal term: exact for every angle."""
    K = np.array([[R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
                  [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
                  [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
                  [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)]]) / 3
    q = np.linalg.eigh(K)[1][:, -1]  # eigh reads the lower triangle
    return q if q[3] >= 0 else -q


def perturbed(T_C_O, centre_O, diameter, seed):
    """A start as a detector would give it: turned by 10..15 degrees about the object's centre and moved by
    10..15 % of its diameter, both in directions drawn at random."""
    random = np.random.RandomState(seed)
    axis, direction = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
    turn_deg, share = random.uniform(10, 15), random.uniform(0.10, 0.15)
    centre_C = T_C_O[:3, :3] @ centre_O + T_C_O[:3, 3]
    start = np.eye(4)
    start[:3, :3] = rotation(axis * np.radians(turn_deg)) @ T_C_O[:3, :3]
    start[:3, 3] = centre_C + share * diameter * direction - start[:3, :3] @ centre_O
    print("initial pose: off by %.1f deg and %.1f %% of the diameter" % (turn_deg, 100 * share))
    return start


def stamped(message, stamp, frame=CAMERA_FRAME):
    message.header.stamp, message.header.frame_id = stamp, frame
    return message


def pose_message(T_C_O, stamp):
    message = stamped(PoseStamped(), stamp)
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = (float(v) for v in T_C_O[:3, 3])
    orientation.x, orientation.y, orientation.z, orientation.w = (float(v) for v in quaternion(T_C_O[:3, :3]))
    return message


def transform_message(pose):
    transform = stamped(TransformStamped(), pose.header.stamp)
    transform.child_frame_id = TRUTH_FRAME
    transform.transform.rotation = pose.pose.orientation
    translation, position = transform.transform.translation, pose.pose.position
    translation.x, translation.y, translation.z = position.x, position.y, position.z
    return TFMessage([transform])


def info_message(sequence, stamp):
    fx, fy, cx, cy = (sequence[k] for k in ("fx", "fy", "cx", "cy"))
    message = stamped(CameraInfo(), stamp)
    message.width, message.height = sequence["width"], sequence["height"]
    message.distortion_model, message.D = "plumb_bob", [0.0] * 5
    message.K = [fx, 0, cx, 0, fy, cy, 0, 0, 1]
    message.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    message.P = [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]
    return message


def image_message(path, stamp, quality):
    picture = cv2.imread(path)
    if picture is None:
        sys.exit("make_bag: cannot read %s" % path)
    message = stamped(CompressedImage(), stamp)
    message.format = "bgr8; jpeg compressed bgr8"
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    message.data = cv2.imencode(".jpg", picture, options)[1].tobytes()
    return message


def pack(args):
    with open(os.path.join(args.sequence, "sequence.json")) as file:
        sequence = json.load(file)
    with open(args.object) as file:
        model = json.load(file)
    centre_O = np.mean(model["bounding_box"], axis=0)
    with rosbag.Bag(args.out, "w") as bag:
        for i, frame in enumerate(sequence["frames"]):
            T_C_O = np.array(frame["T_C_O"])
            stamp = rospy.Time(FIRST_STAMP_S) + rospy.Duration.from_sec(frame["index"] / sequence["rate_hz"])
            if i == 0:
                start = perturbed(T_C_O, centre_O, model["diameter"], args.seed)
                bag.write(START_TOPIC, pose_message(start, stamp), stamp - rospy.Duration.from_sec(START_LEAD_S))
            picture = os.path.join(args.sequence, "frames", "frame_%03d.png" % frame["index"])
            bag.write(INFO_TOPIC, info_message(sequence, stamp), stamp)
            bag.write(IMAGE_TOPIC, image_message(picture, stamp, args.quality), stamp)
            if not args.without_truth:
                truth = pose_message(T_C_O, stamp)
                bag.write(TRUTH_TOPIC, truth, stamp)
                bag.write("/tf", transform_message(truth), stamp)
    print("%s: %d frames, %.2f MiB" % (args.out, len(sequence["frames"]), os.path.getsize(args.out) / 2**20))


def strip(args):
    with rosbag.Bag(args.bag) as full, rosbag.Bag(args.out, "w") as bag:
        for topic, message, stamp in full.read_messages():
            if topic not in TRUTH_TOPICS:
                bag.write(topic, message, stamp)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    packing = commands.add_parser("pack", help="frames to a bag")
    packing.add_argument("sequence", help="folder that render.py wrote")
    packing.add_argument("--object", required=True, help="object.json, beside the training views")
    packing.add_argument("--out", required=True, help="bag to write")
    packing.add_argument("--quality", type=int, default=89, help="of the JPEGs, 1..100")
    packing.add_argument("--seed", type=int, default=7, help="of the initial pose")
    packing.add_argument("--without-truth", action="store_true", help="leave out " + " and ".join(TRUTH_TOPICS))
    packing.set_defaults(act=pack)
    stripping = commands.add_parser("strip", help="copy a bag without " + " and ".join(TRUTH_TOPICS))
    stripping.add_argument("bag")
    stripping.add_argument("out")
    stripping.set_defaults(act=strip)
    args = parser.parse_args()
    args.act(args)


if __name__ == "__main__":
    main()
