#!/usr/bin/python3
"""An IMU, absolute poses, and wheels whose systematic errors are found, in a drive of which the laser sees the first part
only."""

import math
import unittest

import numpy as np
import rospy
from sensor_msgs.msg import Imu

import junit_runner
import run_helpers as helpers
import simulated_bag

MANAGER = '/manager'
NODE = '/sckf_odometry'
SPEED = 10.0
SEEING = 25.0  # [s] then the laser falls silent
DURATION = 35.0
STANDING = 5.0  # [s] at the end
MAP = 'site'  # map_frame


def standing(messages, begin):
    """What comes of the sensors while the robot stands on: odometry that repeats itself, and a gyro that tells its bias."""
    last = [message for topic, message, _ in messages if topic == '/odom'][-1]
    out = []
    for i in range(int(STANDING * simulated_bag.IMU_RATE)):
        stamp = begin + (i + 1) / simulated_bag.IMU_RATE
        imu = Imu()
        imu.header.stamp, imu.header.frame_id = rospy.Time.from_sec(stamp), 'imu_link'
        imu.angular_velocity.z = -simulated_bag.ImuUnit().bias
        imu.orientation_covariance[0] = -1.0
        out.append(('/imu', imu, stamp))
        if i % 5 == 4:
            out.append(('/odom', simulated_bag.odometry_message(rospy.Time.from_sec(stamp), helpers.planar(last.pose.pose)), stamp))
    return out


def bad_imu_messages(stamp):
    """Messages of the IMU that are refused, and what is said of them."""
    def message():
        imu = Imu()
        imu.header.stamp, imu.header.frame_id, imu.orientation.w = rospy.Time.from_sec(stamp), 'imu_link', 1.0
        return imu

    no_stamp, no_frame, no_mount, no_number, not_measured = (message() for _ in range(5))
    no_stamp.header.stamp = rospy.Time()
    no_frame.header.frame_id = ''
    no_mount.header.frame_id = 'elsewhere'
    no_number.angular_velocity.z = float('nan')
    no_number.orientation.w = float('nan')
    not_measured.angular_velocity_covariance[0] = not_measured.orientation_covariance[0] = -1.0
    return [(no_stamp, 'header.stamp is 0'), (no_frame, 'header.frame_id is empty'),
            (no_mount, 'no transform base_link -> elsewhere'), (no_number, 'finite numbers expected'),
            (not_measured, '')]  # of the kind of the one before, which is said once in a while


def bad_pose_updates():
    """Poses that are refused, and what is said of them."""
    rng = np.random.default_rng(6)
    no_stamp, other_frame, no_covariance = (simulated_bag.pose_update(0.0, rng) for _ in range(3))
    no_stamp.header.stamp = rospy.Time()
    no_stamp.header.frame_id = no_covariance.header.frame_id = MAP
    other_frame.header.frame_id = 'world'
    no_covariance.pose.covariance = 36 * [0.0]
    return [(no_stamp, 'header.stamp is 0'), (other_frame, 'header.frame_id is "world": "%s" expected' % MAP),
            (no_covariance, 'a positive definite covariance expected')]


class OtherSensors(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.recorder = helpers.Recorder(in_map=True)
        cls.loader = helpers.load_nodelet(MANAGER, NODE, max_scan_delay=10000, use_imu=True,
                                          use_imu_orientation=True, imu_orientation_std=0.02, standstill_time=1.0,
                                          odometry_yaw_per_meter=0.05, use_pose_updates=True, publish_map_tf=True,
                                          map_frame=MAP)
        helpers.wait_for_subscriber('/scan')
        cls.recorder.wait_for_connection()
        cls.imu = simulated_bag.ImuUnit()
        everything = simulated_bag.messages(duration=DURATION, imu=cls.imu, poses=True)
        in_map = [message for topic, message, _ in everything if topic == '/pose_update']
        for message in in_map:
            message.header.frame_id = MAP
        beside = in_map[7]
        beside.pose.pose.position.x += 3.0
        end = simulated_bag.START + SEEING
        cls.messages = [entry for entry in everything if entry[0] != '/scan' or entry[2] < end]
        cls.feeder = helpers.Feeder(['/odom', '/scan', '/imu', '/pose_update', '/tf_static'])
        cls.feeder.feed([entry for entry in cls.messages if entry[0] == '/tf_static'])
        cls.bad = bad_imu_messages(simulated_bag.START)
        cls.feeder.feed([('/imu', message, simulated_bag.START) for message, _ in cls.bad])
        cls.bad_poses = bad_pose_updates()
        cls.feeder.feed([('/pose_update', message, simulated_bag.START) for message, _ in cls.bad_poses])
        cls.feeder.feed([entry for entry in cls.messages if entry[0] != '/tf_static'], SPEED)
        cls.wait_for_odometry(simulated_bag.START + DURATION)
        cls.driven = cls.recorder.messages('odometry/filtered')
        rest = standing(cls.messages, simulated_bag.START + DURATION)
        cls.feeder.feed(rest, SPEED)
        cls.imu_count = sum(topic == '/imu' for topic, _, _ in cls.messages + rest)
        cls.wait_for_odometry(simulated_bag.START + DURATION + STANDING)
        helpers.wait_until(lambda: cls.recorder.diagnostics().get('imu: messages') == str(cls.imu_count + len(cls.bad)),
                           'diagnostics that have every message of the IMU')

    @classmethod
    def wait_for_odometry(cls, stamp):
        helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= stamp - 1e-6, 'odometry at %f' % stamp)

    @classmethod
    def tearDownClass(cls):
        cls.loader.terminate()
        cls.loader.wait()

    def last_status(self):
        return self.recorder.messages('status')[-1]

    def test_the_bias_of_the_gyro_is_found(self):
        status = self.last_status()
        self.assertLess(abs(status.gyro_bias - self.imu.bias), 4 * status.gyro_bias_std)
        self.assertLess(status.gyro_bias_std, 0.005)
        value, _, std = self.recorder.diagnostics()['gyro bias [rad/s]'].split()
        self.assertAlmostEqual(float(value), status.gyro_bias, places=4)
        self.assertAlmostEqual(float(std), status.gyro_bias_std, places=4)

    def test_the_gyro_measures_the_whole_way(self):
        times = [status.gyro_time for status in self.recorder.messages('status')[3:]]
        np.testing.assert_allclose(times, simulated_bag.SCAN_PERIOD, atol=1e-6)

    def test_the_orientation_is_used_at_the_scans(self):
        headings = [status.heading for status in self.recorder.messages('status')]
        self.assertGreater(headings.count('used'), 0.9 * len(headings))
        self.assertEqual(int(self.recorder.diagnostics()['headings: used']), headings.count('used'))

    def test_the_errors_of_the_wheels_are_found(self):
        status = self.last_status()
        self.assertLess(status.calibration_distance, 0.0)  # they tell 3 % too much
        self.assertLess(abs(status.calibration_distance + 0.03), 4 * status.calibration_distance_std)
        self.assertLess(status.calibration_distance_std, 0.045)
        self.assertLess(abs(status.calibration_laser_ahead), 4 * status.calibration_laser_ahead_std)  # as TF says
        self.assertTrue(0.0 < status.calibration_laser_ahead_std < 0.1, status.calibration_laser_ahead_std)
        self.assertIn('error of the wheels: way [1]', self.recorder.diagnostics())

    def test_the_heading_holds_without_scans(self):
        stamps = np.array([m.header.stamp.to_sec() for m in self.driven])
        poses = np.array([helpers.planar(m.pose.pose) for m in self.driven])
        truth = simulated_bag.true_trajectory(stamps)
        error = np.abs(helpers.wrap(poses[:, 2] - truth[:, 2]))
        self.assertLess(error.max(), 0.05)
        wheels = [helpers.planar(m.pose.pose)[2] for topic, m, _ in self.messages if topic == '/odom']
        drift = helpers.wrap(wheels[-1] - wheels[-201] - (simulated_bag.truth(DURATION)[2] - simulated_bag.truth(DURATION - 10)[2]))
        self.assertGreater(abs(drift), 0.06, 'the drive is no test: the wheels are good enough')

    def test_a_robot_that_stands_stays_and_gets_no_worse(self):
        after = [m for m in self.recorder.messages('odometry/filtered')
                 if m.header.stamp.to_sec() > simulated_bag.START + DURATION + 1.5]
        first, last = after[0], after[-1]
        self.assertLess(np.abs(helpers.planar(last.pose.pose) - helpers.planar(first.pose.pose)).max(), 1e-3)
        np.testing.assert_allclose(helpers.covariance(last), helpers.covariance(first), atol=1e-4)

    def test_every_message_of_the_imu_is_accounted_for(self):
        diagnostics = self.recorder.diagnostics()
        self.assertEqual(int(diagnostics['imu: together']) + int(diagnostics['imu: held back']), self.imu_count + len(self.bad))
        self.assertGreaterEqual(int(diagnostics['imu: used']), self.imu_count - 5)

    def test_what_is_no_reading_is_refused_and_it_is_said_why(self):
        for _, expected in self.bad:
            self.assertTrue(self.recorder.log(expected), expected)
        self.assertEqual(int(self.recorder.diagnostics()['imu: refused']), len(self.bad))

    def transforms(self, child):
        """Stamps [s], and n × 3 poses."""
        found = [t for t in self.recorder.transforms(False) if t.child_frame_id == child]
        poses = [[t.transform.translation.x, t.transform.translation.y,
                  2 * math.atan2(t.transform.rotation.z, t.transform.rotation.w)] for t in found]
        return np.array([t.header.stamp.to_sec() for t in found]), np.array(poses)

    def test_the_pose_in_map_is_where_the_robot_is(self):
        messages = self.recorder.messages('pose_in_map')
        self.assertGreater(len(messages), 0.9 * (SEEING - 4.0) / simulated_bag.SCAN_PERIOD)
        self.assertGreater(np.diff([m.header.stamp.to_nsec() for m in messages]).min(), 0)
        for message in messages:
            self.assertEqual(message.header.frame_id, MAP)
            t = message.header.stamp.to_sec() - simulated_bag.START
            moved = simulated_bag.between(simulated_bag.truth(0.0), simulated_bag.truth(t))
            error = helpers.planar(message.pose.pose) - simulated_bag.compose(simulated_bag.MAP_FROM_ODOM, moved)
            self.assertLess(np.abs([error[0], error[1], helpers.wrap(error[2])]).max(), 0.2, t)
            std = np.sqrt(np.diag(helpers.covariance(message)))
            self.assertTrue((std > 1e-4).all() and (std < 0.2).all(), std)

    def test_the_transforms_of_map_and_odom_give_the_pose_in_map(self):
        self.assertEqual({t.header.frame_id for t in self.recorder.transforms(False) if t.child_frame_id == 'odom'}, {MAP})
        map_stamps, map_from_odom = self.transforms('odom')
        odom_stamps, odom_from_base = self.transforms('base_link')
        self.assertGreater(len(map_stamps), 50)
        self.assertGreater(np.diff(map_stamps).min(), 0.0)
        poses = {m.header.stamp.to_sec(): helpers.planar(m.pose.pose) for m in self.recorder.messages('pose_in_map')}
        both = [(stamp, i) for i, stamp in enumerate(map_stamps) if np.abs(odom_stamps - stamp).min() < 1e-6]
        self.assertGreater(len(both), 30)
        for stamp, i in both:
            there = simulated_bag.compose(map_from_odom[i], odom_from_base[np.abs(odom_stamps - stamp).argmin()])
            error = there - poses[stamp]
            # What TF says at that stamp may have been published before the scan was taken.
            self.assertLess(np.abs([error[0], error[1], helpers.wrap(error[2])]).max(), 0.05)

    def test_odom_does_not_jump_where_map_does(self):
        stamps, poses = self.transforms('base_link')
        true = np.array([simulated_bag.truth(t) for t in stamps - simulated_bag.START])
        jump = max(np.hypot(*(simulated_bag.between(a, b) - simulated_bag.between(c, d))[:2])
                   for a, b, c, d in zip(poses, poses[1:], true, true[1:]) if stamps[0] < simulated_bag.START + SEEING)
        self.assertLess(jump, 0.05)
        map_from_odom = self.transforms('odom')[1]
        self.assertGreater(np.abs(np.diff(map_from_odom, axis=0)).max(), 0.01, 'nothing jumps at all')

    def test_every_absolute_pose_is_accounted_for(self):
        diagnostics = self.recorder.diagnostics()
        came = sum(topic == '/pose_update' for topic, _, _ in self.messages)
        self.assertEqual(int(diagnostics['pose updates: messages']), came + len(self.bad_poses))
        self.assertEqual(int(diagnostics['pose updates: refused']), len(self.bad_poses))
        self.assertEqual(int(diagnostics['pose updates: entered']), 1)
        self.assertGreaterEqual(int(diagnostics['pose updates: contradicts']), 1)
        self.assertGreaterEqual(int(diagnostics['pose updates: used']), came - 8 - int(diagnostics['pose updates: waiting']))
        for _, expected in self.bad_poses:
            self.assertTrue(self.recorder.log(expected), expected)
        self.assertTrue(self.recorder.log('contradicts: normalised innovation squared'))


if __name__ == '__main__':
    rospy.init_node('test_other_sensors')
    junit_runner.run(OtherSensors)
