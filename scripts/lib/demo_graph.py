#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Registers the demo's object in a running ROS graph, plays the bag, and compares the poses with the truth.

The truth is read from the bag's file; what is played has none of it.
"""
import argparse
import json
import math
import os
import subprocess
import sys
import threading
import time

import cv2
import numpy as np
import rosbag
import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Image

from nerf_pose_refiner.msg import RefinementStatus
from nerf_pose_refiner.srv import RegisterObject, RegisterObjectRequest
from pose_evaluation import Target, table, verdict, write_csv

NODE = '/pose_refiner'
PLAYED_TOPICS = ('/camera/image/compressed', '/camera/camera_info', '/initial_pose')
TRUTH_TOPIC = '/ground_truth/object_pose'
SERVICE_TIMEOUT_S = 60
QUIET_S = 10  # without a result after the bag: nothing more will come
OVERLAY_COLUMNS, OVERLAY_ROWS = 3, 2


def matrix(pose):
    x, y, z, w = (getattr(pose.orientation, axis) for axis in 'xyzw')
    T = np.eye(4)
    T[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    T[:3, 3] = pose.position.x, pose.position.y, pose.position.z
    return T


class Bag:
    """What the evaluation takes from the bag's file."""

    def __init__(self, path):
        self.truth = {}  # stamp -> T_C_O
        with rosbag.Bag(path) as bag:
            for topic, message, _ in bag.read_messages(topics=PLAYED_TOPICS + (TRUTH_TOPIC,)):
                if topic == TRUTH_TOPIC:
                    self.truth[message.header.stamp] = matrix(message.pose)
                elif topic == '/initial_pose':
                    self.initial = matrix(message.pose)
                elif topic == '/camera/camera_info':
                    self.intrinsics = message.K
        self.stamps = sorted(self.truth)


class Progress:
    """One line on stderr that is drawn over again; on what is no terminal, a line now and then."""

    def __init__(self):
        self.terminal = sys.stderr.isatty()
        self.last = 0.0

    def show(self, text):
        if self.terminal:
            sys.stderr.write('\r\033[K' + text)
            sys.stderr.flush()
        elif time.monotonic() - self.last > 10:
            self.last = time.monotonic()
            print(text, file=sys.stderr)

    def end(self):
        if self.terminal:
            sys.stderr.write('\n')


class Collector:
    """Gathers poses, statuses and overlays by the stamp of their image. Callbacks run in rospy's threads."""

    def __init__(self):
        self.lock = threading.Lock()  # guards all below
        self.poses, self.statuses, self.overlays = {}, {}, {}
        self.last_result = time.monotonic()
        self.last_status = None
        rospy.Subscriber(NODE + '/pose', PoseStamped, self.on_pose)
        rospy.Subscriber(NODE + '/status', RefinementStatus, self.on_status)
        rospy.Subscriber(NODE + '/overlay/image_raw', Image, self.on_overlay)

    def on_pose(self, message):
        with self.lock:
            self.poses[message.header.stamp] = matrix(message.pose)

    def on_status(self, message):
        with self.lock:
            self.last_status = message
            if message.latency_s > 0:  # a refined image, not a change of state
                self.statuses[message.header.stamp] = message
                self.last_result = time.monotonic()

    def on_overlay(self, message):
        picture = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
        with self.lock:
            self.overlays[message.header.stamp] = picture[:, :, ::-1]

    def rows(self, bag, target):
        """One for each processed frame: the error of the pose it started from, and of its own."""
        rows = []
        with self.lock:
            start = bag.initial
            for index, stamp in enumerate(bag.stamps):
                if stamp not in self.statuses:
                    continue
                status, pose, truth = self.statuses[stamp], self.poses.get(stamp), bag.truth[stamp]
                before = target.errors(start, truth)
                after = (math.inf,) * 3 if pose is None else target.errors(pose, truth)
                start = start if pose is None else pose
                rows.append({'frame': index, 'stamp_s': '%.3f' % stamp.to_sec(),
                             'start_deg': before[0], 'start_diameters': before[1], 'start_px': before[2],
                             'deg': after[0], 'diameters': after[1], 'px': after[2],
                             'score': status.score, 'latency_s': status.latency_s})
        return rows

    def overlay_sheet(self):
        """Some of the overlays, from first to last, as one image; None without any."""
        with self.lock:
            pictures = [self.overlays[stamp] for stamp in sorted(self.overlays)]
        if not pictures:
            return None
        chosen = [pictures[int(i)] for i in
                  np.linspace(0, len(pictures) - 1, OVERLAY_COLUMNS * OVERLAY_ROWS)]
        return np.vstack([np.hstack(chosen[r * OVERLAY_COLUMNS:(r + 1) * OVERLAY_COLUMNS])
                          for r in range(OVERLAY_ROWS)])


def wait_for_master():
    end = time.monotonic() + SERVICE_TIMEOUT_S
    while not rosgraph.is_master_online():
        if time.monotonic() > end:
            sys.exit('demo: no ROS master at %s' % os.environ['ROS_MASTER_URI'])
        time.sleep(0.2)


def register(name, max_seconds):
    """Through the service, as any user; what the node says of its progress is passed on."""
    progress = Progress()

    def on_log(message):
        if message.name == NODE and message.msg.startswith('registering'):
            progress.show(message.msg)

    log = rospy.Subscriber('/rosout_agg', Log, on_log)
    service = NODE + '/register_object'
    rospy.wait_for_service(service, SERVICE_TIMEOUT_S)
    request = RegisterObjectRequest(name=name, dataset=name, max_seconds=max_seconds)
    response = rospy.ServiceProxy(service, RegisterObject)(request)
    log.unregister()
    progress.end()
    if not response.success:
        sys.exit('demo: the object was not registered: ' + response.message)
    print('registered in %.0f s: %s' % (response.seconds, response.message), flush=True)


def play(path, rate, bag, target, collector):
    """Plays the bag and waits until what was in it is refined."""
    command = ['rosbag', 'play', '--quiet', '--clock', '--delay', '2', '--rate', str(rate), path, '--topics']
    player = subprocess.Popen(command + list(PLAYED_TOPICS), stdin=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL)
    progress = Progress()
    ended = None
    try:
        while not rospy.is_shutdown():
            time.sleep(0.5)
            rows = collector.rows(bag, target)
            if rows:
                progress.show('frame %d of %d: %.2f degrees, %.2f %% of the diameter' % (
                    rows[-1]['frame'] + 1, len(bag.stamps), rows[-1]['deg'], 100 * rows[-1]['diameters']))
            if player.poll() is not None:
                ended = ended or time.monotonic()
                all_done = rows and rows[-1]['frame'] == len(bag.stamps) - 1
                if all_done or time.monotonic() - max(ended, collector.last_result) > QUIET_S:
                    break
    finally:
        if player.poll() is None:
            player.terminate()
        player.wait()
        progress.end()
    if player.returncode != 0:
        sys.exit('demo: rosbag play ended with %d' % player.returncode)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--bag', required=True)
    parser.add_argument('--object', required=True, help='object.json of the demo data')
    parser.add_argument('--out', required=True, help='folder for overlay.png and poses.csv')
    parser.add_argument('--rate', type=float, required=True, help='speed of the bag, 1: as recorded')
    parser.add_argument('--max-seconds', type=float, required=True, help='of training')
    args = parser.parse_args()
    with open(args.object, encoding='utf-8') as file:
        description = json.load(file)

    wait_for_master()
    rospy.init_node('demo', disable_signals=True)
    bag = Bag(args.bag)
    target = Target(description['bounding_box'], description['diameter'], bag.intrinsics)
    register(description['name'], args.max_seconds)
    collector = Collector()
    play(args.bag, args.rate, bag, target, collector)

    rows = collector.rows(bag, target)
    if not rows:
        sys.exit('demo: no frame was processed; the last status was:\n%s' % collector.last_status)
    print(table(rows))
    csv_path, overlay_path = (os.path.join(args.out, name) for name in ('poses.csv', 'overlay.png'))
    write_csv(rows, csv_path)
    sheet = collector.overlay_sheet()
    if sheet is not None:
        cv2.imwrite(overlay_path, sheet)
    passed, text = verdict(rows)
    print('\noverlay: %s\nCSV:     %s' % (overlay_path if sheet is not None else 'none was drawn', csv_path))
    print('%s: %s' % ('passed' if passed else 'FAILED', text))
    return 0 if passed else 1


if __name__ == '__main__':
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
