#!/usr/bin/python3
"""Odometry from TF: the log of a TurtleBot that has it nowhere else."""

import os
import unittest

import numpy as np
import rosbag
import rospy

import junit_runner
import run_helpers as helpers


class TurtleBot(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        bag = helpers.data_file('test_turtlebot.bag')
        if not bag:
            raise unittest.SkipTest('no test_turtlebot.bag in SCKF_DATA="%s"' % os.environ.get('SCKF_DATA', ''))
        cls.wheels, cls.scans = [], []
        with rosbag.Bag(bag) as log:
            for topic, message, _ in log.read_messages():
                if topic == '/scan':
                    cls.scans.append(message.header.stamp.to_sec())
                else:
                    cls.wheels += [t.header.stamp.to_sec() for t in message.transforms if t.header.frame_id == 'odom']
        cls.recorder = helpers.Recorder()
        helpers.wait_for_subscriber('/scan')
        helpers.play(bag, rate=5)
        helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= max(cls.wheels) - 1e-6,
                           'the last odometry')

    def test_a_pose_for_every_scan_that_odometry_brackets(self):
        stamps, _ = self.recorder.trajectory('pose')
        bracketed = [s for s in self.scans if min(self.wheels) <= s <= max(self.wheels)]
        # The first come before the transforms of the camera's mount, and wait for them.
        np.testing.assert_allclose(stamps, bracketed, atol=1e-6)

    def test_it_is_published_at_the_stamps_of_the_odometry_on_tf(self):
        stamps, _ = self.recorder.trajectory('odometry/filtered')
        self.assertGreater(np.diff(stamps).min(), 0)
        missing = [s for s in self.wheels if np.abs(stamps - s).min() > 1e-6]
        self.assertLess(len(missing), 0.01 * len(self.wheels))

    def test_frames(self):
        for topic in ('odometry/filtered', 'pose', 'path', 'cloud'):
            self.assertEqual(self.recorder.messages(topic)[-1].header.frame_id, 'sckf_odom', topic)
        self.assertEqual(self.recorder.messages('odometry/filtered')[-1].child_frame_id, 'base_footprint')

    def test_tf_stays_a_tree(self):
        """The estimate's frame hangs below the robot, whose parent is the driver's odom."""
        parent = {}
        for transform in self.recorder.transforms():
            self.assertEqual(parent.setdefault(transform.child_frame_id, transform.header.frame_id),
                             transform.header.frame_id)
        self.assertEqual(parent['sckf_odom'], 'base_footprint')
        self.assertEqual(parent['base_footprint'], 'odom')

    def test_the_estimate_is_continuous(self):
        _, poses = self.recorder.trajectory('odometry/filtered')
        step = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        self.assertLess(step.max(), 0.15)
        self.assertLess(np.abs(helpers.wrap(np.diff(poses[:, 2]))).max(), 0.15)
        # It drives and turns on the spot; over the run it gets some way from where it began.
        self.assertGreater(np.hypot(poses[:, 0], poses[:, 1]).max(), 0.1)

    def test_most_scans_are_used(self):
        helpers.wait_until(lambda: self.recorder.diagnostics().get('scans: together') == str(len(self.scans)),
                           'diagnostics that account for every scan')
        counts = self.recorder.diagnostics()
        used = int(counts.get('scans: updated', 0)) + int(counts.get('scans: slip', 0))
        self.assertGreater(used, 0.8 * len(self.scans), counts)


if __name__ == '__main__':
    rospy.init_node('test_turtlebot')
    junit_runner.run(TurtleBot)
