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
        messages = simulated_bag.messages(duration=20.0)
        feeder = helpers.Feeder(['/odom', '/scan', '/tf_static'])
        last = [stamp for topic, _, stamp in messages if topic == '/odom'][-1]
        for _ in range(2):
            feeder.feed(messages)
            helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= last - 1e-6, 'the last odometry')
            rospy.sleep(1.0)
        stamps, poses = cls.recorder.trajectory('odometry/filtered')
        cls.jumps = np.flatnonzero(np.diff(stamps) <= 0)
        cls.rounds = np.split(stamps, cls.jumps + 1), np.split(poses, cls.jumps + 1)

    def test_stamps_go_back_once(self):
        self.assertEqual(len(self.jumps), 1)

    def test_the_second_round_is_as_the_first(self):
        (first_stamps, second_stamps), (first, second) = self.rounds
        distance, angle = helpers.difference(second_stamps, second, first_stamps, first)
        self.assertLess(distance, 0.05)
        self.assertLess(angle, 0.01)
        self.assertGreater(len(second), 0.95 * len(first))

    def test_it_is_said(self):
        self.assertEqual(len(self.recorder.log('time went back by 20 s: the estimate starts again')), 1)


if __name__ == '__main__':
    rospy.init_node('test_restart')
    junit_runner.run(Restart)
