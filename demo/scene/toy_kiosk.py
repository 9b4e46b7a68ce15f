# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The demo's object: a painted wooden toy kiosk, made up for this package.

Object frame O: origin at the centre of the underside of the base plate, z up, the counter looks along -y,
the barrel stands on the +x side. Sizes are in millimetres. Every side differs from all others in shape and in
paint, so that one picture fixes the pose.
"""
from .paints import (BLUE, BROWN, CREAM, GREEN, GREY, INK, LIME, NAVY, ORANGE, PINK, PURPLE, RED, SLATE, TEAL, YELLOW,
                     Picture)
from .shapes import arc, box, hexahedron, place, turned

NAME = "toy_kiosk"


def _base():
    paving = Picture("paving", 130, 112).tiles([GREY, (150, 132, 120), (120, 140, 128), (164, 150, 132)], 13, 9, SLATE)
    paving.disc(112, 94, 9, YELLOW).disc(112, 94, 6, RED).star(112, 94, 5, CREAM)
    paving.rectangle(4, 96, 34, 11, BLUE).text("EXIT", 7, 105, 7, CREAM).worn()
    rim_front = Picture("rim front", 130, 9).stripes([YELLOW, INK], 6, slant=0.8)
    rim_right = Picture("rim right", 112, 9, TEAL).stripes([TEAL, CREAM, TEAL, RED], 7)
    rim_back = Picture("rim back", 130, 9, PURPLE).dots([YELLOW, PINK], 40, 2.2)
    rim_left = Picture("rim left", 112, 9, ORANGE).tiles([ORANGE, GREEN, NAVY], 9, 4.5, CREAM)
    below = Picture("below", 130, 112).tiles([TEAL, YELLOW, PINK, BLUE, LIME], 26, 28, SLATE, shift=0)
    below.text("MADE FOR PLAY", 8, 60, 11, INK, 1.6)
    box("base", (130, 112, 9), {"front": rim_front, "right": rim_right, "back": rim_back, "left": rim_left,
                                "top": paving, "bottom": below})


def _walls():
    """Four walls around a hollow with an open counter in front: 96 x 74, from z = 9 to 84, centred at (-6, 10)."""
    left = Picture("left wall", 74, 75, TEAL).tiles([TEAL, (56, 160, 150), (40, 138, 160)], 74, 7.5, (36, 110, 120), 0)
    left.rectangle(34, 8, 35, 46, CREAM).rectangle(36, 10, 31, 20, RED).star(51, 20, 9, YELLOW)
    left.text("AB", 38, 45, 12, NAVY, 2.2).text("new tea", 38, 52, 4, INK, 0.6).worn()

    right = Picture("right wall", 74, 75, ORANGE).stripes([ORANGE, YELLOW, ORANGE, (200, 96, 58)], 6)
    right.rectangle(6, 10, 30, 40, NAVY)
    for x in (8, 22):
        right.rectangle(x, 12, 12, 17, (120, 170, 200)).rectangle(x, 31, 12, 17, (96, 140, 180))
    right.disc(55, 22, 13, GREEN).text("7", 50, 29, 14, CREAM, 2.4).worn()

    back = Picture("back wall", 86, 75).mosaic([RED, TEAL, YELLOW, BLUE, PINK, LIME, PURPLE, ORANGE], 46)
    back.rectangle(9, 14, 50, 22, CREAM).text("Q5 & K", 11, 30, 10, PURPLE, 2.0).disc(70, 52, 13, INK)
    back.disc(70, 52, 11, LIME).polygon([(64, 46), (79, 52), (64, 59)], INK).worn()

    counter = Picture("counter", 86, 30, GREEN).tiles([GREEN, (70, 156, 92), (44, 122, 90)], 8, 30, (34, 96, 62), 0)
    counter.rectangle(6, 6, 44, 17, YELLOW).text("SOUP", 9, 19.5, 10, RED, 1.8)
    counter.disc(60, 15, 8, CREAM).disc(60, 15, 5.5, BLUE).star(78, 15, 7, PINK, 6).worn()

    lintel = Picture("lintel", 86, 13, BLUE).stripes([BLUE, CREAM, RED], 5, slant=-0.5)
    inside = Picture("inside", 88, 75, (196, 160, 110))
    for shelf, y in enumerate((14, 32)):
        inside.rectangle(0, y, 88, 3, BROWN)
        for i, x in enumerate(range(3, 84, 9)):
            colour = (RED, BLUE, YELLOW, GREEN, PINK, TEAL, ORANGE)[(3 * i + 2 * shelf) % 7]
            inside.rectangle(x, y - 11 + (i * 5 + shelf) % 4, 6, 11 - (i * 5 + shelf) % 4, colour)
    boards = Picture("boards", 88, 66, BROWN).tiles([BROWN, (148, 100, 66), (118, 80, 58)], 44, 8, INK)

    x0, x1, y0, y1, low, high = -54, 42, -27, 47, 9, 84
    depth, width = y1 - y0, x1 - x0  # the side walls reach from end to end, the others stand between them
    box("left wall", (5, depth, 75), {"left": left, "other": ORANGE}, place(x0 + 2.5, 10, low))
    box("right wall", (5, depth, 75), {"right": right, "other": PINK}, place(x1 - 2.5, 10, low))
    box("back wall", (width - 10, 5, 75), {"back": back, "front": inside, "other": PURPLE}, place(-6, y1 - 2.5, low))
    box("counter", (width - 10, 5, 30), {"front": counter, "other": BROWN}, place(-6, y0 + 2.5, low))
    box("lintel", (width - 10, 5, 13), {"front": lintel, "other": NAVY}, place(-6, y0 + 2.5, high - 13))
    box("floor", (width - 10, depth - 10, 16), boards, place(-6, 10, low))
    box("sill", (104, 15, 3.5), Picture("sill", 104, 15).stripes([CREAM, BROWN, ORANGE], 6).worn(), place(-6, -30, 38))
    # Goods on the sill, each of another shape.
    turned("apple", arc(6.5, centre_z=6), RED, place(-38, -29, 41))
    turned("jar", [(0, 0), (6, 0), (6, 11), (4, 13), (4, 16), (0, 16)],
           Picture("jar", 38, 30, YELLOW).stripes([YELLOW, PURPLE], 4.7), place(-20, -30, 41.5))
    box("tin", (13, 10, 9), {"front": Picture("tin", 13, 9, BLUE).disc(6.5, 4.5, 3, YELLOW), "other": BLUE},
        place(2, -30, 41.5, turn=14))
    turned("melon", arc(8, centre_z=7), Picture("melon", 50, 25).stripes([GREEN, LIME], 3.1), place(27, -29, 41))


def _top():
    reds = [RED, (186, 74, 60), (160, 60, 66), (214, 96, 70)]
    shingles = Picture("shingles", 118, 92).tiles(reds, 9, 8, (110, 44, 50))
    shingles.rectangle(10, 60, 34, 24, CREAM).rectangle(12, 62, 30, 20, NAVY).text("R2", 15, 78, 12, YELLOW, 2.0)
    shingles.disc(60, 25, 9, TEAL).disc(60, 25, 6, CREAM).disc(60, 25, 3, RED).worn()
    eaves = Picture("eaves", 110, 12, YELLOW).tiles([YELLOW, NAVY, LIME], 8, 6, CREAM)
    # A lean-to roof, higher on the left: no half turn brings it back onto itself.
    low = [(-61, -34), (49, -34), (49, 52), (-61, 52)]
    hexahedron("roof", [(*p, 84) for p in low] + [(-61, -34, 103), (49, -34, 90), (49, 52, 90), (-61, 52, 103)],
               {"top": shingles, "bottom": BROWN, "other": eaves})

    cloth = Picture("awning", 104, 36).stripes([RED, CREAM], 8.67)
    cloth.rectangle(0, 29, 104, 2.5, NAVY).worn(0.06)
    box("awning", (104, 36, 3.5), {"top": cloth, "bottom": cloth, "other": NAVY}, place(-6, -45, 73, tilt_x=24))

    sign = Picture("sign", 62, 21, NAVY).frame(YELLOW, 1.8).text("KIOSK", 5, 15.5, 10.5, CREAM, 1.8)
    sign_back = Picture("sign back", 62, 21, LIME).stripes([LIME, GREEN], 7, slant=1)
    box("sign", (62, 6, 21), {"front": sign, "back": sign_back, "other": YELLOW}, place(-24, -27, 94, turn=-6))

    bricks = Picture("chimney", 15, 34).tiles([(176, 92, 66), (156, 80, 66), (194, 112, 80)], 6, 4, CREAM)
    box("chimney", (15, 17, 34), {"top": INK, "other": bricks}, place(-42, 34, 98, turn=12))
    box("chimney cap", (20, 22, 5), SLATE, place(-42, 34, 130, turn=12))

    band = Picture("turret", 107, 38, CREAM).stripes([CREAM, (206, 190, 160)], 5)
    band.rectangle(0, 4, 107, 5, BLUE).text("N", 4, 27, 13, RED, 2).text("E", 31, 27, 13, GREEN, 2)
    band.text("S", 58, 27, 13, BLUE, 2).text("W", 84, 27, 13, PURPLE, 2).rectangle(0, 31, 107, 4, ORANGE)
    turned("turret", [(17, 0), (17, 38)], band, place(22, 27, 86))
    turned("cap", [(0, 0), (22, 0), (12, 14), (3.5, 26)],
           Picture("cap", 138, 50).stripes([PURPLE, YELLOW, PURPLE, TEAL], 11.5, slant=0.6), place(22, 27, 124))
    turned("cap ball", arc(6, centre_z=5), ORANGE, place(22, 27, 147))


def _sides():
    staves = Picture("barrel", 88, 40).tiles([BROWN, (156, 104, 62), (120, 76, 52)], 7, 40, INK, 0)
    staves.rectangle(0, 7, 88, 4, YELLOW).rectangle(0, 29, 88, 4, YELLOW).text("XII", 20, 25, 9, CREAM, 1.6)
    turned("barrel", [(0, 0), (11, 0), (14, 10), (14.5, 18), (13, 29), (11, 36), (9, 36), (9, 32), (0, 32)], staves,
           place(51, -22, 9))
    slats = Picture("crate", 20, 18).tiles([LIME, (160, 190, 90)], 20, 4.5, BROWN, 0).star(10, 9, 6, PURPLE)
    other = Picture("crate two", 20, 18, PINK).frame(NAVY, 2).text("G", 5.5, 14, 9.5, NAVY, 2)
    box("crate", (20, 20, 18), slats, place(53, 30, 9, turn=8))
    box("crate two", (16, 16, 14), other, place(52, 31, 27, turn=-17))
    # The left side carries a ring and a letter box, the back three knobs of three colours and a bench.
    ring = Picture("ring", 80, 25).stripes([RED, CREAM], 10)
    turned("ring", arc(3.2, 9.5, 0, -180, 180, 16), ring, place(-56, 27, 38, tilt_y=90))
    box("letter box", (9, 20, 24), {"left": Picture("letter box", 20, 24, YELLOW).rectangle(4, 5, 12, 3, INK)
                                    .text("M", 5, 20, 8, BLUE, 1.6), "other": YELLOW}, place(-58.5, -12, 9))
    for i, (colour, x, z, radius) in enumerate(((RED, 30, 71, 5), (BLUE, 12, 66, 6.5), (YELLOW, -44, 30, 5.5))):
        turned("knob %d" % i, arc(radius), colour, place(x, 47, z))
    box("bench", (44, 9, 10), {"top": Picture("bench", 44, 9, BLUE).stripes([BLUE, ORANGE], 5.5), "other": BLUE},
        place(12, 51.4, 9))


def build():
    _base()
    _walls()
    _top()
    _sides()
