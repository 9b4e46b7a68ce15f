# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The model of the toy kiosk that tests of programs share: a build learns it once."""
import fcntl
import os
import re
import shutil
import subprocess

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PHOTOS = os.path.join(TOP, 'demo', 'data', 'toy_kiosk')
STEPS = 300  # enough to find a pose again, in seconds
SHORT = ('--steps', str(STEPS), '--samples-per-step', '4096')


def built_at(train):
    """When the program and the library that it uses were built."""
    libraries = subprocess.run(['ldd', train], stdout=subprocess.PIPE, universal_newlines=True, check=True).stdout
    own = re.findall(r'=> (\S*libnerf_pose_refiner\S*)', libraries)
    return max(os.stat(path).st_mtime for path in [train, *own])


def put_kiosk_model(train, folder, target):
    """Copies the model to a file, and learns it before if this build has not yet.

    train: the program. folder: of the test's files; the shared model stands beside it. Tests that run at the same time
    wait for the one that learns.
    """
    folder = os.path.dirname(os.path.abspath(folder))
    shared = os.path.join(folder, 'shared_kiosk.safetensors')
    os.makedirs(os.path.dirname(target), exist_ok=True)
    with open(os.path.join(folder, 'shared_kiosk.lock'), 'w', encoding='utf-8') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not os.path.exists(shared) or os.stat(shared).st_mtime < built_at(train):
            result = subprocess.run([train, PHOTOS, '-o', shared, '--name', 'toy_kiosk', *SHORT], stdout=subprocess.PIPE,
                                    stderr=subprocess.PIPE, universal_newlines=True, timeout=600, check=False)
            assert result.returncode == 0, result.stderr
    shutil.copy(shared, target)
