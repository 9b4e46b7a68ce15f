# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A bottle, symmetric about its axis but for the label. Made up for this package.

Object frame O: origin at the centre of the underside, z along the axis up to the cap, the label looks along -y.
Sizes are in millimetres.
"""
import math

from scene.paints import BROWN, CREAM, GREEN, INK, NAVY, ORANGE, RED, TEAL, YELLOW, Picture
from scene.shapes import add_mesh, place, turned

NAME = "bottle"
ELEVATIONS_DEG = (-75, 80)  # it is looked at from there
LABEL = "bottle label"      # the name of the label's material
SEGMENTS, LABEL_SEGMENTS = 72, 30
RADIUS, LABEL_LOW, LABEL_HIGH = 33.0, 30.0, 98.0


def _label():
    label = Picture(LABEL, 2 * math.pi * RADIUS * LABEL_SEGMENTS / SEGMENTS, LABEL_HIGH - LABEL_LOW, CREAM)
    label.rectangle(0, 0, 87, 5, NAVY).rectangle(0, 63, 87, 5, RED).text("LIMO", 7, 26, 15, NAVY, 3)
    label.text("No 4 bitter lemon", 7, 34, 4, INK, 0.7).disc(66, 18, 11, YELLOW).star(66, 18, 9, ORANGE, 7)
    label.rectangle(7, 40, 34, 18, TEAL).text("33 cl", 10, 53, 8, CREAM, 1.4)
    return label.polygon([(48, 58), (62, 38), (70, 50), (75, 42), (84, 58)], GREEN)


def _sleeve(colour):
    """The part of the body that carries the label: a cylinder, some of whose faces are the label's."""
    angles = [2 * math.pi * (i - LABEL_SEGMENTS / 2) / SEGMENTS - math.pi / 2 for i in range(SEGMENTS)]
    vertices = [(RADIUS * math.cos(a), RADIUS * math.sin(a), z) for z in (LABEL_LOW, LABEL_HIGH) for a in angles]
    faces, uvs, paints, label = [], [], [], _label()
    for i in range(SEGMENTS):
        j = (i + 1) % SEGMENTS
        faces.append((i, j, SEGMENTS + j, SEGMENTS + i))
        left, right = i / LABEL_SEGMENTS, (i + 1) / LABEL_SEGMENTS
        uvs += [(left, 0), (right, 0), (right, 1), (left, 1)]
        paints.append(label if i < LABEL_SEGMENTS else colour)
    add_mesh("sleeve", place(), vertices, faces, uvs, paints)


def build():
    glass, dark = (62, 132, 108), (40, 92, 84)

    def ring(name, profile, colour):
        turned(name, profile, colour, segments=SEGMENTS)

    ring("foot", [(0, 0), (29, 0), (32, 3), (RADIUS, 8)], dark)
    ring("belly", [(RADIUS, 8), (RADIUS, 22)], glass)
    ring("lower line", [(RADIUS, 22), (RADIUS, LABEL_LOW)], YELLOW)
    _sleeve(glass)
    ring("upper line", [(RADIUS, LABEL_HIGH), (RADIUS, 104)], YELLOW)
    ring("shoulder", [(RADIUS, 104), (31, 114), (25, 127), (18, 138)], glass)
    ring("collar", [(18, 138), (14, 148), (13, 156)], dark)
    ring("neck", [(13, 156), (12.5, 176)], glass)
    ring("lip", [(12.5, 176), (15.5, 176), (15.5, 181)], BROWN)
    ring("cap", [(15.5, 181), (15.5, 190)], RED)
    ring("cap top", [(15.5, 190), (14, 193), (7, 193)], CREAM)
    ring("cap middle", [(7, 193), (0, 193)], RED)
