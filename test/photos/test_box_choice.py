#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of the box that a person chooses: its frame, its refusal, and what becomes of it."""
import dataclasses
import os
import shlex
import stat
import tempfile
import unittest
from unittest import mock

import cv2
import numpy as np

import scenes
from object_command import Command, loaded_program, write_model
from photos import box_choice
from photos.board import DEFAULT as BOARD
from photos.box_choice import Cameras
from photos.box_of_output import Similarity, aligned, open_choice, use_box
from photos.common import InputError, write_json
from photos.geometry import exp_so3
from photos.job import Options, words_of, write_options
from photos.steps import Steps

QUARTER_TURN = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # about z: x to y


def cameras_of(model):
    return Cameras(model.R, model.centres())


def frames_of(model, move=None):
    """Of transforms.json, as the package writes them. @param move Similarity to the dataset's frame"""
    cameras = cameras_of(model) if move is None else move.cameras(cameras_of(model))
    frames = []
    for name, R, centre in zip(model.names, cameras.R, cameras.centre):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R.T * (1, -1, -1), centre
        stem = os.path.splitext(name)[0].replace(os.sep, '_')
        frames.append({'file_path': f'images/{stem}.jpg', 'transform_matrix': T.tolist(), 'w': scenes.WIDTH,
                       'h': scenes.HEIGHT, 'fl_x': scenes.FOCAL})
    return frames


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.top = folder.name

    def path(self, *names):
        return os.path.join(self.top, *names)


class Boxes(unittest.TestCase):
    def test_corners_are_sorted(self):
        low, high = box_choice.sorted_box(np.array([1, -2, 3.0]), np.array([0, 5, 4.0]))
        self.assertEqual((low.tolist(), high.tolist()), ([0, -2, 3], [1, 5, 4]))

    def test_corners_and_edges(self):
        corners = box_choice.corners_of(np.array([0, 0, 0.0]), np.array([1, 2, 3.0]))
        self.assertEqual(corners[[0, 1, 6, 7]].tolist(), [[0, 0, 0], [0, 0, 3], [1, 2, 0], [1, 2, 3]])
        lengths = sorted(np.linalg.norm(corners[i] - corners[j]) for i, j in box_choice.EDGES)
        self.assertEqual(lengths, 4 * [1] + 4 * [2] + 4 * [3])

    def test_thin_ones_are_refused(self):
        low = np.zeros(3)
        self.assertEqual(box_choice.refusal((low, np.array([1, 1, 0.0021])), 2), '')  # a thousandth is 0.002
        self.assertIn('along z it is 0.0019 thick', box_choice.refusal((low, np.array([1, 1, 0.0019])), 2))
        self.assertIn('along x it is 0 thick', box_choice.refusal((low, np.array([0, 1, 1.0])), 2))
        self.assertIn('not a number', box_choice.refusal((low, np.array([1, 1, np.nan])), 2))

    def test_a_first_box_is_what_the_cameras_look_at(self):
        # From 3 m at both sides, and 3 m above: a quarter of that each way around the origin.
        poses = [scenes.looking_at(np.array(centre), np.zeros(3)) for centre in ((3.0, 0, 0), (-3, 0, 0), (0, 3, 0))]
        cameras = Cameras(np.array([R for R, _ in poses]), np.array([-R.T @ t for R, t in poses]))
        low, high = box_choice.first_box(cameras)
        np.testing.assert_allclose([low, high], [3 * [-0.75], 3 * [0.75]], atol=1e-6)
        choice = box_choice.choice_of('x', cameras, np.zeros((0, 3)), np.zeros((0, 3)))
        self.assertEqual(choice.size, 6)

    def test_a_view_stands_upright(self):
        np.testing.assert_array_equal(box_choice.upright(np.array([0, 0, 2.0])), np.eye(3))
        # COLMAP's y is downwards: x stays, z is -y, and y is z.
        R = box_choice.upright(np.array([0, -1.0, 0]))
        self.assertEqual(R.T.tolist(), [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        half = np.sqrt(0.5)  # a quarter turn about x, which takes y to z
        np.testing.assert_allclose(box_choice.quaternion(R), [half, 0, 0, half], atol=1e-12)
        self.assertEqual(box_choice.quaternion(np.eye(3)), [0, 0, 0, 1])
        self.assertAlmostEqual(np.linalg.det(box_choice.upright(np.array([1, 0.1, 0]))), 1)


class Datasets(InFolder):
    def write(self, name, **content):
        write_json(self.path(name), {'frames': [{'file_path': 'a', 'transform_matrix': [
            [0, 0, 1, 2], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]}], **content})

    def test_cameras(self):
        # 2 m before the origin on x, upright, looking along -x: see test_object.py, which writes it.
        self.write('transforms.json')
        cameras = box_choice.cameras_in(self.top, box_choice.transforms_in(self.top))
        self.assertEqual(cameras.centres().tolist(), [[2, 0, 0]])
        self.assertEqual(cameras.directions().tolist(), [[-1, 0, 0]])
        np.testing.assert_allclose(cameras.R[0], scenes.looking_at(np.array([2.0, 0, 0]), np.zeros(3))[0], atol=1e-12)

    def test_the_present_box_is_that_which_train_reads(self):
        self.write('transforms_test.json', object_aabb=[[7, 7, 7], [8, 8, 8]])
        self.write('transforms_train.json', aabb=[[0, 0, 0], [9, 9, 9]], object_aabb=[[0, 0, 0], [1, 2, 3]])
        box = box_choice.present_box(self.top, box_choice.transforms_in(self.top))
        self.assertEqual(np.max(box, axis=0).tolist(), [1, 2, 3])

    def test_the_box_is_written_and_all_else_is_kept(self):
        self.write('real.json', aabb=[[0, 0, 0], [9, 9, 9]], title='Käse', k=0.1, n=12345678901234567890)
        os.symlink('real.json', self.path('transforms.json'))
        self.write('transforms_test.json')
        self.write('transforms_old.json')
        os.chmod(self.path('real.json'), 0o640)
        before = {name: box_choice.read_json(self.path(name)) for name in os.listdir(self.top)}
        names = sorted(os.listdir(self.top))
        paths = box_choice.write_box(self.top, (np.zeros(3), np.array([1, 2, 0.1])))
        self.assertEqual(paths, [self.path('transforms.json'), self.path('transforms_test.json')])
        for name in ('real.json', 'transforms_test.json'):
            expected = {**before[name], 'object_aabb': [[0, 0, 0], [1, 2, 0.1]]}
            self.assertEqual(list(box_choice.read_json(self.path(name)).items()), list(expected.items()))
        self.assertEqual(box_choice.read_json(self.path('transforms_old.json')), before['transforms_old.json'])
        self.assertTrue(os.path.islink(self.path('transforms.json')))
        self.assertEqual(stat.S_IMODE(os.stat(self.path('real.json')).st_mode), 0o640)
        self.assertEqual(sorted(os.listdir(self.top)), names)  # nothing temporary is left

    def test_two_names_of_one_file_leave_nothing_behind(self):
        self.write('transforms_train.json')
        os.symlink('transforms_train.json', self.path('transforms.json'))
        box_choice.write_box(self.top, (np.zeros(3), np.ones(3)))
        self.assertEqual(sorted(os.listdir(self.top)), ['transforms.json', 'transforms_train.json'])
        self.assertEqual(box_choice.read_json(self.path('transforms.json'))['object_aabb'], [[0, 0, 0], [1, 1, 1]])

    def test_where_one_file_cannot_be_written_none_is(self):
        for name in ('transforms_train.json', 'transforms_test.json'):
            self.write(name)
        with mock.patch('photos.common.temporary_file', side_effect=['unused', OSError('full')]):
            with self.assertRaisesRegex(OSError, 'full'):
                box_choice.write_box(self.top, (np.zeros(3), np.ones(3)))
        self.assertEqual([name for name in os.listdir(self.top)
                          if 'object_aabb' in box_choice.read_json(self.path(name))], [])

    def test_photos_outside_of_the_folder_are_not_read(self):
        cv2.imwrite(self.path('x.png'), np.zeros((8, 8, 3), np.uint8))
        inside = self.path('dataset')
        os.makedirs(inside)
        os.symlink('../x.png', os.path.join(inside, 'link.png'))
        for name in ('../x.png', self.path('x.png'), 'link.png'):
            self.assertIsNone(box_choice.read_reduced(inside, {'file_path': name}), name)
        self.assertEqual(box_choice.read_reduced(self.top, {'file_path': 'x'}).shape, (8, 8, 3))

    def test_choice_and_its_end(self):
        write_json(self.path('transforms.json'), {'frames': frames_of(scenes.reconstruction(scenes.rounds(3))),
                                                  'object_aabb': [[0, 0, 0], [1, 1, 1]]})
        choice = open_choice(self.top)
        self.assertEqual((choice.low.tolist(), choice.high.tolist(), choice.made_with), ([0, 0, 0], [1, 1, 1], None))
        with self.assertRaisesRegex(InputError, 'refused: along y'):
            use_box(choice, np.zeros(3), np.array([1, 0.0001, 1]))
        self.assertIn(self.path('transforms.json'), use_box(choice, np.ones(3), np.array([0, 2, -1.0])))
        self.assertEqual(box_choice.read_json(self.path('transforms.json'))['object_aabb'], [[0, 1, -1], [1, 2, 1]])

    def test_points_of_photos(self):
        poses = scenes.rounds(8)
        model = scenes.reconstruction(poses)
        os.makedirs(self.path('images'))
        frames = frames_of(model)
        for frame, pose in zip(frames, poses):
            cv2.imwrite(self.path(frame['file_path']), scenes.render(pose))
            frame['file_path'] = os.path.splitext(frame['file_path'])[0]
        write_json(self.path('transforms.json'), {'frames': frames})
        points = open_choice(self.top).points
        self.assertGreater(len(points), 100)
        # On the table or on the box: the height is 0, or the place below it is the box'.
        on_table = np.abs(points[:, 2]) < 0.01
        within = np.all(np.abs(points[:, :2]) < scenes.BOX[:2] / 2 + 0.01, axis=1) & (points[:, 2] < 0.17)
        self.assertGreater(np.mean(on_table | within), 0.9)
        self.assertGreater(np.count_nonzero(within & ~on_table), 20)
        write_json(self.path('transforms.json'), {'frames': frames, 'k1': 0.1})  # such lenses are left alone
        self.assertEqual(len(open_choice(self.top).points), 0)

    def test_what_is_no_dataset(self):
        with self.assertRaisesRegex(InputError, 'holds neither options.json'):
            open_choice(self.top)
        for content, message in (([], 'lists no frames'), ({'frames': []}, 'lists no frames'),
                                 ({'frames': [{}]}, 'frame 0: transform_matrix'),
                                 ({'frames': [{'transform_matrix': [[1, 2], [3]]}]}, 'frame 0: transform_matrix')):
            write_json(self.path('transforms.json'), content)
            with self.assertRaisesRegex(InputError, message):
                open_choice(self.top)
        self.write('transforms.json', aabb=[1, 2])
        with self.assertRaisesRegex(InputError, 'its box is not'):
            open_choice(self.top)


class Worlds(unittest.TestCase):
    def test_a_similarity(self):
        move = Similarity(2, QUARTER_TURN, np.array([1, 0, 0.0]))
        self.assertEqual(move.points(np.array([[1, 0, 3.0]])).tolist(), [[1, 2, 6]])
        np.testing.assert_allclose(move.inverse().points(np.array([[1, 2, 6.0]])), [[1, 0, 3]], atol=1e-12)
        turned = move.cameras(Cameras(np.eye(3)[None], np.zeros((1, 3))))
        self.assertEqual((turned.centre.tolist(), turned.directions().tolist()), ([[1, 0, 0]], [[0, 0, 1]]))
        self.assertEqual(turned.R[0, 0].tolist(), [0, 1, 0])  # what was x is y

    def test_cameras_are_aligned_though_one_pose_was_solved_again(self):
        source = cameras_of(scenes.reconstruction(scenes.rounds(4)))
        move = Similarity(0.25, exp_so3(np.array([0.4, -1, 2])), np.array([3, -1, 2.0]))
        target = move.cameras(source)
        target.R[2], target.centre[2] = exp_so3(np.array([0, 0, 0.1])) @ target.R[2], target.centre[2] + 0.1
        found = aligned(source, target)
        self.assertAlmostEqual(found.scale, 0.25)
        np.testing.assert_allclose(found.R, move.R, atol=1e-9)
        np.testing.assert_allclose(found.t, move.t, atol=1e-9)

    def test_other_cameras_are_not(self):
        source = cameras_of(scenes.reconstruction(scenes.rounds(4)))
        other = Cameras(source.R, source.centre + np.random.default_rng(1).normal(0, 0.001, source.centre.shape))
        self.assertIsNone(aligned(source, other))


class Again(InFolder):
    """The command with which photos_to_object goes on."""

    def make_output(self, options, move=None):
        """A folder as photos_to_object leaves it. @param move Similarity from COLMAP's poses to the dataset's; None: it did
        not get to the dataset."""
        model = scenes.reconstruction(scenes.rounds(4))
        os.makedirs(options.output)
        write_options(options)
        if options.poses == 'colmap':
            write_model(model, os.path.join(options.output, 'colmap', 'parts', '0'))
        if move is not None:
            self.write_dataset(options, frames_of(model, move))
        return model

    def write_dataset(self, options, frames):
        made_with = {'poses': options.poses, 'board': options.board, 'box': options.box}
        Steps(os.path.join(options.output, 'steps.json')).run('object', [], [], lambda: {'made_with': made_with})
        dataset = os.path.join(options.output, 'dataset')
        os.makedirs(dataset, exist_ok=True)
        write_json(os.path.join(dataset, 'transforms_train.json'),
                   {'object_aabb': [[0, 0, 0], [1, 2, 3]], 'frames': frames[1:]})
        write_json(os.path.join(dataset, 'transforms_test.json'), {'frames': frames[:1]})

    def options(self, **said):
        return Options(source='/photos/my mug', output=self.path('my mug_object'), name='my mug', **said)

    def words_of(self, choice):
        return shlex.split(use_box(choice, np.zeros(3), np.ones(3)).split('\n')[2])

    def test_without_a_board_all_is_shown_in_the_frame_of_the_poses(self):
        # A point x of COLMAP is 0.5 * (x turned from x to y) + (0, 0, 1) in the dataset.
        options = self.options(metres_per_unit=0.5, max_side=640)
        model = self.make_output(options, Similarity(0.5, QUARTER_TURN, np.array([0, 0, 1.0])))
        choice = open_choice(os.path.join(options.output, 'dataset'))  # which is a part of it
        np.testing.assert_allclose(choice.cameras.centre, np.roll(model.centres(), -1, axis=0), atol=1e-6)
        self.assertEqual(len(choice.points), np.count_nonzero(model.photos_of_points() >= 3))
        # The box from 0 to (1, 2, 3) of the dataset: x of COLMAP is 2 y, y is -2 x, z is 2 (z - 1).
        np.testing.assert_allclose([choice.low, choice.high], [[0, -2, -2], [4, 0, 4]], atol=1e-6)
        np.testing.assert_allclose(choice.up, [0, 0, 1], atol=1e-9)
        self.assertEqual(self.words_of(choice), [
            'rosrun', 'nerf_pose_refiner', 'photos_to_object', '/photos/my mug', '-o', options.output,
            '--metres-per-unit', '0.5', '--box', '0', '0', '0', '1', '1', '1', '--max-side', '640'])

    def test_with_a_board_all_is_shown_in_its_frame(self):
        move = Similarity(0.5, QUARTER_TURN, np.array([0, 0, 1.0]))
        options = self.options(board=BOARD)
        model = self.make_output(options, move)
        choice = open_choice(options.output)
        np.testing.assert_allclose([choice.low, choice.high], [[0, 0, 0], [1, 2, 3]], atol=1e-9)
        np.testing.assert_allclose(choice.cameras.centre,
                                   np.roll(move.points(model.centres()), -1, axis=0), atol=1e-6)
        self.assertLess(np.abs(choice.points[:, 2] - 1).min(), 1e-6)  # the table
        self.assertEqual(self.words_of(choice)[6:8], ['--board', BOARD])

    def test_poses_of_the_board_alone(self):
        options = self.options(poses='board', board=BOARD)
        self.make_output(options)
        self.write_dataset(options, frames_of(scenes.reconstruction(scenes.rounds(4))))
        choice = open_choice(options.output)
        np.testing.assert_allclose([choice.low, choice.high], [[0, 0, 0], [1, 2, 3]], atol=1e-9)
        self.assertEqual(self.words_of(choice)[6:10], ['--poses', 'board', '--board', BOARD])

    def test_poses_without_a_dataset_or_with_one_of_older_poses(self):
        options = self.options()
        self.make_output(options)
        choice = open_choice(options.output)
        self.assertTrue(np.all(choice.low < (0, 0, 0.06)) and np.all(choice.high > (0, 0, 0.06)))
        self.assertEqual(len(choice.present), 0)
        older = scenes.reconstruction(scenes.rounds(4))
        older.t += np.random.default_rng(1).normal(0, 0.01, older.t.shape)
        self.write_dataset(options, frames_of(older))
        self.assertEqual(len(open_choice(options.output).present), 0)

    def test_an_output_that_was_moved_goes_on_where_it_is(self):
        options = self.options()
        self.make_output(options)
        moved = self.path('elsewhere')
        os.rename(options.output, moved)
        self.assertEqual(self.words_of(open_choice(moved))[3:8], ['/photos/my mug', '-o', moved, '--box', '0'])

    def test_what_cannot_be_used(self):
        options = self.options(board='apriltag:36h11:40:0')
        self.make_output(options)
        with self.assertRaisesRegex(InputError, 'no dataset of its poses yet: give photos_to_object a --box in the frame'):
            open_choice(options.output)
        self.write_dataset(self.options(board=BOARD), frames_of(scenes.reconstruction(scenes.rounds(4))))
        with self.assertRaisesRegex(InputError, 'made with another --poses or --board than the last call'):
            open_choice(options.output)
        write_json(os.path.join(options.output, 'steps.json'), {'object': {'result': None}})
        with self.assertRaisesRegex(InputError, 'does not say how the dataset was made'):
            open_choice(options.output)
        for content, message in (([], 'options.json. is damaged'), ({'source': 'x'}, 'options.json. is damaged')):
            write_json(os.path.join(options.output, 'options.json'), content)
            with self.assertRaisesRegex(InputError, message):
                open_choice(options.output)
        os.unlink(os.path.join(options.output, 'options.json'))
        write_json(os.path.join(options.output, 'steps.json'), {})
        with self.assertRaisesRegex(InputError, 'does not hold options.json'):
            open_choice(options.output)


class Words(unittest.TestCase):
    """Of a command line, from options."""

    def test_they_are_read_back(self):
        program = loaded_program('photos_to_object')
        for said in ({}, {'board': BOARD, 'poses': 'board', 'learn': False, 'train': ['--steps=200', '--backend=cpu']},
                     {'box': [-1e-7, 0.0, -12.3456, 1 / 3, 2e6, 123456.0], 'metres_per_unit': 0.001, 'threads': 3},
                     {'length': ['0.25', 'a b.jpg', '1', '2.5', '3', '4', 'c.jpg', '5', '6', '7', '8'],
                      'masks': '/my masks', 'max_side': 640, 'max_minutes': 5.0, 'tools': '/tools'}):
            options = Options(source='/photos/my mug.mp4', output='/out/x', name='other', **said)
            back, _ = program.options_of(words_of(options))
            np.testing.assert_allclose(back.box, options.box, rtol=1e-5)
            self.assertEqual(dataclasses.replace(back, box=options.box), options)


class WithTheProgram(Command):
    def test_another_box_keeps_the_poses(self):
        """The object is found in the frame of COLMAP's poses, which is tilted, and made anew in the new box."""
        self.look_from(scenes.rounds(6))
        tilt, offset = exp_so3(np.array([1.0, 0.5, -2])), np.array([2, -1, 3.0])
        self.model = self.model.moved(5, tilt, offset)
        self.photos = os.path.join(self.top, 'mug')
        self.output = os.path.join(self.top, 'mug_object')
        self.take_photos()
        first = self.run_program('--no-training', '--metres-per-unit', '0.2')
        self.assertEqual(first.returncode, 0, first.stderr)
        choice = open_choice(self.output)
        # Corners of the true box on the table, in that frame, lie in the present box but for its margins.
        true = 5 * box_choice.corners_of(scenes.BOX * (-0.5, -0.5, 0), scenes.BOX * (0.5, 0.5, 1)) @ tilt.T + offset
        self.assertTrue(np.all(choice.low < true.min(axis=0) + 0.1) and np.all(choice.high > true.max(axis=0) - 0.1))
        np.testing.assert_allclose(choice.present.mean(axis=0), true.mean(axis=0), atol=0.2)

        np.testing.assert_allclose(choice.up, tilt[:, 2], atol=0.01)
        text = use_box(choice, true.min(axis=0) - 0.1, true.max(axis=0) + 0.1)
        words = shlex.split(text.split('\n')[2])
        self.assertEqual(words[3:6], [self.photos, '-o', self.output])
        calls = self.calls()
        again = self.run_program('--no-training', *words[6:])
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual([line for line in again.stdout.split('\n') if line.endswith(' ..')], ['object ..'])
        self.assertEqual(self.calls(), calls)  # none of COLMAP
        box = np.array(self.read('dataset', 'transforms_train.json')['object_aabb'])
        np.testing.assert_allclose(box, 0.2 * np.array([true.min(axis=0) - 0.1, true.max(axis=0) + 0.1]), rtol=1e-4)
        # Chosen once more, it begins with this box in the same frame.
        choice = open_choice(self.output)
        np.testing.assert_allclose([choice.low, choice.high], 5 * box, rtol=1e-6)
        self.assertGreater(choice.up @ tilt[:, 2] / np.linalg.norm(choice.up), np.cos(0.2))


if __name__ == '__main__':
    unittest.main()
