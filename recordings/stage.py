# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""An object, its motion, its light and what passes in front of it, as a Blender scene for any moment.

T_A_B takes points from frame B to frame A. O: object, W: world, C: camera (x right, y down, z forward), X: occluder.
"""
import bpy
import numpy as np
from mathutils import Matrix

import bottle
import desk_lamp
import kinds
import motion
import render as demo
import rig
from lights import Lights
from room import add_occluder
from scene import toy_kiosk
from visibility import Surface

PATHS_AN_IMAGE = 300000  # shared by the pixels that are rendered
FEWEST_SAMPLES, MOST_SAMPLES = 3, 12


class Kiosk:
    """The demo's object, described as the modules `bottle` and `desk_lamp` describe theirs."""

    NAME, LABEL, build = toy_kiosk.NAME, None, staticmethod(toy_kiosk.build)
    ELEVATIONS_DEG = (-10, 75)  # its photos are taken from above


OBJECTS = {thing.NAME: thing for thing in (Kiosk, desk_lamp, bottle)}


def build(thing):
    """Builds an object at the world's origin. @return its parts"""
    others = set(bpy.data.objects)
    thing.build()
    return [part for part in bpy.data.objects if part not in others]


def restrict(scene, low_px, high_px):
    """Renders only a rectangle of the image, with fewer paths a pixel where it is large. Pixels count from the
    image's corner."""
    render = scene.render
    size = [render.resolution_x, render.resolution_y]
    low, high = np.clip(low_px, 0, size), np.clip(high_px, 0, size)
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x = low[0] / size[0], high[0] / size[0]
    render.border_min_y, render.border_max_y = 1 - high[1] / size[1], 1 - low[1] / size[1]
    samples = round(PATHS_AN_IMAGE / max(1.0, np.prod(high - low)))
    scene.cycles.samples = min(max(samples, FEWEST_SAMPLES), MOST_SAMPLES)


def _carried(parts, name):
    """An empty that carries parts along."""
    empty = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(empty)
    for part in parts:
        part.parent = empty
    return empty


class Stage:
    def __init__(self, sequence):
        """@param sequence: what sequence.json says of a recording: its object, kind, seed, seconds and camera"""
        thing, seed = OBJECTS[sequence["object"]], sequence["seed"]
        self.kind = kinds.KINDS[sequence["kind"]]
        self.scene = demo.start(motion.WIDTH, motion.HEIGHT, motion.FOCAL_PX, MOST_SAMPLES, transparent=True)
        parts = build(thing)
        self.surface, self.cover, self.occluder = Surface(parts, thing.LABEL), None, None
        points = self.surface.points()
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        if sequence["kind"] in rig.CAMERAS:
            self.trajectory = rig.Seat(sequence["kind"], sequence["camera"], seed, demo.diameter_m(points), centre,
                                       sequence["seconds"])
        else:
            self.trajectory = motion.Trajectory(seed, demo.diameter_m(points), centre, thing.ELEVATIONS_DEG,
                                                sequence["seconds"])
        self.movers = [(self.scene.camera, lambda t: self.trajectory.T_W_C(t) @ demo.OPTICAL_FROM_OPENGL),
                       (_carried(parts, thing.NAME), lambda t: self.trajectory.T_W_C(t) @ self.trajectory.T_C_O(t))]
        if self.kind.occluder:
            self.occluder = motion.Occluder(seed, self.trajectory)
            part = add_occluder(self.occluder.diameter)
            self.cover = Surface([part])
            self.movers.append((part, lambda t: self.trajectory.T_W_C(t) @ self.T_C_X(t)))
        self.lights = Lights(seed, self.kind.moving_lights)
        kinds.quicken(self.scene, self.kind.exposure_s)

    def T_C_X(self, t_s):
        return self.occluder.T_C_X(t_s) if self.occluder else None

    def exposure(self, count):
        """`count` moments of an exposure around a frame's time, relative to it [s]."""
        return self.kind.exposure_s * ((np.arange(count) + 0.5) / count - 0.5)

    def pose(self, t_s):
        """Moves everything to a moment; with an exposure, from its start to its end while the shutter is open."""
        half = self.kind.exposure_s / 2
        for thing, T_W_B in self.movers:
            if not half:
                thing.matrix_world = Matrix(T_W_B(t_s))
                continue
            thing.animation_data_clear()
            thing.rotation_mode, before = "QUATERNION", None
            for frame, moment in enumerate((t_s - half, t_s, t_s + half)):
                thing.matrix_world = Matrix(T_W_B(moment))
                if before:  # of the two quaternions of a rotation the nearer one
                    thing.rotation_quaternion.make_compatible(before)
                before = thing.rotation_quaternion.copy()
                for path in ("location", "rotation_quaternion"):
                    thing.keyframe_insert(path, frame=frame)
        self.lights.at(t_s)
        restrict(self.scene, *self._bounds(t_s))
        self.scene.frame_set(1)

    def _bounds(self, t_s, margin_px=3.0):
        """Corners of a rectangle in the image, counted from the image's corner [px]."""
        pixels = []
        for moment in t_s + self.exposure(3) * 1.5:
            for surface, T in ((self.surface, self.trajectory.T_C_O(moment)), (self.cover, self.T_C_X(moment))):
                if surface:
                    seen = surface.points() @ T[:3, :3].T + T[:3, 3]
                    pixels.append(seen[:, :2] / seen[:, 2:] * motion.FOCAL_PX + [motion.CX + 0.5, motion.CY + 0.5])
        pixels = np.concatenate(pixels)
        return pixels.min(axis=0) - margin_px, pixels.max(axis=0) + margin_px
