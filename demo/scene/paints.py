# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Painted surfaces: pictures that are drawn in millimetres and wrapped around shapes.

Nothing here knows Blender. A picture's origin is its upper left corner, x goes right and y goes down.
"""
import zlib

import cv2
import numpy as np

PIXELS_PER_MM = 5
SHIFT = 4  # OpenCV draws with fixed-point coordinates: 4 fractional bits keep edges where they belong

RED = (205, 62, 52)
ORANGE = (226, 132, 48)
YELLOW = (226, 186, 62)
LIME = (140, 180, 66)
GREEN = (52, 140, 84)
TEAL = (46, 150, 156)
BLUE = (58, 104, 184)
NAVY = (48, 62, 116)
PURPLE = (126, 78, 156)
PINK = (214, 112, 150)
BROWN = (132, 88, 60)
CREAM = (224, 208, 172)
GREY = (136, 138, 142)
SLATE = (84, 92, 106)
INK = (44, 42, 52)


def seed_of(name):
    """A seed that depends on nothing but the name, so that one picture never changes another."""
    return zlib.crc32(name.encode())


class Picture:
    """A sheet of paper with a name, a size in millimetres and things drawn on it."""

    def __init__(self, name, width, height, colour=CREAM):
        self.name, self.width, self.height = name, width, height
        self.random = np.random.RandomState(seed_of(name) & 0x7FFFFFFF)
        shape = (max(8, round(height * PIXELS_PER_MM)), max(8, round(width * PIXELS_PER_MM)), 3)
        self.rgb = np.empty(shape, np.uint8)
        self.rgb[:] = colour

    @staticmethod
    def _fixed(points):
        return np.round(np.asarray(points, float) * PIXELS_PER_MM * (1 << SHIFT)).astype(np.int32)

    def polygon(self, points, colour):
        cv2.fillPoly(self.rgb, [self._fixed(points)], colour, cv2.LINE_AA, SHIFT)
        return self

    def rectangle(self, x, y, width, height, colour):
        return self.polygon([(x, y), (x + width, y), (x + width, y + height), (x, y + height)], colour)

    def disc(self, x, y, radius, colour):
        centre, radius = self._fixed((x, y)), self._fixed(radius)
        cv2.circle(self.rgb, tuple(int(c) for c in centre), int(radius), colour, -1, cv2.LINE_AA, SHIFT)
        return self

    def text(self, words, x, baseline, height, colour, weight=1.0):
        """Writes with capitals `height` mm tall; weight is the stroke's width in mm."""
        scale = height * PIXELS_PER_MM / 21.0
        at = (round(x * PIXELS_PER_MM), round(baseline * PIXELS_PER_MM))
        cv2.putText(self.rgb, words, at, cv2.FONT_HERSHEY_DUPLEX, scale, colour,
                    max(1, round(weight * PIXELS_PER_MM)), cv2.LINE_AA)
        return self

    def star(self, x, y, radius, colour, points=5, turn_deg=-90.0):
        angles = np.radians(turn_deg + np.arange(2 * points) * 180.0 / points)
        radii = np.where(np.arange(2 * points) % 2 == 0, radius, 0.45 * radius)
        return self.polygon(np.stack([x + radii * np.cos(angles), y + radii * np.sin(angles)], 1), colour)

    def stripes(self, colours, width, slant=0.0):
        """Vertical stripes; slant moves their lower end by that many millimetres per millimetre of height."""
        reach = abs(slant) * self.height
        for i, x in enumerate(np.arange(-reach - 2 * width, self.width + reach + width, width)):
            low = x + slant * self.height
            self.polygon([(x, 0), (x + width, 0), (low + width, self.height), (low, self.height)],
                         colours[i % len(colours)])
        return self

    def tiles(self, colours, width, height, joint=None, shift=0.5, gap=0.5):
        """Rows of tiles, bricks or shingles of random colours; every other row is moved by `shift` of a tile."""
        if joint is not None:
            self.rectangle(0, 0, self.width, self.height, joint)
        for row, y in enumerate(np.arange(0, self.height, height)):
            for x in np.arange(-width, self.width + width, width):
                colour = colours[self.random.randint(len(colours))]
                self.rectangle(x + (row % 2) * shift * width, y, width - gap, height - gap, colour)
        return self

    def mosaic(self, colours, cells, joint=INK):
        """Irregular cells (a Voronoi diagram)."""
        rows, columns = self.rgb.shape[:2]
        sites = self.random.rand(cells, 2) * [columns, rows]
        x = np.arange(columns)[:, None]
        for y in range(rows):  # all at once a table's sheet takes tens of gigabytes
            distance = ((x - sites[:, 0]) ** 2 + (y - sites[:, 1]) ** 2) ** 0.5
            order = np.argsort(distance, axis=1)[:, :2]
            near = np.take_along_axis(distance, order, 1)
            self.rgb[y] = np.array(colours, np.uint8)[order[:, 0] % len(colours)]
            self.rgb[y][near[:, 1] - near[:, 0] < 0.6 * PIXELS_PER_MM] = joint
        return self

    def dots(self, colours, count, radius):
        for _ in range(count):
            x, y = self.random.rand(2) * [self.width, self.height]
            self.disc(x, y, radius * self.random.uniform(0.6, 1.2), colours[self.random.randint(len(colours))])
        return self

    def frame(self, colour, width):
        return (self.rectangle(0, 0, self.width, width, colour)
                .rectangle(0, self.height - width, self.width, width, colour)
                .rectangle(0, 0, width, self.height, colour)
                .rectangle(self.width - width, 0, width, self.height, colour))

    def worn(self, strength=0.10):
        """Uneven paint: patches of 4 and 12 mm that are a little brighter or darker."""
        rows, columns = self.rgb.shape[:2]
        gain = np.ones((rows, columns), np.float32)
        for patch_mm in (4.0, 12.0):
            grid = (max(2, round(self.height / patch_mm) + 1), max(2, round(self.width / patch_mm) + 1))
            noise = self.random.uniform(-strength, strength, grid).astype(np.float32)
            gain += cv2.resize(noise, (columns, rows), interpolation=cv2.INTER_CUBIC)
        self.rgb[:] = np.clip(self.rgb * gain[..., None], 0, 255).astype(np.uint8)
        return self
