#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks who includes whom: the rooms of the package and the libraries each of them may know.

The README ("How it is built") describes the rooms; this table is the exact rule.
"""
import os
import re
import sys
import tempfile
import unittest

PACKAGE = 'nerf_pose_refiner'
LIBRARY_ROOMS = ('tasks', 'maths', 'geometry', 'image', 'dataset', 'field', 'engine', 'register', 'refine',
                 'evaluate')

# Room -> (rooms it may include, libraries it may include, as patterns of the include's path).
EIGEN = r'Eigen/'
JSON = r'nlohmann/json\.hpp'
YAML = r'yaml-cpp/yaml\.h'
OPENCV = r'opencv2/'
POSIX = r'(unistd|fcntl|dirent|spawn|sys/\w+)\.h'
SIMD = r'immintrin\.h|(stdint|string)\.h'  # for files without anything of std in them
ROS = (r'(ros|rosbag|nodelet|pluginlib|image_transport|image_geometry|cv_bridge|message_filters|'
       r'actionlib|boost/signals2|diagnostic_updater|dynamic_reconfigure|interactive_markers|tf2|tf2_\w+|'
       r'xmlrpcpp|std_srvs|\w+_msgs|'
       rf'{PACKAGE}(?=/[A-Z]))/')  # the last: this package's own messages
RULES = {
    'tasks': ((), ()),
    'maths': ((), ()),
    'geometry': (('maths',), (EIGEN,)),
    'image': (('geometry',), (OPENCV,)),
    'dataset': (('geometry', 'image', 'tasks'), (EIGEN, JSON)),
    'field': (('geometry', 'maths'), (EIGEN, JSON, POSIX, YAML)),
    'engine': (('field', 'geometry', 'image', 'maths', 'tasks'), (EIGEN, SIMD)),
    'register': (('refine', 'engine', 'dataset', 'field', 'geometry', 'image', 'maths', 'tasks'),
                 (EIGEN,)),
    'refine': (('engine', 'field', 'geometry', 'image', 'maths', 'tasks'), (EIGEN,)),
    'evaluate': (('refine', 'register', 'dataset', 'engine', 'field', 'geometry', 'image', 'maths',
                  'tasks'), (EIGEN, JSON, OPENCV)),
    'ros': (('refine', 'register', 'dataset', 'engine', 'field', 'geometry', 'image', 'tasks'),
            (EIGEN, OPENCV, POSIX, ROS)),
    'nodelets': (LIBRARY_ROOMS + ('ros',), (EIGEN, ROS)),
    'nodes': (LIBRARY_ROOMS + ('ros',), (EIGEN, OPENCV, ROS)),
    # (Without catkin those tools are built that use no ROS.)
    'tools': (LIBRARY_ROOMS + ('ros',), (EIGEN, JSON, POSIX, r'CLI/CLI\.hpp')),
}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(<[^>]+>|"[^"]+")', re.MULTILINE)
SOURCE_FOLDERS = (f'include/{PACKAGE}', 'src')
SOURCE_SUFFIXES = ('.h', '.cpp', '.inl', '.cuh', '.cu')


def included_rooms_and_libraries(text, folder):
    """Yields ('room', name) and ('library', path) for what a file of `folder` includes."""
    for quoted in INCLUDE.findall(text):
        path = quoted[1:-1]
        if os.path.isfile(os.path.join(folder, path)) and not path.startswith('..'):
            continue  # a private header of the same room
        own = re.match(rf'{PACKAGE}/([a-z]\w*)/', path)
        if own:
            yield 'room', own.group(1)
        elif '/' in path or '.' in path:  # headers of the standard library have neither
            yield 'library', path


def violations_of_file(path, room):
    with open(path, encoding='utf-8') as file:
        text = file.read()
    if room not in RULES:
        yield f'{path}: no such room: {room}'
        return
    rooms, libraries = RULES[room]
    for kind, name in included_rooms_and_libraries(text, os.path.dirname(path)):
        if kind == 'room' and name != room and name not in rooms:
            yield f'{path}: {room} may not use {name}'
        if kind == 'library' and not any(re.match(pattern, name) for pattern in libraries):
            yield f'{path}: {room} may not use <{name}>'
        if kind == 'library' and re.match(OPENCV, name) and path.endswith('.h') and room in ('image', 'evaluate'):
            yield f'{path}: OpenCV shows in a header'


def violations(top):
    for base in SOURCE_FOLDERS:
        for folder, _, files in os.walk(os.path.join(top, base)):
            room = os.path.relpath(folder, os.path.join(top, base)).split(os.sep)[0]
            for name in sorted(files):
                if name.endswith(SOURCE_SUFFIXES):
                    yield from violations_of_file(os.path.join(folder, name), room)


class Rules(unittest.TestCase):
    """The checker itself: each kind of violation is seen."""

    def check(self, room, line, name='file.cpp'):
        with tempfile.TemporaryDirectory() as top:
            folder = os.path.join(top, 'src', room)
            os.makedirs(folder)
            with open(os.path.join(folder, 'own.h'), 'w', encoding='utf-8'):
                pass
            with open(os.path.join(folder, name), 'w', encoding='utf-8') as file:
                file.write(line + '\n')
            return list(violations(top))

    def test_what_is_allowed(self):
        for room, line in (('maths', '#include <cmath>'), ('engine', '#include "own.h"'),
                           ('engine', f'#include "{PACKAGE}/field/field.h"'),
                           ('image', '#include <opencv2/imgproc.hpp>'),
                           ('ros', '#include <ros/ros.h>'), ('geometry', '#include <Eigen/Core>'),
                           ('ros', f'#include <{PACKAGE}/RefinementStatus.h>')):
            self.assertEqual(self.check(room, line), [], (room, line))

    def test_what_is_not(self):
        for room, line in (('maths', '#include <Eigen/Core>'),
                           ('refine', f'#include "{PACKAGE}/dataset/dataset.h"'),
                           ('refine', f'#  include "{PACKAGE}/ros/topics.h"'),
                           ('engine', '#include <ros/ros.h>'),
                           ('engine', '#include <sensor_msgs/Image.h>'),
                           ('engine', f'#include <{PACKAGE}/RefinementStatus.h>'),
                           ('engine', '#include <cuda_runtime.h>'),
                           ('engine', '#include "../register/visual_hull.h"'),
                           ('field', '#include <opencv2/core.hpp>'),
                           ('cellar', '#include <vector>')):
            self.assertTrue(self.check(room, line), (room, line))
        for room in ('image', 'evaluate'):
            self.assertTrue(self.check(room, '#include <opencv2/core.hpp>', 'file.h'), room)


class Tree(unittest.TestCase):
    def test_rooms_of_this_package(self):
        top = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
        found = list(violations(top))
        self.assertEqual(found, [], '\n' + '\n'.join(found))

    def test_it_saw_files(self):
        top = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
        for room in LIBRARY_ROOMS:
            self.assertTrue(os.listdir(os.path.join(top, 'include', PACKAGE, room)), room)


if __name__ == '__main__':
    sys.exit(unittest.main())
