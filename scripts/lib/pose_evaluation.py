# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Compares poses with the truth. T_C_O: 4 x 4, takes points from the object's frame to the camera's [m]."""
import csv
import math

import numpy as np

MAX_ROTATION_DEG = 2.0
MAX_DIAMETERS = 0.02
MIN_FRAMES = 20
MIN_SHARE = 0.9

COLUMNS = ('frame', 'stamp_s', 'start_deg', 'start_diameters', 'start_px', 'deg', 'diameters', 'px',
           'score', 'latency_s')


class Target:
    """The object and the camera that it is measured in."""

    def __init__(self, box, diameter, intrinsics):
        """box: min and max corner [m]; intrinsics: 3 x 3 [px]."""
        low, high = np.asarray(box, float)
        self.centre = (low + high) / 2
        self.corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1])
                                 for z in (low[2], high[2])])
        self.diameter = diameter
        self.intrinsics = np.asarray(intrinsics, float).reshape(3, 3)

    def pixels(self, T_C_O):
        """Of the box's corners, [8][2]; None if one is behind the camera."""
        points_C = self.corners @ T_C_O[:3, :3].T + T_C_O[:3, 3]
        if points_C[:, 2].min() <= 0:
            return None
        image = points_C @ self.intrinsics.T
        return image[:, :2] / image[:, 2:]

    def errors(self, T_C_O, true_T_C_O):
        """Angle [degrees]; offset of the object's centre [diameters]; mean offset of its box's corners [px]."""
        cosine = (np.trace(T_C_O[:3, :3].T @ true_T_C_O[:3, :3]) - 1) / 2
        sine = np.linalg.norm(T_C_O[:3, :3] - true_T_C_O[:3, :3]) / math.sqrt(8)  # of half the angle
        angle = 2 * math.asin(min(1.0, sine)) if cosine > 0 else math.acos(max(-1.0, cosine))
        offset = (T_C_O - true_T_C_O)[:3, :3] @ self.centre + (T_C_O - true_T_C_O)[:3, 3]
        seen, true_seen = self.pixels(T_C_O), self.pixels(true_T_C_O)
        pixels = math.inf
        if seen is not None and true_seen is not None:
            pixels = float(np.linalg.norm(seen - true_seen, axis=1).mean())
        return math.degrees(angle), float(np.linalg.norm(offset)) / self.diameter, pixels


def good(row):
    return row['deg'] <= MAX_ROTATION_DEG and row['diameters'] <= MAX_DIAMETERS


def verdict(rows):
    """Whether the demo passed, and why. A frame without a trusted pose has infinite errors."""
    share = sum(map(good, rows)) / len(rows) if rows else 0.0
    text = '%d frames processed (at least %d), %.0f %% of them within %g degrees and %g %% of the diameter ' \
           '(at least %.0f %%)' % (len(rows), MIN_FRAMES, 100 * share, MAX_ROTATION_DEG,
                                   100 * MAX_DIAMETERS, 100 * MIN_SHARE)
    return len(rows) >= MIN_FRAMES and share >= MIN_SHARE, text


def table(rows):
    """One line a frame, and the medians; '!' marks what is not good."""
    lines = ['       |   error at start: pose before    |     error after refinement        |',
             ' frame | degrees  % of diameter  pixels | degrees  % of diameter  pixels   | latency']
    form = '%6s | %7.2f %14.2f %7.1f | %7.2f %14.2f %7.1f %s | %5.2f s'
    keys = ('start_deg', 'start_diameters', 'start_px', 'deg', 'diameters', 'px', 'latency_s')
    median = {key: float(np.median([row[key] for row in rows])) for key in keys}
    for name, row in [(row['frame'], row) for row in rows] + [('median', median)]:
        lines.append(form % (name, row['start_deg'], 100 * row['start_diameters'], row['start_px'],
                             row['deg'], 100 * row['diameters'], row['px'],
                             ' ' if good(row) else '!', row['latency_s']))
    return '\n'.join(lines)


def write_csv(rows, path):
    with open(path, 'w', newline='', encoding='utf-8') as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
