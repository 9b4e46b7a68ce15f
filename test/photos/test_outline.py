#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of how the table, as all photos show it, tells the object from what is behind it."""
import os
import tempfile
import unittest

import cv2
import numpy as np

import scenes
from photos import mask_volume, masks, outline, quality
from photos.common import InputError, write_json
from photos.plane_match import below_horizon
from photos.table_pixels import GRID, Look, Table

BOX = np.array([-0.15, -0.1, 0]), np.array([0.15, 0.1, 0.2])
SIZE = 100


def points_of_object():
    points, _ = scenes.scene_points(np.random.default_rng(1))
    return points[points[:, 2] > 1e-6]


def views_of(poses, painted=None, camera=None):
    return [masks.View(scenes.render(pose, camera, painted), camera or scenes.camera(), pose) for pose in poses]


class TableInPhotos(unittest.TestCase):
    def test_what_hides_the_table(self):
        """Without the object's points: what all photos hide is never taken for the table, if masks say where it is."""
        poses = scenes.rounds(8, (35, 60))
        views, truth = views_of(poses), [scenes.true_mask(pose) for pose in poses]
        for table in (Table(views, BOX, points_of_object()), Table(views, BOX, np.empty((0, 3)), truth)):
            for view, mask in zip(views, truth):
                hidden, beyond = (image > 0 for image in table.hidden_in(view))
                self.assertGreater(np.mean(hidden[mask > 0]), 0.25)  # the upper part, before what is known
                beside = cv2.dilate(mask, np.ones((5, 5), np.uint8)) == 0
                self.assertLess(np.mean(hidden[beside]), 0.002)
                self.assertFalse(np.any(hidden & beyond))

    def test_what_is_beyond_the_table(self):
        poses = scenes.rounds(8, (12, 60))
        views = views_of(poses)
        table = Table(views, BOX, points_of_object())
        for view, pose in zip(views, poses):
            beyond = table.hidden_in(view)[1] > 0
            ends = np.all(view.image == 90, axis=2)  # of what is rendered
            inner = cv2.erode(np.uint8(ends), np.ones((15, 15), np.uint8)) > 0
            self.assertGreater(np.mean(beyond[inner]) if inner.any() else 1, 0.98)
            self.assertLess(np.mean(beyond[scenes.true_mask(pose) > 0]), 0.6)

    def test_rays_above_the_horizon_meet_the_plane_behind_the_camera(self):
        view = views_of([scenes.looking_at(np.array([0.8, 0, 0.1]), np.array([0, 0, 0.1]))])[0]
        table = Table(views_of(scenes.rounds(8)), BOX, points_of_object())
        below = below_horizon(view)  # the camera looks along the plane: the horizon is its middle row
        self.assertFalse(below[:scenes.HEIGHT // 2 - 1].any())
        self.assertTrue(below[scenes.HEIGHT // 2 + 1:].all())
        self.assertTrue((table.hidden_in(view)[1][:scenes.HEIGHT // 2 - 1] == 255).all())

    def test_sure_views_alone_count_where_there_are_enough(self):
        """Half the photos show something dark on the table: in three others it is surely the table."""
        poses = scenes.rounds(8, (60,))
        views = views_of(poses)
        for view in views[::2]:
            view.image[:] = 20
        place = np.array([[0.13, 0.09, 0.0]])  # beside the box
        for view in views[1::2][:3]:
            inside, x, y = view.pixels_of(place)
            self.assertTrue(inside.all())
            cv2.circle(view.table, (int(x[0]), int(y[0])), 8, 255, -1)
        table = Table(views, BOX, np.empty((0, 3)))
        x, y = np.round((place[0, :2] - table.to_plane[:2, 2]) / table.to_plane[0, 0]).astype(int)
        self.assertGreater(table.colour[y, x].max(), 60)
        self.assertEqual(table.distance[y, x], 0)

    def test_nothing_is_known_where_few_photos_show_the_table(self):
        table = Table(views_of(scenes.rounds(2)), BOX, points_of_object())  # four photos
        self.assertTrue(table.beyond.all())
        self.assertGreater(table.distance.min(), GRID)


def disc_mask(radius):
    return cv2.circle(np.zeros((SIZE, SIZE), np.uint8), (50, 50), radius, 255, -1)


def look(off=0.0, spread=0.0, distance=0.0, beyond=False):
    return Look(*(np.full((SIZE, SIZE), value, np.float32) for value in (off, spread, distance)),
                np.full((SIZE, SIZE), beyond))


class Outline(unittest.TestCase):
    def test_moves_to_where_the_photo_begins_to_differ(self):
        true, seen = disc_mask(32), look()
        seen.off[true > 0] = 60
        for radius in (30, 34):  # masks that are too small or too large by less than the band
            found = outline.against_table(seen, disc_mask(radius), disc_mask(radius))
            self.assertGreater(masks.agreement(found, true), 0.995)

    def test_a_blurred_edge_is_halved(self):
        true, seen = disc_mask(32), look()
        seen.off[:] = cv2.GaussianBlur(np.float32(true) / 255 * 100, (0, 0), 1.0)
        found = outline.against_table(seen, disc_mask(34), disc_mask(33))
        self.assertAlmostEqual(np.count_nonzero(found) / np.count_nonzero(true), 1, delta=0.04)

    def test_stays_where_the_table_does_not_tell(self):
        mask = disc_mask(30)
        for seen in (look(off=100, beyond=True), look(off=100, distance=outline.FAR + 1), look(off=8),
                     look(off=0, spread=outline.PLAIN + 1), look(off=25, spread=200)):
            self.assertGreater(masks.agreement(outline.against_table(seen, mask, mask), mask), 0.998)

    def test_is_unsure_where_nothing_is_known_behind_it(self):
        mask, everywhere = disc_mask(30), np.full((SIZE, SIZE), 255, np.uint8)
        seen = look(off=100)
        seen.beyond[:50] = True
        found = outline.with_doubts(seen, mask, everywhere)
        np.testing.assert_array_equal(found >= 128, mask > 0)
        for (row, column), value in {(18, 50): outline.PERHAPS_BACKGROUND, (21, 50): outline.PERHAPS_OBJECT, (45, 50): 255,
                                     (10, 50): 0, (79, 50): 255, (81, 50): 0}.items():
            self.assertEqual(found[row, column], value, (row, column))
        sure = outline.with_doubts(seen, mask, 0 * everywhere)  # no other photo tells what is there
        np.testing.assert_array_equal(sure, mask)

    def test_gaps_are_unsure_if_they_begin_at_the_outline(self):
        mask, everywhere = disc_mask(40), np.full((SIZE, SIZE), 255, np.uint8)
        seen = look(off=100)
        seen.off[10:40, 44:56] = 0  # from above into the mask
        seen.off[60:75, 44:56] = 0  # within it: a part of the table's colour
        found = outline.with_doubts(seen, mask, everywhere)
        self.assertEqual([found[30, 50], found[67, 50], found[50, 50]], [outline.PERHAPS_OBJECT, 255, 255])


class Votes(unittest.TestCase):
    def test_those_before_an_unknown_background_count_half(self):
        """A quarter of the photos denies the object's upper half."""
        poses = scenes.rounds(8, (30, 55))
        views = views_of(poses)
        shown = [scenes.true_mask(pose) for pose in poses]
        for mask in shown[::4]:
            rows = np.flatnonzero(mask.any(axis=1))
            mask[:rows.mean().astype(int)] = 0
        heights = []
        for doubtful in (False, True):
            for view in views[::4]:
                view.beyond[:] = 255 if doubtful else 0
            volume = mask_volume.Volume(*BOX)
            volume.vote(views, shown)
            heights.append(volume.bounds()[1][2])
        self.assertLess(heights[0], 0.85 * scenes.BOX[2])
        self.assertAlmostEqual(heights[1], scenes.BOX[2], delta=0.03)

    def test_those_before_an_unknown_background_have_none_if_enough_show_the_table(self):
        """Of 27 photos 18 show what is beyond, of which some deny the object's upper half: all from one side among them."""
        poses = scenes.rounds(9, (25, 50, 65))
        views = views_of(poses)
        for known, denying, is_whole in ((9, 12, True), (9, 18, False), (7, 12, False)):
            shown = [scenes.true_mask(pose) for pose in poses]
            for mask in shown[:denying]:
                mask[:np.flatnonzero(mask.any(axis=1)).mean().astype(int)] = 0
            for i, view in enumerate(views):
                view.beyond[:] = 255 if i < len(views) - known else 0
            volume = mask_volume.Volume(*BOX)
            volume.vote(views, shown)
            self.assertEqual(volume.bounds()[1][2] > 0.98 * scenes.BOX[2], is_whole, (known, denying))

    def test_one_photo_alone_has_no_veto(self):
        """Neither one that shows what is beyond, nor one of few that do not."""
        for per_round, beyond, wrong in ((14, (0,), 0), (6, range(6), 6), (10, range(10), 10)):
            poses = scenes.rounds(per_round, (25, 60))
            views, shown = views_of(poses), [scenes.true_mask(pose) for pose in poses]
            for i in beyond:
                views[i].beyond[:] = 255
            whole, damaged = (mask_volume.Volume(*BOX) for _ in range(2))
            whole.vote(views, shown)
            shown[wrong][:np.flatnonzero(shown[wrong].any(axis=1)).mean().astype(int)] = 0
            damaged.vote(views, shown)
            kept = np.count_nonzero(whole.occupied & damaged.occupied) / np.count_nonzero(whole.occupied)
            self.assertGreater(kept, 0.9, per_round)

    def test_a_drawn_mask_is_right_about_the_table(self):
        poses = scenes.rounds(8, (30, 55))
        views, shown = views_of(poses), [scenes.true_mask(pose) for pose in poses]
        occupied = []
        for table in (0, 1):
            for view, mask in zip(views[:3], shown):
                view.drawn, view.added, view.table = mask, mask, table * mask
            volume = mask_volume.Volume(*BOX)
            volume.vote(views, shown)
            occupied.append(volume.occupied)
        self.assertTrue(occupied[0].any())
        np.testing.assert_array_equal(occupied[0], occupied[1])

    def test_what_two_photos_show_the_table_through_is_gone(self):
        """Masks with a piece of the table beside the box, between it and the camera's side."""
        poses = scenes.rounds(8, (30, 55))
        everything = [np.full((scenes.HEIGHT, scenes.WIDTH), 255, np.uint8) for _ in poses]
        for sure, expected in ((1, True), (2, False)):
            views = views_of(poses)
            place = np.array([[0.14, 0.0, 0.05]])
            for view in views[:sure]:
                _, x, y = view.pixels_of(place)
                cv2.circle(view.table, (int(x[0]), int(y[0])), 4, 255, -1)
            volume = mask_volume.Volume(*BOX)
            volume.vote(views, everything)
            nearest = np.linalg.norm(volume.cells - place, axis=1).argmin()
            self.assertEqual(bool(volume.occupied[nearest]), expected)

    def test_a_camera_that_looks_away_says_nothing(self):
        away = views_of([scenes.looking_at(np.array([0.8, 0, 0.3]), np.array([2.0, 0, 0.3]))])[0]
        volume = mask_volume.Volume(*BOX)
        self.assertFalse(volume.silhouette(away).any())
        self.assertFalse(volume.supported(away).any())

    def test_the_user_knows_what_is_before_an_unknown_background(self):
        poses = scenes.rounds(8, (30, 55))
        views, shown = views_of(poses), [scenes.true_mask(pose) for pose in poses]
        for view, mask in zip(views, shown):
            view.beyond[:], view.drawn, view.added = 255, mask, mask
        volume = mask_volume.Volume(*BOX)
        volume.vote(views, shown)
        self.assertTrue((volume.supported(views[0])[shown[0] > 0] > 0).all())

    def test_support_is_what_enough_photos_show_before_the_table(self):
        poses = scenes.rounds(8, (30, 55))
        views, shown = views_of(poses), [scenes.true_mask(pose) for pose in poses]
        volume = mask_volume.Volume(*BOX)
        for known, expected in ((16, True), (6, True), (3, False)):
            for i, view in enumerate(views):
                view.beyond[:] = 0 if i < known else 255
            volume.vote(views, shown)
            self.assertEqual(bool(volume.supported(views[0])[shown[0] > 0].all()), expected, known)


class Quality(unittest.TestCase):
    def test_pixels_of_which_nothing_is_known_do_not_count(self):
        photo, mask = np.full((40, 40, 3), 120, np.uint8), np.zeros((40, 40), np.uint8)
        mask[10:30, 10:30] = 255
        rendering = np.dstack((photo, mask))
        rendering[10:14, :, 3] = 0
        guess = mask.copy()
        guess[10:14, 10:30] = outline.PERHAPS_OBJECT
        guess[6:10, 10:30] = outline.PERHAPS_BACKGROUND
        with tempfile.TemporaryDirectory() as folder:
            for name in ('images', 'masks', 'renderings'):
                os.mkdir(os.path.join(folder, name))
            cv2.imwrite(os.path.join(folder, 'images', 'a.png'), photo)
            cv2.imwrite(os.path.join(folder, 'renderings', 'a.png'), cv2.resize(rendering, None, fx=2, fy=2,
                                                                                interpolation=cv2.INTER_NEAREST))
            write_json(os.path.join(folder, 'transforms_test.json'),
                       {'frames': [{'file_path': 'images/a.png', 'mask_path': 'masks/a.png', 'source': 'a'}]})
            rows = []
            for said in (mask, guess):
                cv2.imwrite(os.path.join(folder, 'masks', 'a.png'), said)
                rows += quality.measure(folder, os.path.join(folder, 'renderings'))
            with open(os.path.join(folder, 'masks', 'a.png'), 'w', encoding='utf-8') as file:
                file.write('damaged')
            with self.assertRaisesRegex(InputError, "masks/a.png': it is missing or damaged"):
                quality.measure(folder, os.path.join(folder, 'renderings'))
        self.assertLess(rows[0]['psnr_object_db'], 20)
        self.assertEqual((rows[1]['psnr_object_db'], rows[1]['psnr_db']), (60, 60))


if __name__ == '__main__':
    unittest.main()
