#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of what measures photos_to_object: errors of cameras, and faults that are put into models."""
import os
import tempfile
import unittest

import cv2
import numpy as np

import scenes
from photo_trials import reference, spoiled, truth
from photos.geometry import exp_so3


def matrix(R, t):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def known(model, T_W_B=None):
    return truth.Truth('', model.cameras[0], {name: matrix(R, t) for name, R, t in zip(model.names, model.R, model.t)},
                       T_W_B, np.zeros((2, 3)), '')


def found(model):
    return [truth.Found(name, name, None, None, np.linalg.inv(matrix(R, t)), False)
            for name, R, t in zip(model.names, model.R, model.t)]


class Errors(unittest.TestCase):
    def test_a_similarity_is_no_error_but_in_scale(self):
        model = scenes.reconstruction()
        turned = model.moved(1.02, exp_so3(np.array([0.2, 0.1, -0.3])), np.array([1, 2, 3.0]))
        errors, aligned = truth.pose_errors(known(model), found(turned))
        self.assertAlmostEqual(errors['scale'], 1 - 1 / 1.02)
        self.assertLess(errors['turn_deg'].max(), 1e-4)
        self.assertLess(errors['shift_m'].max(), 1e-6)
        np.testing.assert_allclose(aligned[0], np.linalg.inv(matrix(model.R[0], model.t[0])), atol=1e-6)
        self.assertNotIn('board_turn_deg', errors)

    def test_in_the_frame_of_a_board_nothing_is_fitted(self):
        model = scenes.reconstruction()
        T_W_B = matrix(exp_so3(np.array([0, 0, 0.7])), [0.1, 0.2, 0])
        R, t = T_W_B[:3, :3].T, -T_W_B[:3, :3].T @ T_W_B[:3, 3]
        in_board = model.moved(1, R, t)
        errors, _ = truth.pose_errors(known(model, T_W_B), found(in_board))
        self.assertLess(errors['board_turn_deg'].max(), 1e-4)
        self.assertLess(errors['board_shift_m'].max(), 1e-6)
        shifted = in_board.moved(1, np.eye(3), np.array([0.003, 0, 0]))
        errors, _ = truth.pose_errors(known(model, T_W_B), found(shifted))
        np.testing.assert_allclose(errors['board_shift_m'], 0.003, atol=1e-6)
        self.assertLess(errors['shift_m'].max(), 1e-6)


class Masks(unittest.TestCase):
    def test_overlap_and_share(self):
        # Of 40 pixels 30 are found, and 10 beside them: 30 of 50 in common, three quarters of the object.
        true, found = np.zeros((10, 10), np.uint8), np.zeros((10, 10), np.uint8)
        true[:4], found[1:5] = 255, 255
        with tempfile.TemporaryDirectory() as output:
            os.makedirs(os.path.join(output, 'dataset', 'masks'))
            for name, mask in (('a', found), ('b', true), ('c', true)):
                cv2.imwrite(os.path.join(output, 'dataset', 'masks', name + '.png'), mask)
            photos = [truth.Found(name, name, np.eye(3), (10, 10), np.eye(4), False) for name in 'abc']
            figures = reference.figures_of_masks(output, photos, [true] * 3)
        self.assertEqual(figures, {'mask_iou': 1, 'mask_iou_worst': 0.6, 'mask_share': 1, 'mask_share_worst': 0.75})


class Faults(unittest.TestCase):
    def test_wrong_poses(self):
        model = scenes.reconstruction()
        wrong, expected = spoiled.with_wrong_poses(model, 1)
        self.assertEqual(len(expected), round(spoiled.WRONG_SHARE * len(model.names)))
        left = [i for i in range(len(model.names)) if i not in expected]
        np.testing.assert_array_equal(wrong.R[left], model.R[left])
        middle = np.median(model.xyz, axis=0)
        for i in expected:  # it looks at the same from elsewhere
            np.testing.assert_allclose(wrong.R[i] @ middle + wrong.t[i], model.R[i] @ middle + model.t[i], atol=1e-9)
        said = spoiled.judged(wrong, model, expected)
        self.assertTrue(said['found'])
        self.assertEqual((said['falsely named'], said['spoiled']), ([], len(expected)))
        self.assertLess(said['worst of solved again [deg]'], 0.5)

    def test_focal_lengths(self):
        model = scenes.reconstruction()
        said = spoiled.judged(*[spoiled.with_focal_lengths(model, 1)[0], model, None])
        self.assertTrue(said['found'])
        self.assertRegex(said['said'], 'focal lengths of one camera differ')
        self.assertFalse(spoiled.judged(model, model, None)['found'])


if __name__ == '__main__':
    unittest.main()
