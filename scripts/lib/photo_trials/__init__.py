# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""How well photos_to_object does on photos that scripts/make_photo_set rendered, of which the truth is known."""
