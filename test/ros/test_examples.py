#!/usr/bin/python3
"""Each of config/examples on a simulated robot of its kind: the estimate is good, and TF is what amcl and gmapping need."""

import collections
import copy
import math
import subprocess
import unittest

import numpy as np
import rospy
import yaml
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

import junit_runner
import run_helpers as helpers
import simulated_bag
from downstream import Downstream
from simulated_bag import Mount

SPEED = 10.0  # times faster than the robot
AMCL_QUEUE, GMAPPING_QUEUE = 100, 5  # scans that wait for TF in amcl and in slam_gmapping

# odom_frame: of the estimate. driver: what the robot's driver publishes, on the topic odom, on TF, or both. sector: that
# the laser sees [rad]. accuracy: [m] that the estimate may be off.
Robot = collections.namedtuple('Robot', 'odom_frame base_frame driver sector beams mount accuracy queue map')
ROBOTS = {
    'pioneer_sick': Robot('odom', 'base_link', 'topic', math.pi, 360, Mount(x=0.16), 0.10, GMAPPING_QUEUE, False),
    'turtlebot': Robot('sckf_odom', 'base_footprint', 'tf', math.radians(57), 3600, Mount(x=-0.09), 0.25, AMCL_QUEUE, False),
    'driver_owns_odom': Robot('sckf_odom', 'base_link', 'topic, tf', 2 * math.pi, 360, Mount(x=0.2), 0.10, AMCL_QUEUE, False),
    'amcl': Robot('odom', 'base_link', 'topic', 2 * math.pi, 360, Mount(x=0.2), 0.10, AMCL_QUEUE, True),
    'gmapping': Robot('odom', 'base_link', 'topic', 2 * math.pi, 360, Mount(x=0.2), 0.10, GMAPPING_QUEUE, True),
}


def narrowed(scan, sector):
    """The beams within half the sector to either side of ahead."""
    angles = scan.angle_min + np.arange(len(scan.ranges)) * scan.angle_increment
    inside = np.flatnonzero(np.abs(angles) <= sector / 2 + 1e-6)
    scan = copy.copy(scan)
    scan.ranges = list(np.array(scan.ranges)[inside])
    scan.angle_min, scan.angle_max = angles[inside[0]], angles[inside[-1]]
    return scan


def on_tf(odometry, base_frame):
    transform = TransformStamped()
    transform.header = odometry.header
    transform.child_frame_id = base_frame
    position = odometry.pose.pose.position
    transform.transform.translation.x, transform.transform.translation.y = position.x, position.y
    transform.transform.rotation = odometry.pose.pose.orientation
    return TFMessage([transform])


def robots_messages(robot):
    """What a simulated robot's drivers send: (topic, message, stamp)."""
    out = []
    for topic, message, stamp in simulated_bag.messages(duration=20.0, mount=robot.mount, beams=robot.beams):
        if topic == '/scan':
            out.append((topic, narrowed(message, robot.sector), stamp))
        elif topic == '/odom':
            if 'topic' in robot.driver:
                out.append((topic, message, stamp))
            if 'tf' in robot.driver:
                out.append(('/tf', on_tf(message, robot.base_frame), stamp))
        else:
            message.transforms[0].header.frame_id = robot.base_frame
            out.append((topic, message, stamp))
    return out


class Example(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.name = rospy.get_param('~example')
        cls.robot = ROBOTS[cls.name]
        messages = robots_messages(cls.robot)
        cls.scans = [stamp for topic, _, stamp in messages if topic == '/scan']
        cls.wheels = [stamp for topic, _, stamp in messages if topic in ('/odom', '/tf')]
        cls.recorder = helpers.Recorder()
        cls.downstream = Downstream(cls.robot.odom_frame, cls.robot.base_frame, cls.robot.queue, cls.robot.map)
        helpers.wait_for_subscriber('/scan')
        cls.recorder.wait_for_connection()
        helpers.Feeder(sorted({topic for topic, _, _ in messages})).feed(messages, SPEED)
        helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= cls.wheels[-1] - 1e-6,
                           'the last odometry')
        helpers.wait_until(lambda: len(cls.downstream.taken) + len(cls.downstream.dropped) >= len(cls.scans),
                           'TF at the last scan')

    def test_every_scan_is_used(self):
        helpers.wait_until(lambda: self.recorder.diagnostics().get('scans: together') == str(len(self.scans)),
                           'diagnostics that account for %d scans' % len(self.scans))
        counts = self.recorder.diagnostics()
        used = sum(int(counts.get('scans: ' + outcome, 0)) for outcome in ('reference', 'updated', 'slip'))
        self.assertGreaterEqual(used, 0.95 * len(self.scans), counts)

    def test_it_is_where_the_robot_is(self):
        stamps, poses = self.recorder.trajectory('pose')
        self.assertEqual(len(stamps), len(self.scans))
        distance, angle = helpers.difference(stamps, poses, stamps, simulated_bag.true_trajectory(stamps))
        self.assertLess(distance, self.robot.accuracy)
        self.assertLess(angle, 0.05)

    def test_frames(self):
        message = self.recorder.messages('odometry/filtered')[-1]
        self.assertEqual((message.header.frame_id, message.child_frame_id), (self.robot.odom_frame, self.robot.base_frame))

    def test_tf_is_one_tree(self):
        parent = {}
        for transform in self.recorder.transforms():
            child = transform.child_frame_id
            self.assertEqual(parent.setdefault(child, transform.header.frame_id), transform.header.frame_id)
        roots = set(parent.values()) - set(parent)
        self.assertEqual(roots, {'map' if self.robot.map else 'odom'})
        self.assertLessEqual({self.robot.odom_frame, self.robot.base_frame, 'laser'}, set(parent) | roots)

    def test_the_example_has_the_laser_where_it_is(self):
        mounts = [each.transform for each in self.recorder.transforms() if each.child_frame_id == 'laser']
        self.assertTrue(mounts)
        for mount in mounts:
            yaw = 2.0 * math.atan2(mount.rotation.z, mount.rotation.w)
            self.assertAlmostEqual(mount.translation.x, self.robot.mount.x, msg=mounts)
            self.assertAlmostEqual(mount.translation.y, 0.0, msg=mounts)
            self.assertAlmostEqual(yaw, 0.0, msg=mounts)

    def test_no_stamp_comes_twice_on_tf(self):
        stamps = collections.defaultdict(list)
        for transform in self.recorder.transforms(static=False):
            stamps[transform.child_frame_id].append(transform.header.stamp.to_nsec())
        for child, of_child in stamps.items():
            self.assertGreater(np.diff(of_child).min(), 0, child)

    def test_who_comes_after_it_finds_tf_at_every_scan(self):
        self.assertEqual(self.downstream.dropped, [])
        np.testing.assert_allclose([stamp for stamp, _, _ in self.downstream.taken], self.scans, atol=1e-6)

    def test_it_need_not_wait_for_tf_for_long(self):
        waits = [wait for _, _, wait in self.downstream.taken]
        self.assertLess(np.median(waits), 0.1)

    def test_tf_says_at_a_scan_what_the_pose_says(self):
        """But for the scan's own correction, where later odometry had been published already."""
        stamps, poses = self.recorder.trajectory('pose')
        for (stamp, transform, _), pose_stamp, pose in zip(self.downstream.taken, stamps, poses):
            self.assertAlmostEqual(stamp, pose_stamp, places=6)
            self.assertLess(math.hypot(transform.translation.x - pose[0], transform.translation.y - pose[1]), 0.02)

    def test_the_map_is_above_all(self):
        if not self.robot.map:
            self.skipTest('nobody publishes a map frame')
        stamp = rospy.Time.from_sec(self.scans[-2])
        self.assertAlmostEqual(self.downstream.buffer.lookup_transform('map', 'odom', stamp).transform.translation.x, 10.0)
        self.assertTrue(self.downstream.buffer.can_transform('map', 'laser', stamp))

    def test_there_is_nothing_to_warn_of(self):
        for part in ('unknown parameter', 'a frame can have one parent only'):
            self.assertEqual(self.recorder.log(part), [])

    def test_who_comes_after_it_asks_for_its_frames(self):
        frames = {'amcl': ('/amcl/odom_frame_id', '/amcl/base_frame_id'),
                  'gmapping': ('/slam_gmapping/odom_frame', '/slam_gmapping/base_frame')}
        if self.name not in frames:
            self.skipTest('starts nobody that comes after it')
        dumped = subprocess.run(['roslaunch', '--dump-params', 'sckf_odometry', self.name + '.launch'],
                                stdout=subprocess.PIPE, universal_newlines=True, check=True).stdout
        parameters = yaml.safe_load(dumped)
        self.assertEqual([parameters[name] for name in frames[self.name]], [self.robot.odom_frame, self.robot.base_frame])

    def test_as_a_user_calls_it_it_starts_what_it_says(self):
        nodes = subprocess.run(['roslaunch', '--nodes', 'sckf_odometry', self.name + '.launch'], stdout=subprocess.PIPE,
                               universal_newlines=True, check=True).stdout.split()
        also = {'amcl': {'/amcl', '/map_server'}, 'gmapping': {'/slam_gmapping'}, 'pioneer_sick': {'/laser_mount'}}
        self.assertEqual(set(nodes), {'/sckf_odometry', '/sckf_odometry_manager'} | also.get(self.name, set()))


if __name__ == '__main__':
    rospy.init_node('test_examples')
    junit_runner.run(Example)
