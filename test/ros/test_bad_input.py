#!/usr/bin/python3
"""Whatever drivers send and users set: the manager lives, the user is told, and the estimate goes on as if nothing were."""

import copy
import math
import subprocess
import unittest
import xmlrpc.client

import numpy as np
import roslib.packages
import rosgraph
import rospy

import junit_runner
import run_helpers as helpers
import simulated_bag

NAN, INF = float('nan'), float('inf')
MANAGER = '/manager'


def changed(message, **fields):
    """A copy with these fields, named as header__stamp, set."""
    message = copy.deepcopy(message)
    for name, value in fields.items():
        *path, last = name.split('__')
        part = message
        for step in path:
            part = getattr(part, step)
        setattr(part, last, value)
    return message


def bad_scans(good):
    """What is wrong, and the message. None of them is good for an estimate."""
    n = len(good.ranges)
    return [
        ('no stamp', changed(good, header__stamp=rospy.Time(0))),
        ('no frame', changed(good, header__frame_id='')),
        ('a frame that nobody knows', changed(good, header__frame_id='nowhere')),
        ('nothing but NaN', changed(good, ranges=[NAN] * n)),
        ('nothing but infinity', changed(good, ranges=[INF, -INF] * (n // 2))),
        ('nothing but zero', changed(good, ranges=[0.0] * n)),
        ('nothing but the largest range', changed(good, ranges=[good.range_max + 1.0] * n)),
        ('no beam', changed(good, ranges=[])),
        ('one beam', changed(good, ranges=[1.0])),
        ('no angle between the beams', changed(good, angle_increment=0.0)),
        ('NaN between the beams', changed(good, angle_increment=NAN)),
        ('NaN for the first angle', changed(good, angle_min=NAN)),
        ('ranges turned round', changed(good, range_min=10.0, range_max=0.1)),
        ('NaN for the range limits', changed(good, range_min=NAN, range_max=NAN)),
    ]


def bad_odometry(good):
    stamp = good.header.stamp
    return [
        ('no stamp', changed(good, header__stamp=rospy.Time(0))),
        ('a stamp of long ago', changed(good, header__stamp=stamp - rospy.Duration(500))),
        ('a stamp far ahead', changed(good, header__stamp=stamp + rospy.Duration(500))),
        ('NaN position', changed(good, pose__pose__position__x=NAN)),
        ('infinite position', changed(good, pose__pose__position__y=INF)),
        ('no quaternion', changed(good, pose__pose__orientation__z=0.0, pose__pose__orientation__w=0.0)),
        ('a quaternion of length 2', changed(good, pose__pose__orientation__x=0.0, pose__pose__orientation__w=2.0)),
        ('NaN in the quaternion', changed(good, pose__pose__orientation__w=NAN)),
        ('the pose of a frame that nobody knows', changed(good, child_frame_id='nowhere', pose__pose__position__x=99.0)),
    ]


def odd_but_good(topic, good):
    """What a driver may do and no harm comes of."""
    if topic == '/odom':
        message = copy.deepcopy(good)
        message.pose.covariance = [NAN] * 36
        message.twist.covariance = [-1.0] * 36
        return [good, message]
    return [good, changed(good, time_increment=-1.0, scan_time=NAN, angle_max=NAN)]


def with_bad_messages(messages):
    """The messages, each followed by a bad one or an odd duplicate in turn; and how many bad scans there are of each kind."""
    out, kinds = [], {}
    count = {'/scan': 0, '/odom': 0, '/tf_static': 0}
    for topic, message, stamp in messages:
        out.append((topic, message, stamp))
        if topic == '/tf_static':
            continue
        shift = rospy.Duration(0, 1000 * 1000)  # a stamp of its own, a little later
        later = changed(message, header__stamp=message.header.stamp + shift)
        bad = bad_scans(later) if topic == '/scan' else bad_odometry(later)
        bad += [('odd', m) for m in odd_but_good(topic, message)]
        kind, extra = bad[count[topic] % len(bad)]
        count[topic] += 1
        kinds[topic, kind] = kinds.get((topic, kind), 0) + 1
        out.append((topic, extra, stamp))
    return out, kinds


def load_nodelet(name):
    tool = roslib.packages.find_node('nodelet', 'nodelet')[0]
    return subprocess.Popen([tool, 'load', 'sckf_odometry/ScKfOdometryNodelet', MANAGER, '__name:=' + name])


def manager_pid():
    node = rosgraph.Master(rospy.get_name()).lookupNode(MANAGER)
    return xmlrpc.client.ServerProxy(node).getPid(rospy.get_name())[2]


class BadInput(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        helpers.wait_until(lambda: rosgraph.Master(rospy.get_name()).lookupNode(MANAGER), 'the manager')
        cls.pid = manager_pid()
        cls.recorder = helpers.Recorder()
        rospy.set_param('/refused', {'gate_probability': 2.0, 'kf_dist_linear': 'far', 'publish_tf': 1, 'odom_frame': ''})
        rospy.set_param('/sckf_odometry', {'kf_dist_linaer': 0.3, 'kf_dist_linear': 1, 'max_scan_delay': 10000})
        cls.loaders = [load_nodelet('refused')]
        helpers.wait_until(lambda: cls.recorder.log('not started'), 'the refusal of bad parameters')
        cls.loaders.append(load_nodelet('sckf_odometry'))
        helpers.wait_for_subscriber('/scan')
        good = simulated_bag.messages(duration=40.0)
        messages, cls.kinds = with_bad_messages(good)
        cls.scans = [message.header.stamp.to_sec() for topic, message, _ in good if topic == '/scan']
        cls.sent = len([topic for topic, _, _ in messages if topic == '/scan'])
        early = [m for m in messages if m[0] != '/tf_static' and m[2] < simulated_bag.START + 3.0]
        late = [m for m in messages if m[0] != '/tf_static' and m[2] >= simulated_bag.START + 3.0]
        mount = [m for m in messages if m[0] == '/tf_static']
        feeder = helpers.Feeder(['/odom', '/scan', '/tf_static'])
        feeder.feed(early)
        helpers.wait_until(lambda: cls.recorder.log('waiting for the mount'), 'word that it waits for the mount')
        feeder.feed(mount + late)
        last = [message.header.stamp.to_sec() for topic, message, _ in good if topic == '/odom'][-1]
        helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= last - 1e-6, 'the last odometry')

    @classmethod
    def tearDownClass(cls):
        for loader in cls.loaders:
            loader.terminate()

    def test_the_manager_lives(self):
        self.assertEqual(manager_pid(), self.pid)

    def test_every_bad_parameter_is_named_with_what_is_allowed(self):
        text = self.recorder.log('not started')[0]
        for part in ('gate_probability = 2: a number in (0, 1) expected',
                     'kf_dist_linear = "far": a number of at least 0 m expected',
                     'publish_tf = 1: true or false expected',
                     'odom_frame = "": a text that is not empty expected'):
            self.assertIn(part, text)

    def test_a_misspelt_parameter_is_named(self):
        self.assertEqual(len(self.recorder.log('unknown parameter /sckf_odometry/kf_dist_linaer')), 1)

    def test_the_estimate_goes_on(self):
        stamps, poses = self.recorder.trajectory('pose')
        distance, angle = helpers.difference(stamps, poses, stamps, simulated_bag.true_trajectory(stamps))
        self.assertLess(distance, 0.10)
        self.assertLess(angle, 0.02)
        stamps, poses = self.recorder.trajectory('odometry/filtered')
        self.assertTrue(np.isfinite(poses).all())
        self.assertGreater(np.diff(stamps).min(), 0)

    def test_no_good_scan_is_lost(self):
        stamps, _ = self.recorder.trajectory('pose')
        missing = [s for s in self.scans[:-1] if np.abs(stamps - s).min() > 1e-6]
        self.assertEqual(missing, [])

    def test_every_scan_is_accounted_for(self):
        def accounted():
            counts = self.recorder.diagnostics()
            return int(counts.get('scans: together', 0)) + int(counts.get('scans: waiting for their mount', 0)) == self.sent
        helpers.wait_until(accounted, 'diagnostics that account for %d scans' % self.sent)
        counts = self.recorder.diagnostics()
        of_kind = lambda kind: self.kinds['/scan', kind]
        self.assertEqual(int(counts['scans: refused']), of_kind('no stamp') + of_kind('no frame'))
        self.assertEqual(int(counts['scans: waiting for their mount']), of_kind('a frame that nobody knows'))
        self.assertEqual(int(counts['scans: out of order']), of_kind('odd'))
        self.assertGreaterEqual(int(counts['odometry: refused']), 30)

    def test_it_says_which_mount_it_waits_for(self):
        self.assertIn('no transform base_link -> laser on TF', self.recorder.log('waiting for the mount')[0])

    def test_what_is_wrong_is_said(self):
        for part in ('scan on /scan not used', 'odometry on /odom not used', 'expected'):
            self.assertTrue(self.recorder.log(part), part)


if __name__ == '__main__':
    rospy.init_node('test_bad_input')
    junit_runner.run(BadInput)
