# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The kinds of recordings: what differs in light, exposure, noise and what passes in front; rig.py says how those with
several cameras move."""
import numpy as np


class Kind:
    def __init__(self, exposure_s=0.0, noise=0.0, occluder=False, moving_lights=False):
        self.exposure_s = exposure_s        # how long the shutter is open; 0: no motion blur
        self.noise = noise                  # sigma of the sensor's noise, of white
        self.occluder = occluder
        self.moving_lights = moving_lights


KINDS = {
    "regular": Kind(noise=0.004),
    "light": Kind(noise=0.004, moving_lights=True),
    "noise": Kind(noise=0.04, exposure_s=1 / 60),
    "occlusion": Kind(noise=0.004, occluder=True),
    "rig": Kind(noise=0.004),
    "sweep": Kind(noise=0.004),
}


def quicken(scene, exposure_s):
    """What makes a frame cheap: no indirect light, which would be noise, and a tree that survives motion."""
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 0
    scene.cycles.debug_bvh_type = "DYNAMIC_BVH"
    scene.render.use_motion_blur = exposure_s > 0
    scene.render.motion_blur_shutter = 2.0  # frames, of which Stage.pose makes the exposure
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.image_settings.compression = 0


def with_noise(image, sigma, seeds):
    """@param image uint8; @param sigma of white. The same seeds give the same noise."""
    noise = np.random.RandomState(np.array(seeds, np.uint32)).normal(0, 255 * sigma, image.shape)
    return np.clip(np.round(image + noise), 0, 255).astype(np.uint8)
