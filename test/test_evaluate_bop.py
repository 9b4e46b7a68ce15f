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
# Says that the object is where it was told, 1 mm farther to the right; of image 7 that there is none. Writes its words down.
REFINE = '''#!/usr/bin/env python3
import json, os, sys
with open(os.path.join(os.path.dirname(sys.argv[0]), 'words'), 'a') as file:
    print(json.dumps(sys.argv[2:]), file=file)
at = sys.argv.index('--pose') + 1
pose = [float(word) for word in sys.argv[at:at + 7]]
pose[0] += 0.001
outcome = 'diverged' if '000007' in ' '.join(sys.argv) else 'refined'
print(json.dumps({'outcome': outcome, 'pose': pose, 'score': 0.75, 'seconds': 0.5,
                  'depth': {'use': 'used' if '--depth-bias' in sys.argv else 'refused'}}))
'''
DETECT = '''#!/usr/bin/env python3
import json
print(json.dumps({'seconds': 0.25, 'detections': [{'pose': [0.1, 0.2, 0.5, 0, 0, 0, 1], 'score': 0.5}]}))
'''
NO_IMAGE = '''#!/usr/bin/env python3
import sys
sys.exit('refine: cannot read depth')
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
            for kind in ('rgb', 'depth'):
                write(self.picture(kind, image), '')
        for name, text in (('refine', REFINE), ('detect', DETECT)):
            write(os.path.join(self.top, 'tools', name), text)
            os.chmod(os.path.join(self.top, 'tools', name), 0o755)
        self.model = os.path.join(self.top, 'dragon.safetensors')
        described = json.dumps({'__metadata__': {'field': json.dumps({'metadata': {
            'centre': [0.01, 0, 0.02], 'diameter': 0.2}})}}).encode()
        with open(self.model, 'wb') as file:
            file.write(struct.pack('<Q', len(described)) + described)

    def picture(self, kind, image):
        return os.path.join(self.scene, kind, f'{image:06d}.png')

    def run_program(self, *words):
        return subprocess.run([sys.executable, PROGRAM, self.model, os.path.join(self.top, 'test'), '-o',
                               os.path.join(self.top, 'out.csv'), '--tools', os.path.join(self.top, 'tools'), '--json',
                               *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, check=False)

    def words(self):
        """Lists of words that the tool refine was called with, the model left out."""
        with open(os.path.join(self.top, 'tools', 'words'), encoding='utf-8') as file:
            return [json.loads(line) for line in file]

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
        line = bop.line_of(bop.Result(target, 0.5, target.truth, 0.125, False))
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

    def test_depth_beside_the_image_and_in_its_place(self):
        camera = {'cam_K': [500, 0, 320, 0, 510, 240, 0, 0, 1], 'depth_scale': 0.1}
        write(os.path.join(self.scene, 'scene_camera.json'), json.dumps({'3': camera, '7': camera}))
        with_depth = ['--depth', self.picture('depth', 3), '--depth-unit', '0.0001']
        noise = ('--depth-noise', '0.001', '0', '--depth-bias', '0', '0.002')
        for options, expected in ((('none',), [self.picture('rgb', 3)]), (('alone',), with_depth),
                                  (('with_colours',), [self.picture('rgb', 3), *with_depth]),
                                  (('alone', *noise), [*with_depth, '--depth-noise', '0.001', '0.0',
                                                       '--depth-bias', '0.0', '0.002'])):
            result = self.run_program('--object-id', '4', '--depth', *options)
            self.assertEqual(result.returncode, 0, result.stderr)
            words = self.words()[-2]
            self.assertEqual(words[:words.index('--intrinsics')], expected)
            said = json.loads(result.stdout)
            self.assertEqual((said['found'], said['with_depth']), (1, len(options) > 1))

    def test_errors_along_the_view(self):
        target = bop.targets_of(self.scene, 4)[0]
        away = target.truth.copy()
        away[:3, 3] += [0.003, 0, 0.004]
        # The middle (0, 0, 0) is seen at (10, 20, 600) mm: 0.01 of that direction goes to the right.
        deg, all_of_it, along = bop.errors_of(bop.Result(target, 1, away, 1, False), np.zeros(3), 0.5)
        self.assertAlmostEqual(deg, 0, 5)
        self.assertAlmostEqual(all_of_it, 0.01)
        self.assertAlmostEqual(along, (0.003 * 10 + 0.004 * 600) / np.linalg.norm((10, 20, 600)) / 0.5)

    def test_depth_that_cannot_be_used(self):
        depth = ('--object-id', '4', '--depth', 'with_colours')
        wrong = self.run_program(*depth, '--start', 'none')
        self.assertEqual(wrong.returncode, 2)
        self.assertIn('needs a rough pose: --start robot', wrong.stderr)
        self.assertEqual(self.run_program('--depth-bias', '0', '0').returncode, 2)
        blind = self.run_program(*depth, '--preset', 'align')
        self.assertEqual(blind.returncode, 2)
        self.assertIn('--preset align compares colours alone: --depth needs --preset keyframes', blind.stderr)
        write(os.path.join(self.top, 'tools', 'refine'), NO_IMAGE)
        self.assertIn('refine: cannot read depth', self.run_program(*depth).stderr)
        os.unlink(self.picture('depth', 12))  # which does not show the object
        self.assertIn('refine: cannot read depth', self.run_program(*depth).stderr)
        os.unlink(self.picture('depth', 7))
        self.assertIn('has no depth image 000007.png in depth', self.run_program(*depth).stderr)
        for scale, why in (({}, 'image 3: scene_camera.json states no depth_scale'),
                           ({'depth_scale': 0}, 'image 3: depth_scale is 0, not above 0')):
            camera = {'cam_K': [500, 0, 320, 0, 510, 240, 0, 0, 1], **scale}
            write(os.path.join(self.scene, 'scene_camera.json'), json.dumps({'3': camera, '7': camera}))
            result = self.run_program(*depth)
            self.assertEqual((result.returncode, why in result.stderr), (1, True), result.stderr)
        self.assertFalse(os.path.exists(os.path.join(self.top, 'out.csv')))

    def test_what_cannot_be_used(self):
        self.assertIn('shows the object 9', self.run_program('--object-id', '9').stderr)
        write(os.path.join(self.scene, 'scene_camera.json'), '{"3": {}}')
        self.assertIn('scene_camera.json or scene_gt.json is not as BOP has it', self.run_program('--object-id', '4').stderr)
        write(self.model, 'x')
        self.assertIn(f"cannot read the model '{self.model}'", self.run_program().stderr)
        self.assertFalse(os.path.exists(os.path.join(self.top, 'out.csv')))


if __name__ == '__main__':
    unittest.main()
