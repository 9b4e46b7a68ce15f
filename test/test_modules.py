#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks who includes whom: the modules of the package and the libraries that each of them may use.

docs/architecture.md describes the modules; this table is the exact rule.
"""
import glob
import os
import re
import sys
import tempfile
import unittest

from source_files import source_files

PACKAGE = 'nerf_pose_refiner'

# Libraries, as patterns of the include's path.
EIGEN = r'Eigen/'
JSON = r'nlohmann/json\.hpp'
YAML = r'yaml-cpp/\w+\.h'
OPENCV = r'opencv2/'
FLANN = r'opencv2/flann\.hpp'
CLI = r'CLI/CLI\.hpp'
OPENMP = r'omp\.h'
POSIX = r'(unistd|fcntl|dirent|spawn|sys/\w+)\.h'
GLIBC = r'malloc\.h'
C_HEADERS = r'(stddef|stdint|string)\.h'  # for kernels: files without anything of std in them
SIMD = r'immintrin\.h'
CUDA = r'(cuda|cub|cooperative_groups|mma)[\w/]*\.(h|cuh)'
ROS = (r'(ros|rosbag|nodelet|pluginlib|image_transport|image_geometry|cv_bridge|message_filters|'
       r'actionlib|boost/signals2|diagnostic_updater|dynamic_reconfigure|interactive_markers|tf2|tf2_\w+|'
       r'xmlrpcpp|std_srvs|\w+_msgs|'
       rf'{PACKAGE}(?=/[A-Z]))/')  # the last: this package's own messages

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def modules_used():
    """Module of the library -> modules that it may include: those of its CMakeLists.txt (npr_add_module)."""
    used = {}
    for path in glob.glob(os.path.join(TOP, 'src', '*', 'CMakeLists.txt')):
        with open(path, encoding='utf-8') as file:
            call = re.search(r'npr_add_module\(([^()]*)\)', file.read()).group(1)
        name, *words = call.split()
        uses = re.search(r'\bUSES\s+([a-z\s]+)', call)
        used[name] = tuple(uses.group(1).split()) if uses else ()
    return used


# Module -> libraries that it may include. (The library's modules: the last is `library`, the public classes.)
LIBRARIES = {
    'math': (),
    'concurrency': (POSIX,),
    'geometry': (EIGEN,),
    'files': (JSON, POSIX),
    'image': (OPENCV,),
    'dataset': (EIGEN, JSON),
    'field': (EIGEN, JSON, YAML),
    'backend': (EIGEN, FLANN, SIMD, C_HEADERS),
    'views': (EIGEN,),
    'refinement': (EIGEN,),
    'detection': (EIGEN, OPENCV, C_HEADERS),
    'trust': (EIGEN,),
    'registration': (EIGEN,),
    'tracking': (EIGEN,),
    'runtime': (EIGEN, OPENCV, POSIX, GLIBC),
    'library': (EIGEN,),
}
# Module -> (modules that it may include, libraries that it may include). A module uses modules above
# it alone.
MODULES = {module: (uses, LIBRARIES[module]) for module, uses in modules_used().items()}
MODULES['evaluation'] = (tuple(LIBRARIES), (EIGEN, JSON, OPENCV))
MODULES['tools'] = (tuple(MODULES), (EIGEN, JSON, POSIX, CLI))
MODULES['ros'] = (tuple(MODULES), (EIGEN, JSON, OPENCV, POSIX, CLI, ROS))
MODULES['cuda'] = (('backend', 'field', 'geometry', 'image', 'math', 'concurrency'),
                   (EIGEN, CUDA, C_HEADERS, OPENMP))

# The public headers, and the module that each belongs to.
PUBLIC = {
    'backend.h': 'backend',
    'camera.h': 'geometry',
    'cancellation_token.h': 'concurrency',
    'depth.h': 'image',
    'detector.h': 'library',
    'image.h': 'image',
    'object.h': 'views',
    'observation.h': 'backend',
    'overlay.h': 'library',
    'pose.h': 'geometry',
    'refiner.h': 'library',
    'registration.h': 'registration',
    'symmetry.h': 'geometry',
    'track_status.h': 'tracking',
    'tracker.h': 'library',
    'undistorter.h': 'image',
}
MAX_PUBLIC_HEADERS = 16

# Files of src/ros that stand there without a ROS header: the names of the ROS interface.
ROS_NAMES = ('src/ros/conversions/topics.h',)

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(<[^>]+>|"[^"]+")', re.MULTILINE)
FOLDERS = ('include', 'src', 'cuda')
SUFFIXES = ('.h', '.cpp', '.inl', '.cuh', '.cu')


def module_of(path):
    """The module of a file or of an include, by its path below the top folder; None if it is none."""
    parts = path.split('/')
    if parts[0] == 'include':
        return PUBLIC.get(parts[-1]) if len(parts) == 3 else None
    if parts[0] == 'src':
        return parts[1] if len(parts) > 2 and parts[1] in MODULES else None
    return 'cuda' if parts[0] == 'cuda' else None


def included(text, top, folder):
    """Yields (path below the top folder, None) of own files and (None, include) of libraries."""
    for quoted in INCLUDE.findall(text):
        path = quoted[1:-1]
        for base in ('src', 'include', folder):
            own = os.path.normpath(os.path.join(base, path))
            if os.path.isfile(os.path.join(top, own)):
                yield own, None
                break
        else:
            if '/' in path or '.' in path:  # headers of the standard library have neither
                yield None, path


def violations_of_file(top, path):
    with open(os.path.join(top, path), encoding='utf-8') as file:
        text = file.read()
    module = module_of(path)
    if module is None:
        yield f'{path}: belongs to no module'
        return
    modules, libraries = MODULES[module]
    public = path.startswith('include/')
    for own, library in included(text, top, os.path.dirname(path)):
        if own is not None:
            other = module_of(own)
            if other != module and other not in modules:
                yield f'{path}: {module} may not use {own} ({other})'
            if public and not own.startswith('include/'):
                yield f'{path}: a public header may not include {own}'
            if public and not quoted_with_package(text, own):
                yield f'{path}: a public header names others as <{PACKAGE}/...> or "{PACKAGE}/..."'
        elif not any(re.match(pattern, library) for pattern in libraries):
            yield f'{path}: {module} may not use <{library}>'
        elif public and not re.match(EIGEN, library):
            yield f'{path}: <{library}> shows in a public header'
        elif re.match(OPENCV, library) and path.endswith('.h') and module != 'ros':
            yield f'{path}: OpenCV shows in a header'


def reaches_ros(top, path, seen=()):
    """Whether a file of src/ros includes a header of ROS, itself or through other headers of src/ros."""
    with open(os.path.join(top, path), encoding='utf-8') as file:
        includes = list(included(file.read(), top, os.path.dirname(path)))
    if any(library and re.match(ROS, library) for _, library in includes):
        return True
    seen = (*seen, path)
    return any(own not in seen and reaches_ros(top, own, seen) for own, _ in includes
               if own and module_of(own) == 'ros')


def quoted_with_package(text, own):
    return f'"{own[len("include/"):]}"' in text or f'<{own[len("include/"):]}>' in text


def violations(top):
    for path in source_files(top, FOLDERS, SUFFIXES):
        yield from violations_of_file(top, path)
        if module_of(path) == 'ros' and path not in ROS_NAMES and not reaches_ros(top, path):
            yield f'{path}: needs no ROS and belongs to another module'


class Rules(unittest.TestCase):
    """The checker itself: each kind of violation is seen."""

    def check(self, path, line):
        with tempfile.TemporaryDirectory() as top:
            for other in ('src/field/field.h', 'src/registration/visual_hull.h', 'src/backend/cpu/own.h',
                          'src/dataset/dataset.h', 'src/ros/conversions/topics.h', 'src/ros/conversions/with_ros.h',
                          'src/tracking/prior.h', 'src/refinement/refiner.h', 'src/runtime/model_cache.h',
                          f'include/{PACKAGE}/pose.h', path):
                os.makedirs(os.path.join(top, os.path.dirname(other)), exist_ok=True)
                with open(os.path.join(top, other), 'w', encoding='utf-8') as file:
                    text = '#include <ros/ros.h>' if other.endswith('with_ros.h') else ''
                    file.write((line if other == path else text) + '\n')
            return list(violations(top))

    def test_what_is_allowed(self):
        for path, line in (('src/math/file.cpp', '#include <cmath>'),
                           ('src/backend/cpu/file.cpp', '#include "own.h"'),
                           ('src/backend/cpu/file.cpp', '#include "field/field.h"'),
                           ('src/image/file.cpp', '#include <opencv2/imgproc.hpp>'),
                           ('src/ros/bag/file.cpp', '#include <ros/ros.h>'),
                           ('src/ros/bag/file.h', '#include <opencv2/core.hpp>\n#include <ros/ros.h>'),
                           ('src/geometry/file.h', '#include <Eigen/Core>'),
                           ('cuda/file.cu', '#include <cuda_runtime.h>'),
                           (f'include/{PACKAGE}/camera.h', f'#include "{PACKAGE}/pose.h"'),
                           ('src/ros/nodelet/file.cpp', f'#include <{PACKAGE}/RefinementStatus.h>')):
            self.assertEqual(self.check(path, line), [], (path, line))

    def test_what_is_not(self):
        for path, line in (('src/math/file.cpp', '#include <Eigen/Core>'),
                           ('src/refinement/file.cpp', '#include "dataset/dataset.h"'),
                           ('src/refinement/file.cpp', '#  include "ros/conversions/topics.h"'),
                           ('src/backend/cpu/file.cpp', '#include <ros/ros.h>'),
                           ('src/backend/file.cpp', '#include <sensor_msgs/Image.h>'),
                           ('src/tracking/file.cpp', f'#include <{PACKAGE}/RefinementStatus.h>'),
                           ('src/tracking/file.cpp', '#include "runtime/model_cache.h"'),
                           ('src/backend/file.cpp', '#include <cuda_runtime.h>'),
                           ('src/backend/file.cpp', '#include "../registration/visual_hull.h"'),
                           ('src/field/file.cpp', '#include <opencv2/core.hpp>'),
                           ('src/image/file.h', '#include <opencv2/core.hpp>'),
                           ('src/evaluation/file.h', '#include <opencv2/core.hpp>'),
                           ('src/cellar/file.cpp', '#include <vector>'),
                           ('cuda/file.cu', '#include "refinement/refiner.h"'),
                           ('cuda/file.cu', '#include <opencv2/core.hpp>'),
                           (f'include/{PACKAGE}/unknown.h', '#include <vector>'),
                           (f'include/{PACKAGE}/image.h', '#include <opencv2/core.hpp>'),
                           (f'include/{PACKAGE}/camera.h', '#include "pose.h"'),
                           (f'include/{PACKAGE}/observation.h', '#include "field/field.h"')):
            self.assertTrue(self.check(path, line), (path, line))

    def test_what_needs_no_ros_is_not_in_ros(self):
        for line in ('#include <vector>', '#include "tracking/prior.h"', '#include "ros/conversions/topics.h"',
                     '#include "file.h"'):
            self.assertTrue(self.check('src/ros/services/file.h', line), line)
        for line in ('#include <ros/time.h>', f'#include <{PACKAGE}/RefinementStatus.h>',
                     '#include "ros/conversions/with_ros.h"'):
            self.assertEqual(self.check('src/ros/services/file.h', line), [], line)

    def test_the_table_has_no_cycle(self):
        seen = set()
        while len(seen) < len(MODULES):
            free = {m for m, (uses, _) in MODULES.items() if m not in seen and set(uses) <= seen}
            self.assertTrue(free, f'these use each other: {set(MODULES) - seen}')
            seen |= free


class Tree(unittest.TestCase):
    def test_modules_of_this_package(self):
        found = list(violations(TOP))
        self.assertEqual(found, [], '\n' + '\n'.join(found))

    def test_geometry_of_eigen_is_named(self):
        """Other files may name them before in a joined source; alone, such a file does not link."""
        for path in source_files(TOP, ('src', 'include'), ('.cpp', '.h')):
            with open(os.path.join(TOP, path), encoding='utf-8') as file:
                text = file.read()
            if '.cross(' in text:
                self.assertRegex(text, '<Eigen/(Geometry|Dense)>', path)

    def test_public_headers(self):
        headers = os.listdir(os.path.join(TOP, 'include', PACKAGE))
        self.assertEqual(sorted(headers), sorted(PUBLIC))
        self.assertLessEqual(len(headers), MAX_PUBLIC_HEADERS)

    def test_it_saw_files_of_every_module(self):
        seen = {module_of(path) for path in source_files(TOP, FOLDERS, SUFFIXES)}
        self.assertEqual(seen, set(MODULES))


if __name__ == '__main__':
    sys.exit(unittest.main())
