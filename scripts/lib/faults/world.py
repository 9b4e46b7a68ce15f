# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What a row works with: the graph, the camera, and checks."""
import os
import shutil
import signal
import threading
import time

import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from sensor_msgs.msg import Image
from std_srvs.srv import SetBool, Trigger

from faults import graph as graphs
from faults.graph import NODE, of_process
from faults.watcher import REASONS, in_words
from nerf_pose_refiner.msg import RefinementStatus as Status
from nerf_pose_refiner import srv

BACK_S = 2.0  # of stamps: right poses are back
SETTLED_S = 1.0  # of stamps, after that: right poses stay
RIGHT_SHARE = 0.9  # of the refined images in that time
LATE_S = 0.3  # a pose arrives after the status of its image
SPARE_MIB = 200  # a fault must not take more memory than this
SERVICE_S = 20
JUST_NOW_S = 0.25  # what was provoked before the call may have been answered by then


class Missed(AssertionError):
    """A statement that does not hold."""


def require(condition, text):
    if not condition:
        raise Missed(text)


class World:
    """@param patience factor of all times, for slow machines."""

    def __init__(self, graph, player, watcher, patience):
        self.graph, self.player, self.watcher, self.patience = graph, player, watcher, patience
        self.initial_poses = rospy.Publisher(NODE + '/initial_pose', PoseStamped, queue_size=1000)
        self.initial_poses_with_covariance = rospy.Publisher(NODE + '/initial_pose_with_covariance',
                                                             PoseWithCovarianceStamped, queue_size=10)
        self.masks = rospy.Publisher('/camera/mask', Image, queue_size=10)
        self.ignore_masks = rospy.Publisher('/camera/ignore_mask', Image, queue_size=10)
        self.models = os.path.join(graph.folder, 'models')  # ~model_root
        self.datasets = os.path.join(graph.folder, 'datasets')  # ~dataset_root
        self.setup = None

    # ---- The node ----

    def start(self, setup, parameters=None, **environment):
        """Starts the node anew. @param setup one of graph.SETUPS. @param parameters beside those."""
        self.graph.stop_node()
        shutil.rmtree(self.models, ignore_errors=True)
        shutil.copytree(self.graph.folder + '/intact', self.models)
        if rospy.has_param(NODE):
            rospy.delete_param(NODE)
        rospy.set_param(NODE, {'model_root': self.models, 'dataset_root': self.datasets,
                               **graphs.SETUPS[setup], **(parameters or {})})
        self.watcher.forget()
        self.graph.start_node(**environment)
        self.setup = setup

    def ready(self):
        """Waits for the services, which come last."""
        rospy.wait_for_service(NODE + '/overlay/set_parameters', SERVICE_S * self.patience)

    def pid(self):
        return self.graph.node.pid

    def alive(self):
        return self.graph.node.poll() is None

    def kill(self, how=signal.SIGKILL):
        """Ends the process and waits for that."""
        self.graph.node.send_signal(how)
        self.graph.node.wait(10)
        if self.graph.nodelet:  # the loader ends by its bond; a launch file would start it again
            graphs.stop(self.graph.processes['node'])

    # ---- Time ----

    def wait(self, seconds):
        """Of stamps."""
        end = self.player.now_s + seconds
        graphs.wait_until(lambda: self.player.now_s >= end, 10 * seconds / self.player.speed)

    # ---- Poses ----

    def send_initial_pose(self):
        with self.player.lock:
            self.initial_poses.publish(self.player.frame().initial_pose(self.player.stamp()))

    def right_after(self, stamp_s):
        """@return whether a right pose of an image from then on has been published. Lock held."""
        return any(p.right and p.stamp_ns >= 1e9 * stamp_s for p in self.watcher.poses)

    def track(self, within=20):
        """Sends initial poses until the object is tracked."""
        since, end = self.player.now_s, time.monotonic() + within * self.patience
        while not self.watcher.wait(lambda: self.right_after(since), 0.6):
            require(time.monotonic() < end, 'no right pose after an initial pose; the last status: %s'
                    % in_words(self.watcher.last()))
            self.send_initial_pose()

    def expect_back(self, initial_pose=False):
        """Right poses come within BACK_S of stamps, and stay. @param initial_pose the row needs a new one."""
        since, speed = self.player.now_s, self.player.speed
        if initial_pose:
            self.send_initial_pose()
        back = self.watcher.wait(lambda: self.right_after(since), BACK_S * self.patience / speed)
        require(back, 'no right pose within %g s; the last status: %s' % (BACK_S, in_words(self.watcher.last())))
        self.expect_right_poses()

    def expect_right_poses(self, seconds=SETTLED_S):
        """Most of the images that are refined in this time have a right pose."""
        begin = self.player.now_s
        self.wait(seconds)
        with self.watcher.changed:
            refined = sum(s.latency_s > 0 and s.header.stamp.to_sec() >= begin for s, _ in self.watcher.statuses)

        def right():
            return sum(p.right and p.stamp_ns >= 1e9 * begin for p in self.watcher.poses)
        # A pose may arrive later than the status of its image: each topic has a thread of its own here.
        enough = self.watcher.wait(lambda: right() >= max(1, RIGHT_SHARE * refined - 1), LATE_S * self.patience)
        require(enough, '%d right poses of %d refined images; the last status: %s'
                % (right(), refined, in_words(self.watcher.last())))

    def excuse_doubtful_poses(self):
        """Wrong poses that have a score below `trust_score` are not counted."""
        trust_score = rospy.get_param(NODE + '/tracker/trust_score')
        with self.watcher.changed:
            scores = {s.header.stamp.to_nsec(): s.score for s, _ in self.watcher.statuses}
            self.watcher.poses = [p for p in self.watcher.poses
                                  if p.right or scores.get(p.stamp_ns, 1) >= trust_score]

    def expect_no_pose(self, seconds):
        """Nothing is published for images from now on. Images under way may still be."""
        begin = self.player.now_s + 0.1
        self.wait(seconds)
        with self.watcher.changed:
            count = sum(p.stamp_ns >= 1e9 * begin for p in self.watcher.poses)
        require(count == 0, '%d poses were published' % count)

    # ---- What the node says ----

    def expect(self, reason=None, state=None, text='', within=1.0):
        """A status from now on has this reason or state, and this text. @param within seconds."""
        since = time.monotonic() - JUST_NOW_S

        def said():
            return any(at >= since and (reason is None or s.reason == reason) and
                       (state is None or s.state == state) and text in s.message
                       for s, at in self.watcher.statuses)
        require(self.watcher.wait(said, within * self.patience),
                'no status with %s "%s" within %g s; the last one: %s'
                % (REASONS.get(reason, 'state %s' % state), text, within, in_words(self.watcher.last())))

    def expect_diagnostics(self, task, text, within=3.0):
        """/diagnostics, which comes once a second, has this text in a task's summary or values."""
        since = time.monotonic()

        def said():
            status, at = self.watcher.diagnostics.get(task, (None, 0))
            return at >= since and any(text in part for part in [status.message] + [v.value for v in status.values])
        require(self.watcher.wait(said, within * self.patience), 'diagnostics of %s do not say "%s": %s'
                % (task, text, self.watcher.diagnostics.get(task)))

    def expect_log(self, text, within=2.0):
        """The node's log has this text."""
        names = ['manager', 'node'] if self.graph.nodelet else ['node']

        def logged():
            for name in names:
                with open(self.graph.log_of(name), encoding='utf-8', errors='replace') as file:
                    if text in file.read():
                        return True
            return False
        require(graphs.wait_until(logged, within * self.patience), 'the log does not say "%s"' % text)

    # ---- Services ----

    def call(self, service, kind, within=SERVICE_S, **request):
        """Calls a service of the node. @return its response."""
        rospy.wait_for_service(NODE + '/' + service, SERVICE_S)
        result = []

        def work():
            try:
                result.append(rospy.ServiceProxy(NODE + '/' + service, kind)(**request))
            except rospy.ServiceException as e:
                result.append(e)
        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        thread.join(within * self.patience)
        require(result, '~%s did not answer within %g s' % (service, within))
        require(not isinstance(result[0], Exception), '~%s: %s' % (service, result and result[0]))
        return result[0]

    def refused(self, response, text=''):
        require(not response.success, 'the call succeeded: %s' % response.message)
        require(response.message and text in response.message,
                'the message lacks "%s": %s' % (text, response.message))

    def load(self, name, **more):
        return self.call('load_object', srv.LoadObject, name=name, **more)

    def choose(self, name):
        return self.call('set_object', srv.SetObject, name=name)

    def objects(self, **more):
        return self.call('list_objects', srv.ListObjects, **more)

    def reset(self):
        return self.call('reset', Trigger)

    def enable(self, on):
        return self.call('enable', SetBool, data=on)

    def register(self, within=60, **request):
        return self.call('register_object', srv.RegisterObject, within=within, **request)

    # ---- Around a row ----

    def prepare(self, row):
        """A node with the row's parameters that tracks, or has no object."""
        self.player.as_usual()
        if self.setup != row.setup or not self.alive():
            self.start(row.setup)
            self.ready()
        if 'object' in graphs.SETUPS[row.setup]:
            self.track()
        self.watcher.forget()
        self.before = (self.pid(), of_process(self.pid(), 'VmRSS'))

    def conclude(self, row):
        """What holds for every row: no wrong pose, the node lives, and the memory is as it was."""
        with self.watcher.changed:
            wrong = [p for p in self.watcher.poses if not p.right]
        require(not wrong, '%d wrong poses, the first one: %s' % (len(wrong), wrong[0].text if wrong else ''))
        if row.restarts or row.last:
            return
        require(self.alive() and self.pid() == self.before[0], 'the node has ended')
        taken = (of_process(self.pid(), 'VmRSS') - self.before[1]) / 1024
        require(taken < SPARE_MIB, 'the node has taken %.0f MiB' % taken)
