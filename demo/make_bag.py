#!/usr/bin/python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Packs a rendered sequence into a ROS bag and its further cameras into another, joins bags, or takes the truth out.

    make_bag.py pack SEQUENCE_DIR --object object.json --out demo.bag
    make_bag.py companions IN.bag COMPANIONS_DIR OUT.bag
    make_bag.py join IN.bag COMPANIONS.bag OUT.bag
    make_bag.py strip IN.bag OUT.bag

T_A_B takes points from frame B to frame A. C: camera_optical (x right, y down, z forward), O: the object, R: room,
D: depth_optical, S: side_camera_optical.
"""
import argparse
import heapq
import json
import os
import sys

import cv2
import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import PoseStamped, TransformStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage

from depth_sensor import measured_mm

CAMERA_FRAME = "camera_optical"
DEPTH_FRAME = "depth_optical"
SIDE_FRAME = "side_camera_optical"
ROOM_FRAME = "room"
TRUTH_FRAME = "ground_truth_object"
IMAGE_TOPIC = "/camera/image/compressed"
INFO_TOPIC = "/camera/camera_info"
DEPTH_TOPIC = "/camera/depth/image"
DEPTH_INFO_TOPIC = "/camera/depth/camera_info"
SIDE_TOPIC = "/side_camera/image/compressed"
SIDE_INFO_TOPIC = "/side_camera/camera_info"
START_TOPIC = "/initial_pose"
TRUTH_TOPIC = "/ground_truth/object_pose"
TF_TOPIC = "/tf"
TRUTH = "%s and the frame %s" % (TRUTH_TOPIC, TRUTH_FRAME)
FIRST_STAMP_S = 1700000000
START_LEAD_S = 0.01  # the initial pose is recorded this long before the image that it belongs to
PLACE_LEAD_S = 0.005  # and so are the cameras' places


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


def pose_message(T_C_O, stamp, frame=CAMERA_FRAME):
    message = stamped(PoseStamped(), stamp, frame)
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = (float(v) for v in T_C_O[:3, 3])
    orientation.x, orientation.y, orientation.z, orientation.w = (float(v) for v in quaternion(T_C_O[:3, :3]))
    return message


def transform(pose, child):
    """@param pose a PoseStamped in the parent frame"""
    message = stamped(TransformStamped(), pose.header.stamp, pose.header.frame_id)
    message.child_frame_id = child
    message.transform.rotation = pose.pose.orientation
    translation, position = message.transform.translation, pose.pose.position
    translation.x, translation.y, translation.z = position.x, position.y, position.z
    return message


def info_message(camera, stamp, frame=CAMERA_FRAME):
    fx, fy, cx, cy = (camera[k] for k in ("fx", "fy", "cx", "cy"))
    message = stamped(CameraInfo(), stamp, frame)
    message.width, message.height = camera["width"], camera["height"]
    message.distortion_model, message.D = "plumb_bob", [0.0] * 5
    message.K = [fx, 0, cx, 0, fy, cy, 0, 0, 1]
    message.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    message.P = [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]
    return message


def image_message(path, stamp, quality, frame=CAMERA_FRAME):
    picture = cv2.imread(path)
    if picture is None:
        sys.exit("make_bag: cannot read %s" % path)
    message = stamped(CompressedImage(), stamp, frame)
    message.format = "bgr8; jpeg compressed bgr8"
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    message.data = cv2.imencode(".jpg", picture, options)[1].tobytes()
    return message


def depth_message(depth_mm, stamp):
    message = stamped(Image(), stamp, DEPTH_FRAME)
    message.height, message.width = depth_mm.shape
    message.encoding, message.step = "16UC1", 2 * message.width
    message.data = depth_mm.astype("<u2").tobytes()
    return message


def place_message(companions, T_R_C, stamp):
    """Where the cameras stand: those that stand still as well, at each stamp, so that no listener comes too late."""
    places = ((ROOM_FRAME, CAMERA_FRAME, T_R_C), (ROOM_FRAME, SIDE_FRAME, companions["side"]["T_R_S"]),
              (CAMERA_FRAME, DEPTH_FRAME, companions["depth"]["T_C_D"]))
    return TFMessage([transform(pose_message(np.array(T), stamp, parent), child) for parent, child, T in places])


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
                bag.write(TF_TOPIC, TFMessage([transform(truth, TRUTH_FRAME)]), stamp)
    print("%s: %d frames, %.2f MiB" % (args.out, len(sequence["frames"]), os.path.getsize(args.out) / 2**20))


def write_companions(bag, args, companions, frame, stamp):
    depth, side, name = companions["depth"], companions["side"], "%03d" % frame["index"]
    exact_m = np.load(os.path.join(args.companions, "depth_" + name + ".npy"))
    picture = os.path.join(args.companions, "side_" + name + ".png")
    bag.write(TF_TOPIC, place_message(companions, frame["T_R_C"], stamp), stamp - rospy.Duration.from_sec(PLACE_LEAD_S))
    bag.write(DEPTH_INFO_TOPIC, info_message(depth, stamp, DEPTH_FRAME), stamp)
    bag.compression = "bz2"  # the images are compressed themselves
    bag.write(DEPTH_TOPIC, depth_message(measured_mm(exact_m, depth["fx"], frame["index"]), stamp), stamp)
    bag.compression = "none"
    bag.write(SIDE_INFO_TOPIC, info_message(side, stamp, SIDE_FRAME), stamp)
    bag.write(SIDE_TOPIC, image_message(picture, stamp, args.quality, SIDE_FRAME), stamp)


def companions_of(args):
    """At the times of a bag's images."""
    with open(os.path.join(args.companions, "companions.json")) as file:
        companions = json.load(file)
    with rosbag.Bag(args.bag) as alone, rosbag.Bag(args.out, "w") as bag:
        stamps = [stamp for _, _, stamp in alone.read_messages(topics=[INFO_TOPIC])]
        if len(stamps) != len(companions["frames"]):
            sys.exit("make_bag: %s has not the images that %s belongs to" % (args.bag, args.companions))
        for frame, stamp in zip(companions["frames"], stamps):
            write_companions(bag, args, companions, frame, stamp)
    print("%s: %.2f MiB" % (args.out, os.path.getsize(args.out) / 2**20))


def join(args):
    """Of what was recorded at the same time, the companions come first: an image finds them there."""
    with rosbag.Bag(args.bag) as first, rosbag.Bag(args.companions) as second, rosbag.Bag(args.out, "w") as bag:
        for topic, message, stamp in heapq.merge(second.read_messages(raw=True), first.read_messages(raw=True),
                                                 key=lambda entry: entry.timestamp):
            bag.write(topic, message, stamp, raw=True)


def strip(args):
    with rosbag.Bag(args.bag) as full, rosbag.Bag(args.out, "w") as bag:
        for topic, message, stamp in full.read_messages():
            if topic == TF_TOPIC:
                message.transforms = [t for t in message.transforms if t.child_frame_id != TRUTH_FRAME]
                if not message.transforms:
                    continue
            if topic != TRUTH_TOPIC:
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
    packing.add_argument("--without-truth", action="store_true", help="leave out " + TRUTH)
    packing.set_defaults(act=pack)
    further = commands.add_parser("companions", help="depth and the camera from the side, at a bag's times")
    further.add_argument("bag")
    further.add_argument("companions", help="folder that render.py wrote: companions of the same sequence")
    further.add_argument("out")
    further.add_argument("--quality", type=int, default=85, help="of the JPEGs, 1..100")
    further.set_defaults(act=companions_of)
    joining = commands.add_parser("join", help="a bag and its companions in one")
    joining.add_argument("bag")
    joining.add_argument("companions", help="bag with the companions")
    joining.add_argument("out")
    joining.set_defaults(act=join)
    stripping = commands.add_parser("strip", help="copy a bag without " + TRUTH)
    stripping.add_argument("bag")
    stripping.add_argument("out")
    stripping.set_defaults(act=strip)
    args = parser.parse_args()
    args.act(args)


if __name__ == "__main__":
    main()
