# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A ROS graph of its own: a master, and the node or a nodelet in a manager."""
import os
import signal
import socket
import subprocess
import time

import rosgraph

NODE = '/pose_refiner'

# Parameters of the node, beside model_root and dataset_root.
SETUPS = {
    'camera': {'object': 'toy_kiosk'},
    'world': {'object': 'toy_kiosk', 'output_frame': 'world', 'fixed_frame': 'world'},
    'no_object': {},
}

REMAPPINGS = ('image:=camera/image', 'mask:=camera/mask', 'ignore_mask:=camera/ignore_mask')


def free_port():
    with socket.socket() as s:
        s.bind(('127.0.0.1', 0))
        return s.getsockname()[1]


def program(package, name):
    """Path of a program of a catkin package."""
    found = subprocess.run(['catkin_find', '--first-only', '--libexec', package, name], check=True,
                           stdout=subprocess.PIPE, universal_newlines=True).stdout.strip()
    if not found:
        raise RuntimeError('%s of %s is not built' % (name, package))
    return found


def wait_until(condition, timeout_s):
    """@return whether the condition held within the time."""
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def stop(process, how=signal.SIGINT, patience_s=10):
    """Ends a process, as roslaunch does. @return its exit code, or None where it had to be killed."""
    if process is None or process.poll() is not None:
        return None if process is None else process.returncode
    process.send_signal(how)
    try:
        return process.wait(patience_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return None


class Graph:
    """Its processes write to log files in a folder."""

    def __init__(self, folder, nodelet):
        self.folder = folder
        self.nodelet = nodelet
        self.port = free_port()
        self.master = None
        self.processes = {}  # by name
        for name in ('ROS_HOSTNAME', 'ROS_NAMESPACE'):
            os.environ.pop(name, None)
        os.environ.update(ROS_IP='127.0.0.1', ROS_MASTER_URI='http://127.0.0.1:%d' % self.port,
                          ROS_HOME=os.path.join(folder, 'ros'), OMP_WAIT_POLICY='passive')
        self.start_master()

    def start_master(self):
        self.master = self.run('master', ['rosmaster', '--core', '-p', str(self.port)])
        if not wait_until(rosgraph.is_master_online, 30):
            raise RuntimeError('the master does not start: see %s' % self.log_of('master'))

    def log_of(self, name):
        return os.path.join(self.folder, name + '.log')

    def run(self, name, command, **environment):
        """Starts a process. @param environment variables that it gets beside those of this one."""
        also = environment.pop('preexec', lambda: None)

        def preexec():
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # which a job in the background ignores
            also()
        with open(self.log_of(name), 'ab') as log:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                       env={**os.environ, **environment}, preexec_fn=preexec)
        self.processes[name] = process
        return process

    @property
    def node(self):
        """The process that refines."""
        return self.processes.get('manager' if self.nodelet else 'node')

    def start_node(self, **environment):
        """The node, or a manager and the nodelet in it, with as few heaps as in the package's launch files. Parameters are
        on the master already."""
        environment.setdefault('MALLOC_ARENA_MAX', '4')
        if not self.nodelet:
            self.run('node', [program('nerf_pose_refiner', 'pose_refiner'), '__name:=' + NODE[1:], *REMAPPINGS],
                     **environment)
            return
        nodelet = program('nodelet', 'nodelet')
        self.run('manager', [nodelet, 'manager', '__name:=manager'], **environment)
        self.run('node', [nodelet, 'load', 'nerf_pose_refiner/PoseRefiner', 'manager', '__name:=' + NODE[1:],
                          *REMAPPINGS])

    def stop_node(self):
        if self.nodelet:
            stop(self.processes.get('node'))
        stop(self.node)

    def stop_all(self):
        for name in list(self.processes):
            if name != 'master':
                stop(self.processes[name], patience_s=5)
        stop(self.master)


def of_process(pid, key):
    """A number of /proc/<pid>/status: VmRSS [KiB], Threads."""
    with open('/proc/%d/status' % pid, encoding='ascii', errors='replace') as file:
        for line in file:
            if line.startswith(key + ':'):
                return int(line.split()[1])
    return 0


def descriptors(pid):
    return len(os.listdir('/proc/%d/fd' % pid))
