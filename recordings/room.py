# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A large room full of things, which no model of any object knows, and an object that passes in front of another.

World frame W: the origin is the middle of the room, z up. The object and the camera move within 2.5 m of it, so
everything stands farther away. Pictures are drawn in their own units and stretched over what they cover.
"""
import math

import numpy as np

from scene.paints import (BLUE, BROWN, CREAM, GREEN, GREY, INK, LIME, NAVY, ORANGE, PINK, PURPLE, RED, SLATE, TEAL,
                          YELLOW, Picture)
from scene.shapes import arc, box, place, turned

COLOURS = (RED, ORANGE, YELLOW, LIME, GREEN, TEAL, BLUE, NAVY, PURPLE, PINK, BROWN, CREAM, GREY, SLATE, INK)
WORDS = ("OATS", "No 31", "PEAS", "exit", "R2-D", "VOL 9", "tea", "KIOSK", "1987", "ABCD", "Lamp", "open", "fragile")
NEAREST_M, WALL_M, FLOOR_M = 3.0, 4.4, 2.4


def _colours(random, count):
    """Colours that are mixed with grey by chance: rooms are less gaudy than toys."""
    picked = [np.array(COLOURS[random.randint(len(COLOURS))]) for _ in range(count)]
    mixed = [c + random.uniform(0, 0.7) * (random.uniform(50, 190) - c) for c in picked]
    return [tuple(int(v) for v in c) for c in mixed]


def _sheet(random, name):
    """A picture of a kind picked by chance."""
    colours = _colours(random, 5)
    sheet = Picture(name, 120, 90, colours[0])
    draw = (lambda: sheet.tiles(colours, random.uniform(8, 40), random.uniform(5, 30), colours[1]),
            lambda: sheet.stripes(colours, random.uniform(3, 14), random.uniform(-1, 1)),
            lambda: sheet.mosaic(colours, random.randint(12, 70), colours[2]),
            lambda: sheet.dots(colours, random.randint(20, 160), random.uniform(1.5, 6)),
            lambda: sheet.frame(colours[1], random.uniform(2, 8)))
    draw[random.randint(len(draw))]()
    if random.rand() < 0.7:
        x, y = random.uniform(5, 40), random.uniform(30, 60)
        sheet.rectangle(x, y, 60, 22, colours[3])
        sheet.text(WORDS[random.randint(len(WORDS))], x + 3, y + 17, 14, colours[4], 2.2)
    if random.rand() < 0.4:
        sheet.star(random.uniform(20, 100), random.uniform(15, 70), random.uniform(8, 22), colours[1],
                   random.randint(4, 9))
    return sheet.worn(random.uniform(0.05, 0.25))


def _shell(random, sheets):
    """Floor, ceiling and walls. Sizes in millimetres."""
    side, height = 2000 * WALL_M, 2000 * FLOOR_M
    box("floor", (side, side, 50), sheets[0], place(0, 0, -1000 * FLOOR_M - 50))
    box("ceiling", (side, side, 50), sheets[1], place(0, 0, 1000 * FLOOR_M))
    for i in range(4):
        x, y = math.cos(i * math.pi / 2), math.sin(i * math.pi / 2)
        for k in range(6):  # panels side by side
            along = side * ((k + 0.5) / 6 - 0.5)
            box("wall %d %d" % (i, k), (side / 6, 50, height), sheets[random.randint(2, len(sheets))],
                place(1000 * WALL_M * x - along * y, 1000 * WALL_M * y + along * x, -height / 2, turn=90 * i + 90))


def _stand(random, name, where, sheet):
    """One thing of a size and shape picked by chance. @param where (x, y, z of its underside) in millimetres"""
    width, depth, height = random.uniform(100, 620, 3) * (1, 0.6, 1)
    at = place(*where, turn=random.uniform(0, 360))
    shape = random.randint(5)
    if shape < 3:
        box(name, (width, depth, height), sheet, at)
    elif shape == 3:
        radius = width / 2.5
        turned(name, [(0, 0), (0.6 * radius, 0), (radius, 0.4 * height), (0.4 * radius, 0.8 * height),
                      (0.6 * radius, height)], sheet, at, segments=24)
    else:
        turned(name, arc(0.3 * width, centre_z=0.3 * width), sheet, at, segments=24)


def furnish(seed):
    """Builds the room."""
    random = np.random.RandomState(seed)
    sheets = [_sheet(random, "sheet %d of %d" % (i, seed)) for i in range(26)]
    _shell(random, sheets)
    for level, z in enumerate((-1500, -650, 150, 900)):  # boards along the walls, with things on them
        for i in range(4):
            turn = i * math.pi / 2
            middle = 1000 * (WALL_M - 0.25)
            box("board %d %d" % (level, i), (1900 * WALL_M, 400, 40), _colours(random, 1)[0],
                place(middle * math.cos(turn), middle * math.sin(turn), z - 40, turn=math.degrees(turn) + 90))
            for k in range(20):
                along = 1000 * random.uniform(-0.9, 0.9) * WALL_M
                out = 1000 * (WALL_M - random.uniform(0.15, 0.4))
                x, y = out * math.cos(turn) - along * math.sin(turn), out * math.sin(turn) + along * math.cos(turn)
                _stand(random, "thing %d %d %d" % (level, i, k), (x, y, z), sheets[random.randint(4, len(sheets))])
    for k in range(48):  # things on the floor, and piles of them
        angle, distance = random.uniform(0, 2 * math.pi), 1000 * random.uniform(NEAREST_M + 0.3, WALL_M - 0.5)
        x, y = distance * math.cos(angle), distance * math.sin(angle)
        for pile in range(random.randint(1, 5)):
            _stand(random, "pile %d %d" % (k, pile), (x, y, -1000 * FLOOR_M + 330 * pile),
                   sheets[random.randint(4, len(sheets))])


def add_occluder(diameter_m):
    """A striped spinning top with a handle, about `diameter_m` large, its centre at the origin. @return the part"""
    size = 1000 * diameter_m / 2
    paint = Picture("spinning top", 120, 60, SLATE).tiles([SLATE, LIME, PURPLE, CREAM], 12, 10, INK).worn()
    profile = ((0, -0.75), (0.45, -0.5), (0.85, 0), (0.5, 0.35), (0.16, 0.4), (0.16, 1), (0, 1))
    return turned("spinning top", [(size * r, size * z) for r, z in profile], paint, segments=40)
