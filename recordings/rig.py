# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Cameras around an object, for several cameras and for one that moves. Knows numpy alone, not Blender.

A rig: three cameras that stand still and look at one place, where an object moves slowly. A sweep: one camera that
passes an object that stands still. Frames are named as in motion.py.
"""
import math

import numpy as np

import motion

RATE_HZ = 10.0
CAMERAS = {"rig": 3, "sweep": 1}
SIZE = 0.36           # the object's diameter in the images, in widths of the image, about
TILT_RAD = 0.15       # of the object, at most
SHIFT = 0.25          # of the object in a rig, along each axis, at most [diameters]
SWEEP_DEG = 45.0      # around the object


def looking_at(place, target, roll):
    """T_W_C of cameras at places [...][3] that have a target in the middle of their images, z of the world upwards
    but for a roll (rad)."""
    away = np.asarray(place, float) - target
    azimuth = np.arctan2(away[..., 1], away[..., 0])
    elevation = np.arctan2(away[..., 2], np.hypot(away[..., 0], away[..., 1]))
    R_W_C = np.swapaxes(motion.view_rotation(azimuth, elevation, roll), -1, -2)
    return motion.transforms(R_W_C, np.asarray(place, float))


class Seat:
    """What one camera of a rig or a sweep sees: what motion.Trajectory is for a recording with one camera.

    @param kind "rig" or "sweep". @param camera its number.
    """

    def __init__(self, kind, camera, seed, diameter, centre_O, duration_s):
        random = np.random.RandomState(seed + 2000003)
        self.kind, self.diameter, self.centre_O = kind, diameter, np.asarray(centre_O, float)
        self.duration_s = duration_s
        self.distance = diameter * motion.FOCAL_PX / (SIZE * motion.WIDTH)
        turn = random.uniform(0, 2 * math.pi)
        beside = np.radians([0, random.uniform(60, 90), -random.uniform(60, 90)])
        up = np.radians(random.uniform(8, 22, 3))
        self.azimuth, self.elevation = turn + beside[camera], up[camera]
        self.way = random.choice((-1, 1))
        self.moving = [motion.Wave(random, 0.05, 0.25) for _ in range(3)]
        self.turning = [motion.Wave(random, 0.04, 0.20) for _ in range(3)]
        self.swaying = [motion.Wave(random, 0.10, 0.50) for _ in range(3)]
        self.start = random.uniform(0, 2 * math.pi)

    def T_W_O(self, t_s):
        """[...][4][4]; the object's centre is near the world's origin."""
        moment = np.zeros_like(np.asarray(t_s, float)) if self.kind == "sweep" else np.asarray(t_s, float)
        tilt = [TILT_RAD * wave(moment) for wave in self.turning[:2]]
        R = motion.rotation_about(0, tilt[0]) @ motion.rotation_about(1, tilt[1])
        R = R @ motion.rotation_about(2, self.start + 2.5 * self.turning[2](moment))
        shift = np.stack([SHIFT * self.diameter * wave(moment) for wave in self.moving], -1)
        return motion.transforms(R, shift - R @ self.centre_O)

    def T_W_C(self, t_s):
        """[...][4][4]: the camera stands still in a rig, and sways a little in a sweep as a hand does."""
        t_s = np.asarray(t_s, float)
        azimuth, elevation = np.full(t_s.shape, self.azimuth), np.full(t_s.shape, self.elevation)
        distance, roll = np.full(t_s.shape, self.distance), np.zeros(t_s.shape)
        if self.kind == "sweep":
            part = t_s / max(1e-9, motion_end(self.duration_s)) - 0.5
            azimuth = azimuth + self.way * math.radians(SWEEP_DEG) * part
            elevation = elevation + 0.10 * self.swaying[0](t_s)
            distance = distance * (1 + 0.08 * self.swaying[1](t_s))
            roll = 0.10 * self.swaying[2](t_s)
        flat = np.cos(elevation)
        place = np.stack([np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation)], -1)
        return looking_at(distance[..., None] * place, np.zeros(3), roll)

    def T_C_O(self, t_s):
        return np.linalg.inv(self.T_W_C(t_s)) @ self.T_W_O(t_s)

    def size(self, t_s):
        """The object's diameter in the image, in widths of the image."""
        T = self.T_C_O(t_s)
        depth = (T[..., :3, :3] @ self.centre_O + T[..., :3, 3])[..., 2]
        return self.diameter * motion.FOCAL_PX / (depth * motion.WIDTH)


def motion_end(duration_s):
    """The time of the last frame."""
    return (round(duration_s * RATE_HZ) - 1) / RATE_HZ


def frame_times(duration_s):
    return np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
