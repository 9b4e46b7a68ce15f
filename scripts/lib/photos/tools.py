# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""This package's programs, train and render, wherever they are installed."""
import json
import os
import shutil
import subprocess
import sys

from photos.common import InputError, require

PACKAGE = 'nerf_pose_refiner'


def find_tool(name, folder=None):
    """Beside this program (as rosrun finds it), or nerf_pose_refiner_<name> on PATH. @param folder to look in first."""
    beside = [folder] if folder else [os.path.dirname(os.path.abspath(sys.argv[0]))]
    for path in (os.path.join(place, tool) for place in beside for tool in (name, f'{PACKAGE}_{name}')):
        if os.path.isfile(path) and os.access(path, os.X_OK):
            return path
    path = shutil.which(f'{PACKAGE}_{name}')
    require(path, f"the program '{name}' of this package was not found in '{beside[0]}' nor {PACKAGE}_{name} on PATH: "
            'build the package with CLI11, run this with rosrun, or give --tools')
    return path


def run_tool(path, arguments):
    """Runs a tool with --json; its progress goes to the terminal. @return what it prints."""
    result = subprocess.run([path, *map(str, arguments), '--json'], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            stdin=subprocess.DEVNULL, errors='replace', check=False)
    if result.returncode != 0:
        last = [line for line in result.stderr.splitlines() if line.strip()][-3:]
        raise InputError(f"{os.path.basename(path)} failed (exit code {result.returncode}): {' / '.join(last)}")
    try:
        return json.loads(result.stdout)
    except ValueError as error:
        raise InputError(f"{os.path.basename(path)} printed no JSON: {error}") from error
