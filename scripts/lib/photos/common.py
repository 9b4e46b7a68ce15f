# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Errors that users see, and files and folders that appear whole or not at all."""
import contextlib
import json
import os
import shutil
import tempfile


class InputError(Exception):
    """What a user gave cannot be used. The text names the file and the cure."""


def require(holds, message):
    if not holds:
        raise InputError(message)


def say(text):
    print(text, flush=True)


def count(number, noun):
    """'1 photo', '2 photos'."""
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'


def readable_mode(is_folder):
    """Permissions of what a user makes; a temporary file's are for the user alone."""
    mask = os.umask(0o022)
    os.umask(mask)
    return (0o777 if is_folder else 0o666) & ~mask


def write_text(path, text):
    handle, temporary = tempfile.mkstemp(prefix='.', dir=os.path.dirname(os.path.abspath(path)))
    try:
        with os.fdopen(handle, 'w', encoding='utf-8') as file:
            file.write(text)
        os.chmod(temporary, readable_mode(False))
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def write_json(path, content):
    write_text(path, json.dumps(content, indent=1) + '\n')


def read_json(path):
    try:
        with open(path, encoding='utf-8') as file:
            return json.load(file)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read '{path}': {error}") from error


@contextlib.contextmanager
def whole_folder(path):
    """A new folder to fill, which becomes `path` when nothing failed; what was at `path` is replaced."""
    folder = tempfile.mkdtemp(prefix='.', dir=os.path.dirname(os.path.abspath(path)))
    try:
        yield folder
        os.chmod(folder, readable_mode(True))
        shutil.rmtree(path, ignore_errors=True)
        os.rename(folder, path)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
