#!/usr/bin/python3
"""Messages late, early, out of order, twice, in bursts, with wrong stamps, or not at all: a robot for each, all at once.

Each is the same drive as its own drivers tell it, through a nodelet of its own, by the time of one simulated clock.
"""

import copy
import math
import threading
import time
import unittest

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock, Log
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

import junit_runner
import run_helpers as helpers
import simulated_bag
from sckf_odometry.msg import Status

MANAGER = '/manager'
DURATION = 16.0  # [s] of robot time
SPEED = 2.5  # times faster than the robot, slow enough for the diagnostics, once a second of wall time, to see each silence
BEGIN, END = 5.0, 9.0  # [s] of the drive: what happens, happens then
HALF = 0.5 * (BEGIN + END)
FAR = 500.0  # [s]


def shifted(message, dt):
    message = copy.copy(message)
    message.header = copy.copy(message.header)
    message.header.stamp = rospy.Time.from_sec(message.header.stamp.to_sec() + dt)
    return message


def moved(message, pose):
    """Odometry in another frame of the driver, where the robot is at the origin when it is at this pose in the first."""
    at = simulated_bag.between(pose, helpers.planar(message.pose.pose))
    message = simulated_bag.odometry_message(message.header.stamp, at)
    message.child_frame_id = ''
    return message


class Drive:
    """(topic, message, time of arrival), to be changed by the functions below."""

    def __init__(self, messages):
        self.entries = [(topic.lstrip('/'), message, stamp - simulated_bag.START) for topic, message, stamp in messages]

    def change(self, kind, function):
        """function(i, message, t) returns what arrives in the place of the message: a list of (message, t)."""
        out, i = [], 0
        for topic, message, t in self.entries:
            if topic != kind:
                out.append((topic, message, t))
                continue
            out += [(topic, m, at) for m, at in function(i, message, t)]
            i += 1
        self.entries = sorted(out, key=lambda entry: entry[2])
        return self

    def delay(self, kind, dt):
        return self.change(kind, lambda i, m, t: [(m, t + dt)])

    def lose(self, kind, begin, end=math.inf):
        return self.change(kind, lambda i, m, t: [] if begin <= t < end else [(m, t)])

    def stray(self, kind, dt):
        """One stamp that is wrong by dt."""
        k = len([t for topic, _, t in self.entries if topic == kind and t < HALF])
        return self.change(kind, lambda i, m, t: [(shifted(m, dt), t)] if i == k else [(m, t)])

    def pose_at(self, t):
        return next(helpers.planar(m.pose.pose) for topic, m, at in self.entries if topic == 'odom' and at >= t)


def shuffled(drive):
    order = [3, 1, 4, 0, 2]
    return drive.change('odom', lambda i, m, t: [(m, t + (order[i % 5] - i % 5 + 5) / simulated_bag.ODOMETRY_RATE)])


def in_bursts(drive):
    """Ten messages at the time of the last, four stamps at a time within 3 ms."""
    step = 1.0 / simulated_bag.ODOMETRY_RATE
    return drive.change('odom', lambda i, m, t: [(shifted(m, (3 - i % 4) * (step - 0.001)), t + (9 - i % 10) * step)])


def with_equal_stamps(drive):
    """Every second reading of the wheels has the stamp of the one before."""
    before = [None]

    def with_the_stamp_before(i, message, t):
        if i % 2 == 1:
            message = copy.copy(message)
            message.header = before[0]
        before[0] = message.header
        return [(message, t)]
    return drive.change('odom', with_the_stamp_before)


def without_stamps(drive):
    none = lambda m: shifted(m, -m.header.stamp.to_sec())
    for kind in ('odom', 'scan'):
        drive.change(kind, lambda i, m, t: [(none(m), t), (m, t)] if i % 5 == 4 else [(m, t)])
    return drive


def with_strays(drive):
    for kind in ('odom', 'scan'):
        drive.stray(kind, FAR)
    return drive


def with_near_strays(drive):
    """Ahead by less than a gap that is believed, but ahead of the clock too."""
    for kind in ('odom', 'scan'):
        drive.stray(kind, 8.0)
    return drive


def with_a_clock_that_jumps(drive):
    for kind in ('odom', 'scan'):
        drive.change(kind, lambda i, m, t: [(shifted(m, FAR if t >= HALF else 0.0), t)])
    return drive


def with_a_clock_that_goes_back(drive):
    for kind in ('odom', 'scan'):
        drive.change(kind, lambda i, m, t: [(shifted(m, -FAR if t >= HALF else 0.0), t)])
    return drive


def alone_with_a_clock_that_goes_back(drive):
    return with_a_clock_that_goes_back(drive).lose('odom', 0.0)


def driver_died(drive):
    return drive.lose('odom', BEGIN, END)


def driver_started_at_zero(drive):
    origin = drive.pose_at(END)
    return driver_died(drive).change('odom', lambda i, m, t: [(moved(m, origin) if t >= END else m, t)])


CASES = {
    'as_it_is': lambda drive: drive,
    'late_scans': lambda drive: drive.delay('scan', 0.6),
    'late_odometry': lambda drive: drive.delay('odom', 0.6),
    'shuffled': shuffled,
    'twice': lambda drive: drive.change('odom', lambda i, m, t: 2 * [(m, t)]).change('scan', lambda i, m, t: 2 * [(m, t)]),
    'in_bursts': in_bursts,
    'equal_stamps': with_equal_stamps,
    'no_stamps': without_stamps,
    'strays': with_strays,
    'near_strays': with_near_strays,
    'clock_ahead': with_a_clock_that_jumps,
    'clock_back': with_a_clock_that_goes_back,
    'clock_back_alone': alone_with_a_clock_that_goes_back,
    'driver_died': driver_died,
    'driver_at_zero': driver_started_at_zero,
    'scans_alone': driver_started_at_zero,
    'scans_stop': lambda drive: drive.lose('scan', BEGIN),
}
GOOD = ('as_it_is', 'late_scans', 'late_odometry', 'shuffled', 'twice', 'in_bursts', 'equal_stamps', 'no_stamps', 'strays',
        'near_strays')  # that end as if nothing were
ONE_TIME = tuple(name for name in CASES if not name.startswith('clock'))


class Robots:
    """What the nodelets of all cases publish."""

    def __init__(self):
        self._lock = threading.Lock()
        self.odometry = {name: [] for name in CASES}
        self.status = {name: [] for name in CASES}
        self.tf = {name: [] for name in CASES}
        self.levels = {name: [] for name in CASES}
        self.counts = {name: {} for name in CASES}
        self.log = []
        self._subscribers = [rospy.Subscriber('/tf', TFMessage, self._record_transforms, queue_size=None)]
        for name in CASES:
            for topic, kind, record in (('odometry/filtered', Odometry, self.odometry[name].append),
                                        ('status', Status, self.status[name].append)):
                self._subscribers.append(rospy.Subscriber('/%s/%s' % (name, topic), kind, record, queue_size=None))
        rospy.Subscriber('/diagnostics', DiagnosticArray, self._record_diagnostics, queue_size=None)
        rospy.Subscriber('/rosout', Log, lambda message: self.log.append(message.msg), queue_size=None)

    def are_connected(self):
        return all(subscriber.get_num_connections() > 0 for subscriber in self._subscribers)

    def _record_transforms(self, message):
        for transform in message.transforms:
            self.tf[transform.header.frame_id[:-len('_odom')]].append(transform.header.stamp.to_nsec())

    def _record_diagnostics(self, message):
        for status in message.status:
            name = status.name.split('/')[0]
            self.levels[name].append((status.level, status.message))
            self.counts[name] = {entry.key: entry.value for entry in status.values}

    def trajectory(self, name):
        messages = list(self.odometry[name])
        return (np.array([m.header.stamp.to_sec() - simulated_bag.START for m in messages]),
                np.array([helpers.planar(m.pose.pose) for m in messages]))

    def said(self, part):
        return [text for text in list(self.log) if part in text]


class TimeAndLoss(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.robots = Robots()
        clock = rospy.Publisher('/clock', Clock, queue_size=10)
        messages = [entry for entry in simulated_bag.messages(duration=DURATION, mount=simulated_bag.Mount())
                    if entry[0] != '/tf_static']
        for topic, message, _ in messages:
            if topic == '/odom':
                message.child_frame_id = ''  # of the robot, whose frame has another name in each case: they share one TF
        drives = {name: change(Drive(messages)) for name, change in CASES.items()}
        cls.sent = {name: {kind: [entry for entry in drive.entries if entry[0] == kind] for kind in ('odom', 'scan')}
                    for name, drive in drives.items()}
        cls.loaders = [helpers.load_nodelet(MANAGER, '/%s/sckf_odometry' % name, odom_frame=name + '_odom',
                                            base_frame=name + '_base', max_scan_delay=20.0, scans_alone='alone' in name, publish_tf=True)
                       for name in CASES]
        publishers = {}
        for name in CASES:
            for topic, kind in ('odom', Odometry), ('scan', LaserScan):
                publishers[name, topic] = rospy.Publisher('/%s/%s' % (name, topic), kind, queue_size=1000, tcp_nodelay=True)
        for publisher in publishers.values():
            helpers.wait_until(lambda publisher=publisher: publisher.get_num_connections() > 0, publisher.name)
        helpers.wait_until(cls.robots.are_connected, 'the topics of all nodelets')
        cls.feed(clock, publishers, drives)
        helpers.wait_until(cls.all_has_come, 'diagnostics that account for everything')
        helpers.wait_until(lambda: all(len(cls.robots.tf[name]) == len(cls.robots.odometry[name]) for name in CASES), 'TF')

    @classmethod
    def feed(cls, clock, publishers, drives):
        entries = sorted(((t, name, topic, message) for name, drive in drives.items() for topic, message, t in drive.entries),
                         key=lambda entry: entry[:3])
        begin, last_tick = time.time(), -1.0
        for t, name, topic, message in entries:
            time.sleep(max(0.0, begin + t / SPEED - time.time()))
            if t - last_tick >= 0.01:
                clock.publish(Clock(rospy.Time.from_sec(simulated_bag.START + t)))
                last_tick = t
            if topic == 'scan':
                message.header.frame_id = name + '_base'
            publishers[name, topic].publish(message)

    @classmethod
    def all_has_come(cls):
        return all(helpers.accounted(cls.robots.counts[name], kind, len(cls.sent[name][topic]))
                   for name in CASES for kind, topic in (('scans', 'scan'), ('odometry', 'odom')))

    @classmethod
    def tearDownClass(cls):
        for loader in cls.loaders:
            loader.terminate()

    def count(self, name, key):
        return int(self.robots.counts[name].get(key, 0))

    def truth(self, stamps):
        return simulated_bag.true_trajectory(stamps + simulated_bag.START)

    def error(self, name, begin=0.0, end=math.inf):
        """Largest distance from the truth."""
        stamps, poses = self.robots.trajectory(name)
        inside = (stamps >= begin) & (stamps <= end)
        self.assertTrue(inside.any(), name)
        return helpers.difference(stamps[inside], poses[inside], stamps[inside], self.truth(stamps[inside]))[0]

    def largest_step(self, name):
        """[m] between two messages, more than the robot can have moved in between, and when."""
        stamps, poses = self.robots.trajectory(name)
        step = np.hypot(*np.diff(poses[:, :2], axis=0).T) - 0.5 * np.clip(np.diff(stamps), 0.0, 1.0)
        return step.max(), stamps[step.argmax()]

    def test_what_is_in_disorder_ends_as_if_it_were_not(self):
        for name in GOOD:
            self.assertLess(self.error(name), 0.15 if name == 'in_bursts' else 0.10, name)  # whose stamps are up to 0.15 s off
            used = self.count(name, 'scans: updated') + self.count(name, 'scans: reference')
            wrong = self.count(name, 'scans: refused, wrong stamp')
            scans = len({m.header.stamp for _, m, _ in self.sent[name]['scan'] if not m.header.stamp.is_zero()})
            self.assertGreaterEqual(used, scans - wrong - 1, name)

    def test_each_case_has_its_counter(self):
        sent = {name: {topic: len(entries) for topic, entries in topics.items()} for name, topics in self.sent.items()}
        for name, key, expected in (
                ('twice', 'odometry: refused, duplicate', sent['twice']['odom'] // 2),
                ('twice', 'scans: out of order', sent['twice']['scan'] // 2),
                ('equal_stamps', 'odometry: refused, duplicate', sent['equal_stamps']['odom'] // 2),
                ('no_stamps', 'odometry: refused, no stamp', sent['no_stamps']['odom'] // 6),
                ('no_stamps', 'scans: refused, no stamp', sent['no_stamps']['scan'] // 6),
                ('strays', 'odometry: refused, wrong stamp', 1), ('strays', 'scans: refused, wrong stamp', 1),
                ('near_strays', 'odometry: refused, wrong stamp', 1), ('near_strays', 'scans: refused, wrong stamp', 1),
                ('clock_ahead', 'time jumps: ahead', 1), ('clock_ahead', 'time jumps: back', 0),
                ('clock_back', 'time jumps: back', 1), ('clock_back', 'time jumps: ahead', 0),
                ('clock_back_alone', 'time jumps: back', 1), ('clock_back_alone', 'time jumps: ahead', 0),
                ('driver_at_zero', 'odometry: jumps', 1), ('as_it_is', 'odometry: jumps', 0)):
            self.assertEqual(self.count(name, key), expected, (name, key))

    def test_no_stamp_comes_twice_on_tf(self):
        for name in ONE_TIME + ('clock_ahead',):
            self.assertGreater(np.diff(self.robots.tf[name]).min(), 0, name)
            self.assertEqual(len(self.robots.tf[name]), len(self.robots.odometry[name]), name)

    def test_nothing_makes_the_estimate_jump(self):
        for name in ONE_TIME + ('clock_ahead',):
            step, at = self.largest_step(name)
            self.assertLess(step, 0.15, '%s at %.2f' % (name, at))

    def test_everything_published_is_finite(self):
        for name in CASES:
            for message in self.robots.odometry[name]:
                self.assertTrue(np.isfinite(message.pose.covariance).all() and np.isfinite(message.twist.covariance).all())
                self.assertTrue(np.isfinite(helpers.planar(message.pose.pose)).all(), name)

    def test_a_clock_that_jumps_ahead_leaves_the_estimate_where_it_is(self):
        self.assertTrue(self.robots.said('time went ahead by'))
        stamps, poses = self.robots.trajectory('clock_ahead')
        truth = self.truth(np.where(stamps > FAR, stamps - FAR, stamps))
        self.assertLess(np.hypot(*(poses - truth)[:, :2].T).max(), 0.15)
        self.assertGreater((stamps > FAR).sum(), 50)

    def test_a_clock_that_goes_back_starts_the_estimate_again(self):
        names = ('clock_back', 'clock_back_alone')  # of which the second has scans only to tell
        self.assertEqual(len(self.robots.said('time went back by')), len(names))
        for name in names:
            stamps, poses = self.robots.trajectory(name)
            back = np.flatnonzero(np.diff(stamps) < 0)
            self.assertEqual(len(back), 1, name)
            after = slice(back[0] + 1, None)
            begin = simulated_bag.truth(stamps[after][0] + FAR)
            truth = np.array([simulated_bag.between(begin, simulated_bag.truth(t + FAR)) for t in stamps[after]])
            self.assertGreater(len(truth), 10, name)
            self.assertLess(np.hypot(*(poses[after] - truth)[:, :2].T).max(), 0.10, name)

    def test_silent_wheels_are_an_error_until_they_are_back(self):
        for name in ('driver_died', 'driver_at_zero', 'scans_alone'):
            errors = [text for level, text in self.robots.levels[name] if level == DiagnosticStatus.ERROR]
            self.assertTrue(errors, name)
            self.assertIn('no odometry on /%s/odom for' % name, errors[0])
            self.assertIn('the scans carry on alone' if name == 'scans_alone' else 'the estimate waits', errors[0])
            self.assertTrue(self.robots.said('no odometry on /%s/odom for' % name), name)
            last = [level for level, _ in self.robots.levels[name]][-1]
            self.assertLess(last, DiagnosticStatus.ERROR, name)

    def test_without_leave_for_the_scans_the_estimate_waits(self):
        for name in ('driver_died', 'driver_at_zero'):
            stamps, _ = self.robots.trajectory(name)
            arrived = [m for m in self.robots.status[name] if m.latency > 1.0]
            self.assertTrue(arrived, name)  # the scans of the silence were used when the wheels were back
            self.assertLess(self.error(name, begin=END + 1.0), 0.20, name)

    def test_scans_carry_on_alone_where_they_may(self):
        silent = [m for m in self.robots.status['scans_alone']
                  if BEGIN + 1.5 < m.header.stamp.to_sec() - simulated_bag.START < END and m.latency < 1.5]
        self.assertGreater(len(silent), 5)
        self.assertTrue(all(m.accepted and not m.wheels_known for m in silent))
        self.assertLess(self.error('scans_alone'), 0.15)

    def test_where_scans_stop_the_wheels_carry_on_with_growing_covariance(self):
        warnings = [text for level, text in self.robots.levels['scans_stop'] if level == DiagnosticStatus.WARN]
        self.assertTrue([text for text in warnings if 'no scans on /scans_stop/scan for' in text], warnings)
        self.assertTrue(self.robots.said('no scans on /scans_stop/scan for'))
        stamps, _ = self.robots.trajectory('scans_stop')
        self.assertGreater(stamps[-1], DURATION - 0.5)
        messages = [m for m in self.robots.odometry['scans_stop']
                    if m.header.stamp.to_sec() - simulated_bag.START > BEGIN + 1.0]
        traces = [np.trace(helpers.covariance(m)) for m in messages]
        self.assertGreater(np.diff(traces).min(), -1e-9)
        self.assertGreater(traces[-1], 2 * traces[0])
        for name in GOOD:
            self.assertFalse(self.robots.said('no scans on /%s/scan for' % name))


if __name__ == '__main__':
    rospy.init_node('test_time_and_loss')
    junit_runner.run(TimeAndLoss)
