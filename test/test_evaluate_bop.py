#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/evaluate_bop: what it reads of a BOP scene, what it gives to the tools (stand-ins here), what it writes."""
import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest

import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
from photos import bop_scenes as bop  # noqa: E402 (after the path)

PROGRAM = os.path.join(TOP, 'scripts', 'evaluate_bop')
# Says that the object is where it was told, 1 mm farther to the right; of image 7 that there is none.
REFINE = '''#!/usr/bin/env python3
import json, sys
at = sys.argv.index('--pose') + 1
pose = [float(word) for word in sys.argv[at:at + 7]]
pose[0] += 0.001
outcome = 'diverged' if '000007' in sys.argv[2] else 'refined'
print(json.dumps({'outcome': outcome, 'pose': pose, 'score': 0.75, 'seconds': 0.5}))
'''
DETECT = '''#!/usr/bin/env python3
import json
print(json.dumps({'seconds': 0.25, 'detections': [{'pose': [0.1, 0.2, 0.5, 0, 0, 0, 1], 'score': 0.5}]}))
'''
TURN = [0, -1, 0, 1, 0, 0, 0, 0, 1]  # by 90 degrees about z


def write(path, text):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, 'w', encoding='utf-8') as file:
        file.write(text)


class Scene(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.top = folder.name
        self.scene = os.path.join(self.top, 'test', '000002')
        camera = {'cam_K': [500, 0, 320, 0, 510, 240, 0, 0, 1], 'depth_scale': 1}
        entry = {'cam_R_m2c': TURN, 'cam_t_m2c': [10, 20, 600], 'obj_id': 4}
        write(os.path.join(self.scene, 'scene_camera.json'), json.dumps({'12': camera, '3': camera, '7': camera}))
        write(os.path.join(self.scene, 'scene_gt.json'), json.dumps({
            '3': [entry, {**entry, 'obj_id': 5}], '7': [entry], '12': [{**entry, 'obj_id': 5}]}))
        for image in (3, 7, 12):
            write(os.path.join(self.scene, 'rgb', f'{image:06d}.png'), '')
        for name, text in (('refine', REFINE), ('detect', DETECT)):
            write(os.path.join(self.top, 'tools', name), text)
            os.chmod(os.path.join(self.top, 'tools', name), 0o755)
        self.model = os.path.join(self.top, 'dragon.safetensors')
        described = json.dumps({'__metadata__': {'field': json.dumps({'metadata': {
            'centre': [0.01, 0, 0.02], 'diameter': 0.2}})}}).encode()
        with open(self.model, 'wb') as file:
            file.write(struct.pack('<Q', len(described)) + described)

    def run_program(self, *words):
        return subprocess.run([sys.executable, PROGRAM, self.model, os.path.join(self.top, 'test'), '-o',
                               os.path.join(self.top, 'out.csv'), '--tools', os.path.join(self.top, 'tools'), '--json',
                               *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, check=False)

    def lines(self):
        with open(os.path.join(self.top, 'out.csv'), encoding='utf-8') as file:
            return file.read().splitlines()

    def test_images_that_show_the_object(self):
        targets = bop.targets_of(self.scene, 4)
        self.assertEqual([(t.scene, t.image, t.object) for t in targets], [(2, 3, 4), (2, 7, 4)])
        np.testing.assert_allclose(targets[0].truth, [[0, -1, 0, 0.01], [1, 0, 0, 0.02], [0, 0, 1, 0.6], [0, 0, 0, 1]])
        self.assertEqual(targets[0].K[1, 1], 510)
        os.unlink(os.path.join(self.scene, 'scene_gt.json'))
        secret = bop.targets_of(self.scene, 4)
        self.assertEqual([(t.image, t.truth) for t in secret], [(3, None), (7, None), (12, None)])

    def test_a_line_of_the_results_file(self):
        target = bop.targets_of(self.scene, 4)[0]
        line = bop.line_of(bop.Result(target, 0.5, target.truth, 0.125))
        self.assertEqual(line, '2,3,4,0.5,0 -1 0 1 0 0 0 0 1,10 20 600,0.1250')

    def test_poses_as_numbers_and_back(self):
        T = bop.targets_of(self.scene, 4)[0].truth
        np.testing.assert_allclose(bop.matrix_of(bop.pose_numbers(T)), T, atol=1e-12)
        np.testing.assert_allclose(np.abs(bop.pose_numbers(T)), [0.01, 0.02, 0.6, 0, 0, 0.5 ** 0.5, 0.5 ** 0.5], atol=1e-12)

    def test_refinement_from_rough_poses(self):
        result = self.run_program('--object-id', '4')
        self.assertEqual(result.returncode, 0, result.stderr)
        lines = self.lines()
        self.assertEqual((lines[0], len(lines)), (bop.HEADER, 2))  # image 7 diverged
        self.assertTrue(lines[1].startswith('2,3,4,0.75,') and lines[1].endswith(',0.5000'), lines[1])
        said = json.loads(result.stdout)
        self.assertEqual((said['targets'], said['found']), (2, 1))
        self.assertGreater(said['median_deg'], 0.1)         # the stand-in does not refine
        self.assertLess(said['median_deg'], 15 * 3 ** 0.5)
        self.assertLess(said['median_diameters'], 0.15 * 3 ** 0.5 + 0.005)

    def test_detection(self):
        os.unlink(os.path.join(self.scene, 'scene_gt.json'))
        result = self.run_program('--object-id', '4', '--start', 'none')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(self.lines()[1:], [f'2,{i},4,0.5,1 0 0 0 1 0 0 0 1,100 200 500,0.2500' for i in (3, 7, 12)])
        self.assertEqual(json.loads(result.stdout), {'targets': 3, 'found': 3})
        secret = self.run_program('--object-id', '4')
        self.assertIn('are secret, so there is nothing to start from: --start none', secret.stderr)

    def test_what_cannot_be_used(self):
        self.assertIn('shows the object 9', self.run_program('--object-id', '9').stderr)
        write(os.path.join(self.scene, 'scene_camera.json'), '{"3": {}}')
        self.assertIn('scene_camera.json or scene_gt.json is not as BOP has it', self.run_program('--object-id', '4').stderr)
        write(self.model, 'x')
        self.assertIn(f"cannot read the model '{self.model}'", self.run_program().stderr)
        self.assertFalse(os.path.exists(os.path.join(self.top, 'out.csv')))


if __name__ == '__main__':
    unittest.main()
