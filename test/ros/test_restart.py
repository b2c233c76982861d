#!/usr/bin/python3
"""Time that goes back, as of a bag in a loop, starts a new estimate without a restart of the node."""

import unittest

import numpy as np
import rospy

import junit_runner
import run_helpers as helpers
import simulated_bag


class Restart(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.recorder = helpers.Recorder()
        helpers.wait_for_subscriber('/scan')
        cls.recorder.wait_for_connection()
        messages = simulated_bag.messages(duration=20.0)
        feeder = helpers.Feeder(['/odom', '/scan', '/tf_static'])
        last = [stamp for topic, _, stamp in messages if topic == '/odom'][-1]
        for _ in range(2):
            feeder.feed(messages)
            helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= last - 1e-6, 'the last odometry')
            rospy.sleep(1.0)
        stamps, _ = cls.recorder.trajectory('odometry/filtered')
        cls.jumps = np.flatnonzero(np.diff(stamps) <= 0)

    def test_stamps_go_back_once(self):
        self.assertEqual(len(self.jumps), 1)

    def test_the_second_round_is_as_the_first(self):
        stamps, poses = self.recorder.trajectory('pose')
        (first_stamps, second_stamps), (first, second) = np.split(stamps, 2), np.split(poses, 2)
        np.testing.assert_array_equal(second_stamps, first_stamps)
        np.testing.assert_allclose(second, first, atol=1e-9)

    def test_it_is_said(self):
        self.assertEqual(self.recorder.diagnostics()['time jumps: back'], '1')
        self.assertEqual(len(self.recorder.log('time went back by 20 s: the estimate starts again')), 1)


if __name__ == '__main__':
    rospy.init_node('test_restart')
    junit_runner.run(Restart)
