# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of model files."""
import os
import shutil

from faults.rows import row
from faults.world import require
from nerf_pose_refiner import srv

REFUSED = 'refused with a reason within 1 s; tracking goes on'


def refused_model(world, make):
    """`make` makes the file of another object, which is refused; the one that is tracked stays."""
    path = os.path.join(world.models, 'spoilt.safetensors')
    make(path)
    try:
        world.refused(world.load('spoilt', within=1))
        require(world.objects(within=2).success, '~list_objects fails')
    finally:
        if os.path.isdir(path):
            os.rmdir(path)
        else:
            os.remove(path)
    world.expect_back()


def intact(world):
    with open(os.path.join(world.models, 'toy_kiosk.safetensors'), 'rb') as file:
        return file.read()


def write(path, data):
    with open(path, 'wb') as file:
        file.write(data)


@row('a truncated file', REFUSED, fast=True)
def truncated(world):
    refused_model(world, lambda path: write(path, intact(world)[:-1000]))


@row('a file with one wrong bit', REFUSED)
def flipped(world):
    data = bytearray(intact(world))
    data[len(data) // 2] ^= 1
    refused_model(world, lambda path: write(path, data))


@row('an empty file', REFUSED)
def empty(world):
    refused_model(world, lambda path: write(path, b''))


@row('a file of another kind', REFUSED)
def foreign(world):
    refused_model(world, lambda path: write(path, b'\x89PNG\r\n\x1a\n' + bytes(1000)))


@row('a header that nests 500,000 brackets', REFUSED)
def nested(world):
    header = b'[' * 500000
    refused_model(world, lambda path: write(path, len(header).to_bytes(8, 'little') + header))


@row('a sparse file of 1 TB', REFUSED)
def sparse(world):
    def make(path):
        write(path, intact(world))
        os.truncate(path, 10**12)
    refused_model(world, make)


@row('a FIFO with the name of a model', REFUSED)
def fifo(world):
    refused_model(world, os.mkfifo)


@row('a folder with the name of a model', REFUSED)
def folder(world):
    refused_model(world, os.mkdir)


@row('a link that leads out of `~model_root`', REFUSED)
def link(world):
    outside = os.path.join(world.graph.folder, 'outside.safetensors')
    write(outside, intact(world))
    refused_model(world, lambda path: os.symlink(outside, path))


@row('metadata beside the model that is no YAML', REFUSED)
def metadata(world):
    beside = os.path.join(world.models, 'spoilt.yaml')
    write(beside, b'frame_in_model: [')
    try:
        refused_model(world, lambda path: write(path, intact(world)))
    finally:
        os.remove(beside)


def damaged_in_use(world, damage):
    """The tracked object's file is damaged; a restored one can be chosen."""
    path = os.path.join(world.models, 'toy_kiosk.safetensors')
    kept = path + '.kept'
    shutil.copy(path, kept)
    try:
        damage(path)
        world.wait(1)
        world.expect_right_poses()
    finally:
        os.replace(kept, path)
    require(world.choose('toy_kiosk').success, 'the restored file is refused')
    world.track()
    world.expect_back()


IN_USE = 'tracking goes on; once restored, the file can be chosen again'


@row('the tracked object\'s file is deleted', IN_USE)
def deleted_in_use(world):
    damaged_in_use(world, os.remove)


@row('the tracked object\'s file is replaced by a truncated one', IN_USE)
def replaced_in_use(world):
    def damage(path):
        write(path + '.new', intact(world)[:5000])
        os.replace(path + '.new', path)
    damaged_in_use(world, damage)


@row('the tracked object\'s file is overwritten in place', IN_USE)
def overwritten_in_use(world):
    damaged_in_use(world, lambda path: write(path, b'no model'))


@row('metadata of the tracked object that is no YAML', 'the log says so within 2 s; tracking goes on')
def metadata_in_use(world):
    path = os.path.join(world.models, 'toy_kiosk.yaml')
    kept = path + '.kept'
    if os.path.exists(path):
        shutil.copy(path, kept)
    write(path, b'symmetries: [')
    try:
        world.expect_log('toy_kiosk.yaml', within=4)
        world.expect_right_poses()
    finally:
        os.remove(path)
        if os.path.exists(kept):
            os.replace(kept, path)
    world.wait(2)
    world.track()
    world.expect_back()


@row('the tracked object is to be unloaded', REFUSED)
def unload_in_use(world):
    world.refused(world.call('unload_object', srv.UnloadObject, name='toy_kiosk', within=1), 'in use')
    world.expect_back()


@row('50 changes of the object', 'each succeeds; right poses with a new initial pose')
def swaps(world):
    shutil.copy(os.path.join(world.models, 'toy_kiosk.safetensors'), os.path.join(world.models, 'twin.safetensors'))
    for i in range(50):
        require(world.choose(('twin', 'toy_kiosk')[i % 2]).success, 'change %d is refused' % i)
    world.track()
    world.expect_back()
    require(world.call('unload_object', srv.UnloadObject, name='twin').success, 'the twin stays')
    os.remove(os.path.join(world.models, 'twin.safetensors'))
