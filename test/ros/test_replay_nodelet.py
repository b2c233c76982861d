#!/usr/bin/python3
"""A bag through the nodelet in a manager, as on a robot: what it publishes, and that it is what the offline replay says."""

import os
import subprocess
import tempfile
import unittest

import numpy as np
import rosbag
import roslib.packages
import rospy
import yaml

import junit_runner
import run_helpers as helpers
import simulated_bag

RAWLOG = '/usr/share/mrpt/datasets/2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog'


def find_tool(name):
    found = roslib.packages.find_node('sckf_odometry', name)
    return found[0] if found else None


def make_bag(name, folder):
    """The bag of that name and None, or None and why there is none."""
    if name == 'simulated':
        path = os.path.join(folder, 'simulated.bag')
        simulated_bag.write(path)
        return path, None
    if name == 'malaga':
        path = os.path.join(folder, 'malaga.bag')
        if not os.path.isfile(RAWLOG) or not find_tool('rawlog_to_bag'):
            return None, 'no rawlog_to_bag, or no ' + RAWLOG
        subprocess.check_call([find_tool('rawlog_to_bag'), RAWLOG, path])
        return path, None
    path = helpers.data_file(name + '.bag')
    return path, None if path else 'no %s.bag in SCKF_DATA="%s"' % (name, os.environ.get('SCKF_DATA', ''))


def wheels_of(bag):
    """Stamps [s], and n × 3 poses of the wheel odometry."""
    with rosbag.Bag(bag) as log:
        messages = [message for _, message, _ in log.read_messages('/odom')]
    return (np.array([m.header.stamp.to_sec() for m in messages]), np.array([helpers.planar(m.pose.pose) for m in messages]))


class ReplayNodelet(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.bag, missing = make_bag(rospy.get_param('~bag'), cls.folder.name)
        if missing:
            raise unittest.SkipTest(missing)
        cls.wheels = wheels_of(cls.bag)
        with rosbag.Bag(cls.bag) as log:
            cls.scans = [message.header.stamp.to_sec() for _, message, _ in log.read_messages('/scan')]
        cls.recorder = helpers.Recorder()
        helpers.wait_for_subscriber('/scan')
        helpers.play(cls.bag, rospy.get_param('~rate'))
        last = cls.wheels[0][-1]
        helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= last - 1e-6, 'the last odometry')
        helpers.wait_until(cls.views_are_up_to_date, 'path and cloud up to the last scan')

    @classmethod
    def views_are_up_to_date(cls):
        poses = cls.recorder.messages('pose')
        paths = cls.recorder.messages('path')
        return poses and paths and paths[-1].header.stamp == poses[-1].header.stamp and cls.recorder.messages('cloud')

    def test_every_scan_is_accounted_for(self):
        helpers.wait_until(lambda: self.recorder.diagnostics().get('scans: together') == str(len(self.scans)),
                           'diagnostics that account for %d scans' % len(self.scans))
        counts = self.recorder.diagnostics()
        self.assertEqual(counts['scans: waiting for their mount'], '0')
        used = int(counts.get('scans: updated', 0)) + int(counts.get('scans: slip', 0))
        self.assertGreater(used, 0.8 * len(self.scans), counts)

    def test_a_pose_for_every_scan_that_odometry_brackets(self):
        stamps, _ = self.recorder.trajectory('pose')
        bracketed = [s for s in self.scans if self.wheels[0][0] <= s <= self.wheels[0][-1]]
        np.testing.assert_allclose(stamps, bracketed, atol=1e-6)

    def test_stamps_increase_and_none_comes_twice(self):
        for topic in ('odometry/filtered', 'pose'):
            nanoseconds = [m.header.stamp.to_nsec() for m in self.recorder.messages(topic)]
            self.assertGreater(np.diff(nanoseconds).min(), 0, topic)
        transforms = [t.header.stamp.to_nsec() for t in self.recorder.transforms(False) if t.child_frame_id == 'base_link']
        self.assertGreater(np.diff(transforms).min(), 0)

    def test_it_is_published_at_the_rate_of_the_odometry(self):
        stamps, _ = self.recorder.trajectory('odometry/filtered')
        wheels = np.unique(self.wheels[0])
        # The first one after a silence is used with the next one, as its stamp may be wrong.
        after_silence = wheels[1:][np.diff(wheels) > rospy.get_param('/sckf_odometry/odometry_timeout')]
        missing = [s for s in wheels if np.abs(stamps - s).min() > 1e-6 and s not in after_silence]
        # Before the first scan there need be no estimate.
        self.assertEqual([s for s in missing if s > self.scans[1]], [])

    def test_tf_is_one_tree_from_odom_to_the_laser(self):
        parent = {}
        for transform in self.recorder.transforms():
            child = transform.child_frame_id
            self.assertEqual(parent.setdefault(child, transform.header.frame_id), transform.header.frame_id)
        self.assertEqual(parent.get('laser'), 'base_link')
        self.assertEqual(parent.get('base_link'), 'odom')
        self.assertNotIn('odom', parent)

    def test_tf_says_what_the_odometry_says(self):
        by_stamp = {m.header.stamp.to_nsec(): m.pose.pose for m in self.recorder.messages('odometry/filtered')}
        transforms = [t for t in self.recorder.transforms(False) if t.child_frame_id == 'base_link']
        self.assertEqual(len(transforms), len(by_stamp))
        for transform in transforms:
            pose = by_stamp[transform.header.stamp.to_nsec()]
            self.assertEqual(transform.transform.translation.x, pose.position.x)
            self.assertEqual(transform.transform.translation.y, pose.position.y)
            self.assertEqual(transform.transform.rotation, pose.orientation)

    def test_the_estimate_is_continuous(self):
        """Between two messages it moves as the wheels do, but for a correction of a size that scans can make."""
        stamps, poses = self.recorder.trajectory('odometry/filtered')
        x, y = (np.interp(stamps, self.wheels[0], self.wheels[1][:, i]) for i in (0, 1))
        step = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        wheel_step = np.hypot(np.diff(x), np.diff(y))
        jump = np.abs(step - wheel_step)
        self.assertLess(jump.max(), 0.5, 'at %.3f' % stamps[jump.argmax()])

    def test_covariances_are_symmetric_positive_and_grow(self):
        messages = self.recorder.messages('odometry/filtered')
        for message in messages:
            whole = np.array(message.pose.covariance).reshape(6, 6)
            np.testing.assert_array_equal(whole, whole.T)
            self.assertGreaterEqual(np.linalg.eigvalsh(whole).min(), -1e-12)
        # Grow: not at every step, as the position's gets smaller on the way back to the start, but over the run.
        covariances = np.array([helpers.covariance(m) for m in messages])
        position, yaw = covariances[:, 0, 0] + covariances[:, 1, 1], covariances[:, 2, 2]
        begin, end = slice(len(messages) // 20), slice(-len(messages) // 4, None)
        self.assertGreater(np.median(position[end]), 2 * np.median(position[begin]))
        self.assertGreaterEqual(np.median(yaw[end]), np.median(yaw[begin]))

    def test_path_and_cloud_are_in_odom(self):
        for topic in ('path', 'path_odometry', 'cloud'):
            self.assertEqual(self.recorder.messages(topic)[-1].header.frame_id, 'odom', topic)
        for message in self.recorder.messages('odometry/filtered')[:1]:
            self.assertEqual((message.header.frame_id, message.child_frame_id), ('odom', 'base_link'))
        path = self.recorder.messages('path')[-1]
        _, poses = self.recorder.trajectory('pose')
        np.testing.assert_allclose(helpers.planar(path.poses[-1].pose), poses[-1], atol=1e-9)
        self.assertGreater(self.recorder.messages('cloud')[-1].width, 100)

    def test_it_is_what_the_offline_replay_says(self):
        tool = find_tool('replay')
        if not tool:
            self.skipTest('no replay tool')
        tum, params = (os.path.join(self.folder.name, name) for name in ('replay.tum', 'params.yaml'))
        with open(params, 'w') as out:
            yaml.safe_dump(rospy.get_param('/sckf_odometry'), out)
        subprocess.check_call([tool, self.bag, '--trajectory', tum, '--params', params], stdout=subprocess.DEVNULL)
        stamps, poses = self.recorder.trajectory('pose')
        replay_stamps, replay_poses = helpers.read_tum(tum)
        distance, angle = helpers.difference(stamps, poses, replay_stamps, replay_poses)
        self.assertLess(distance, 1e-3)
        self.assertLess(angle, 1e-3)
        self.assertLess(np.abs(poses[-1, :2] - replay_poses[-1, :2]).max(), 1e-3)

    def test_it_is_where_the_simulated_robot_is(self):
        if rospy.get_param('~bag') != 'simulated':
            self.skipTest('no truth for this bag')
        if rospy.get_param('/sckf_odometry/method') == 'dead_reckoning':
            self.skipTest('the wheels alone are not there')
        stamps, poses = self.recorder.trajectory('pose')
        distance, angle = helpers.difference(stamps, poses, stamps, simulated_bag.true_trajectory(stamps))
        self.assertLess(distance, 0.10)
        self.assertLess(angle, 0.02)


if __name__ == '__main__':
    rospy.init_node('test_replay_nodelet')
    junit_runner.run(ReplayNodelet)
