# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Where the object stands: an empty studio for the training views, a cluttered table for the sequence.

World frame W: origin on the table's surface, z up. Sizes are in millimetres, lights in watts and metres.
"""
import math

import bpy
from mathutils import Vector

from .paints import (BLUE, BROWN, CREAM, GREEN, GREY, INK, LIME, NAVY, ORANGE, PINK, PURPLE, RED, SLATE, TEAL, YELLOW,
                     Picture)
from .shapes import arc, box, place, turned

# Ambient light (linear RGB, strength) and area lamps: where (m), how large (m), how strong (W), linear colour.
# The studio is even and white. The others differ from it, and from each other, in strength, tint and side.
LIGHTS = {
    "studio": ((1.0, 1.0, 1.0), 0.80, (((0.9, -0.9, 1.1), 1.2, 9.0, (1.0, 1.0, 1.0)),
                                       ((-1.0, 0.7, 1.2), 1.2, 7.0, (1.0, 1.0, 1.0)))),
    "warm": ((0.84, 0.92, 1.0), 0.50, (((0.85, -0.75, 0.95), 0.55, 36.0, (1.0, 0.74, 0.46)),)),
    "cool": ((0.80, 0.90, 1.0), 0.50, (((-0.80, -0.85, 0.90), 0.50, 22.0, (0.62, 0.82, 1.0)),)),
    "dim": ((1.0, 0.92, 0.84), 0.26, (((0.20, -0.95, 1.05), 0.60, 12.0, (1.0, 0.86, 0.66)),)),
}


def light(name):
    tint, strength, lamps = LIGHTS[name]
    world = bpy.data.worlds.new("ambient")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*tint, 1.0)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = strength
    bpy.context.scene.world = world
    for i, (where, size, power, colour) in enumerate(lamps):
        lamp = bpy.data.lights.new("lamp %d" % i, "AREA")
        lamp.shape, lamp.size, lamp.energy, lamp.color = "DISK", size, power, colour
        thing = bpy.data.objects.new("lamp %d" % i, lamp)
        thing.location = where
        thing.rotation_euler = (Vector((0, 0, 0.08)) - Vector(where)).to_track_quat("-Z", "Y").to_euler()
        bpy.context.scene.collection.objects.link(thing)


def _room():
    cloth = Picture("table cloth", 1500, 1100, (176, 168, 150))
    # Fewer pixels per millimetre would do here, but the cloth is seen from as near as the object is.
    for x in range(0, 1500, 60):
        cloth.rectangle(x, 0, 22, 1100, (128, 150, 168))
    for y in range(0, 1100, 60):
        cloth.rectangle(0, y, 1500, 8, (186, 104, 92))
    for x in range(41, 1500, 60):
        for y in range(34, 1100, 60):
            cloth.star(x, y, 11, (PURPLE, GREEN, ORANGE)[(x // 60 + 2 * (y // 60)) % 3], 6)
    box("table", (1500, 1100, 30), {"top": cloth, "other": BROWN}, place(0, 0, -30))

    paper = Picture("wall paper", 900, 360, (170, 186, 160)).stripes([(170, 186, 160), (150, 172, 168)], 30)
    for i, x in enumerate(range(20, 900, 75)):
        for j, y in enumerate(range(25, 360, 70)):
            paper.disc(x + 20 * (j % 2), y, 13, (RED, TEAL, YELLOW, PURPLE)[(i + 3 * j) % 4])
            paper.star(x + 20 * (j % 2), y, 9, CREAM, 5 + (i + j) % 4)
    paper.worn()
    bricks = Picture("brick wall", 900, 360).tiles([(170, 106, 84), (150, 92, 78), (184, 124, 96), (140, 100, 90)],
                                                   48, 22, (190, 182, 170), gap=4).worn()
    box("wall", (4000, 20, 1600), {"front": paper, "other": GREY}, place(0, 640, -400))
    box("left wall", (20, 3000, 1600), {"right": bricks, "other": GREY}, place(-1150, 0, -400))
    box("right wall", (20, 3000, 1600), {"left": bricks, "other": GREY}, place(1150, 0, -400))


def _clutter():
    cereal = Picture("cereal", 130, 190, YELLOW).rectangle(0, 130, 130, 60, RED).disc(65, 92, 42, ORANGE)
    cereal.disc(65, 92, 34, CREAM).text("OATS", 18, 32, 22, BLUE, 4).star(62, 92, 24, PURPLE, 7)
    cereal.text("crisp & dry", 16, 166, 11, CREAM, 1.6).worn()
    side = Picture("cereal side", 50, 190, RED).tiles([RED, ORANGE], 50, 24, YELLOW, 0).worn()
    box("cereal", (130, 50, 190), {"front": cereal, "back": cereal, "other": side}, place(-215, 215, 0, turn=18))

    carton = Picture("carton", 180, 120, (178, 138, 92)).rectangle(72, 0, 24, 120, (200, 170, 120))
    carton.rectangle(12, 16, 48, 34, CREAM).text("No 31", 15, 38, 11, INK, 1.8).disc(140, 76, 26, TEAL)
    carton.star(140, 76, 20, CREAM, 4).worn()
    box("carton", (180, 130, 120), carton, place(245, 235, 0, turn=-24))
    spines = Picture("spines", 170, 26)
    for i, (height, colour) in enumerate(((30, BLUE), (22, PINK), (34, GREEN), (26, ORANGE))):
        spine = Picture("spine %d" % i, 170, height, colour).rectangle(10, 0, 5, height, CREAM)
        spine.text("VOL %d  tales of tin" % (i + 3), 24, height * 0.68, height * 0.34, CREAM, 1.4).worn()
        box("book %d" % i, (170 - 8 * i, 120, height), {"front": spine, "back": spine, "top": colour, "other": CREAM},
            place(45, 300, sum((30, 22, 34, 26)[:i]), turn=(4, -7, 9, -3)[i]))
    label = Picture("label", 230, 100, GREY).rectangle(0, 14, 230, 72, GREEN).text("PEAS", 20, 62, 30, YELLOW, 5)
    label.disc(170, 50, 24, LIME).text("PEAS", 190, 62, 20, CREAM, 3)
    turned("can", [(0, 0), (36, 0), (36, 100), (0, 100)], label, place(-330, 40, 0))
    vase = Picture("vase", 300, 220, NAVY).tiles([NAVY, BLUE, PURPLE], 22, 22, CREAM).worn()
    turned("vase", [(0, 0), (34, 0), (52, 45), (48, 90), (24, 130), (32, 150)], vase, place(345, 20, 0))
    turned("bowl", [(0, 0), (40, 0), (78, 38), (82, 46), (74, 46), (36, 8), (0, 8)],
           Picture("bowl", 520, 150).stripes([CREAM, TEAL, CREAM, RED], 22), place(-95, 330, 0))
    for i, (x, y, z, colour) in enumerate(((-120, 320, 42, RED), (-72, 345, 42, LIME), (-90, 300, 48, ORANGE))):
        turned("fruit %d" % i, arc(30), colour, place(x, y, z))
    dice = Picture("dice", 40, 40, PINK)
    dice.disc(10, 10, 5, CREAM).disc(30, 30, 5, CREAM).disc(20, 20, 5, CREAM)
    box("dice", (40, 40, 40), dice, place(-170, -60, 0, turn=33))
    box("block", (52, 52, 34), Picture("block", 52, 52, LIME).frame(PURPLE, 6).text("H", 14, 40, 24, PURPLE, 4),
        place(180, -15, 0, turn=-14))
    turned("ball", arc(33), Picture("ball", 200, 100).stripes([BLUE, YELLOW, CREAM], 16), place(150, 120, 33, tilt_x=35))


CUP_AT = (70, -215, 0)


def occlude():
    """A tall cup between the object and the middle of the camera's path."""
    cup = Picture("cup", 190, 130, SLATE).tiles([SLATE, TEAL, (110, 120, 136)], 19, 16, CREAM).worn()
    turned("cup", [(0, 0), (24, 0), (30, 135), (27, 135), (22, 6), (0, 6)], cup, place(*CUP_AT))


def cover():
    """A closed box over the object, which is then not to be seen from anywhere."""
    wrap = Picture("wrap", 180, 190, (150, 120, 150)).mosaic([PURPLE, SLATE, TEAL, GREY], 60, CREAM).worn()
    box("cover", (200, 200, 190), wrap, place(0, 0, 0, turn=math.degrees(0.4)))


def exchange():
    """Another toy, of about the same size and colours, in the object's place."""
    front = Picture("train", 130, 70, GREEN).stripes([GREEN, RED, GREEN, YELLOW], 11)
    front.rectangle(10, 12, 66, 28, NAVY).text("LOK 9", 14, 34, 14, CREAM, 2.4).worn()
    box("train", (130, 64, 70), front, place(0, 0, 22, turn=15))
    cab = Picture("cab", 54, 56, BLUE).rectangle(8, 8, 38, 22, CREAM).worn()
    box("cab", (54, 70, 56), cab, place(-36, -10, 90, turn=15))
    turned("boiler", [(0, 0), (18, 0), (14, 30), (24, 52), (0, 52)],
           Picture("boiler", 110, 80).stripes([ORANGE, PURPLE], 14), place(40, 12, 90))
    wheel = [(0, -6), (21, -6), (21, 6), (0, 6)]
    for i, x in enumerate((-44, 0, 44)):
        turned("wheel %d" % i, wheel, RED, place(x, -38 + 0.27 * x, 21, tilt_x=90, turn=15))


def furnish():
    _room()
    _clutter()
