#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks llff_to_transforms against scenes that are worked out by hand, and that bad input leaves nothing behind."""
import collections
import contextlib
import importlib.machinery
import importlib.util
import io
import json
import os
import sys
import tempfile
import unittest

import cv2
import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
WIDTH, HEIGHT = 40, 30
Result = collections.namedtuple('Result', 'returncode stdout stderr')


def load_script():
    sys.dont_write_bytecode = True  # beside the script
    path = os.path.join(TOP, 'scripts', 'llff_to_transforms')
    loader = importlib.machinery.SourceFileLoader('llff_to_transforms', path)
    script = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(script)
    return script


SCRIPT = load_script()


def llff_row(position, near=4.0, far=16.0, turned=False):
    """A camera of a photo of 80 x 60 pixels and focal length 80, that looks along -z of the world, x to the right; or
    the same world turned by 90 degrees about z."""
    right, up, back = (0, 1, 0) if turned else (1, 0, 0), (-1, 0, 0) if turned else (0, 1, 0), (0, 0, 1)
    pose = np.column_stack((np.negative(up), right, back, position, (60, 80, 80)))
    return np.concatenate((pose.ravel(), (near, far)))


class Scene(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.scene = os.path.join(folder.name, 'scene')
        self.output = os.path.join(folder.name, 'output')
        os.makedirs(os.path.join(self.scene, 'images_2'))

    def write(self, rows, pictures=None, size=(WIDTH, HEIGHT)):
        np.save(os.path.join(self.scene, 'poses_bounds.npy'), np.array(rows))
        for i in range(len(rows) if pictures is None else pictures):
            picture = np.full((size[1], size[0], 3), 10 * i, np.uint8)
            cv2.imwrite(os.path.join(self.scene, 'images_2', f'image{i:03}.png'), picture)

    def run_script(self, *arguments):
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as error:
            status = SCRIPT.main([*arguments, '-o', self.output])
        return Result(status, out.getvalue(), error.getvalue())

    def convert(self, *arguments):
        result = self.run_script(*(arguments or (self.scene, '--images', 'images_2')))
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def refused(self, message, *arguments):
        before = sorted(os.listdir(self.folder))
        result = self.run_script(*(arguments or (self.scene, '--images', 'images_2')))
        self.assertEqual(result.returncode, 1)
        self.assertIn(message, result.stderr)
        self.assertEqual(sorted(os.listdir(self.folder)), before)

    def read(self, name):
        with open(os.path.join(self.output, f'transforms_{name}.json'), encoding='utf-8') as file:
            return json.load(file)

    def positions(self, name):
        return np.array([frame['transform_matrix'] for frame in self.read(name)['frames']])[:, :3, 3]


class PosesBounds(Scene):
    def test_two_cameras(self):
        # The mean is (6, 0, 1), the scale 1 / (0.75 * 4) = 1/3.
        self.write([llff_row((3, 0, 1)), llff_row((9, 0, 1), near=5, far=13)])
        self.assertIn('scale 0.333333', self.convert().stdout)
        test, train = self.read('test'), self.read('train')
        np.testing.assert_allclose(test['frames'][0]['transform_matrix'],
                                   [[1, 0, 0, -1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-12)
        np.testing.assert_allclose(train['frames'][0]['transform_matrix'],
                                   [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-12)
        self.assertAlmostEqual(test['near'], 4 / 3)
        self.assertAlmostEqual(train['near'], 5 / 3)
        self.assertAlmostEqual(train['far'], 13 / 3)
        # A photo ends at tangents of 20/40 and 15/40: the first camera's at depth 16/3 at 8/3 and 2 from its axis, the
        # second's at depth 13/3 at 13/6. The box begins at 0.9 * 4/3.
        for part in (test, train):
            np.testing.assert_allclose(part['aabb'], [[-1 - 8 / 3, -2, -16 / 3], [1 + 13 / 6, 2, -1.2]], atol=1e-12)

    def test_intrinsics_are_those_of_the_copied_picture(self):
        self.write([llff_row((3, 0, 1)), llff_row((9, 0, 1))])
        self.convert()
        frame = self.read('train')['frames'][0]
        self.assertEqual({key: frame[key] for key in ('w', 'h', 'fl_x', 'fl_y', 'cx', 'cy')},
                         {'w': 40, 'h': 30, 'fl_x': 40, 'fl_y': 40, 'cx': 20, 'cy': 15})
        picture = cv2.imread(os.path.join(self.output, frame['file_path']))
        self.assertEqual(picture.shape, (HEIGHT, WIDTH, 3))
        self.assertEqual(picture[0, 0, 0], 10)  # the second

    def test_every_eighth_photo_is_held_out(self):
        self.write([llff_row((i, 0, 0)) for i in range(18)])
        self.convert()
        np.testing.assert_allclose(self.positions('test')[:, 0], np.array([-8.5, -0.5, 7.5]) / 3, atol=1e-12)
        self.assertEqual(len(self.read('train')['frames']), 15)
        self.assertEqual(self.read('test')['frames'][1]['file_path'], 'images/image008.png')

    def test_the_world_turns_with_the_mean_camera(self):
        self.write([llff_row((0, 3, 1), turned=True), llff_row((0, 9, 1), turned=True)])
        self.convert()
        np.testing.assert_allclose(self.read('test')['frames'][0]['transform_matrix'],
                                   [[1, 0, 0, -1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-12)

    def test_bad_input(self):
        good = llff_row((0, 0, 0))
        self.refused('poses_bounds.npy')
        self.write([good])
        self.refused('one pose')
        self.write([good, good], pictures=3)
        self.refused('2 poses')
        os.remove(os.path.join(self.scene, 'images_2', 'image002.png'))
        for bad, message in ((llff_row((0, 0, 0), near=-1), "row 1: the bounds -1.0 and 16.0"),
                             (llff_row((0, 0, 0), near=20), '0 < near < far'),
                             (llff_row((0, np.nan, 0)), 'not finite'), (2 * good, 'not rigid'),
                             (np.where(good == 80, 0, good), 'not positive')):
            self.write([good, bad])
            self.refused(message)
        back = llff_row((0, 0, 0))
        back[[1, 2, 11, 12]] *= -1  # right and back
        self.write([good, back])
        self.refused('one direction')
        self.write([good, good], size=(WIDTH, WIDTH))
        self.refused('not the shape of 80 x 60')
        self.write([good, good])
        with open(os.path.join(self.scene, 'images_2', 'image001.png'), 'w', encoding='utf-8') as file:
            file.write('no picture')
        self.refused('is not a picture')
        np.save(os.path.join(self.scene, 'poses_bounds.npy'), np.zeros((2, 12)))
        self.refused('rows of 17 numbers')

    def test_other_folders_are_named(self):
        self.write([llff_row((3, 0, 1)), llff_row((9, 0, 1))])
        self.refused('one of: images_2', self.scene)

    def test_an_output_that_exists_is_left_alone(self):
        self.write([llff_row((3, 0, 1)), llff_row((9, 0, 1))])
        os.mkdir(self.output)
        self.refused('exists already')
        self.assertEqual(os.listdir(self.output), [])

    def test_cameras_within_the_scene_are_told(self):
        self.write([llff_row((0, 0, 0)), llff_row((0, 0, 30))])
        self.assertIn('1 cameras are inside of the box', self.convert().stderr)


class Transforms(Scene):
    def write_parts(self, **keys):
        """Cameras at x = 3 and 9, without ending and with a mask; `keys` are of both files, None for those left out."""
        os.makedirs(os.path.join(self.scene, 'masks'))
        for name, x in (('train', 3), ('test', 9)):
            cv2.imwrite(os.path.join(self.scene, f'{name}.png'), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
            cv2.imwrite(os.path.join(self.scene, 'masks', f'{name}.png'), np.zeros((HEIGHT, WIDTH), np.uint8))
            frame = {'file_path': name, 'mask_path': f'masks/{name}.png', 'fl_x': 40,
                     'transform_matrix': [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]}
            content = {'frames': [frame], 'near': 4, 'far': 16, 'cx': 16, 'k1': 0.1, 'metres_per_unit': 2, **keys}
            content = {key: value for key, value in content.items() if value is not None}
            with open(os.path.join(self.scene, f'transforms_{name}.json'), 'w', encoding='utf-8') as file:
                json.dump(content, file)

    def test_bounds_of_the_file(self):
        self.write_parts()
        self.convert('--transforms', self.scene)
        train, test = self.read('train'), self.read('test')
        np.testing.assert_allclose(self.positions('train'), [[-1, 0, 0]], atol=1e-12)
        np.testing.assert_allclose(self.positions('test'), [[1, 0, 0]], atol=1e-12)
        # cx = 16: a photo ends at tangents of -16/40 and 24/40.
        np.testing.assert_allclose(test['aabb'][0][0], -1 - 0.4 * 16 / 3)
        np.testing.assert_allclose(test['aabb'][1][0], 1 + 0.6 * 16 / 3)
        self.assertEqual((train['cx'], train['k1'], train['frames'][0]['fl_x']), (16, 0.1, 40))
        self.assertAlmostEqual(train['metres_per_unit'], 6)  # a unit is three of the old ones
        for key in ('file_path', 'mask_path'):
            self.assertTrue(os.path.isfile(os.path.join(self.output, train['frames'][0][key])))

    def test_bounds_of_the_command_line(self):
        self.write_parts(near=None, far=None)
        self.refused('give --near and --far', '--transforms', self.scene)
        self.refused('0 < near < far', '--transforms', self.scene, '--near', '4', '--far', 'nan')
        self.convert('--transforms', self.scene, '--near', '2', '--far', '8')
        np.testing.assert_allclose(self.positions('train'), [[-2, 0, 0]], atol=1e-12)

    def test_bad_input(self):
        self.refused('transforms_train.json', '--transforms', self.scene)
        self.write_parts()
        frame = self.read_source('test')
        for change, message in (({'file_path': '../secret.png'}, 'is not below'), ({'file_path': 'none'}, 'no file'),
                                ({'transform_matrix': [[1, 2], [3]]}, 'matrix of numbers'),
                                ({'transform_matrix': np.zeros((4, 4)).tolist()}, 'not rigid'),
                                ({'fl_x': 'wide'}, 'makes no sense'), ({'fl_x': 0}, 'not positive')):
            self.write_source('test', {**frame, **change})
            self.refused(message, '--transforms', self.scene)
        del frame['fl_x']
        self.write_source('test', frame)
        self.refused('neither fl_x nor camera_angle_x', '--transforms', self.scene)

    def read_source(self, name):
        with open(os.path.join(self.scene, f'transforms_{name}.json'), encoding='utf-8') as file:
            return json.load(file)['frames'][0]

    def write_source(self, name, frame):
        with open(os.path.join(self.scene, f'transforms_{name}.json'), 'w', encoding='utf-8') as file:
            json.dump({'near': 4, 'far': 16, 'frames': [frame]}, file)


if __name__ == '__main__':
    unittest.main()
