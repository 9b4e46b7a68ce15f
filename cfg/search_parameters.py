# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Parameters that the searches from an initial pose and from the last one have in common."""
from dynamic_reconfigure.parameter_generator_catkin import bool_t, double_t, int_t


def add_search(gen, rotation_deg, translation):
    width = gen.add_group('width of the search')
    width.add('rotation_deg', double_t, 0,
              'Half width of the search per axis, about the object\'s centre [degrees]', rotation_deg, 0.01, 180)
    width.add('translation', double_t, 0,
              'Half width of the search per axis [object diameters]', translation, 0.0001, 100)
    comparison = gen.add_group('comparison with the image')
    comparison.add('robust_scale', double_t, 0,
                   'Colour difference (0..1) beyond which a pixel counts as an outlier', 0.1, 0.001, 10)
    comparison.add('compare_contrast', bool_t, 0,
                   'Compare local contrast; false: compare colours with the model\'s', True)
    comparison.add('fit_gain_bias', bool_t, 0, 'Fit gain and bias of each colour channel', True)
    comparison.add('seed', int_t, 0, 'Seed of the random hypotheses', 1, 0, 2147483647)
