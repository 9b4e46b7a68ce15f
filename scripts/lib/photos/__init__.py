# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""From photos of an object on a table to a model of it: what photos_to_object and make_board are made of.

Conventions: a pose R, t takes a point of the world to the camera (optical axes: x right, y down, z forward). Pixels
are counted as COLMAP and transforms.json do: the image's corner is (0, 0), the centre of its first pixel (0.5, 0.5).
Where OpenCV is called, 0.5 is subtracted.
"""
import os

# Photos are worked on with all cores (photos.common.in_threads): numpy's BLAS shall not start as many threads in each.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
