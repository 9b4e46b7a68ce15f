# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults of the GPU."""
import ctypes
import subprocess
import sys

from faults.rows import row
from faults.world import require

TAKE_ALL = '''
import ctypes, time
cuda = ctypes.CDLL("libcuda.so.1")
cuda.cuInit(0)
context, free, total, pointer = ctypes.c_void_p(), ctypes.c_size_t(), ctypes.c_size_t(), ctypes.c_void_p()
cuda.cuCtxCreate_v2(ctypes.byref(context), 0, 0)
cuda.cuMemGetInfo_v2(ctypes.byref(free), ctypes.byref(total))
size = free.value
while size > (1 << 20):
    if cuda.cuMemAlloc_v2(ctypes.byref(pointer), ctypes.c_size_t(size)): size //= 2
print("taken", flush=True)
time.sleep(600)
'''


def gpu_is_there():
    try:
        cuda = ctypes.CDLL('libcuda.so.1')
    except OSError:
        return False
    count = ctypes.c_int()
    return cuda.cuInit(0) == 0 and cuda.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0


@row('no GPU is visible at the start, `backend: auto`', 'the CPU refines, and diagnostics say so within 3 s',
     restarts=True)
def none_visible(world):
    world.start('world', {'backend': 'auto'}, CUDA_VISIBLE_DEVICES='')
    world.ready()
    world.track()
    world.expect_diagnostics('engine', 'CPU')
    world.setup = None


@row('no GPU is visible at the start, `backend: cuda`', 'the status or the log says why within 5 s; the node lives',
     restarts=True)
def none_visible_cuda(world):
    world.start('world', {'backend': 'cuda'}, CUDA_VISIBLE_DEVICES='')
    world.expect_log('CUDA', within=8)
    require(world.alive(), 'the node has ended')
    world.setup = None


@row('another process takes all memory of the GPU, then ends', 'right poses on the GPU or the CPU within 2 s after it',
     gpu=True)
def memory_taken(world):
    taker = subprocess.Popen([sys.executable, '-c', TAKE_ALL], stdout=subprocess.PIPE)
    try:
        require(taker.stdout.readline() == b'taken\n', 'the memory was not taken')
        world.wait(2)
    finally:
        taker.kill()
        taker.wait()
    world.expect_back()


@row('the node starts while another process has all memory of the GPU', 'the CPU refines: right poses with an initial '
     'pose', gpu=True, restarts=True)
def memory_taken_at_start(world):
    taker = subprocess.Popen([sys.executable, '-c', TAKE_ALL], stdout=subprocess.PIPE)
    try:
        require(taker.stdout.readline() == b'taken\n', 'the memory was not taken')
        world.start('world')
        world.ready()
        world.track()
    finally:
        taker.kill()
        taker.wait()
    world.expect_back()
    world.setup = None
