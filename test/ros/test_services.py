#!/usr/bin/python3
"""Set pose, reset, pause, parameters at run time, and a node that is started again, in the middle of a drive."""

import math
import os
import tempfile
import unittest

import dynamic_reconfigure.client
import numpy as np
import rospy
import yaml
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Empty, SetBool

import junit_runner
import run_helpers as helpers
import simulated_bag
from sckf_odometry.srv import SetPose

MANAGER = '/manager'
NODE = '/sckf_odometry'
SPEED = 20.0
IN_THE_PAUSE = int(3 * simulated_bag.ODOMETRY_RATE)  # messages of odometry
GIVEN = np.array([10.0, -5.0, 1.0])  # a pose that is set
STD = np.array([0.5, 0.4, 0.1])


def pose_message(pose=GIVEN, std=STD, frame='odom'):
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose.position.x, message.pose.pose.position.y = pose[0], pose[1]
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    for axis, value in zip(helpers.PLANE, std):
        message.pose.covariance[7 * axis] = value**2
    return message


def bad_poses():
    """Poses that are refused, and what is said of them."""
    out = [(pose_message(frame='map'), 'header.frame_id is "map": "odom" expected')]
    message = pose_message()
    message.pose.pose.orientation.w = 0.0
    out.append((message, 'a quaternion of length 1 expected'))
    message = pose_message()
    message.pose.pose.position.x = float('nan')
    out.append((message, 'position (nan, -5): finite numbers expected'))
    message = pose_message()
    message.pose.covariance[0] = -1.0
    out.append((message, 'without negative eigenvalue expected'))
    message = pose_message()
    message.pose.covariance[1] = 0.1
    out.append((message, 'symmetric'))
    message = pose_message()
    message.pose.covariance[35] = float('inf')
    out.append((message, 'finite'))
    return out


class Services(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.state_file = os.path.join(cls.folder.name, 'state.yaml')
        with open(cls.state_file, 'w') as file:
            file.write('foreign: file\n')
        cls.recorder = helpers.Recorder()
        cls.loader = cls.load()
        cls.messages = simulated_bag.messages(duration=40.0)
        cls.feeder = helpers.Feeder(['/odom', '/scan', '/tf_static'])
        cls.fed = simulated_bag.START - 1.0
        cls.service = {name: rospy.ServiceProxy(NODE + '/' + name, kind, persistent=False)
                       for name, kind in (('reset', Empty), ('set_pose', SetPose), ('pause', SetBool), ('resume', SetBool))}
        cls.before_set = cls.drive(5.0)
        cls.refusals = [(cls.service['set_pose'](message), expected) for message, expected in bad_poses()]
        cls.after_refusals = cls.drive(1.07)  # up to where a scan comes next, and the newest odometry stays what it is
        cls.set = cls.service['set_pose'](pose_message())
        cls.after_set = cls.drive(3.0)
        unknown = pose_message()
        unknown.header.stamp = rospy.Time(5)
        cls.set_of_old = cls.service['set_pose'](unknown)
        cls.after_topic = cls.set_by_topic()
        cls.drive_on_a_pause()
        cls.change_parameters()
        cls.service['reset']()
        cls.after_reset = cls.drive(3.0)
        cls.restart_the_node()

    @classmethod
    def tearDownClass(cls):
        cls.loader.terminate()
        cls.loader.wait()
        cls.folder.cleanup()

    @classmethod
    def load(cls):
        loader = helpers.load_nodelet(MANAGER, NODE, max_scan_delay=10000, state_file=cls.state_file)
        helpers.wait_for_subscriber('/scan')
        cls.recorder.wait_for_connection()
        return loader

    @classmethod
    def drive(cls, duration):
        """Feeds the next seconds of the drive, and returns what the node publishes of them."""
        begin, end = cls.fed, max(cls.fed, simulated_bag.START) + duration
        part = [entry for entry in cls.messages if begin < entry[2] <= end]
        cls.fed = end
        count = len(cls.recorder.messages('odometry/filtered'))
        cls.feeder.feed(part, SPEED)
        last = [stamp for topic, _, stamp in part if topic == '/odom'][-1]
        if not getattr(cls, 'paused', False):
            helpers.wait_until(lambda: cls.recorder.newest_stamp('odometry/filtered') >= last - 1e-6, 'the odometry at %f' % last)
        else:
            rospy.sleep(1.5)  # and nothing comes
        return cls.recorder.messages('odometry/filtered')[count:]

    @classmethod
    def set_by_topic(cls):
        publisher = rospy.Publisher('set_pose', PoseWithCovarianceStamped, queue_size=1)
        helpers.wait_until(lambda: publisher.get_num_connections() > 0, 'a subscriber to set_pose')
        publisher.publish(pose_message(-GIVEN, std=np.zeros(3), frame='/odom'))
        helpers.wait_until(lambda: len(cls.recorder.log('pose set to')) == 3, 'the pose by topic')
        return cls.drive(1.0)

    @classmethod
    def drive_on_a_pause(cls):
        cls.before_pause = cls.recorder.messages('odometry/filtered')[-1]
        cls.statuses_before_pause = len(cls.recorder.messages('status'))
        cls.paused_answer = cls.service['pause'](True)
        cls.paused = True
        cls.while_paused = cls.drive(3.0)
        cls.statuses_while_paused = len(cls.recorder.messages('status')) - cls.statuses_before_pause
        helpers.wait_until(lambda: cls.recorder.diagnostics().get('paused') == 'True', 'diagnostics that say so')
        helpers.wait_until(lambda: int(cls.recorder.diagnostics().get('odometry: paused', 0)) >= IN_THE_PAUSE and
                           int(cls.recorder.diagnostics().get('scans: paused', 0)) >= 12, 'diagnostics that count all')
        cls.counts_while_paused = cls.recorder.diagnostics()
        cls.paused = False
        cls.resumed_answer = cls.service['resume'](True)
        cls.after_pause = cls.drive(3.0)

    @classmethod
    def change_parameters(cls):
        client = dynamic_reconfigure.client.Client(NODE, timeout=helpers.TIMEOUT)
        count = len(cls.recorder.messages('status'))
        cls.drive(3.0)
        cls.references_before = [m.new_reference for m in cls.recorder.messages('status')[count:]]
        count = len(cls.recorder.messages('status'))
        client.update_configuration({'kf_dist_linear': 0.0, 'kf_dist_angular': 0.0})
        cls.drive(3.0)
        cls.references_after = [m.new_reference for m in cls.recorder.messages('status')[count:]]
        cls.refused_configuration = client.update_configuration({'range_min': 5.0, 'range_max': 4.0})
        client.close()

    @classmethod
    def restart_the_node(cls):
        cls.first_log = list(cls.recorder.log('~state_file'))
        cls.loader.terminate()
        cls.loader.wait()
        helpers.wait_until(lambda: helpers.subscribers('/scan') == 0, 'the end of the nodelet')
        with open(cls.state_file) as file:
            cls.state = yaml.safe_load(file)
        cls.last_before_restart = cls.recorder.messages('odometry/filtered')[-1]
        cls.feeder.close()
        cls.loader = cls.load()
        cls.feeder = helpers.Feeder(['/odom', '/scan', '/tf_static'])
        cls.feeder.feed([entry for entry in cls.messages if entry[0] == '/tf_static'])
        cls.after_restart = cls.drive(3.0)

    def assert_motion_since(self, messages, pose, begin, distance=0.15, angle=0.10):
        """The messages tell the true motion after the instant begin [s], from a pose on."""
        start = simulated_bag.truth(begin - simulated_bag.START)
        for message in messages:
            moved = simulated_bag.between(start, simulated_bag.truth(message.header.stamp.to_sec() - simulated_bag.START))
            error = simulated_bag.between(simulated_bag.compose(pose, moved), helpers.planar(message.pose.pose))
            self.assertLess(np.hypot(error[0], error[1]), distance, message.header.stamp)
            self.assertLess(abs(error[2]), angle, message.header.stamp)

    def test_bad_poses_are_refused_with_value_and_expectation(self):
        for answer, expected in self.refusals:
            self.assertFalse(answer.success)
            self.assertIn(expected, answer.message)
            self.assertTrue(self.recorder.log('set_pose refused: ' + answer.message), answer.message)
        last = self.before_set[-1]
        self.assert_motion_since(self.after_refusals, helpers.planar(last.pose.pose), last.header.stamp.to_sec())

    def test_the_estimate_goes_on_from_a_pose_that_is_set(self):
        self.assertTrue(self.set.success, self.set.message)
        begin = self.after_refusals[-1].header.stamp.to_sec()
        self.assert_motion_since(self.after_set, GIVEN, begin)
        for message in self.after_set:
            self.assertTrue(np.isfinite(message.pose.covariance).all())
        np.testing.assert_allclose(np.sqrt(np.diag(helpers.covariance(self.after_set[0]))), STD, rtol=0.2)

    def test_a_stamp_of_which_nothing_is_known_is_told(self):
        self.assertEqual((self.set.success, self.set.message), (True, ''))
        self.assertTrue(self.set_of_old.success)
        self.assertIn('its stamp, 5.000000000 s, nothing is known; expected 0', self.set_of_old.message)
        self.assertTrue(self.recorder.log('set_pose: ' + self.set_of_old.message))

    def test_a_pose_by_topic_is_exact_where_its_covariance_is_zero(self):
        begin = self.after_set[-1].header.stamp.to_sec()
        self.assert_motion_since(self.after_topic, -GIVEN, begin)
        self.assertLess(np.sqrt(np.diag(helpers.covariance(self.after_topic[0]))).max(), 0.05)

    def test_nothing_is_published_while_it_is_paused_and_everything_counted(self):
        self.assertEqual((self.paused_answer.success, self.paused_answer.message), (True, 'paused'))
        self.assertEqual((self.resumed_answer.success, self.resumed_answer.message), (True, 'running'))
        self.assertEqual(self.while_paused, [])
        self.assertEqual(self.statuses_while_paused, 0)
        self.assertEqual(int(self.counts_while_paused['odometry: paused']), IN_THE_PAUSE)
        self.assertGreaterEqual(int(self.counts_while_paused['scans: paused']), 12)

    def test_what_happened_in_a_pause_does_not_count(self):
        first = self.after_pause[0].header.stamp.to_sec()
        self.assert_motion_since(self.after_pause, helpers.planar(self.before_pause.pose.pose), first)
        np.testing.assert_allclose(helpers.covariance(self.after_pause[0]), helpers.covariance(self.before_pause), atol=1e-2)

    def test_no_stamp_comes_twice_on_tf(self):
        stamps = [t.header.stamp.to_nsec() for t in self.recorder.transforms(False) if t.child_frame_id == 'base_link']
        self.assertGreater(len(stamps), 400)
        self.assertGreater(np.diff(stamps).min(), 0)

    def test_parameters_change_between_scans(self):
        self.assertGreater(len(self.references_before), 10)
        self.assertFalse(all(self.references_before[1:]))
        self.assertGreater(len(self.references_after), 10)
        self.assertTrue(all(self.references_after[1:]))

    def test_parameters_that_contradict_each_other_are_refused_and_the_client_is_told(self):
        self.assertTrue(self.recorder.log('parameters not changed: bad parameters:\n  range_min = 5: less than range_max = 4'))
        self.assertEqual((self.refused_configuration['range_min'], self.refused_configuration['range_max']), (0.0, 80.0))

    def test_a_reset_starts_at_the_origin(self):
        self.assert_motion_since(self.after_reset, np.zeros(3), self.after_reset[0].header.stamp.to_sec())
        self.assertEqual(np.abs(helpers.covariance(self.after_reset[0])).max(), 0.0)

    def test_a_foreign_state_file_is_named_and_replaced(self):
        self.assertEqual(len(self.first_log), 1)
        self.assertIn(self.state_file, self.first_log[0])
        self.assertIn('pose [x, y, yaw], covariance [3 x 3] expected', self.first_log[0])

    def test_the_state_file_has_the_last_pose(self):
        pose = helpers.planar(self.last_before_restart.pose.pose)
        # A scan may have corrected it after it was published.
        np.testing.assert_allclose(self.state['pose'][:2], pose[:2], atol=0.05)
        self.assertEqual(self.state['stamp'], self.last_before_restart.header.stamp.to_nsec())

    def test_a_node_that_is_started_again_goes_on(self):
        self.assertTrue(self.recorder.log('the estimate goes on where ' + self.state_file))
        first = self.after_restart[0].header.stamp.to_sec()
        self.assert_motion_since(self.after_restart, helpers.planar(self.last_before_restart.pose.pose), first)
        np.testing.assert_allclose(helpers.covariance(self.after_restart[0]),
                                   helpers.covariance(self.last_before_restart), atol=1e-2)

    def test_every_scan_has_a_status(self):
        statuses = self.recorder.messages('status')
        stamps = [m.header.stamp.to_nsec() for m in statuses]
        self.assertEqual(sorted(set(stamps)), sorted(stamps))
        poses = {m.header.stamp.to_nsec() for m in self.recorder.messages('pose')}
        self.assertEqual(poses, {m.header.stamp.to_nsec() for m in statuses if m.outcome != 'no odometry'})
        updated = [m for m in statuses if m.outcome == 'updated']
        self.assertGreater(len(updated), 0.7 * len(statuses))
        for message in updated:
            self.assertTrue(message.accepted)
            self.assertEqual((message.method, message.header.frame_id, message.dimension), ('sckf_multi', 'odom', 3))
            self.assertGreater(message.pairs, 100)
            self.assertGreater(message.overlap, 0.3)
            self.assertLess(message.nis, message.nis_bound)
            self.assertGreater(message.reference_age, 0.2)
            self.assertGreater(message.match_time, 0.0)
            self.assertGreater(message.total_time, message.match_time)


if __name__ == '__main__':
    rospy.init_node('test_services')
    junit_runner.run(Services)
