# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Services that are called often, at odd times, or with nonsense."""
import threading

import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped

from faults.graph import descriptors, of_process
from faults.rows import row
from faults.watcher import in_words
from faults.world import require
from nerf_pose_refiner import srv
from nerf_pose_refiner.msg import RefinementStatus as Status


@row('all of them are called while there is no object', 'each answers within 2 s; what cannot be done has a reason',
     setup='no_object')
def without_object(world):
    status = world.watcher.last()
    require(status and status.state == Status.STATE_NO_MODEL and 'no object' in status.message,
            'the status says: %s' % in_words(status))
    require(world.reset().success and world.enable(False).success and world.enable(True).success, 'refused')
    require(world.objects(within=2).success, '~list_objects is refused')
    world.refused(world.load('no_such_object', within=2), 'no_such_object')
    world.refused(world.choose('no_such_object'), 'no_such_object')
    world.refused(world.call('unload_object', srv.UnloadObject, name='no_such_object', within=2), 'no_such_object')
    world.refused(world.call('refine', srv.RefinePose, timeout_s=1.0, within=2), 'no object')


@row('names of objects that lead out of `~model_root`, or are empty, or long', 'refused within 1 s; tracking goes on',
     fast=True)
def odd_names(world):
    for name in ('', '..', '../toy_kiosk', '/etc/passwd', 'a/b', 'a' * 5000, 'toy\nkiosk', '.hidden'):
        world.refused(world.load(name, within=1))
    world.expect_back()


@row('`~reset` while the object is tracked', '`REASON_RESET` within 1 s, no pose; right poses with a new initial pose')
def reset(world):
    world.reset()
    world.expect(Status.REASON_RESET)
    world.expect_no_pose(0.5)
    world.track()
    world.expect_back()


@row('`~enable` false', '`REASON_DISABLED` within 1 s, no pose, no image is received; right poses after true and a new '
     'initial pose')
def disabled(world):
    world.enable(False)
    world.expect(Status.REASON_DISABLED)
    world.expect_no_pose(0.5)
    require(world.player.images.get_num_connections() == 0, 'images are still received')
    world.enable(True)
    world.wait(0.5)
    world.track()
    world.expect_back()


@row('`~enable` is switched 100 times', 'descriptors and threads as before; right poses with a new initial pose')
def switched(world):
    before = descriptors(world.pid()), of_process(world.pid(), 'Threads')
    for i in range(100):
        world.enable(i % 2 == 1)
    world.wait(1)
    after = descriptors(world.pid()), of_process(world.pid(), 'Threads')
    require(after[0] <= before[0] + 5 and after[1] <= before[1] + 5, 'descriptors and threads: %s, then %s'
            % (before, after))
    world.track()
    world.expect_back()


def flooded(world, service, kind, count, **request):
    """Four threads call a service over and over while the object is tracked."""
    errors = []

    def called(proxy):
        """ROS's own transport drops one of some thousand calls that come so fast: it gets a second try."""
        try:
            proxy(**request)
        except rospy.ServiceException as e:
            if 'transport error' not in str(e):
                raise
            proxy(**request)

    def work():
        proxy = rospy.ServiceProxy('/pose_refiner/' + service, kind)
        for _ in range(count):
            try:
                called(proxy)
            except rospy.ServiceException as e:
                errors.append(e)
    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    world.expect_right_poses()
    for thread in threads:
        thread.join()
    require(not errors, '%d calls failed: %s' % (len(errors), errors[:1]))
    world.expect_back()


ANSWERED = 'each call is answered, at the second try at most; tracking goes on'


@row('`~list_objects` is called 400 times by four clients', ANSWERED)
def list_flood(world):
    flooded(world, 'list_objects', srv.ListObjects, 100)


@row('`~load_object` with an unknown name is called 400 times by four clients', ANSWERED)
def load_flood(world):
    flooded(world, 'load_object', srv.LoadObject, 100, name='no_such_object')


@row('`~refine` with an image that cannot be used', 'refused with `REASON_BAD_IMAGE` within 1 s; tracking goes on')
def refine_bad_image(world):
    image, info = world.player.frame().messages(world.player.stamp())
    image.data = image.data[:1000]
    good = world.player.frame().initial_pose(world.player.stamp())
    initial = PoseWithCovarianceStamped(header=good.header)
    initial.pose.pose = good.pose
    reply = world.call('refine', srv.RefinePose, image=image, camera_info=info, initial=initial, within=1)
    world.refused(reply)
    require(reply.reason == Status.REASON_BAD_IMAGE, 'reason %d: %s' % (reply.reason, reply.message))
    world.expect_back()


@row('`~refine` without a camera', 'refused after its `timeout_s` of 1 s')
def refine_no_camera(world):
    good = world.player.frame().initial_pose(rospy.Time())
    initial = PoseWithCovarianceStamped(header=good.header)
    initial.pose.pose = good.pose
    world.player.camera_on = False
    try:
        world.refused(world.call('refine', srv.RefinePose, initial=initial, timeout_s=1.0, within=3))
    finally:
        world.player.camera_on = True
    world.track()
    world.expect_back()
