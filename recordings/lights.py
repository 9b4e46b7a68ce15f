# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Light that needs few samples: a sun with hard shadows, and everything else as a formula in the materials.

A path tracer's soft light is noise until it has hundreds of samples. Here each material adds what the sky and further
lamps give a surface by its normal alone, without shadows, so that four samples make a clean image.
"""
import math

import bpy
import numpy as np
from mathutils import Euler, Vector

from motion import Wave

ZENITH = Vector((0.25, 0.15, 0.95)).normalized()


class Source:
    """A lamp at infinity inside the node group: colour * clamp(slope * cosine + offset)."""

    def __init__(self, tree, normal, slope, offset):
        nodes, links = tree.nodes, tree.links
        self.direction = nodes.new("ShaderNodeVectorMath")
        self.direction.operation = "DOT_PRODUCT"
        links.new(normal, self.direction.inputs[0])
        amount = nodes.new("ShaderNodeMath")
        amount.operation, amount.use_clamp = "MULTIPLY_ADD", True
        amount.inputs[1].default_value, amount.inputs[2].default_value = slope, offset
        links.new(self.direction.outputs["Value"], amount.inputs[0])
        self.colour = nodes.new("ShaderNodeVectorMath")
        self.colour.operation = "SCALE"
        links.new(amount.outputs[0], self.colour.inputs["Scale"])
        self.light = self.colour.outputs["Vector"]

    def set(self, direction, colour):
        """@param direction towards the lamp; @param colour: radiance of a white surface that faces it, linear"""
        self.direction.inputs[1].default_value = direction
        self.colour.inputs[0].default_value = colour


def _fill_light(count):
    """A node group whose output is the light on a surface. @return the group; the sky and `count` lamps"""
    tree = bpy.data.node_groups.new("fill light", "ShaderNodeTree")
    tree.outputs.new("NodeSocketVector", "light")
    normal = tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
    sources = [Source(tree, normal, 0.35, 0.65)] + [Source(tree, normal, 1.0, 0.0) for _ in range(count)]
    total = sources[0].light
    for source in sources[1:]:
        add = tree.nodes.new("ShaderNodeVectorMath")
        tree.links.new(total, add.inputs[0])
        tree.links.new(source.light, add.inputs[1])
        total = add.outputs["Vector"]
    tree.links.new(total, tree.nodes.new("NodeGroupOutput").inputs["light"])
    return tree, sources[0], sources[1:]


def _shine(material, tree):
    """Adds the fill light to a matt material with a picture."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    fill = nodes.new("ShaderNodeGroup")
    fill.node_tree = tree
    product = nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    links.new(nodes["Image Texture"].outputs["Color"], product.inputs[0])
    links.new(fill.outputs["light"], product.inputs[1])
    emission, both = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeAddShader")
    links.new(product.outputs["Vector"], emission.inputs["Color"])
    links.new(nodes["Diffuse BSDF"].outputs["BSDF"], both.inputs[0])
    links.new(emission.outputs["Emission"], both.inputs[1])
    links.new(both.outputs["Shader"], nodes["Material Output"].inputs["Surface"])
    material.cycles.sample_as_light = False


class Lights:
    """A sun and the sky; where the light changes, less of both and two coloured lamps that move and flash.

    To be made when all materials are there.
    """

    SUN, SKY = np.array((1.0, 0.93, 0.84)), np.array((0.88, 0.93, 1.0))

    def __init__(self, seed, changing=False):
        random = np.random.RandomState(seed + 2000003)
        share = 0.45 if changing else 1.0
        self._set_sun(1.9 * share, self.SUN, random.uniform(0, 2 * math.pi))
        tree, sky, self.lamps = _fill_light(2 if changing else 0)
        sky.set(ZENITH, 0.5 * share * self.SKY)
        for material in bpy.data.materials:
            _shine(material, tree)
        self.waves = [[Wave(random, 0.1, 0.6) for _ in range(6)] for _ in self.lamps]
        self.flashes_hz = [random.uniform(0.8, 2.5) for _ in self.lamps]

    @staticmethod
    def _set_sun(strength, colour, turn):
        sun = bpy.data.lights.new("sun", "SUN")
        sun.color, sun.energy, sun.angle = colour, strength, math.radians(0.5)
        thing = bpy.data.objects.new("sun", sun)
        thing.rotation_euler = Euler((math.radians(40), 0, turn))
        bpy.context.scene.collection.objects.link(thing)

    def _lamp(self, i, t_s):
        """Direction and colour of a moving lamp."""
        turn, tilt, bright, *colour = (wave(t_s) for wave in self.waves[i])
        elevation, azimuth = 0.4 + 0.5 * tilt, 5 * turn
        flash = 1 / (1 + math.exp(-12 * math.sin(2 * math.pi * self.flashes_hz[i] * t_s)))
        strength = (0.6 + 0.35 * bright) * (0.25 + 0.75 * flash)
        return ((math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)),
                strength * (0.55 + 0.45 * np.array(colour)))

    def at(self, t_s):
        """Sets the lamps for a moment: each turns around the room, changes its colour, and flashes."""
        for i, lamp in enumerate(self.lamps):
            lamp.set(*self._lamp(i, t_s))

    def gain_bgr(self, t_s):
        """What the lamps do to the room, which was rendered without them: factors of encoded values."""
        if not self.lamps:
            return np.ones(3)
        light = 0.45 + sum(0.6 * self._lamp(i, t_s)[1] for i in range(len(self.lamps)))
        return light[::-1] ** (1 / 2.2)


def light_studio():
    """The even, white light of the photos that an object is learned from."""
    tree, sky, _ = _fill_light(0)
    sky.set(ZENITH, (0.75, 0.75, 0.75))
    Lights._set_sun(0.8, (1, 1, 1), 0.6)
    for material in bpy.data.materials:
        _shine(material, tree)
