# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A small desk lamp: plain and thin, of three colours, without any pattern. Made up for this package.

Object frame O: origin at the centre of the foot's underside, z up, the shade looks along -y. Sizes are in millimetres.
"""
import math

from scene.paints import CREAM, ORANGE, SLATE
from scene.shapes import arc, box, place, turned

NAME = "desk_lamp"
ELEVATIONS_DEG = (-75, 80)  # it is looked at from there
LABEL = None                # no part of it breaks a symmetry


def _rod(name, start, end, radius, colour):
    """A round rod between two points (y, z) of the plane that halves the lamp."""
    dy, dz = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dy, dz)
    turned(name, [(0, 0), (radius, 0), (radius, length), (0, length)], colour,
           place(0, start[0], start[1], tilt_x=math.degrees(math.atan2(-dy, dz))), segments=32)


def _hinge(name, y, z, radius, width):
    turned(name, [(0, -width / 2), (radius, -width / 2), (radius, width / 2), (0, width / 2)], ORANGE,
           place(0, y, z, tilt_y=90), segments=40)


def build():
    elbow, wrist = (66, 112), (-26, 176)
    turned("foot", [(0, 0), (44, 0), (46, 2), (46, 7), (43, 10), (0, 10)], SLATE)
    turned("switch", [(0, 10), (6, 10), (6, 15), (0, 15)], ORANGE, place(24, -20, 0), segments=32)
    _hinge("ankle", 18, 15, 8, 14)
    _rod("lower arm", (18, 15), elbow, 4.5, SLATE)
    _hinge("elbow", *elbow, 8, 16)
    _rod("upper arm", elbow, wrist, 4.5, SLATE)
    _hinge("wrist", *wrist, 7, 14)
    # The shade hangs from the wrist and looks forwards and down; its wall is 2 mm thick and open below.
    outside = [(0, 0), (12, 0), (16, -8), (36, -46)]
    inside = [(34, -46), (14, -8), (10, -3), (0, -3)]
    tilt = place(0, wrist[0] - 4, wrist[1] - 4, tilt_x=-24)
    turned("shade", outside[::-1], SLATE, tilt)
    turned("rim", [inside[0], outside[-1]], CREAM, tilt)
    turned("shade inside", inside[::-1], CREAM, tilt)
    turned("bulb", arc(11, centre_z=-20), CREAM, tilt)
    box("weight", (16, 20, 10), SLATE, place(0, elbow[0] + 17, elbow[1] - 18))
