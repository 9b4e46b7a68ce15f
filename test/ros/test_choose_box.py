#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs scripts/choose_box in a ROS graph of its own, and drags a corner as RViz does."""
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import rospy
from std_srvs.srv import Trigger
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit, Marker, MarkerArray

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
from faults.graph import Graph, free_port, stop, wait_until  # noqa: E402 (after the path)

PROGRAM = os.path.join(TOP, 'scripts', 'choose_box')
PATIENCE_S = 30
BOX = [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.2]]


def matrix(x, y):
    """A camera at height 1 that looks down: OpenGL's axes are the world's."""
    return [[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, 1], [0, 0, 0, 1]]


def make_dataset(folder):
    os.makedirs(folder)
    for part in ('train', 'test'):
        frames = [{'file_path': 'none.png', 'transform_matrix': matrix(x, y)} for x, y in ((1, 0), (-1, 0), (0, 1))]
        with open(os.path.join(folder, f'transforms_{part}.json'), 'w', encoding='utf-8') as file:
            json.dump({'object_aabb': BOX, 'fl_x': 500, 'frames': frames}, file)


def read(folder, part):
    with open(os.path.join(folder, f'transforms_{part}.json'), encoding='utf-8') as file:
        return json.load(file)


def positions_of(init):
    return {m.name: [m.pose.position.x, m.pose.position.y, m.pose.position.z] for m in init.markers}


def run_program(folder, **environment):
    return subprocess.run([sys.executable, PROGRAM, folder], env={**os.environ, **environment},
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, check=False, timeout=PATIENCE_S)


class ChooseBox(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.top = tempfile.TemporaryDirectory()
        cls.graph = Graph(cls.top.name, False)
        rospy.init_node('test_choose_box', disable_signals=True)

    @classmethod
    def tearDownClass(cls):
        rospy.signal_shutdown('done')
        cls.graph.stop_all()
        cls.top.cleanup()

    def start(self, name):
        """@return (folder of a new dataset, process that shows it)."""
        folder = os.path.join(self.top.name, 'with blank', name)
        make_dataset(folder)
        process = self.graph.run(name, [sys.executable, PROGRAM, folder, '__name:=' + name])
        self.addCleanup(stop, process)
        rospy.wait_for_service(f'/{name}/use', PATIENCE_S)
        return folder, process

    def log_of(self, name):
        with open(self.graph.log_of(name), encoding='utf-8') as file:
            return file.read()

    def send(self, name, feedback, arrived):
        """Sends what RViz sends, until it has arrived: a new marker takes none within its first second."""
        publisher = rospy.Publisher(f'/{name}/feedback', InteractiveMarkerFeedback, queue_size=1)
        self.addCleanup(publisher.unregister)
        self.assertTrue(wait_until(publisher.get_num_connections, PATIENCE_S))

        def sent():
            publisher.publish(feedback)
            time.sleep(0.1)  # as often as while a mouse moves
            return arrived()
        self.assertTrue(wait_until(sent, PATIENCE_S))

    def drag(self, name, corner, position):
        """Drags a corner, and waits until the box is drawn anew."""
        places = {}
        update = rospy.Subscriber(f'/{name}/update_full', InteractiveMarkerInit,
                                  lambda init: places.update(positions_of(init)))
        self.addCleanup(update.unregister)
        feedback = InteractiveMarkerFeedback(client_id='rviz', marker_name=corner, control_name='move_x',
                                             event_type=InteractiveMarkerFeedback.POSE_UPDATE)
        feedback.header.frame_id = 'photos'
        p = feedback.pose.position
        p.x, p.y, p.z = position
        feedback.pose.orientation.w = 1
        self.send(name, feedback, lambda: places.get(corner) == list(position))

    def test_a_corner_is_dragged_and_the_box_written(self):
        folder, process = self.start('writes')
        scene = rospy.wait_for_message('/writes/markers', MarkerArray, PATIENCE_S).markers
        self.assertEqual([(m.type, m.header.frame_id) for m in scene], 2 * [(Marker.LINE_LIST, 'photos')])
        self.assertEqual(len(scene[0].points), 6 * 8 * 2)  # of six cameras
        shown = positions_of(rospy.wait_for_message('/writes/update_full', InteractiveMarkerInit, PATIENCE_S))
        self.assertEqual(shown, {'corner_1': BOX[0], 'corner_2': BOX[1], 'box': [0, 0, 0.1]})
        use = rospy.ServiceProxy('/writes/use', Trigger)

        self.drag('writes', 'corner_1', (0.1, 0.3, 0.1))  # beyond the other one along y; flat along x
        refused = use()
        self.assertFalse(refused.success)
        self.assertIn('along x it is 0 thick', refused.message)
        self.assertEqual(read(folder, 'train')['object_aabb'], BOX)

        self.drag('writes', 'corner_1', (-0.2, 0.3, 0.1))
        answer = use()
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(process.wait(PATIENCE_S), 0)
        for part in ('train', 'test'):
            content = read(folder, part)
            self.assertEqual(content['object_aabb'], [[-0.2, 0.1, 0.1], [0.1, 0.3, 0.2]])
            self.assertEqual((content['fl_x'], len(content['frames'])), (500, 3))
            self.assertIn(os.path.join(folder, f'transforms_{part}.json'), self.log_of('writes'))
        self.assertEqual(sorted(os.listdir(folder)), ['transforms_test.json', 'transforms_train.json'])

    def test_the_menu_ends_it(self):
        folder, process = self.start('menu')
        self.drag('menu', 'corner_2', (0.2, 0.3, 0.4))
        shown = {m.name: m for m in rospy.wait_for_message('/menu/update_full', InteractiveMarkerInit, PATIENCE_S).markers}
        for name in ('corner_1', 'corner_2', 'box'):  # those that were drawn anew, too
            self.assertEqual([entry.title for entry in shown[name].menu_entries], ['Use this box'])
        choose = InteractiveMarkerFeedback(client_id='rviz', marker_name='box', menu_entry_id=shown['box'].menu_entries[0].id,
                                           event_type=InteractiveMarkerFeedback.MENU_SELECT)
        choose.header.frame_id = 'photos'
        self.send('menu', choose, lambda: process.poll() is not None)
        self.assertEqual(process.returncode, 0)
        self.assertEqual(read(folder, 'test')['object_aabb'], [[-0.1, -0.1, 0], [0.2, 0.3, 0.4]])

    def test_interrupted_after_the_choice_it_says_what_was_done(self):
        folder, process = self.start('chosen')
        use = rospy.ServiceProxy('/chosen/use', Trigger, persistent=True)  # which it waits for
        self.addCleanup(use.close)
        self.assertTrue(use().success)
        self.assertTrue(wait_until(lambda: folder in self.log_of('chosen'), PATIENCE_S))
        self.assertEqual(stop(process, signal.SIGINT), 0)
        self.assertNotIn('nothing was changed', self.log_of('chosen'))

    def test_interrupted_it_changes_nothing(self):
        folder, process = self.start('interrupted')
        self.drag('interrupted', 'corner_2', (1, 1, 1))
        self.assertEqual(stop(process, signal.SIGINT), 130)
        self.assertEqual(read(folder, 'train')['object_aabb'], BOX)
        self.assertIn('nothing was changed', self.log_of('interrupted'))

    def test_what_cannot_be_used_is_named(self):
        empty = os.path.join(self.top.name, 'empty')
        os.makedirs(empty)
        make_dataset(os.path.join(self.top.name, 'no_master'))
        for folder, environment, message in (
                ('/no/such', {}, "there is no folder '/no/such'"), (empty, {}, 'holds neither options.json'),
                (os.path.join(self.top.name, 'no_master'), {'ROS_MASTER_URI': f'http://127.0.0.1:{free_port()}'},
                 'there is no ROS master at http://127.0.0.1'),
                (os.path.join(self.top.name, 'no_master'), {'ROS_MASTER_URI': 'x'}, "ROS_MASTER_URI is 'x'")):
            result = run_program(folder, **environment)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn(message, result.stderr)
            self.assertEqual(result.stderr.count('\n'), 1, result.stderr)


if __name__ == '__main__':
    unittest.main(warnings='ignore')  # rospy's
