#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of what photos of the table's plane have in common, and what does not."""
import unittest

import cv2
import numpy as np

import scenes
from photos import masks
from photos.board import Board
from photos.plane_match import (APART, BETWEEN, MIN_PARALLAX, PARTNERS, below_horizon, parallax, partners_of, plane_to_pixels,
                                shows_plane)

BOX = np.array([-0.1, -0.06, 0]), np.array([0.1, 0.06, 0.16])
MIDDLE = 0.5 * (BOX[0] + BOX[1])
CAMERA = scenes.Camera(480, 360, np.array([460.0, 460, 240, 180, 0, 0, 0, 0]))
POSES = scenes.rounds(8, (35, 60))


def on_board():
    """A box with the board's colours on the board."""
    painted = scenes.on_board(Board(12, 12, 40.0, 30.0, '4X4_100'))
    return painted[:1] + [(corners, painted[0][1]) for corners, _ in painted[1:]]


def views_of(painted, gains=(1.0,)):
    """@param gains of the photos' exposures, in turn"""
    views = [masks.View(scenes.render(pose, CAMERA, painted), CAMERA, pose) for pose in POSES]
    for i, view in enumerate(views):
        view.image = np.uint8(np.clip(view.image * gains[i % len(gains)], 0, 255))
    return views


def shown_in(views, box=BOX):
    return [shows_plane(view, [views[j] for j in partners]) > 0 for view, partners in zip(views, partners_of(views, box))]


class PlaneMatch(unittest.TestCase):
    def test_a_point_of_the_plane_and_its_pixel(self):
        """A camera 2 m above, which looks down with its x axis along the world's: (0.1, 0.2, 0) is 23 px right of the middle
        and 46 px above."""
        view = masks.View(np.zeros((360, 480, 3), np.uint8), CAMERA, (np.diag((1.0, -1, -1)), np.array([0, 0, 2.0])))
        x, y, w = plane_to_pixels(view) @ (0.1, 0.2, 1)
        np.testing.assert_allclose((x / w, y / w), (240 + 23 - 0.5, 180 - 46 - 0.5))
        self.assertTrue(below_horizon(view).all())

    def test_partners_look_from_elsewhere(self):
        views = [masks.View(np.zeros((36, 48, 3), np.uint8), CAMERA, pose) for pose in scenes.rounds(90, (45,))]
        directions = np.array([-view.R.T @ view.t - MIDDLE for view in views])
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        for i, partners in enumerate(partners_of(views, BOX)):
            self.assertEqual(len(partners), PARTNERS)
            cosines, among = directions[partners] @ directions[i], directions[partners] @ directions[partners].T
            self.assertLess(cosines.max(), APART)
            self.assertLess((among - 2 * np.eye(PARTNERS)).max(), BETWEEN)
            np.testing.assert_array_equal(np.argsort(-cosines, kind='stable'), np.arange(PARTNERS))  # nearest first

    def test_parallax(self):
        """From 45 degrees on both sides the top, 0.16 m high, hides places of the table 0.16 m beyond it."""
        views = [masks.View(np.zeros((360, 480, 3), np.uint8), CAMERA, scenes.looking_at(np.array([x, 0, 0.96]), np.array([0, 0, 0.16])))
                 for x in (0.8, -0.8)]
        (same, shift), _ = parallax(views, BOX)
        self.assertAlmostEqual(same, 0, delta=1e-6)
        place = np.array([-0.16, 0, 0]) - np.array([-0.8, 0, 0.96])  # of the table that the first photo shows at the top
        seen = views[1].R @ place
        self.assertAlmostEqual(shift, 460 * np.linalg.norm(seen[:2]) / seen[2], delta=1e-6)

    def test_flat_objects_have_far_partners_or_none(self):
        views = [masks.View(np.zeros((360, 480, 3), np.uint8), CAMERA, pose) for pose in scenes.rounds(24, (45,))]
        counts = []
        for height in (0.16, 0.01, 0.001):
            box = BOX[0], np.array([0.1, 0.06, height])
            partners, shifts = partners_of(views, box), parallax(views, box)
            counts.append(len(partners[0]))
            self.assertTrue(all((shifts[i, chosen] > MIN_PARALLAX).all() for i, chosen in enumerate(partners)))
        self.assertEqual((counts[0], counts[2]), (PARTNERS, 0))
        self.assertGreater(counts[1], 0)

    def check(self, views, object_masks, least):
        for shown, truth in zip(shown_in(views), object_masks):
            self.assertLess(np.mean(shown[truth > 0]), 0.01)
            ring = cv2.dilate(truth, np.ones((41, 41), np.uint8)) > 0
            self.assertGreater(np.mean(shown[ring & (truth == 0)]), least)

    def test_the_table_is_told_from_an_object_of_its_colours(self):
        self.check(views_of(on_board()), [scenes.true_mask(pose, CAMERA) for pose in POSES], 0.15)

    def test_so_it_is_with_other_exposures(self):
        self.check(views_of(on_board(), (1.0, 0.7, 0.85)), [scenes.true_mask(pose, CAMERA) for pose in POSES], 0.15)

    def test_a_plain_table_says_nothing(self):
        """But for the corners of the object's foot, which are on it."""
        plain = [(corners, np.full((64, 64, 3), 200 if i == 0 else 60, np.uint8)) for i, (corners, _) in enumerate(scenes.quads())]
        for shown, pose in zip(shown_in(views_of(plain)), POSES):
            around = cv2.dilate(scenes.true_mask(pose, CAMERA), np.ones((31, 31), np.uint8)) > 0  # the table's edge is beyond
            self.assertLess(np.mean(shown[around]), 0.015)

    def test_a_thin_object_is_not_the_table(self):
        """A card on the board, with fine spots or with blotches alone."""
        board, corners = on_board()[0], 0.15 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
        blotches = scenes.texture(1, 100)
        for height, paint in ((0.012, scenes.detailed(blotches, 1)), (0.012, blotches), (0.005, blotches), (0.003, blotches)):
            card = corners + (0, 0, height)
            white = [(board[0], np.zeros((8, 8, 3), np.uint8)), (card, np.full((8, 8, 3), 255, np.uint8))]
            for pose, shown in zip(POSES, shown_in(views_of([board, (card, paint)]), (corners[0], card[2]))):
                self.assertLess(np.mean(shown[scenes.render(pose, CAMERA, white)[:, :, 0] > 127]), 0.02, height)

    def test_a_hollow_of_the_object_shows_the_table(self):
        """Below a plate that is wider than the box."""
        plate = np.array([(-0.2, -0.15, 0.16), (0.2, -0.15, 0.16), (0.2, 0.15, 0.16), (-0.2, 0.15, 0.16)])
        painted = on_board() + [(plate, scenes.detailed(scenes.texture(7, 5), 7))]
        black, white = np.zeros((8, 8, 3), np.uint8), np.full((8, 8, 3), 255, np.uint8)
        views, hollow = views_of(painted), 0
        for pose, shown in zip(POSES, shown_in(views)):
            truth = scenes.render(pose, CAMERA, [(corners, white if i else black) for i, (corners, _) in enumerate(painted)])
            truth = np.uint8(truth[:, :, 0] > 127)
            self.assertLess(np.mean(shown[truth > 0]), 0.01)
            hull, _ = cv2.findContours(truth, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
            inner = cv2.fillConvexPoly(np.zeros_like(truth), cv2.convexHull(np.concatenate(hull)), 1)
            hollow += np.count_nonzero(shown & (inner > 0) & (truth == 0))
        self.assertGreater(hollow, 2000)


if __name__ == '__main__':
    unittest.main()
