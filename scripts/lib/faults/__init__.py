# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults on a running graph, for scripts/faults: what is provoked, and what must happen then."""
