#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of what finds the object: table, box, masks, and the dataset that is written of them."""
import dataclasses
import json
import os
import tempfile
import unittest

import cv2
import numpy as np

import scenes
from photos import dataset, masks, object_masks, object_region, supporting_plane
from photos.common import InputError
from photos.geometry import exp_so3
from photos.object_region import Region, on_board, on_found_table, scaled
from photos.outline import is_unsure


class SupportingPlane(unittest.TestCase):
    def test_plane_and_box_of_a_box_on_a_table(self):
        model = scenes.reconstruction(noise_px=0)
        plane = supporting_plane.find_plane(model)
        np.testing.assert_allclose(plane.n, [0, 0, 1], atol=1e-3)
        self.assertAlmostEqual(plane.d, 0, delta=1e-3)
        points = supporting_plane.points_above(model, plane)
        self.assertGreater(points[:, 2].min(), 0)
        self.assertTrue(np.all(np.abs(points[:, :2]) <= scenes.BOX[:2] / 2 + 1e-9))

    def test_the_frame_stands_on_the_table_whatever_that_of_the_poses(self):
        R, t = exp_so3(np.array([0.3, -0.8, 0.5])), np.array([3, -1, 2.0])
        region = on_found_table(scenes.reconstruction(noise_px=0).moved(5, R, t))
        # x is the longer side, 1.0 with the scale of 5; the box has margins at its sides and its top, none at the table.
        size = np.ptp(region.points, axis=0)
        np.testing.assert_allclose(size, 5 * scenes.BOX, rtol=0.06)
        np.testing.assert_allclose(region.low[2], 0)
        self.assertGreater(region.reconstruction.centres()[:, 2].min(), 0)
        self.assertGreater(np.min(region.points[:, :2].min(axis=0) - region.low[:2]), 0)
        np.testing.assert_allclose(0.5 * (region.points.min(axis=0) + region.points.max(axis=0))[:2], 0, atol=0.05)

    def test_another_thing_on_the_table_is_not_the_object(self):
        model = scenes.reconstruction(noise_px=0)
        beside = np.random.default_rng(2).uniform((0.33, 0.33, 0.0), (0.4, 0.4, 0.2), (80, 3))
        model.xyz[:80] = np.where(model.xyz[:80, 2:] == 0, beside, model.xyz[:80])
        points = supporting_plane.points_above(model, supporting_plane.find_plane(model))
        self.assertLess(np.abs(points[:, :2]).max(), 0.2)

    def test_a_box_stands_for_points_above_a_board(self):
        model = scenes.reconstruction(noise_px=0)
        on_table = model.of_points(model.xyz[:, 2] == 0)
        with self.assertRaisesRegex(InputError, 'give --box'):
            on_board(on_table, None)
        region = on_board(on_table, [-0.1, -0.1, 0, 0.1, 0.1, 0.2])
        np.testing.assert_array_equal([region.low, region.high], [[-0.1, -0.1, 0], [0.1, 0.1, 0.2]])
        self.assertEqual((region.is_given, region.table_is_known, region.metres_per_unit), (True, True, 1.0))

    def test_a_plane_of_the_object_itself_is_not_the_table(self):
        model = scenes.reconstruction(noise_px=0)
        self.assertEqual(on_found_table(model).low[2], 0)
        on_box = np.all(np.abs(model.xyz[:, :2]) <= scenes.BOX[:2] / 2 + 1e-9, axis=1)
        bottom = np.random.default_rng(1).uniform(-0.5, 0.5, (60, 3)) * scenes.BOX * (1, 1, 0)
        on_table = np.flatnonzero(~on_box)
        model.xyz[on_table[:60]] = bottom + (0, 0, 0.01)  # of a plain table nothing is known but the object's lower edge
        region = on_found_table(model.of_points(on_box | np.isin(np.arange(len(on_box)), on_table[:60])))
        self.assertAlmostEqual(region.low[2], -0.12 * 0.2, delta=0.005)
        self.assertIn('too little texture', region.origin)

    def test_no_table(self):
        model = scenes.reconstruction()
        model.xyz[:] = np.random.default_rng(1).normal(0, 0.1, model.xyz.shape)
        with self.assertRaisesRegex(InputError, 'no table was found'):
            supporting_plane.find_plane(model)

    def test_nothing_on_it(self):
        model = scenes.reconstruction(noise_px=0)
        model = model.of_points(model.xyz[:, 2] == 0)
        with self.assertRaisesRegex(InputError, 'above the table'):
            supporting_plane.points_above(model, supporting_plane.find_plane(model))

    def test_clusters(self):
        points = np.array([[0, 0, 0], [0.9, 0, 0], [1.8, 0, 0], [9, 0, 0], [9.5, 0, 0]])
        labels = supporting_plane.clusters(points, 1.0)
        self.assertEqual([labels[0] == labels[i] for i in range(5)], [True, True, True, False, False])
        self.assertEqual(labels[3], labels[4])


def region_of(model):
    points = model.xyz[model.xyz[:, 2] > 1e-6]
    return Region(model, np.array([-0.25, -0.2, 0]), np.array([0.25, 0.2, 0.3]), False, points, True, 0)


class Scale(unittest.TestCase):
    def test_the_table_in_a_box_that_was_given(self):
        model = scenes.reconstruction(noise_px=0)
        region = object_region.within_box(model, [-0.2, -0.2, -0.05, 0.2, 0.2, 0.3])
        self.assertTrue(np.any(region.points[:, 2] < 1e-6))
        above = object_region.without_table(region).points
        self.assertGreater(above[:, 2].min(), 0.005)
        self.assertGreater(len(above), 0.8 * np.count_nonzero(region.points[:, 2] > 0.01))
        on_board = object_region.on_board(model, [-0.2, -0.2, -0.05, 0.2, 0.2, 0.3])
        np.testing.assert_array_equal(on_board.points, above)
        plain = model.of_points(model.xyz[:, 2] > 1e-6)  # nothing is known of the table
        plain_region = object_region.within_box(plain, [-0.2, -0.2, -0.05, 0.2, 0.2, 0.3])
        self.assertEqual(len(object_region.without_table(plain_region).points), len(plain_region.points))

    def test_known_and_unknown(self):
        region = region_of(scenes.reconstruction(noise_px=0))
        metric = scaled(region, 0.5)
        np.testing.assert_allclose(metric.high, [0.125, 0.1, 0.15])
        self.assertEqual(metric.metres_per_unit, 1)
        unknown = scaled(region, 0)
        self.assertEqual((unknown.high - unknown.low).max(), 1)
        self.assertEqual(unknown.metres_per_unit, 0)
        self.assertLess(unknown.reconstruction.errors().max(), 1e-6)


class Masks(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.poses = scenes.rounds(6)
        cls.model = scenes.reconstruction(cls.poses, noise_px=0)
        cls.photos = [dataset.PosedPhoto(f'view_{i}', f'{i}.jpg', scenes.render(pose), scenes.camera(), *pose)
                      for i, pose in enumerate(cls.poses)]
        cls.agreements, cls.box = object_masks.mask_photos(cls.photos, region_of(cls.model))

    def test_masks_are_the_object_without_the_table(self):
        for photo, pose in zip(self.photos, self.poses):
            found, true, sure = photo.mask >= 128, scenes.true_mask(pose) > 0, ~is_unsure(photo.mask)
            self.assertGreater(masks.agreement(found, true), 0.95, photo.name)
            self.assertGreater(masks.agreement(found & sure, true & sure), 0.97, photo.name)
            self.assertGreater(np.mean(sure[true | found]), 0.8, photo.name)
            self.assertLess(np.mean((sure & ~found)[true]), 0.02, photo.name)  # of the object, lost to the training
        self.assertGreater(min(self.agreements), 0.9)

    def test_the_box_grows_to_the_object(self):
        region = region_of(self.model)
        region.high[2] = 0.05  # it grows three times, by a third of its longest side or less
        self.assertGreater(object_masks.found_volume(self.photos, region).bounds()[1][2], scenes.BOX[2] - 0.02)

    def test_the_box_is_that_of_the_object(self):
        # Not smaller, and larger by what twelve silhouettes leave, of which one may deny a cell.
        low, high = self.box
        self.assertTrue(np.all(low[:2] < (-0.1, -0.06)) and np.all(high > (0.1, 0.06, 0.16)))
        np.testing.assert_allclose(low, [-0.1, -0.06, 0], atol=0.04)
        np.testing.assert_allclose(high, [0.1, 0.06, 0.16], atol=0.04)

    def test_a_box_that_is_too_small_grows(self):
        region = region_of(self.model)
        region.high[0] = 0.05
        _, box = object_masks.mask_photos(self.photos, region)
        self.assertAlmostEqual(box[1][0], 0.12, delta=0.02)

    @staticmethod
    def view(image):
        return masks.View(image, scenes.camera(), scenes.around(0, 30))

    def test_a_mask_that_the_others_deny_is_replaced(self):
        silhouette = np.zeros((100, 100), np.uint8)
        silhouette[30:70, 30:70] = 255
        mask, share = masks.agreed(self.view(silhouette), np.roll(silhouette, 40, axis=1), silhouette)
        self.assertEqual(share, 0)
        np.testing.assert_array_equal(mask, silhouette)

    def test_the_table_is_cut_off_but_leaves_no_hole(self):
        silhouette = np.zeros((100, 100), np.uint8)
        silhouette[30:70, 30:70] = 255
        view = self.view(silhouette)
        view.table[:, 69:] = 255      # along the outline
        view.table[45:55, 45:55] = 255  # one photo alone, within
        mask, _ = masks.agreed(view, silhouette, silhouette)
        np.testing.assert_array_equal(mask[30:70, 30:69], 255)
        self.assertFalse(mask[:, 69:].any())

    def test_the_table_is_no_object_whatever_the_seeds_say(self):
        view = self.view(np.full((60, 80, 3), 120, np.uint8))
        view.image[20:40, 30:50] = (0, 0, 200)
        view.table[20:40, 30:34] = 255
        trimap = np.full((60, 80), cv2.GC_BGD, np.uint8)
        trimap[18:42, 28:52] = cv2.GC_PR_FGD
        trimap[20:40, 30:50] = cv2.GC_FGD
        found = masks.grab_cut(view, trimap)
        self.assertFalse(found[view.table > 0].any())
        self.assertTrue((found[22:38, 36:48] == 255).all())

    def test_a_mask_may_not_cut_off_what_the_others_see(self):
        silhouette = np.zeros((100, 100), np.uint8)
        silhouette[30:70, 30:70] = 255
        mask = silhouette.copy()
        mask[30:70, 60:70] = 0
        result, share = masks.agreed(self.view(silhouette), mask, silhouette)
        self.assertAlmostEqual(share, 0.75)
        self.assertEqual(result[50, 67], 255)  # within two pixels of the silhouette: the band is 0.04 of 40 px
        larger = silhouette.copy()
        larger[30:70, 26:30] = 255
        result, _ = masks.agreed(self.view(silhouette), larger, silhouette)
        self.assertEqual((result[50, 29], result[50, 28]), (255, 0))  # outwards it is narrower

    def test_votes(self):
        volume = masks.Volume(np.array([-0.25, -0.2, 0]), np.array([0.25, 0.2, 0.3]))
        views = [masks.View(photo.image, photo.camera, (photo.R, photo.t)) for photo in self.photos]
        volume.vote(views, [scenes.true_mask(pose) for pose in self.poses])
        low, high = volume.bounds()
        np.testing.assert_allclose(high[:2], [0.1, 0.06], atol=0.03)
        # From above the hull of silhouettes is higher than the box by little: cameras stand at 25 and 50 degrees.
        self.assertTrue(0.155 < high[2] < 0.2, high)
        self.assertLess(volume.cells[volume.occupied][:, 2].min(), volume.size)

    def test_what_one_side_denies_is_not_the_object(self):
        # 32 photos in a round; some say that nothing is left of the middle. Four beside each other see a gap that the
        # others do not see; four that are far from each other err. Either way 28 of 32, enough of all votes, agree.
        views = [masks.View(np.zeros((240, 320, 3), np.uint8), scenes.camera(), pose) for pose in scenes.rounds(32, (25,))]
        half = np.full((240, 320), 255, np.uint8)
        half[:, :160] = 0
        volume = masks.Volume(np.array([-0.1, -0.1, 0]), np.array([0.1, 0.1, 0.1]))
        for denying, left in (((0, 1, 2, 3), 0), ((0, 8, 16, 24), 1)):
            volume.vote(views, [half if i in denying else np.full_like(half, 255) for i in range(32)])
            _, x, _ = views[1].pixels_of(volume.cells)
            self.assertEqual(np.mean(volume.occupied[x < 135]), left)
            self.assertEqual(np.mean(volume.occupied[x > 195]), 1)

    def test_points_of_the_object_stay(self):
        # The right half of what two rounds took for the object has the colours of the table, but points lie on it.
        silhouette = np.zeros((240, 320), np.uint8)
        silhouette[80:160, 100:220] = 255
        image = np.full((240, 320, 3), 200, np.uint8)
        image[80:160, 100:160] = (40, 60, 200)
        pose = scenes.looking_at(np.array([0, -0.8, 0.06]), np.array([0, 0, 0.06]))
        view = masks.View(image, scenes.camera(), pose)
        x, y = np.meshgrid(np.arange(100, 220, 4), np.arange(80, 160, 4))
        rays = np.column_stack(((x.ravel() + 0.5 - 160) / scenes.FOCAL, (y.ravel() + 0.5 - 120) / scenes.FOCAL,
                                np.ones(x.size)))
        seeds = (0.8 * rays - pose[1]) @ pose[0]
        kept = masks.mask_of(view, masks.band_trimap(view, silhouette, 0.3, seeds))
        self.assertGreater(masks.agreement(kept, silhouette), 0.95)
        cut = masks.mask_of(view, masks.band_trimap(view, silhouette, 0.3, seeds[:0]))
        self.assertLess(np.mean(cut[80:160, 160:220] > 0), 0.1)

    def test_points_beside_the_surface(self):
        x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
        plane = np.column_stack((x.ravel(), y.ravel(), np.zeros(400)))
        stray = [[5.3, 5.3, 1.5], [12.2, 3.1, -2]]
        kept = masks.on_surface(np.concatenate((plane, stray)))
        np.testing.assert_array_equal(kept, plane)
        np.testing.assert_array_equal(masks.on_surface(plane[:3]), plane[:3])  # too few to tell

    def test_a_box_without_points_is_the_object_first(self):
        image = np.full((240, 320, 3), 200, np.uint8)
        pose = scenes.looking_at(np.array([0, -0.8, 0.06]), np.array([0, 0, 0.06]))
        volume = masks.Volume(-scenes.BOX / 2 + (0, 0, 0.06), scenes.BOX / 2 + (0, 0, 0.06))
        image[volume.silhouette(masks.View(image, scenes.camera(), pose)) > 0] = (40, 60, 200)
        view = masks.View(image, scenes.camera(), pose)
        larger = masks.Volume(1.3 * volume.low, 1.3 * volume.high)
        mask = masks.mask_of(view, masks.first_trimap(view, larger, np.zeros((0, 3))))
        self.assertGreater(masks.agreement(mask, volume.silhouette(view)), 0.95)

    def views(self, drawn):
        """@param drawn {number of a photo: the user's mask}"""
        return [masks.View(photo.image, photo.camera, (photo.R, photo.t), drawn.get(i)) for i, photo in enumerate(self.photos)]

    def test_drawn_masks_take_away_in_all_photos(self):
        volume = masks.Volume(np.array([-0.25, -0.2, 0]), np.array([0.25, 0.2, 0.3]))
        true = [scenes.true_mask(pose) for pose in self.poses]
        too_large = [cv2.dilate(mask, masks.disc(41)) for mask in true]
        surplus = []
        for drawn in ({}, {i: true[i] for i in (0, 1, 8)}):
            volume.vote(self.views(drawn), too_large)
            silhouettes = [volume.silhouette(view) for view in self.views({})]
            surplus.append(np.mean([np.count_nonzero(seen[mask == 0]) / np.count_nonzero(mask)
                                    for seen, mask in zip(silhouettes, true)]))
        self.assertGreater(surplus[0], 0.5)
        self.assertLess(surplus[1], 0.3 * surplus[0])

    def test_a_drawn_mask_brings_back_what_some_photos_deny(self):
        volume = masks.Volume(np.array([-0.25, -0.2, 0]), np.array([0.25, 0.2, 0.3]))
        true = [scenes.true_mask(pose) for pose in self.poses]
        seen_by_some = [mask if i % 3 else np.zeros_like(mask) for i, mask in enumerate(true)]  # by two thirds
        volume.vote(self.views({}), seen_by_some)
        self.assertFalse(volume.occupied.any())
        views = self.views({1: true[1]})
        volume.vote(views, seen_by_some)
        self.assertGreater(masks.agreement(volume.silhouette(views[1]), true[1]), 0.9)

    def test_the_drawn_mask_is_kept_as_it_is(self):
        photos = [dataclasses.replace(photo) for photo in self.photos]
        photos[2].drawn = scenes.true_mask(self.poses[2])
        photos[2].drawn[100:102, 150:160] = 0
        object_masks.mask_photos(photos, region_of(self.model))
        np.testing.assert_array_equal(photos[2].mask, photos[2].drawn)

    def test_a_right_mask_leaves_the_others_as_they_are(self):
        photos = [dataclasses.replace(photo) for photo in self.photos]
        photos[2].drawn = scenes.true_mask(self.poses[2])
        _, box = object_masks.mask_photos(photos, region_of(self.model))
        np.testing.assert_allclose(box, self.box, atol=0.015)
        for photo, before, pose in zip(photos, self.photos, self.poses):
            true = scenes.true_mask(pose)
            self.assertGreater(masks.agreement(photo.mask >= 128, true), masks.agreement(before.mask >= 128, true) - 0.01)

    def test_inverted_masks_contradict_the_others(self):
        photos = [dataclasses.replace(photo) for photo in self.photos]
        photos[2].drawn = 255 - scenes.true_mask(self.poses[2])
        with self.assertRaisesRegex(InputError, r"masks drawn for 2\.jpg contradict those of the other photos\. White"):
            object_masks.mask_photos(photos, region_of(self.model))

    def test_names_of_drawn_masks(self):
        photos = [dataclasses.replace(self.photos[i], source=source) for i, source in
                  enumerate(('a.jpg', 'a.png', 'b.jpg', 'film.mp4, frame 7'))]
        white = np.full((scenes.HEIGHT, scenes.WIDTH), 255, np.uint8)
        with tempfile.TemporaryDirectory() as folder:
            for name, message in (('a', "may be of 'a.jpg' or of 'a.png': name it 'view_0.png' or 'view_1.png'"),
                                  ('film', 'named like no photo'), ('b', None), ('view_3', None)):
                path = os.path.join(folder, name + '.png')
                cv2.imwrite(path, white)
                if message:
                    with self.assertRaisesRegex(InputError, message):
                        object_masks.take_drawn_masks(photos, [path])
                else:
                    object_masks.take_drawn_masks(photos, [path])
            self.assertEqual([photo.drawn is not None for photo in photos], [False, False, True, True])
            cv2.imwrite(os.path.join(folder, 'b.jpg'), white)
            with self.assertRaisesRegex(InputError, 'b.jpg. is no PNG'):
                object_masks.drawn_masks(folder)

    def test_drawn_masks_that_cannot_be_used(self):
        photo = self.photos[0]
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaisesRegex(InputError, 'holds no masks'):
                object_masks.drawn_masks(folder)
            white = np.full((scenes.HEIGHT, scenes.WIDTH), 255, np.uint8)
            whole, short, black = (cv2.imencode('.png', mask)[1].tobytes() for mask in (white, white[1:], 0 * white))
            for names, content, message in ((['other.png'], whole, 'named like no photo'), (['view_0.png'], short, '320 x 239'),
                                            (['view_0.png'], b'text', 'is no JPEG or PNG'),
                                            (['view_0.png'], whole[:60], 'damaged'),
                                            (['0.png', 'view_0.png'], whole, "second mask of '0.jpg'"),
                                            (['0.png'], black, 'it is black')):  # by the name of the user's photo
                paths = [os.path.join(folder, name) for name in names]
                for path in paths:
                    with open(path, 'wb') as file:
                        file.write(content)
                with self.assertRaisesRegex(InputError, message):
                    object_masks.take_drawn_masks([dataclasses.replace(photo)], object_masks.drawn_masks(folder))
                for path in paths:
                    os.unlink(path)


class Dataset(unittest.TestCase):
    def test_what_is_written(self):
        # The camera stands 2 m before the origin on the x axis, upright: it sees along -x; OpenGL's z looks back, to +x.
        R, t = scenes.looking_at(np.array([2.0, 0, 0]), np.zeros(3))
        photos = [dataset.PosedPhoto(f'view_{i}', f'IMG {i}.jpg', scenes.render((R, t)), scenes.camera(), R, t,
                                     np.full((scenes.HEIGHT, scenes.WIDTH), 255, np.uint8)) for i in range(9)]
        with tempfile.TemporaryDirectory() as top:
            folder = os.path.join(top, 'dataset')
            dataset.write_dataset(photos, (np.zeros(3), np.array([1, 2, 3.0])), 0.25, folder)
            contents = {}
            for part in ('train', 'test'):
                with open(os.path.join(folder, f'transforms_{part}.json'), encoding='utf-8') as file:
                    contents[part] = json.load(file)
            self.assertEqual([len(contents[part]['frames']) for part in ('train', 'test')], [8, 1])
            frame = contents['test']['frames'][0]
            self.assertEqual(frame['source'], 'IMG 4.jpg')  # of eight the one in the middle is held out
            np.testing.assert_allclose(frame['transform_matrix'],
                                       [[0, 0, 1, 2], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], atol=1e-12)
            self.assertEqual([frame[key] for key in ('w', 'h', 'fl_x', 'cx')], [320, 240, 330, 160])
            self.assertEqual(contents['train']['object_aabb'], [[0, 0, 0], [1, 2, 3]])
            self.assertEqual(contents['train']['metres_per_unit'], 0.25)
            for key in ('file_path', 'mask_path'):
                self.assertIsNotNone(cv2.imread(os.path.join(folder, frame[key])))
            self.assertEqual(os.listdir(top), ['dataset'])

    def test_distortion_is_taken_out(self):
        bent = scenes.camera(distortion=(-0.2, 0.05, 0, 0))
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'a.png')
            image = np.full((scenes.HEIGHT, scenes.WIDTH), 255, np.uint8)
            corner = np.array([[0.3, 0.2, 1]])
            x, y = bent.pixels(corner)[0] - 0.5
            cv2.circle(image, (round(x * 16), round(y * 16)), 5 * 16, 0, -1, cv2.LINE_AA, 4)
            cv2.imwrite(path, image)
            flat, pinhole = dataset.undistorted(path, bent)
        moments = cv2.moments(255 - cv2.cvtColor(flat, cv2.COLOR_BGR2GRAY))
        found = np.array([moments['m10'], moments['m01']]) / moments['m00'] + 0.5
        np.testing.assert_allclose(found, pinhole.pixels(corner)[0], atol=0.15)


if __name__ == '__main__':
    unittest.main()
