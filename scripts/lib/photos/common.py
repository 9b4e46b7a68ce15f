# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Errors that users see, and files and folders that appear whole or not at all."""
import concurrent.futures
import contextlib
import fcntl
import json
import os
import shutil
import stat
import tempfile

import cv2


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


def in_threads(function, items):
    """The results in order. OpenCV, and numpy with large arrays, work without Python's lock."""
    own_threads = cv2.getNumThreads()
    cv2.setNumThreads(1)  # else each thread would start as many again
    try:
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as threads:
            return list(threads.map(function, items))
    finally:
        cv2.setNumThreads(own_threads)


def mode_of(path):
    """Permissions of the file that is there, or of one that a user makes: a temporary file's are for the user alone."""
    if os.path.exists(path):
        return stat.S_IMODE(os.stat(path).st_mode)
    mask = os.umask(0o022)
    os.umask(mask)
    return 0o666 & ~mask


def sync(path):
    """Brings a file or the names in a folder to the disk. Some file systems cannot do that with folders: then it comes
    there when the system likes."""
    opened = os.open(path, os.O_RDONLY)
    try:
        os.fsync(opened)
    except OSError:
        if not os.path.isdir(path):
            raise
    finally:
        os.close(opened)


def temporary_file(path, text):
    """Writes a file beside `path` that can take its place. @return its path."""
    handle, temporary = tempfile.mkstemp(prefix='.', dir=os.path.dirname(path))
    try:
        with os.fdopen(handle, 'w', encoding='utf-8') as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, mode_of(path))
    except BaseException:
        os.unlink(temporary)
        raise
    return temporary


def write_texts(texts):
    """Replaces files as wholes: after a loss of power, too, either the old or the new one is there. Where one cannot be
    written, none is replaced. @param texts {path: text}"""
    made = {}
    try:
        for path, text in {os.path.realpath(path): text for path, text in texts.items()}.items():  # a link stays one
            made[path] = temporary_file(path, text)
        for path, temporary in made.items():
            os.replace(temporary, path)
    except BaseException:
        for temporary in made.values():
            with contextlib.suppress(FileNotFoundError):  # it has taken its place
                os.unlink(temporary)
        raise
    for folder in {os.path.dirname(path) for path in made}:
        sync(folder)


def write_text(path, text):
    write_texts({path: text})


def text_of(content):
    """JSON as it is written."""
    return json.dumps(content, indent=1) + '\n'


def write_json(path, content):
    write_text(path, text_of(content))


def read_json(path):
    try:
        with open(path, encoding='utf-8') as file:
            return json.load(file)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read '{path}': {error}") from error


@contextlib.contextmanager
def whole_folder(path):
    """A new folder to fill, which becomes `path` when nothing failed and all of it is on the disk; what was at `path` is
    replaced. What an earlier process left when it was killed is removed: a folder of results is one process' at a time,
    see `locked`."""
    folder = os.path.join(os.path.dirname(os.path.abspath(path)), f'.{os.path.basename(path)}.part')
    shutil.rmtree(folder, ignore_errors=True)
    os.mkdir(folder)
    try:
        yield folder
        for parent, _, names in os.walk(folder):
            for name in names:
                sync(os.path.join(parent, name))
            sync(parent)
        shutil.rmtree(path, ignore_errors=True)
        os.rename(folder, path)
        sync(os.path.dirname(folder))
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


@contextlib.contextmanager
def locked(folder):
    """The folder, made if need be, for this process alone: another one waits. The system frees it however this one ends."""
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, '.lock'), 'w', encoding='utf-8') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
