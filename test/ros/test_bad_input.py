#!/usr/bin/python3
"""Whatever drivers send and users set: the manager lives, the user is told, and the estimate goes on as if nothing were."""

import collections
import copy
import math
import subprocess
import unittest

import numpy as np
import roslib.packages
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from tf2_msgs.msg import TFMessage

import junit_runner
import run_helpers as helpers
import simulated_bag
from run_helpers import changed

NAN, INF = float('nan'), float('inf')
MANAGER = '/manager'
MANY_BEAMS = 100000


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
        ('a number for no return', changed(good, ranges=[good.range_max - 1.0] * n)),
        ('no beam', changed(good, ranges=[])),
        ('one beam', changed(good, ranges=[1.0])),
        ('no angle between the beams', changed(good, angle_increment=0.0)),
        ('NaN between the beams', changed(good, angle_increment=NAN)),
        ('NaN for the first angle', changed(good, angle_min=NAN)),
        ('ranges turned round', changed(good, range_min=10.0, range_max=0.1)),
        ('NaN for the range limits', changed(good, range_min=NAN, range_max=NAN)),
        ('angles turned round', changed(good, angle_increment=-good.angle_increment)),
    ]


# The upper bound is range_max, and from the first number for no return on that number.
NONE_WITHIN = '0 of 360 ranges are finite and within [0.05, %g) m: expected at least 20'

# What is said of a scan that the pipeline cannot use: the value, and what is expected.
REASONS = {
    'nothing but NaN': NONE_WITHIN,
    'nothing but infinity': '0 of 360 ranges',
    'nothing but zero': '0 of 360 ranges',
    'nothing but the largest range': '0 of 360 ranges',
    'a number for no return': NONE_WITHIN,
    'no beam': '0 of 0 ranges',
    'one beam': '1 of 1 ranges',
    'no angle between the beams': 'angle_increment 0 with 360 ranges: expected values in rad, an increment that is not zero',
    'NaN between the beams': 'angle_increment nan with 360 ranges: expected',
    'NaN for the first angle': 'angle_min is nan, angle_increment',
    'ranges turned round': 'range_min is 10, range_max 0.1: expected range_min below range_max [m]',
    'NaN for the range limits': 'range_min is nan, range_max nan: expected range_min below range_max [m]',
}


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


def varied(scan, i):
    """The same scan as other drivers send it: the other way round, with intensities, with far more beams, or as it is."""
    if i == 60:
        n = MANY_BEAMS // len(scan.ranges)
        return changed(scan, ranges=list(np.repeat(scan.ranges, n)), angle_increment=scan.angle_increment / n,
                       angle_min=scan.angle_min - 0.5 * scan.angle_increment * (1 - 1 / n))
    if i % 3 == 1:
        last = scan.angle_min + (len(scan.ranges) - 1) * scan.angle_increment
        return changed(scan, ranges=list(reversed(scan.ranges)), angle_min=last, angle_max=scan.angle_min,
                       angle_increment=-scan.angle_increment)
    return changed(scan, intensities=[47.0] * len(scan.ranges)) if i % 3 == 2 else scan


def with_bad_messages(messages):
    """The messages, each followed by a bad one or an odd duplicate in turn; how many bad ones there are of each kind;
    and of which kind the one of a stamp is."""
    out, kinds, stamps = [], {}, {}
    count = {'/scan': 0, '/odom': 0, '/tf_static': 0}
    for topic, message, stamp in messages:
        out.append((topic, varied(message, count[topic]) if topic == '/scan' else message, stamp))
        if topic == '/tf_static':
            continue
        shift = rospy.Duration(0, 1000 * 1000)  # a stamp of its own, a little later
        later = changed(message, header__stamp=message.header.stamp + shift)
        bad = bad_scans(later) if topic == '/scan' else bad_odometry(later)
        bad += [('odd', m) for m in odd_but_good(topic, message)]
        kind, extra = bad[count[topic] % len(bad)]
        count[topic] += 1
        kinds[topic, kind] = kinds.get((topic, kind), 0) + 1
        stamps[topic, extra.header.stamp.to_nsec()] = kind
        out.append((topic, extra, stamp))
    return out, kinds, stamps


class BadInput(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.pid = helpers.wait_for_process_of(MANAGER)
        cls.recorder = helpers.Recorder()
        cls.loaders = [helpers.load_nodelet(MANAGER, '/refused', gate_probability=2.0, kf_dist_linear='far',
                                            publish_tf=1, odom_frame='', references_kept=16.0, scan_topics=[1, 'b'])]
        helpers.wait_until(lambda: cls.recorder.log('not started'), 'the refusal of bad parameters')
        cls.loaders.append(helpers.load_nodelet(
            MANAGER, '/sckf_odometry', kf_dist_linaer=0.3, kf_dist_linear=1, max_scan_delay=10000,
            prefer_twist_covariance=True, fixed_frame='odom', base_link_frame='unknown', base_frame='base_link'))
        helpers.wait_for_subscriber('/scan')
        cls.recorder.wait_for_connection()
        good = simulated_bag.messages(duration=40.0)
        messages, cls.kinds, cls.kind_at = with_bad_messages(good)
        cls.scans = [message.header.stamp.to_sec() for topic, message, _ in good if topic == '/scan']
        cls.sent = collections.Counter(topic for topic, _, _ in messages)
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
        self.assertEqual(helpers.process_of(MANAGER), self.pid)

    def test_every_bad_parameter_is_named_with_what_is_allowed(self):
        text = self.recorder.log('not started')[0]
        for part in ('gate_probability = 2.0: a number in (0, 1) expected',
                     'kf_dist_linear = "far": a number in [0, 1000] m expected',
                     'publish_tf = 1: true or false expected',
                     'odom_frame = "": a text that is not empty expected',
                     'references_kept = 16.0: a whole number in',
                     'scan_topics = [1, "b"]: a list of texts'):
            self.assertIn(part, text)

    def test_a_node_that_does_not_start_says_why(self):
        program = roslib.packages.find_node('sckf_odometry', 'sckf_odometry_node')[0]
        for name, value, expected in (
                ('gate_probability', 2, 'not started: bad parameters:\n  gate_probability = 2: a number in (0, 1) expected'),
                ('scan_topics', ['scan', '/scan'], 'not started: scan_topics has "scan" and "/scan": both are /scan'),
                ('scan_topics', ['a b'], 'not started: ')):
            rospy.set_param('/alone', {name: value})
            done = subprocess.run([program, '__name:=alone'], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  universal_newlines=True, timeout=helpers.TIMEOUT)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn(expected, done.stdout)

    def test_another_parent_of_the_frame_is_named_and_its_own_transform_is_none(self):
        warning = 'on TF too, and a frame can have one parent only: set ~publish_tf to false'
        self.assertTrue(self.recorder.transforms())
        self.assertEqual([text for _, text in self.recorder.levels() if warning in text], [])
        driver = rospy.Publisher('/tf', TFMessage, queue_size=10)
        transform = [t for t in self.recorder.transforms(static=False) if t.child_frame_id == 'base_link'][-1]

        def warned():
            driver.publish([transform])
            return [(level, text) for level, text in self.recorder.levels() if warning in text]

        helpers.wait_until(warned, 'word of the other parent')
        level, text = warned()[0]
        self.assertGreaterEqual(level, DiagnosticStatus.WARN)  # by then the wheels may be silent
        self.assertIn('%s publishes odom -> base_link' % rospy.get_name(), text)

    def test_a_misspelt_parameter_is_named_with_the_one_that_is_near(self):
        self.assertEqual(self.recorder.log('unknown parameter'),
                         ['/sckf_odometry: unknown parameter kf_dist_linaer: no effect; is kf_dist_linear meant?'])

    def test_names_of_other_packages_are_taken_with_a_warning(self):
        self.assertTrue(self.recorder.log('parameter fixed_frame = "odom": it is called odom_frame here'))
        self.assertTrue(self.recorder.log('it is called base_frame here, and is set to "base_link", which holds'))

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

    def test_every_message_is_accounted_for(self):
        helpers.wait_until(lambda: helpers.accounted(self.recorder.diagnostics(), 'scans', self.sent['/scan']) and
                           helpers.accounted(self.recorder.diagnostics(), 'odometry', self.sent['/odom']),
                           'diagnostics that account for %s' % self.sent)
        counts = self.recorder.diagnostics()
        scans, odometry = (lambda kind, topic=topic: self.kinds[topic, kind] for topic in ('/scan', '/odom'))
        for key, expected in {
                'scans: refused, no stamp': scans('no stamp'),
                'scans: refused, no frame': scans('no frame'),
                'scans: refused, angles turned round': scans('angles turned round'),
                'scans: waiting for their mount': scans('a frame that nobody knows'),
                'scans: out of order': scans('odd'),
                'scans: unusable': sum(scans(kind) for kind in REASONS),
                'odometry: refused, no stamp': odometry('no stamp'),
                'odometry: refused, other frame': odometry('the pose of a frame that nobody knows'),
                'odometry: refused, wrong stamp': odometry('a stamp of long ago') + odometry('a stamp far ahead'),
                'odometry: refused, duplicate': odometry('odd'),
                'odometry: refused, no pose': sum(odometry(kind) for kind in (
                    'NaN position', 'infinite position', 'no quaternion', 'a quaternion of length 2',
                    'NaN in the quaternion')),
        }.items():
            self.assertEqual(int(counts.get(key, 0)), expected, key)

    def test_the_status_names_value_and_expectation(self):
        seen = set()
        first_number = min(stamp for (_, stamp), kind in self.kind_at.items() if kind == 'a number for no return')
        for status in self.recorder.messages('status'):
            stamp = status.header.stamp.to_nsec()
            kind = self.kind_at.get(('/scan', stamp))
            if kind in REASONS:
                self.assertEqual(status.outcome, 'unusable', kind)
                expected = REASONS[kind]
                if expected == NONE_WITHIN:
                    expected %= 30 if stamp < first_number else 29
                self.assertIn(expected, status.reason)
                seen.add(kind)
        self.assertEqual(seen, set(REASONS))

    def test_it_says_which_mount_it_waits_for(self):
        self.assertIn('no transform base_link -> laser on TF', self.recorder.log('waiting for the mount')[0])

    def test_what_is_wrong_is_said_with_topic_value_and_expectation(self):
        for part in ('scan on /scan not used: header.stamp is 0: the time of the first beam expected',
                     'scan on /scan not used: header.frame_id is empty: the laser\'s frame expected',
                     'scan on /scan not used: angle_min is -3.14159, angle_max 3.12414, angle_increment -0.0174533: an',
                     'scan on /scan not used: unusable: ',
                     'scan on /scan: its driver writes 29 m where the laser has seen nothing, and a larger range_max: readings of '
                     'that and more are not used; expected range_max in the message, or ~range_max, to be 29',
                     'scan on /scan not used: out of order: not newer than the estimate',
                     'odometry on /odom not used: header.stamp is 0: the time of the reading expected',
                     'odometry on /odom held back: header.stamp is ',
                     'odometry on /odom not used: position (nan, ',
                     'odometry on /odom not used: child_frame_id is "nowhere", ~base_frame "base_link" expected',
                     'odometry on /odom: twist.covariance of x, y, yaw [-1, -1, -1; -1, -1, -1; -1, -1, -1]: finite, symmetric'):
            self.assertTrue(self.recorder.log(part), part)


if __name__ == '__main__':
    rospy.init_node('test_bad_input')
    junit_runner.run(BadInput)
