# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Free motion of an object and a camera, in the manner of the RBOT data set. Knows numpy alone, not Blender.

T_A_B takes points from frame B to frame A. C: camera (x right, y down, z forward), O: object, W: world (z up),
all in metres. Everything is a smooth function of time, so that exposures between two frames have poses, too.
"""
import math

import numpy as np

RATE_HZ = 30.0
WIDTH, HEIGHT, FOCAL_PX = 640, 480, 650.0
CX, CY = (WIDTH - 1) / 2, (HEIGHT - 1) / 2  # pixel centres are integers
SMALLEST, LARGEST = 1 / 8, 1.0              # the object's diameter in the image, in widths of the image

# What a recording reaches at least: degrees a second, diameters a second.
MEDIAN_DEG_S, P95_DEG_S, MEDIAN_DIAMETERS_S = 42.0, 105.0, 0.55


class Wave:
    """A sum of sines with random phases, and frequencies (Hz) drawn from an interval. Values are in -1..1."""

    def __init__(self, random, lowest_hz, highest_hz, terms=3):
        edges = np.linspace(lowest_hz, highest_hz, terms + 1)
        self.omega = 2 * math.pi * random.uniform(edges[:-1], edges[1:])
        self.phase = random.uniform(0, 2 * math.pi, terms)
        self.amplitude = 1 / np.arange(1.0, terms + 1)
        self.amplitude /= self.amplitude.sum()

    def __call__(self, t_s):
        return np.sin(np.multiply.outer(t_s, self.omega) + self.phase) @ self.amplitude


def rotation_about(axis, angle_rad):
    """Rotations about a coordinate axis (0, 1, 2): [...][3][3] for angles [...]."""
    angle = np.asarray(angle_rad, float)
    c, s = np.cos(angle), np.sin(angle)
    R = np.zeros(angle.shape + (3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[..., axis, axis] = 1
    R[..., i, i], R[..., j, j] = c, c
    R[..., i, j], R[..., j, i] = -s, s
    return R


def rotation_onto(direction):
    """The smallest rotation that takes +z onto unit vectors [...][3] (z > -1)."""
    x, y, z = np.moveaxis(np.asarray(direction, float), -1, 0)
    k = 1 / (1 + z)
    return np.stack([np.stack([1 - k * x * x, -k * x * y, x], -1),
                     np.stack([-k * x * y, 1 - k * y * y, y], -1),
                     np.stack([-x, -y, z], -1)], -2)


def view_rotation(azimuth, elevation, roll):
    """R_C_O of a camera that looks at the object from a direction (rad) with the object's z upwards, turned by `roll`
    about the line of sight. Azimuth counts from the object's +x towards +y."""
    # At azimuth and elevation 0 the camera stands on +x: its z is -x of the object, its x is +y, its y is -z.
    base = np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    tilt = rotation_about(1, elevation)  # about the object's y
    return rotation_about(2, roll) @ base @ tilt @ rotation_about(2, -np.asarray(azimuth, float))


def angle_between_deg(R_a, R_b):
    """Angle of the rotation from one to the other, [...] for [...][3][3]."""
    trace = np.einsum("...ij,...ij->...", R_a, R_b)
    distance = np.linalg.norm(np.asarray(R_a) - R_b, axis=(-2, -1))  # 2 sqrt(2) sin(angle / 2), exact when small
    return np.degrees(np.where(trace > 0, 2 * np.arcsin(np.minimum(1, distance / math.sqrt(8))),
                               np.arccos(np.clip((trace - 1) / 2, -1, 1))))


class Trajectory:
    """How an object moves in a camera, and the camera in a room, for a seed.

    @param diameter, centre_O: of the object. @param elevations_deg: (lowest, highest) from which the object's
    centre is looked at. The tempo of the motion is raised until it is as fast as this module promises.
    """

    def __init__(self, seed, diameter, centre_O, elevations_deg=(-75, 80), duration_s=10.0):
        random = np.random.RandomState(seed)
        self.diameter, self.centre_O = diameter, np.asarray(centre_O, float)
        self.duration_s = duration_s
        self.drift = random.choice((-1, 1)) * random.uniform(0.30, 0.45)  # of the azimuth [rad/s]
        self.start = random.uniform(0, 2 * math.pi)
        self.turning = [Wave(random, 0.06, 0.45) for _ in range(3)]  # azimuth, elevation, roll
        self.moving = [Wave(random, 0.08, 0.40) for _ in range(2)]   # right, down
        self.nearing = Wave(random, 0.05, 0.22, terms=2)
        self.pace = Wave(random, 0.12, 0.35, terms=2)
        self.panning = [Wave(random, 0.04, 0.30) for _ in range(3)]  # yaw, pitch, roll of the camera
        low, high = np.radians(elevations_deg)
        self.elevation_middle, self.elevation_half = (low + high) / 2, (high - low) / 2
        self.tempo_turn = self.tempo_move = 0.4
        self._speed_up()

    def _speed_up(self):
        t_s = frame_times(self.duration_s)
        while True:
            log_size = self.nearing(self._moved(t_s))
            self._nearest, self._farthest = log_size.max(), log_size.min()
            speeds = motion_speeds(self.T_C_O(t_s), self.centre_O, self.diameter)
            slow_turn = np.median(speeds.deg_s) < MEDIAN_DEG_S or np.percentile(speeds.deg_s, 95) < P95_DEG_S
            slow_move = np.median(speeds.diameters_s) < MEDIAN_DIAMETERS_S
            if not (slow_turn or slow_move):
                return
            self.tempo_turn *= 1.04 if slow_turn else 1
            self.tempo_move *= 1.04 if slow_move else 1

    def _turned(self, t_s):
        """The rotation's own time, which runs at 0.4 to 1.6 of the tempo: jerks between rests."""
        steps = np.linspace(0, 1, 65)
        t_s = np.asarray(t_s, float)
        pace = 1 + 0.6 * self.pace(np.multiply.outer(t_s, steps))
        return self.tempo_turn * t_s * np.trapz(pace, steps, axis=-1)

    def _moved(self, t_s):
        return self.tempo_move * np.asarray(t_s, float)

    def size(self, t_s):
        """The object's diameter in the image, in widths of the image."""
        span = self._nearest - self._farthest
        part = (self.nearing(self._moved(t_s)) - self._farthest) / span
        return SMALLEST * (LARGEST / SMALLEST) ** part

    def centre_C(self, t_s):
        """Where the object's centre is: [...][3]. The larger the object, the nearer to the image's middle."""
        size = self.size(t_s)
        moved = self._moved(t_s)
        right_px = self.moving[0](moved) * WIDTH * (0.48 - 0.42 * size)
        down_px = self.moving[1](moved) * (0.46 * HEIGHT - 0.33 * WIDTH * size)
        depth = self.diameter * FOCAL_PX / (size * WIDTH)
        return np.stack([right_px * depth / FOCAL_PX, down_px * depth / FOCAL_PX, depth], -1)

    def T_C_O(self, t_s):
        """[...][4][4] for times [...]."""
        u = self._turned(t_s)
        azimuth = self.start + self.drift * u + 1.6 * self.turning[0](u)
        elevation = self.elevation_middle + self.elevation_half * np.sin(1.4 * self.turning[1](u))
        roll = 1.4 * self.turning[2](u)
        centre_C = self.centre_C(t_s)
        sight = centre_C / np.linalg.norm(centre_C, axis=-1, keepdims=True)
        R = rotation_onto(sight) @ view_rotation(azimuth, elevation, roll)
        return transforms(R, centre_C - R @ self.centre_O)

    def T_W_C(self, t_s):
        """The camera in the room, in whose middle it turns: [...][4][4]."""
        yaw, pitch, roll = (a * wave(np.asarray(t_s, float)) for a, wave in zip((1.5, 0.20, 0.12), self.panning))
        R = np.swapaxes(view_rotation(yaw, pitch, roll), -1, -2)
        return transforms(R, np.zeros(R.shape[:-1]))


class Occluder:
    """Another object that moves in front of the first and hides part of it, now and then.

    It keeps to 0.38 of the object's distance, so that the two never touch, and looks half as large.
    """

    NEARER, APPARENT_SIZE = 0.38, 0.5

    def __init__(self, seed, trajectory):
        random = np.random.RandomState(seed + 1000003)
        self.trajectory = trajectory
        self.around, self.aside = Wave(random, 0.08, 0.40), Wave(random, 0.15, 0.60)
        self.turning = [Wave(random, 0.05, 0.40) for _ in range(3)]
        self.diameter = self.NEARER * self.APPARENT_SIZE * trajectory.diameter

    def T_C_X(self, t_s):
        """[...][4][4] of the occluder's frame, whose origin is its centre."""
        t_s = np.asarray(t_s, float)
        angle, radius = 4 * self.around(t_s), 0.5 * self.trajectory.diameter * (0.72 + 0.62 * self.aside(t_s))
        beside = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros_like(radius)], -1)
        R = view_rotation(*(5 * wave(t_s) for wave in self.turning))
        return transforms(R, self.NEARER * (self.trajectory.centre_C(t_s) + beside))


def transforms(R, t):
    """[...][4][4] of rotations [...][3][3] and translations [...][3]."""
    T = np.zeros(R.shape[:-2] + (4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, t, 1
    return T


def frame_times(duration_s):
    return np.arange(round(duration_s * RATE_HZ)) / RATE_HZ


class Speeds:
    """From frame to frame: rotation (deg/s) and the centre's movement (diameters/s) of the object in the camera."""

    def __init__(self, deg_s, diameters_s):
        self.deg_s, self.diameters_s = deg_s, diameters_s


def motion_speeds(T_C_O, centre_O, diameter):
    """@param T_C_O [n][4][4] at RATE_HZ."""
    R, centre_C = T_C_O[:, :3, :3], T_C_O[:, :3, :3] @ centre_O + T_C_O[:, :3, 3]
    moved = np.linalg.norm(np.diff(centre_C, axis=0), axis=-1)
    return Speeds(angle_between_deg(R[1:], R[:-1]) * RATE_HZ, moved / diameter * RATE_HZ)
