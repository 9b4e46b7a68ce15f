# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The source files of the package, for the checks that read them."""
import os


def source_files(top, folders, suffixes):
    """Yields the paths, below the folder `top`, of all files in its `folders` whose names end in one of `suffixes`."""
    for base in folders:
        for folder, _, files in os.walk(os.path.join(top, base)):
            for name in sorted(files):
                if name.endswith(suffixes):
                    yield os.path.relpath(os.path.join(folder, name), top)
