# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Two shapes, enough for everything in the demo: a box (or any hexahedron) and a turned (lathed) solid.

Sizes are given in millimetres, for that is how small things are drawn; Blender's scene is in metres.
"""
import math

import bpy
import numpy as np
from mathutils import Euler, Matrix

from .paints import Picture

METRES_PER_MM = 0.001
FACES = ("front", "right", "back", "left", "top", "bottom")  # front looks along -y, right along +x
# Corners of each face, counter-clockwise seen from outside, the picture's lower left corner first.
FACE_CORNERS = ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7), (3, 2, 1, 0))


def place(x=0.0, y=0.0, z=0.0, turn=0.0, tilt_x=0.0, tilt_y=0.0):
    """A placement: tilted about x, then y, then turned about z (degrees), then moved (mm)."""
    angles = [math.radians(a) for a in (tilt_x, tilt_y, turn)]
    return Matrix.Translation((x, y, z)) @ Euler(angles, "XYZ").to_matrix().to_4x4()


def _material(paint):
    """A matt material of one colour (r, g, b in 0..255, sRGB) or of a picture."""
    name = paint.name if isinstance(paint, Picture) else "colour %d %d %d" % tuple(paint)
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    if not isinstance(paint, Picture):
        paint = Picture(name, 2, 2, paint)
    rows, columns = paint.rgb.shape[:2]
    image = bpy.data.images.new(name, columns, rows)
    rgba = np.ones((rows, columns, 4), np.float32)
    rgba[..., :3] = paint.rgb[::-1] / 255.0  # Blender counts rows from below
    image.pixels.foreach_set(rgba.ravel())
    image.pack()
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")  # no highlight: the object must not shine
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(texture.outputs["Color"], diffuse.inputs["Color"])
    links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def add_mesh(name, placement, vertices_mm, faces, corner_uvs, face_paints):
    """Links a mesh to the scene. @param vertices_mm [n][3] before `placement`; @param corner_uvs of all faces' corners
    in turn; @param face_paints one a face, a colour or a Picture"""
    mesh = bpy.data.meshes.new(name)
    vertices = [(placement @ Matrix.Translation(v)).translation * METRES_PER_MM for v in vertices_mm]
    mesh.from_pydata(vertices, [], faces)
    uv = mesh.uv_layers.new(name="uv")
    uv.data.foreach_set("uv", np.asarray(corner_uvs, np.float32).ravel())
    slots = {}
    for polygon, paint in zip(mesh.polygons, face_paints):
        material = _material(paint)
        if material.name not in slots:
            slots[material.name] = len(slots)
            mesh.materials.append(material)
        polygon.material_index = slots[material.name]
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def hexahedron(name, corners, paint, placement=place()):
    """@param corners 4 below and 4 above, counter-clockwise from (-x, -y); @param paint one for all faces, or
    a dict of them by face name with "other" for the rest."""
    paints = [paint.get(f, paint.get("other")) if isinstance(paint, dict) else paint for f in FACES]
    uvs = [(0, 0), (1, 0), (1, 1), (0, 1)] * 6
    return add_mesh(name, placement, corners, FACE_CORNERS, uvs, paints)


def box(name, size, paint, placement=place()):
    """A box that stands on its placement's origin."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    floor = [(-x, -y), (x, -y), (x, y), (-x, y)]
    return hexahedron(name, [(*p, 0) for p in floor] + [(*p, z) for p in floor], paint, placement)


def turned(name, profile, paint, placement=place(), segments=64):
    """A solid of revolution about z. @param profile (radius, z) from below upwards along the outside; the picture
    goes once around and from the profile's first point (below) to its last."""
    profile = np.asarray(profile, float)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    along /= along[-1]
    angles = 2 * math.pi * np.arange(segments) / segments
    vertices = [(r * math.cos(a), r * math.sin(a), z) for r, z in profile for a in angles]
    faces, uvs = [], []
    for ring in range(len(profile) - 1):
        for i in range(segments):
            j = (i + 1) % segments
            faces.append((ring * segments + i, ring * segments + j,
                          (ring + 1) * segments + j, (ring + 1) * segments + i))
            left, right = i / segments, (i + 1) / segments
            uvs += [(left, along[ring]), (right, along[ring]), (right, along[ring + 1]), (left, along[ring + 1])]
    return add_mesh(name, placement, vertices, faces, uvs, [paint] * len(faces))


def arc(radius, centre_radius=0.0, centre_z=0.0, start_deg=-90.0, end_deg=90.0, steps=12):
    """Profile points of a circle's arc: a ball when it starts below and ends above the axis, a ring when closed."""
    angles = np.radians(np.linspace(start_deg, end_deg, steps + 1))
    return [(centre_radius + radius * math.cos(a), centre_z + radius * math.sin(a)) for a in angles]
