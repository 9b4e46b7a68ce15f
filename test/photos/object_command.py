# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs scripts/photos_to_object as users call it, with a stand-in for COLMAP."""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader

import cv2
import numpy as np

import scenes

PROGRAM = os.path.join(scenes.TOP, 'scripts', 'photos_to_object')
HERE = os.path.dirname(os.path.abspath(__file__))


def loaded_program(name):
    """A script without an ending as a module."""
    loader = SourceFileLoader(name, os.path.join(scenes.TOP, 'scripts', name))
    program = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(program)
    return program


def quaternion(R):
    """w x y z."""
    r = cv2.Rodrigues(R)[0].ravel()
    angle = np.linalg.norm(r)
    axis = r / angle if angle > 0 else r
    return [np.cos(angle / 2), *(np.sin(angle / 2) * axis)]


def write_model(model, folder):
    """As COLMAP's text files; cameras are RADIAL."""
    os.makedirs(folder)

    def write(name, lines):
        with open(os.path.join(folder, name), 'w', encoding='utf-8') as file:
            file.write('\n'.join(lines) + '\n')

    write('cameras.txt', [f'{i + 1} RADIAL {c.width} {c.height} {c.parameters[0]} {c.parameters[2]} {c.parameters[3]} 0 0'
                          for i, c in enumerate(model.cameras)])
    images = []
    for i, name in enumerate(model.names):
        pose = ' '.join(f'{x:.12g}' for x in [*quaternion(model.R[i]), *model.t[i]])
        images.append(f'{i + 1} {pose} {model.camera_of[i] + 1} {name}')
        of_it = model.photo_of == i
        images.append(' '.join(f'{x:.4f} {y:.4f} {point}' for (x, y), point in zip(model.xy[of_it], model.point_of[of_it])))
    write('images.txt', images)
    write('points3D.txt', [f'{i} {x:.9g} {y:.9g} {z:.9g} 0 0 0 0' for i, (x, y, z) in enumerate(model.xyz)])


class Command(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.top = folder.name
        self.bin, self.photos, self.output = (os.path.join(self.top, name) for name in ('bin', 'photos', 'output'))
        os.mkdir(self.bin)
        os.symlink(os.path.join(HERE, 'stand_in_colmap'), os.path.join(self.bin, 'colmap'))
        self.look_from(scenes.rounds(8))

    def look_from(self, poses):
        """Photos are taken from there; fewer make a test shorter."""
        self.poses = poses
        self.model = scenes.reconstruction(poses)

    def take_photos(self, folder=None, camera=None, painted=None):
        folder = folder or self.photos
        os.makedirs(folder)
        for i, pose in enumerate(self.poses):
            cv2.imwrite(os.path.join(folder, f'IMG {i:02d}.png'), scenes.render(pose, camera, painted))

    def run_program(self, *words, source=None, **environment):
        prepared = os.path.join(self.top, 'prepared')
        shutil.rmtree(prepared, ignore_errors=True)
        write_model(self.model, prepared)
        env = {**os.environ, 'PATH': f'{self.bin}:/usr/bin:/bin', 'PREPARED_MODEL': prepared,
               'COLMAP_CALLS': os.path.join(self.top, 'calls'), **environment}
        return subprocess.run([sys.executable, PROGRAM, source or self.photos, '-o', self.output, *words], env=env,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, check=False)

    def calls(self):
        path = os.path.join(self.top, 'calls')
        if not os.path.exists(path):
            return []
        with open(path, encoding='utf-8') as file:
            return file.read().split()

    def read(self, *names):
        with open(os.path.join(self.output, *names), encoding='utf-8') as file:
            return json.load(file)
