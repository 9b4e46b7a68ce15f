# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The four kinds of recordings: what differs in light, exposure, noise and what passes in front."""
import math

import bpy
import numpy as np
from mathutils import Euler

from motion import Wave


class Kind:
    def __init__(self, exposure_s=0.0, noise=0.0, occluder=False, moving_lights=False):
        self.exposure_s = exposure_s        # how long the shutter is open; 0: no motion blur
        self.noise = noise                  # sigma of the sensor's noise, of white
        self.occluder = occluder
        self.moving_lights = moving_lights


SKY = 0.55  # strength

KINDS = {
    "regular": Kind(noise=0.004),
    "light": Kind(noise=0.004, moving_lights=True),
    "noise": Kind(noise=0.04, exposure_s=1 / 60),
    "occlusion": Kind(noise=0.004, occluder=True),
}


class Lights:
    """A sun and an even sky; where the light changes, less of both and two coloured lamps that move and flash."""

    def __init__(self, kind, seed):
        random = np.random.RandomState(seed + 2000003)
        share = 0.45 if kind.moving_lights else 1.0
        sun = _sun("sun", 2.0 * share, (1.0, 0.93, 0.84))
        sun.rotation_euler = Euler((math.radians(40), 0, random.uniform(0, 2 * math.pi)))
        _sky((0.88, 0.93, 1.0), SKY * share)
        self.lamps = []
        if kind.moving_lights:
            self.lamps = [(_sun("lamp %d" % i, 1.0, (1, 1, 1)), [Wave(random, 0.1, 0.6) for _ in range(6)],
                           random.uniform(0.8, 2.5)) for i in range(2)]

    def at(self, t_s):
        """Sets the lamps for a moment: each turns around the room, changes its colour, and flashes."""
        for lamp, (turn, tilt, bright, *colour), flashes_hz in self.lamps:
            lamp.rotation_euler = Euler((0.9 + 0.5 * tilt(t_s), 0, 5 * turn(t_s)))
            lamp.data.color = [0.55 + 0.45 * wave(t_s) for wave in colour]
            flash = 1 / (1 + math.exp(-12 * math.sin(2 * math.pi * flashes_hz * t_s)))
            lamp.data.energy = (1.8 + 1.2 * bright(t_s)) * (0.25 + 0.75 * flash)

    def gain_bgr(self):
        """What the lamps of the moment do to the room, which was rendered without them: factors of encoded values."""
        if not self.lamps:
            return np.ones(3)
        light = 0.45 + sum(0.25 * lamp.data.energy * np.array(lamp.data.color) for lamp, _, _ in self.lamps)
        return light[::-1] ** (1 / 2.2)


def _sun(name, strength, colour):
    lamp = bpy.data.lights.new(name, "SUN")
    lamp.color, lamp.energy, lamp.angle = colour, strength, math.radians(3)
    thing = bpy.data.objects.new(name, lamp)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _sky(tint, strength):
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*tint, 1.0)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = strength
    world.cycles.sampling_method = "NONE"  # an even sky needs no sampling of its own
    bpy.context.scene.world = world


def quicken(scene, exposure_s):
    """What makes a frame cheap without being seen: one bounce, and a tree that survives motion."""
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 1
    scene.cycles.debug_bvh_type = "DYNAMIC_BVH"
    scene.render.use_motion_blur = exposure_s > 0
    scene.render.motion_blur_shutter = 2.0  # frames, of which Stage.pose makes the exposure
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.image_settings.compression = 0


def with_noise(image, sigma, seeds):
    """@param image uint8; @param sigma of white. The same seeds give the same noise."""
    noise = np.random.RandomState(np.array(seeds, np.uint32)).normal(0, 255 * sigma, image.shape)
    return np.clip(np.round(image + noise), 0, 255).astype(np.uint8)
