#!/usr/bin/python3
"""Scans whose beams are measured one after the other: with ~deskew the motion in between is undone, and where the driver's
times are wrong no scan is lost by it."""

import unittest

import dynamic_reconfigure.client
import numpy as np
import rospy
from sensor_msgs import point_cloud2

import junit_runner
import run_helpers as helpers
import simulated_bag
from run_helpers import changed

TIME_INCREMENT = 0.2 / 360  # [s]: a scan takes 0.2 s of the 0.23 s from one to the next
NAN = float('nan')
WRONG = [-TIME_INCREMENT, 5.0 * TIME_INCREMENT, NAN, 1.5 * TIME_INCREMENT]  # negative, 1 s, none, longer than scans are apart
NODES = {'deskewed': True, 'skewed': False, 'wrong': True, 'untold': True, 'switched': False}
VIEWS = {'skewed': {'cloud_resolution': 0.5}, 'untold': {'visualization_rate': 0.0},
         'wrong': {'path_max_poses': 10, 'cloud_max_points': 50}}
SWITCHED = simulated_bag.START + 10.0  # the instant at which it is told to undo the motion, too


def scan_of(node, scan, i):
    """What the driver of a node says."""
    if node == 'wrong':
        return changed(scan, time_increment=WRONG[i % len(WRONG)])
    return changed(scan, time_increment=0.0) if node == 'untold' else scan


class Deskewing(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.set_param('/use_sim_time', False)
        cls.recorders = {node: helpers.Recorder(node + '/', node + '/sckf_odometry') for node in NODES}
        cls.loaders = [
            helpers.load_nodelet('/manager', '/%s/sckf_odometry' % node, deskew=deskew, publish_tf=False,
                                 max_scan_delay=10000, **VIEWS.get(node, {})) for node, deskew in NODES.items()
        ]
        messages = []
        cls.scans = 0
        for topic, message, stamp in simulated_bag.messages(duration=20.0, path=simulated_bag.swinging,
                                                            time_increment=TIME_INCREMENT):
            if topic == '/tf_static':
                messages.append((topic, message, stamp))
                continue
            for node in NODES:
                own = scan_of(node, message, cls.scans) if topic == '/scan' else message
                messages.append(('/%s%s' % (node, topic), own, stamp))
            cls.scans += topic == '/scan'
        for node, recorder in cls.recorders.items():
            helpers.wait_for_subscriber('/%s/scan' % node)
            recorder.wait_for_connection()
        feeder = helpers.Feeder(sorted({topic for topic, _, _ in messages}))
        feeder.feed([entry for entry in messages if entry[2] <= SWITCHED])
        cls.switch()
        feeder.feed([entry for entry in messages if entry[2] > SWITCHED])
        for node, recorder in cls.recorders.items():
            helpers.wait_until(lambda recorder=recorder: len(recorder.messages('pose')) >= cls.scans, 'poses of ' + node)

    @classmethod
    def switch(cls):
        helpers.wait_until(lambda: cls.recorders['switched'].newest_stamp('odometry/filtered') >= SWITCHED - 1e-6,
                           'what comes before it is switched')
        client = dynamic_reconfigure.client.Client('/switched/sckf_odometry', timeout=helpers.TIMEOUT)
        client.update_configuration({'deskew': True})
        client.close()

    @classmethod
    def tearDownClass(cls):
        for loader in cls.loaders:
            loader.terminate()

    def error(self, node):
        """Largest distance [m] and angle [rad] from the truth."""
        stamps, poses = self.recorders[node].trajectory('pose')
        return helpers.difference(stamps, poses, stamps,
                                  simulated_bag.true_trajectory(stamps, simulated_bag.swinging))

    def count(self, node, key):
        recorder = self.recorders[node]
        helpers.wait_until(lambda: helpers.accounted(recorder.diagnostics(), 'scans', self.scans),
                           'diagnostics that account for %d scans of %s' % (self.scans, node))
        return int(recorder.diagnostics().get(key, 0))

    def test_the_motion_is_undone(self):
        distance, angle = self.error('deskewed')
        self.assertLess(distance, 0.10)
        self.assertLess(angle, 0.03)
        _, skewed = self.error('skewed')
        self.assertGreater(skewed, 3.0 * angle)

    def test_no_scan_is_lost(self):
        for node, recorder in self.recorders.items():
            stamps, poses = recorder.trajectory('pose')
            self.assertEqual(len(stamps), self.scans, node)
            self.assertTrue(np.isfinite(poses).all(), node)

    def test_what_is_wrong_is_as_if_nothing_were_undone(self):
        for node in ('wrong', 'untold'):
            distance, angle = helpers.difference(*self.recorders[node].trajectory('pose'),
                                                 *self.recorders['skewed'].trajectory('pose'))
            self.assertLess(distance, 1e-9, node)
            self.assertLess(angle, 1e-9, node)

    def test_the_cloud_has_one_point_in_each_square(self):
        self.assertTrue(self.recorders['skewed'].messages('cloud'))
        cloud = self.recorders['skewed'].messages('cloud')[-1]
        points = np.array(list(point_cloud2.read_points(cloud, field_names=('x', 'y'))))
        self.assertGreater(len(points), 20)
        self.assertEqual(len(np.unique(np.floor(points / VIEWS['skewed']['cloud_resolution']), axis=0)), len(points))

    def test_views_are_no_larger_than_allowed(self):
        allowed, others = self.recorders['wrong'], self.recorders['deskewed']
        for topic in ('path', 'path_odometry'):
            self.assertLessEqual(max(len(path.poses) for path in allowed.messages(topic)), 10 + 1, 'and the newest')
            self.assertGreater(len(others.messages(topic)[-1].poses), 11, 'the drive is no test')
        self.assertEqual(allowed.messages('cloud')[-1].width, 50)
        self.assertGreater(others.messages('cloud')[-1].width, 50)

    def test_without_a_rate_there_are_no_views(self):
        for topic in ('path', 'path_odometry', 'cloud'):
            self.assertEqual(self.recorders['untold'].messages(topic), [])
            self.assertTrue(self.recorders['deskewed'].messages(topic))

    def test_the_scans_are_counted_by_what_became_of_their_motion(self):
        self.assertEqual(self.count('deskewed', 'scans deskewed'), self.scans)
        self.assertEqual(self.count('skewed', 'scans deskewed'), 0)
        self.assertEqual(self.count('untold', 'scans not deskewed, no time_increment'), self.scans)
        self.assertEqual(self.count('wrong', 'scans not deskewed, wrong time_increment'), self.scans)

    def test_the_status_tells(self):
        for node in set(NODES) - {'switched'}:
            deskewed = {status.deskewed for status in self.recorders[node].messages('status')}
            self.assertEqual(deskewed, {node == 'deskewed'}, node)

    def test_a_wrong_time_is_said_with_topic_value_and_expectation(self):
        log = self.recorders['wrong'].log('scan on /wrong/scan used as it is, not deskewed: time_increment is -0.000555556 s')
        self.assertTrue(log)
        self.assertIn('a finite time above 0 expected', log[0])

    def test_that_a_driver_does_not_tell_is_said_once(self):
        self.assertEqual(len(self.recorders['untold'].log('scan on /untold/scan used as it is')), 1)
        self.assertIn('time_increment is 0 s: the time from one beam to the next expected',
                      self.recorders['untold'].log('scan on /untold/scan used as it is')[0])

    def test_it_can_be_switched_at_run_time(self):
        statuses = self.recorders['switched'].messages('status')
        self.assertEqual([status.deskewed for status in statuses],
                         [status.header.stamp.to_sec() > SWITCHED for status in statuses])


if __name__ == '__main__':
    rospy.init_node('test_deskewing')
    junit_runner.run(Deskewing)
