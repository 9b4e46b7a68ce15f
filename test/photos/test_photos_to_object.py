#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/photos_to_object as users call it, with a stand-in for COLMAP.

    test_photos_to_object.py [TOOLS]

TOOLS: folder of the programs train and render; without it, nothing is learned.
"""
import dataclasses
import os
import shutil
import sys
import unittest

import cv2
import numpy as np

import scenes
from object_command import Command, write_model
from photos import turntable
from photos.board import Board, text_of
from photos.masks import agreement
from photos.outline import is_unsure

TOOLS = os.path.abspath(sys.argv.pop()) if len(sys.argv) > 1 and os.path.isdir(sys.argv[-1]) else None


class OneObject(Command):
    def test_photos_to_a_dataset_that_is_not_made_twice(self):
        self.take_photos()
        self.model = self.model.of_photos([i for i in range(16) if i not in (3, 9)])
        result = self.run_program('--no-training')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('2 of 16 photos have no pose: 2 their place does not agree with the others (IMG 03.png, IMG 09.png)',
                      result.stdout)
        self.assertEqual(self.calls(), ['feature_extractor', 'matches_importer', 'mapper', 'bundle_adjuster', 'bundle_adjuster'])
        self.check_dataset()
        report = self.read('report.json')
        self.assertEqual((report['posed'], report['photos'], report['wrong'], report['folded']), (14, 16, {}, []))
        self.assertTrue(any('scale is unknown' in text for text in report['advice']), report['advice'])
        with open(os.path.join(self.output, 'report.html'), encoding='utf-8') as file:
            page = file.read()
        self.assertEqual(page.count('src="data:image/jpeg;base64,'), 14)
        self.assertNotRegex(page, 'src="(?!data:)|href=')  # nothing outside of the file
        again = self.run_program('--no-training')
        self.assertEqual((again.returncode, len(self.calls())), (0, 5), again.stderr)
        self.assertNotIn(' ..\n', again.stdout)  # no step was done
        self.check_drawn_mask()

    def check_drawn_mask(self):
        """A mask that is corrected stays so, and only what depends on it is done again."""
        folder, name = os.path.join(self.top, 'drawn'), self.read('dataset', 'transforms_train.json')['frames'][0]['mask_path']
        drawn = cv2.imread(os.path.join(self.output, 'dataset', name), cv2.IMREAD_GRAYSCALE)
        drawn[:, :drawn.shape[1] // 2] = 0
        os.mkdir(folder)
        cv2.imwrite(os.path.join(folder, os.path.basename(name)), drawn)
        result = self.run_program('--no-training', '--masks', folder)
        self.assertEqual((result.returncode, result.stdout.count(' ..\n')), (0, 1), result.stderr)
        kept = cv2.imread(os.path.join(self.output, 'dataset', name), cv2.IMREAD_GRAYSCALE)
        np.testing.assert_array_equal(kept, np.where(drawn >= 128, 255, 0))  # what the user leaves unsure, too

    def check_dataset(self):
        train, test = self.read('dataset', 'transforms_train.json'), self.read('dataset', 'transforms_test.json')
        self.assertEqual((len(train['frames']), len(test['frames'])), (12, 2))
        low, high = np.array(train['object_aabb'])
        # The scale is unknown: the box is as wide as it was searched, and about as long, wide and high as the object.
        np.testing.assert_allclose((high - low) / (high - low)[0], scenes.BOX / scenes.BOX[0], atol=0.2)
        for frame in train['frames'] + test['frames']:
            pose = self.poses[int(frame['source'][4:6])]
            mask = cv2.imread(os.path.join(self.output, 'dataset', frame['mask_path']), cv2.IMREAD_GRAYSCALE)
            found, true, sure = mask >= 128, scenes.true_mask(pose) > 0, ~is_unsure(mask)
            self.assertGreater(agreement(found, true), 0.9, frame['source'])
            self.assertGreater(agreement(found & sure, true & sure), 0.94, frame['source'])
            self.assertGreater(np.mean(sure[true | found]), 0.7, frame['source'])

    def test_photos_that_are_cut_out(self):
        self.take_photos()
        for i, pose in enumerate(self.poses):
            path = os.path.join(self.photos, f'IMG {i:02d}.png')
            alpha = 257 * scenes.true_mask(pose).astype(np.uint16)[:, :, None]
            image = np.concatenate((257 * cv2.imread(path).astype(np.uint16), alpha), axis=2)
            cv2.imwrite(path, image if i % 2 else (image // 257).astype(np.uint8))  # 16 bits, 8 bits
        result = self.run_program('--no-training')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('photos are cut out', self.read('report.json')['frame'])
        for frame in self.read('dataset', 'transforms_train.json')['frames']:
            mask = cv2.imread(os.path.join(self.output, 'dataset', frame['mask_path']), cv2.IMREAD_GRAYSCALE)
            np.testing.assert_array_equal(mask, scenes.true_mask(self.poses[int(frame['source'][4:6])]))
        with open(os.path.join(self.top, 'options'), encoding='utf-8') as file:
            self.assertIn(f"ImageReader.mask_path {os.path.join(self.output, 'photos', 'alpha')}", file.read())
        cv2.imwrite(os.path.join(self.photos, 'IMG 03.png'), np.zeros((240, 320, 4), np.uint8))
        result = self.run_program('--no-training')
        self.assertRegex(result.stderr, 'IMG 03.png\' is transparent everywhere')

    def test_a_model_whose_sides_are_in_one_place_is_refused(self):
        model, _ = scenes.folded(shared=lambda points: np.abs(points[:, 1]) < scenes.BOX[1] / 2 - 1e-6)
        model = model.of_points(model.xyz[:, 2] > 1e-6)
        self.look_from(list(zip(model.R, model.t)))
        self.take_photos()
        self.model = dataclasses.replace(model, names=[f'camera_0/view_{i:04d}.jpg' for i in range(len(self.poses))])
        result = self.run_program('--no-training')
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, r'the model is folded: IMG \d\d\.png and IMG \d\d\.png show different things in the same '
                         'place. The object looks the same from several sides: put something with texture beside it')
        self.assertFalse(os.path.exists(os.path.join(self.output, 'dataset')))

    def test_an_interrupted_run_goes_on(self):
        self.take_photos()
        result = self.run_program('--no-training', COLMAP_FAILS='mapper')
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, r'colmap mapper failed \(exit code 3\).*it went wrong here')
        self.assertFalse([name for name in os.listdir(os.path.join(self.output, 'colmap')) if 'parts' in name])
        result = self.run_program('--no-training')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(self.calls(), ['feature_extractor', 'matches_importer', 'mapper', 'mapper', 'bundle_adjuster', 'bundle_adjuster'])

    def test_a_known_length_gives_the_scale(self):
        self.look_from(scenes.rounds(6))
        self.take_photos()
        ends = np.array([[0.1, -0.06, 0.16], [0.1, 0.06, 0.16]])
        marks = []
        for i in (0, 5):
            marks += [f'IMG {i:02d}.png', *map(str, self.model.projected(i, ends).ravel())]
        result = self.run_program('--no-training', '--length', '0.06', *marks)  # half of what the model says
        self.assertEqual(result.returncode, 0, result.stderr)
        train = self.read('dataset', 'transforms_train.json')
        self.assertEqual(train['metres_per_unit'], 1)
        heights = np.array([frame['transform_matrix'] for frame in train['frames']])[:, 2, 3]
        expected = 0.5 * (0.06 + scenes.DISTANCE * np.sin(np.radians([25, 50])))
        np.testing.assert_allclose([heights.min(), heights.max()], expected, rtol=0.01)

    def test_wrong_poses_are_named_and_solved_again(self):
        self.take_photos()
        for photo in (2, 11):
            self.model.R, self.model.t = scenes.turned(self.model, photo, 8)
        result = self.run_program('--no-training')
        self.assertEqual(result.returncode, 0, result.stderr)
        for name in ('IMG 02.png', 'IMG 11.png'):
            self.assertRegex(result.stdout, name + ': the points that it sees lie .* px beside where its pose puts them; its '
                             'pose was solved again')
        self.assertEqual(self.read('report.json')['posed'], 16)

    def test_a_folded_model_is_solved_again_with_its_larger_part(self):
        both, n = scenes.folded(shared=0.0)
        self.model = both.of_photos(list(range(2 * n - 2)))
        self.model.names = [f'camera_0/view_{i:04d}.jpg' for i in range(2 * n - 2)]
        self.poses = list(zip(self.model.R, self.model.t))
        self.take_photos()
        result = self.run_program('--no-training')
        self.assertIn('the model was folded: 10 photos (IMG 12.png, IMG 13.png, IMG 14.png ..)', result.stdout,
                      result.stderr)
        self.assertEqual(self.calls()[2:], 2 * ['mapper', 'bundle_adjuster', 'bundle_adjuster'])
        self.assertEqual(self.read('report.json')['posed'], n)

    def test_a_board_gives_poses_and_scale_without_colmap(self):
        """A camera of 640 x 480 at 0.8 m: poses within 2 mm, though the lens is not known."""
        board = Board(12, 12, 40.0, 30.0, '4X4_100')
        camera = scenes.Camera(640, 480, np.array([620.0, 620, 320, 240, 0, 0, 0, 0]))
        upright = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # as every third photo is taken
        self.poses = [(upright @ R, upright @ t) if i % 3 == 0 else (R, t)
                      for i, (R, t) in enumerate(scenes.rounds(10, (35, 60)))]
        self.take_photos(camera=camera, painted=scenes.on_board(board))
        result = self.run_program('--no-training', '--poses', 'board', '--board', text_of(board))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(self.calls(), [])
        report, train = self.read('report.json'), self.read('dataset', 'transforms_train.json')
        self.assertEqual(result.stdout.count('board ..'), 1)
        again = self.run_program('--no-training', '--poses', 'board', '--board', text_of(board))
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertNotIn(' ..\n', again.stdout)  # no step was done again
        self.assertEqual((report['posed'], train['metres_per_unit']), (20, 1))
        for frame in train['frames']:
            R, t = self.poses[int(frame['source'][4:6])]
            self.assertLess(np.linalg.norm(np.array(frame['transform_matrix'])[:3, 3] + R.T @ t), 0.002)
        low, high = np.array(train['object_aabb'])
        self.assertTrue(np.all(low[:2] < -scenes.BOX[:2] / 2) and np.all(high > scenes.BOX * (0.5, 0.5, 1)), (low, high))
        np.testing.assert_allclose(high - low, scenes.BOX, atol=0.08)

    def test_a_model_with_a_focal_length_for_each_photo_is_named_and_solved_again(self):
        project = os.path.join(self.top, 'project')
        self.take_photos(os.path.join(project, 'images'))
        cameras = [scenes.camera(scenes.FOCAL * (1 + 0.01 * i)) for i in range(len(self.poses))]
        write_model(scenes.reconstruction(self.poses, cameras=cameras), os.path.join(project, 'sparse', '0'))
        result = self.run_program('--no-training', source=project)
        self.assertEqual(result.returncode, 0, result.stderr)
        # From 1 to 1.15; the median is 1.075.
        self.assertIn('the model in sparse/0 is not used: focal lengths of one camera differ by 14 %', result.stdout)
        self.assertEqual(self.calls(), ['feature_extractor', 'matches_importer', 'mapper', 'bundle_adjuster', 'bundle_adjuster'])
        self.assertEqual(self.read('report.json')['posed'], 16)

    def test_the_principal_point_is_what_the_photos_show(self):
        self.take_photos()
        result = self.run_program('--no-training', COLMAP_MOVES='3')
        self.assertEqual(result.returncode, 0, result.stderr)
        # The photos show it to 0.3 px; their prior draws it towards the middle a little.
        frame = self.read('dataset', 'transforms_train.json')['frames'][0]
        self.assertAlmostEqual(frame['cx'], scenes.WIDTH / 2 + 3, delta=0.3)

    def test_photos_without_overlap(self):
        self.take_photos()
        result = self.run_program('--no-training', COLMAP_UNLIKE='1')
        self.assertEqual(result.returncode, 1)
        self.assertIn('no two photos show the same thing from two places: take photos that overlap', result.stderr)
        self.assertEqual(result.stderr.count('\n'), 1)
        self.assertEqual(sorted(os.listdir(self.output)), ['.lock', 'colmap', 'options.json', 'photos', 'steps.json'])

    def test_what_cannot_be_used(self):
        self.take_photos()
        for words, message in ((('--poses', 'board'), 'needs --board'), (('--board', 'x'), "'x' is no board"),
                               (('--length', '1', 'none.jpg', '1', '2', '3', '4'), '--length: give METRES')):
            result = self.run_program('--no-training', *words)
            self.assertEqual(result.returncode, 1)
            self.assertIn(message, result.stderr)
            self.assertFalse(os.path.exists(os.path.join(self.output, 'dataset')))
        os.unlink(os.path.join(self.bin, 'colmap'))
        if not shutil.which('colmap', path='/usr/bin:/bin'):
            self.assertIn('COLMAP is not installed', self.run_program('--no-training').stderr)

    @unittest.skipUnless(TOOLS, 'without the folder of the tools')
    def test_learning_and_the_report(self):
        self.take_photos()
        words = ('--tools', TOOLS, '--steps', '200', '--backend', 'cpu', '--metres-per-unit', '1', '--name', 'crate')
        result = self.run_program(*words)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue(os.path.isfile(os.path.join(self.output, 'crate.safetensors')))
        report = self.read('report.json')
        self.assertEqual(len(report['quality']), 16)
        self.assertEqual(sum(row['held_out'] for row in report['quality']), 2)
        self.assertGreater(np.mean([row['psnr_object_db'] for row in report['quality'] if row['held_out']]), 12)
        self.assertEqual(report['model']['metres_per_unit'], 1)
        self.assertIn('PSNR on the object, 2 held-out photos', result.stdout)
        strip = cv2.imread(os.path.join(self.output, 'turntable.jpg'))
        self.assertEqual(strip.shape, (turntable.SIDE, turntable.FRAMES * turntable.SIDE, 3))
        seen = [np.mean(np.abs(view.astype(int) - turntable.GREY) > 40)
                for view in np.split(strip, turntable.FRAMES, axis=1)]
        self.assertGreater(min(seen), 0.05)  # from each side, and not cut off
        self.assertLess(max(seen), 0.8)
        with open(os.path.join(self.output, 'report.html'), encoding='utf-8') as file:
            page = file.read()
        self.assertEqual(page.count('class="turntable"'), 1)
        self.assertNotRegex(page, 'src="(?!data:)|href=|<script')


class ManyObjects(Command):
    def test_parts_failures_and_the_overview(self):
        self.look_from(scenes.rounds(5))
        objects = os.path.join(self.top, 'objects')
        for name in ('a', 'b', 'c #1'):
            self.take_photos(os.path.join(objects, name))
        os.makedirs(os.path.join(objects, 'empty'))
        first = self.run_program('--many', '--no-training', '--part', '0/2', source=objects)
        self.assertEqual(first.returncode, 0, first.stdout + first.stderr)
        self.assertEqual([row['state'] for row in self.read('index.json')], ['done', 'not yet', 'done', 'not yet'])
        second = self.run_program('--many', '--no-training', '--part', '1/2', source=objects)
        self.assertEqual(second.returncode, 1)
        rows = {row['name']: row for row in self.read('index.json')}
        self.assertEqual(rows['empty']['state'], 'failed')
        self.assertIn('holds no photos', rows['empty']['why'])
        self.assertEqual([rows[name]['state'] for name in ('a', 'c #1')], ['done', 'done'])
        with open(os.path.join(self.output, 'index.html'), encoding='utf-8') as file:
            self.assertIn('href="c%20%231/report.html"', file.read())
        before = len(self.calls())
        self.run_program('--many', '--no-training', '--part', '0/2', source=objects)
        self.assertEqual(len(self.calls()), before)
        wrong = self.run_program('--many', '--part', '2/2', source=objects)
        self.assertIn('--part 2/2: write i/n', wrong.stderr)
        masks = self.run_program('--many', '--masks', objects, source=objects)
        self.assertIn('--masks are those of one object', masks.stderr)


if __name__ == '__main__':
    unittest.main()
