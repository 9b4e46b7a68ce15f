#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks the motion of recordings: conventions by hand-worked poses, the promised speeds and sizes for many seeds."""
import os
import sys
import unittest

import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'recordings'))
import motion  # noqa: E402
import rig  # noqa: E402

CENTRE_O, DIAMETER = np.array([0.01, -0.02, 0.08]), 0.2
ELEVATIONS_DEG = (-10, 75)
SEEDS = range(12)


def trajectory(seed):
    return motion.Trajectory(seed, DIAMETER, CENTRE_O, ELEVATIONS_DEG)


class Conventions(unittest.TestCase):
    def test_a_camera_on_the_x_axis_sees_y_to_the_right_and_z_up(self):
        R = motion.view_rotation(0, 0, 0)
        np.testing.assert_allclose(R @ [1, 0, 0], [0, 0, -1], atol=1e-15)  # towards the camera
        np.testing.assert_allclose(R @ [0, 1, 0], [1, 0, 0], atol=1e-15)
        np.testing.assert_allclose(R @ [0, 0, 1], [0, -1, 0], atol=1e-15)

    def test_azimuth_counts_from_x_to_y_and_elevation_upwards(self):
        np.testing.assert_allclose(motion.view_rotation(np.pi / 2, 0, 0) @ [0, 1, 0], [0, 0, -1], atol=1e-15)
        np.testing.assert_allclose(motion.view_rotation(0.3, np.pi / 2, 0) @ [0, 0, 1], [0, 0, -1], atol=1e-15)

    def test_roll_turns_the_image(self):
        np.testing.assert_allclose(motion.view_rotation(0, 0, np.pi / 2) @ [0, 1, 0], [0, 1, 0], atol=1e-15)

    def test_the_line_of_sight_turns_by_the_smallest_rotation(self):
        direction = np.array([3.0, 0, 4]) / 5
        R = motion.rotation_onto(direction)
        np.testing.assert_allclose(R @ [0, 0, 1], direction, atol=1e-15)
        np.testing.assert_allclose(R @ [0, 1, 0], [0, 1, 0], atol=1e-15)  # its axis
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)

    def test_angles_between_rotations(self):
        for angle_deg in (0, 1e-5, 0.5, 89, 91, 150, 180):
            R = motion.rotation_about(1, np.radians(angle_deg))
            found = float(motion.angle_between_deg(np.eye(3), R))
            self.assertAlmostEqual(found, angle_deg, delta=1e-9 + 1e-7 * angle_deg)

    def test_speeds_of_a_motion_worked_by_hand(self):
        T = np.stack([np.eye(4)] * 2)
        T[1, :3, :3] = motion.rotation_about(2, np.radians(2))
        T[:, :3, 3] = [-CENTRE_O, -T[1, :3, :3] @ CENTRE_O + [0.03, 0, 0.04]]  # the centre moves by 5 cm
        speeds = motion.motion_speeds(T, CENTRE_O, DIAMETER)
        np.testing.assert_allclose(speeds.deg_s, [60])          # 2 degrees in 1/30 s
        np.testing.assert_allclose(speeds.diameters_s, [7.5])   # a quarter of a diameter in 1/30 s


class EverySeed(unittest.TestCase):
    def setUp(self):
        self.t_s = motion.frame_times(10.0)
        self.assertEqual(len(self.t_s), 300)

    def test_is_as_fast_as_promised(self):
        for seed in SEEDS:
            speeds = motion.motion_speeds(trajectory(seed).T_C_O(self.t_s), CENTRE_O, DIAMETER)
            self.assertGreaterEqual(np.median(speeds.deg_s), 40, seed)
            self.assertGreaterEqual(np.percentile(speeds.deg_s, 95), 100, seed)
            self.assertLess(speeds.deg_s.max(), 300, seed)  # 10 degrees a frame
            self.assertGreaterEqual(np.median(speeds.diameters_s), 0.5, seed)

    def test_covers_all_sizes_and_stays_in_the_image(self):
        for seed in SEEDS:
            T = trajectory(seed).T_C_O(self.t_s)
            centre_C = T[:, :3, :3] @ CENTRE_O + T[:, :3, 3]
            size = DIAMETER * motion.FOCAL_PX / centre_C[:, 2] / motion.WIDTH
            self.assertAlmostEqual(size.min(), 1 / 8, places=9)
            self.assertAlmostEqual(size.max(), 1, places=9)
            offset_px = np.abs(centre_C[:, :2] / centre_C[:, 2:] * motion.FOCAL_PX)
            self.assertTrue((offset_px < [motion.WIDTH / 2, motion.HEIGHT / 2]).all(), seed)

    def test_is_seen_only_from_the_permitted_elevations(self):
        for seed in SEEDS:
            T_O_C = np.linalg.inv(trajectory(seed).T_C_O(self.t_s))
            eye = T_O_C[:, :3, 3] - CENTRE_O
            elevation_deg = np.degrees(np.arcsin(eye[:, 2] / np.linalg.norm(eye, axis=1)))
            self.assertGreaterEqual(elevation_deg.min(), ELEVATIONS_DEG[0] - 1e-6)
            self.assertLessEqual(elevation_deg.max(), ELEVATIONS_DEG[1] + 1e-6)

    def test_has_rigid_poses_that_depend_on_the_moment_alone(self):
        for seed in SEEDS:
            path = trajectory(seed)
            for poses in (path.T_C_O(self.t_s), path.T_W_C(self.t_s),
                          motion.Occluder(seed, path).T_C_X(self.t_s)):
                np.testing.assert_allclose(poses[:, :3, :3] @ np.swapaxes(poses[:, :3, :3], 1, 2),
                                           np.broadcast_to(np.eye(3), (300, 3, 3)), atol=1e-12)
            np.testing.assert_allclose(path.T_C_O(self.t_s[17]), path.T_C_O(self.t_s)[17], atol=1e-12)

    def test_is_the_same_again_and_another_for_another_seed(self):
        np.testing.assert_array_equal(trajectory(3).T_C_O(self.t_s), trajectory(3).T_C_O(self.t_s))
        np.testing.assert_array_equal(trajectory(3).T_W_C(self.t_s), trajectory(3).T_W_C(self.t_s))
        self.assertGreater(np.abs(trajectory(3).T_C_O(0.0) - trajectory(4).T_C_O(0.0)).max(), 0.1)


class OccluderMotion(unittest.TestCase):
    def test_passes_in_front_without_touching(self):
        t_s = motion.frame_times(10.0)
        for seed in SEEDS:
            path = trajectory(seed)
            occluder = motion.Occluder(seed, path)
            centre_C, cover_C = path.centre_C(t_s), occluder.T_C_X(t_s)[:, :3, 3]
            gap = np.linalg.norm(centre_C - cover_C, axis=1) - (DIAMETER + occluder.diameter) / 2
            self.assertGreater(gap.min(), 0, seed)
            self.assertGreater(cover_C[:, 2].min(), occluder.diameter / 2, seed)  # before the camera, all of it
            # How far apart their middles look, in the object's apparent diameters: near at times, apart at others.
            apart = np.linalg.norm(cover_C / cover_C[:, 2:] - centre_C / centre_C[:, 2:], axis=1)
            apart *= centre_C[:, 2] / DIAMETER
            self.assertLess(apart.min(), 0.45, seed)
            self.assertGreater(apart.max(), 0.45, seed)


class Rigs(unittest.TestCase):
    def seats(self, seed, duration_s=5.0):
        return [rig.Seat('rig', camera, seed, DIAMETER, CENTRE_O, duration_s) for camera in range(3)]

    def test_a_camera_looks_at_its_target_with_z_upwards(self):
        T = rig.looking_at([0, -2.0, 0.5], np.array([0, 1.0, 0.5]), 0.0)
        np.testing.assert_allclose(T[:3, :3] @ [0, 0, 1], [0, 1, 0], atol=1e-12)  # forward
        np.testing.assert_allclose(T[:3, :3] @ [0, 1, 0], [0, 0, -1], atol=1e-12)  # down
        np.testing.assert_allclose(T[:3, 3], [0, -2, 0.5])

    def test_cameras_stand_still_and_60_to_90_degrees_apart(self):
        for seed in SEEDS:
            first, second, third = self.seats(seed)
            for other in (second, third):
                a, b = first.T_W_C(0.0)[:3, 3], other.T_W_C(0.0)[:3, 3]
                flat = [v[:2] / np.linalg.norm(v[:2]) for v in (a, b)]
                angle = np.degrees(np.arccos(flat[0] @ flat[1]))
                self.assertTrue(60 - 1e-6 < angle < 90 + 1e-6, angle)
                np.testing.assert_allclose(other.T_W_C(3.0), other.T_W_C(0.0), atol=1e-12)

    def test_all_cameras_see_one_object_in_the_middle_of_their_images(self):
        t_s = rig.frame_times(5.0)
        for seed in SEEDS:
            seats = self.seats(seed)
            for seat in seats:
                np.testing.assert_allclose(seat.T_W_C(t_s) @ seat.T_C_O(t_s), seats[0].T_W_O(t_s), atol=1e-12)
                T = seat.T_C_O(t_s)
                centre = T[:, :3, :3] @ CENTRE_O + T[:, :3, 3]
                self.assertLess(np.abs(centre[:, :2] / centre[:, 2:]).max() * motion.FOCAL_PX, 0.3 * motion.WIDTH)
                self.assertTrue((seat.size(t_s) > 0.25).all() and (seat.size(t_s) < 0.5).all())

    def test_a_sweep_passes_an_object_that_stands_still(self):
        for seed in SEEDS:
            seat = rig.Seat('sweep', 0, seed, DIAMETER, CENTRE_O, 4.0)
            np.testing.assert_allclose(seat.T_W_O(3.0), seat.T_W_O(0.0), atol=1e-12)
            ends = [seat.T_W_C(t)[:2, 3] for t in (0.0, rig.frame_times(4.0)[-1])]
            cosine = ends[0] @ ends[1] / np.linalg.norm(ends[0]) / np.linalg.norm(ends[1])
            self.assertAlmostEqual(np.degrees(np.arccos(cosine)), 45, delta=1e-6)


if __name__ == '__main__':
    unittest.main()
