# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A table on which an object stands for photos, with a printed board, and where the photos are taken from.

World frame W: origin on the table below the object, z up. The frame of a board is that of scripts/lib/photos/board.py:
origin in its middle, x to the right, y up, z out of the paper. Pictures and shapes are in millimetres.
"""
import math

import cv2
import numpy as np

from photos import board as boards
from photos import board_drawing
from scene import toy_kiosk
from scene.paints import BLUE, BROWN, CREAM, GREEN, GREY, INK, LIME, NAVY, ORANGE, PINK, RED, SLATE, TEAL, YELLOW, Picture
from scene.shapes import box, place

TABLES = ("cloth", "plain", "wood", "newspaper", "marble")
BOARD_PIXELS_PER_MM = 3  # of its texture: edges are about as soft as a pixel of a photo, and need few samples
FINER = 4                # it is drawn so much finer
PAPER_MM = 0.2
WORDS = ("the toy", "market", "today", "report", "spring", "kiosk", "open", "light", "river", "seven", "harbour", "notes")


def _cloth(random):
    sheet = Picture("cloth", 900, 900, (176, 168, 150))
    for i in range(0, 900, 45):
        sheet.rectangle(i, 0, 16, 900, (128, 150, 168)).rectangle(0, i, 900, 6, (186, 104, 92))
    for x, y in random.uniform(0, 900, (220, 2)):
        sheet.star(x, y, random.uniform(5, 11), (GREEN, ORANGE, NAVY)[random.randint(3)], random.randint(4, 8))
    return sheet.worn(0.08)


def _plain(random):
    del random
    return Picture("plain", 900, 900, (198, 194, 186))


def _wood(random):
    boards_ = [tuple(int(c + random.uniform(-14, 14)) for c in (158, 118, 78)) for _ in range(7)]
    sheet = Picture("wood", 900, 900).tiles(boards_, 420, 75, (96, 68, 44))
    for x, y, length in random.uniform((0, 0, 20), (900, 900, 120), (900, 3)):
        sheet.rectangle(x, y, length, random.uniform(0.5, 1.4), (120 + random.randint(-20, 20), 88, 56))
    return sheet.worn(0.12)


def _newspaper(random):
    sheet = Picture("newspaper", 900, 900, (206, 202, 190))
    for column in range(0, 900, 90):
        y = random.uniform(0, 60)
        while y < 900:
            height = 14 if random.rand() < 0.08 else 3.2
            words = " ".join(WORDS[random.randint(len(WORDS))] for _ in range(2 if height > 10 else 6))
            sheet.text(words[:int(84 / (0.75 * height))], column + 3, y, height, INK, 0.12 * height)
            y += 1.9 * height
    return sheet


def _marble(random):
    sheet = Picture("marble", 900, 900).mosaic([(196, 192, 186), (176, 174, 172), (160, 162, 166), (206, 200, 190)], 260,
                                               (120, 118, 120))
    for x, y in random.uniform(0, 900, (500, 2)):
        sheet.disc(x, y, random.uniform(0.6, 3.5), (92 + random.randint(70), 92, 98))
    return sheet.worn(0.1)


def add_table(name, seed):
    paints = {"cloth": _cloth, "plain": _plain, "wood": _wood, "newspaper": _newspaper, "marble": _marble}
    box("table", (900, 900, 30), {"top": paints[name](np.random.RandomState(seed + 11)), "other": BROWN}, place(0, 0, -30))


def add_board(text, x_mm, y_mm, turn_deg):
    """A printed board on the table. @return T_W_B, 4 x 4 [m]; its surface is PAPER_MM above z = 0"""
    board = boards.parse_board(text)
    size = [(n + 1) * board.square_mm for n in (board.columns, board.rows)]
    paper = Picture("board", 1, 1)
    fine = board_drawing.picture(board, FINER * BOARD_PIXELS_PER_MM)
    drawn = cv2.resize(fine, None, fx=1 / FINER, fy=1 / FINER, interpolation=cv2.INTER_AREA)
    paper.rgb = np.repeat(drawn[:, :, None], 3, axis=2)
    paper.rgb = (20 + 0.85 * paper.rgb.astype(float)).astype(np.uint8)  # ink and paper, neither black nor white
    at = place(x_mm, y_mm, 0, turn=turn_deg)
    box("board", (*size, PAPER_MM), {"top": paper, "other": CREAM}, at)
    T = np.array(at)
    T[:3, 3] = np.array((x_mm, y_mm, PAPER_MM)) / 1000
    return T


def build_twin():
    """A carton whose front and back carry the same artwork, as those of many packages do; its sides are not the same."""
    art = Picture("twin art", 150, 170, ORANGE).mosaic([ORANGE, YELLOW, RED, PINK, CREAM], 60)
    art.rectangle(14, 20, 122, 44, CREAM).text("TWIN", 20, 56, 32, NAVY, 6).disc(75, 116, 38, TEAL)
    art.star(75, 116, 30, YELLOW, 7).text("250 g  both sides", 14, 164, 8, INK, 1.2).worn()
    left = Picture("twin left", 60, 170, GREEN).tiles([GREEN, LIME, TEAL], 12, 9, SLATE)
    left.text("A 17", 6, 60, 14, CREAM, 2.4).worn()
    right = Picture("twin right", 60, 170, BLUE).dots([CREAM, PINK, YELLOW, INK], 150, 3)
    right.rectangle(8, 90, 44, 50, CREAM).text("B 52", 10, 120, 13, RED, 2.4).worn()
    box("twin", (150, 60, 170), {"front": art, "back": art, "left": left, "right": right, "top": GREY, "other": GREY},
        place(0, 0, 0))


OBJECTS = {"toy_kiosk": toy_kiosk.build, "twin": build_twin}


def viewpoints(random, count, elevations_deg=(22, 46), distance_m=0.46):
    """(azimuth, elevation, distance, shift of what is in the middle [3] m, roll) of hand-held photos in rounds; angles in
    rad."""
    rounds = len(elevations_deg)
    for i in range(count):
        level, step = i * rounds // count, i % math.ceil(count / rounds)
        azimuth = 2 * math.pi * (step + 0.5 * level) * rounds / count + random.normal(0, 0.03)
        elevation = math.radians(elevations_deg[level] + random.uniform(-5, 5))
        yield (azimuth, elevation, distance_m * random.uniform(0.88, 1.12), random.uniform(-0.02, 0.02, 3),
               random.normal(0, 0.03))
