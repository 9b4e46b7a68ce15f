# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The model of the toy kiosk that tests of programs share: a build learns it once."""
import fcntl
import json
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
    Returns what train said (--json), and the file of the landmarks that it made of photos.
    """
    shared = os.path.join(os.path.dirname(os.path.abspath(folder)), 'shared_kiosk')
    model, landmarks, report = (os.path.join(shared, 'toy_kiosk.' + kind) for kind in ('safetensors', 'landmarks', 'json'))
    os.makedirs(shared, exist_ok=True)
    os.makedirs(os.path.dirname(target), exist_ok=True)
    with open(os.path.join(shared, 'lock'), 'w', encoding='utf-8') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not os.path.exists(report) or os.stat(report).st_mtime < built_at(train):
            result = subprocess.run([train, PHOTOS, '-o', model, *SHORT, '--landmarks', '--json'], stdout=subprocess.PIPE,
                                    stderr=subprocess.PIPE, universal_newlines=True, timeout=600, check=False)
            assert result.returncode == 0, result.stderr
            with open(report, 'w', encoding='utf-8') as file:
                file.write(result.stdout)
    shutil.copy(model, target)
    with open(report, encoding='utf-8') as file:
        return json.load(file), landmarks
