#!/usr/bin/python3
"""Wherever the laser is mounted, the robot has driven the same way."""

import itertools
import unittest

import rospy

import junit_runner
import run_helpers as helpers
import simulated_bag
from simulated_bag import Mount

MOUNTS = {
    'ahead': Mount(x=0.4, y=0.0, frame='laser_ahead'),
    'rotated': Mount(x=-0.1, y=0.2, yaw=1.5708, frame='laser_rotated'),
    'upside_down': Mount(x=0.1, y=-0.1, yaw=-0.4, upside_down=True, frame='laser_upside_down'),
    'tilted': Mount(x=0.2, z=5.0, yaw=0.3, pitch=0.3, frame='laser_tilted'),  # 5 % longer ranges ahead and behind
}


class Mounts(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.recorders = {name: helpers.Recorder(name + '/') for name in MOUNTS}
        messages = []
        for name, mount in MOUNTS.items():
            helpers.wait_for_subscriber('/%s/scan' % name)
            for topic, message, stamp in simulated_bag.messages(duration=30.0, mount=mount):
                if topic == '/scan':
                    topic = '/%s/scan' % name
                if topic != '/odom' or name == 'ahead':  # odometry is that of the one robot
                    messages.append((topic, message, stamp))
        messages.sort(key=lambda entry: entry[2])
        for recorder in cls.recorders.values():
            recorder.wait_for_connection()
        cls.scans = len([topic for topic, _, _ in messages if topic == '/ahead/scan'])
        helpers.Feeder(sorted({topic for topic, _, _ in messages})).feed(messages)
        for name, recorder in cls.recorders.items():
            helpers.wait_until(lambda recorder=recorder: len(recorder.messages('pose')) >= cls.scans, 'poses of ' + name)

    def test_each_follows_the_truth(self):
        for name, recorder in self.recorders.items():
            stamps, poses = recorder.trajectory('pose')
            distance, angle = helpers.difference(stamps, poses, stamps, simulated_bag.true_trajectory(stamps))
            self.assertLess(distance, 0.10, name)
            self.assertLess(angle, 0.02, name)

    def test_all_say_the_same(self):
        for a, b in itertools.combinations(sorted(MOUNTS), 2):
            distance, angle = helpers.difference(*self.recorders[a].trajectory('pose'),
                                                 *self.recorders[b].trajectory('pose'))
            self.assertLess(distance, 0.05, a + ', ' + b)
            self.assertLess(angle, 0.01, a + ', ' + b)

    def test_nothing_is_published_on_tf(self):
        self.assertEqual(self.recorders['ahead'].transforms(static=False), [])


if __name__ == '__main__':
    rospy.init_node('test_mounts')
    junit_runner.run(Mounts)
