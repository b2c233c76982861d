#!/usr/bin/python3
"""Clouds of points instead of scans: the robot is followed as with a laser, what is wrong with a cloud is said, and the
manager lives."""

import unittest

import rospy
from sensor_msgs.msg import PointField

import junit_runner
import run_helpers as helpers
import simulated_bag
from run_helpers import changed
from simulated_bag import Mount

MOUNT = Mount(x=0.2, y=-0.1, z=0.8, yaw=0.4, pitch=0.3, upside_down=True, frame='lidar')
NODES = ('cloud', 'everything')
NAN = b'\x00\x00\xc0\x7f'  # as float32


def bad_clouds(good):
    """What becomes of it, and the message."""
    x, y, z = good.fields
    double = PointField(name='z', offset=z.offset, datatype=PointField.FLOAT64, count=1)
    return [
        ('no stamp', changed(good, header__stamp=rospy.Time(0))),
        ('no frame', changed(good, header__frame_id='')),
        ('bad cloud', changed(good, fields=[x, y])),
        ('bad cloud', changed(good, fields=[x, y, double])),
        ('bad cloud', changed(good, width=0, data=b'')),
        ('bad cloud', changed(good, data=good.data[:-1])),
        ('bad cloud', changed(good, point_step=13)),
        ('bad cloud', changed(good, point_step=2**32 - 1)),
        ('bad cloud', changed(good, width=2**32 - 1)),
        ('bad cloud', changed(good, height=2**32 - 1)),
        ('bad cloud', changed(good, is_bigendian=True)),
        ('unusable', changed(good, data=NAN * (3 * good.width))),
        ('nowhere', changed(good, header__frame_id='nowhere')),
    ]


class CloudInput(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.set_param('/use_sim_time', False)
        cls.pid = helpers.wait_for_process_of('/manager')
        cls.recorders = {node: helpers.Recorder(node + '/', node + '/sckf_odometry') for node in NODES}
        good = simulated_bag.messages(duration=25.0, mount=MOUNT, clouds=True)
        cls.clouds = [message.header.stamp.to_sec() for topic, message, _ in good if topic == '/cloud_in']
        messages, cls.kinds, cls.sent = [], {}, 0
        for topic, message, stamp in good:
            messages.append((topic, message, stamp))
            if topic != '/cloud_in':
                continue
            later = changed(message, header__stamp=message.header.stamp + rospy.Duration(0, 1000 * 1000))
            bad = bad_clouds(later)
            kind, cloud = bad[cls.sent // 2 % len(bad)]
            messages.append((topic, cloud, stamp))
            cls.kinds[kind] = cls.kinds.get(kind, 0) + 1
            cls.sent += 2
        for node, recorder in cls.recorders.items():  # in one manager: who subscribes is not told apart
            helpers.wait_until(recorder.diagnostics, 'diagnostics of ' + node)
        helpers.Feeder(['/cloud_in', '/odom', '/tf_static']).feed(messages, speed=10.0)
        for node, recorder in cls.recorders.items():
            helpers.wait_until(lambda recorder=recorder: recorder.newest_stamp('pose') >= cls.clouds[-1] - 1e-6,
                               'poses of ' + node)

    def error(self, node):
        """Largest distance [m] and angle [rad] from the truth."""
        stamps, poses = self.recorders[node].trajectory('pose')
        return helpers.difference(stamps, poses, stamps, simulated_bag.true_trajectory(stamps))

    def test_the_robot_is_followed(self):
        distance, angle = self.error('cloud')
        self.assertLess(distance, 0.10)
        self.assertLess(angle, 0.02)

    def test_the_band_of_heights_matters(self):
        """The robot's own roof moves with it, and is nearer than every wall."""
        distance, _ = self.error('everything')
        self.assertGreater(distance, 0.3)

    def test_no_good_cloud_is_lost(self):
        stamps, _ = self.recorders['cloud'].trajectory('pose')
        missing = [stamp for stamp in self.clouds if abs(stamps - stamp).min() > 1e-6]
        self.assertEqual(missing, [])

    def test_every_cloud_is_accounted_for(self):
        recorder = self.recorders['cloud']
        helpers.wait_until(lambda: helpers.accounted(recorder.diagnostics(), 'scans', self.sent), 'all clouds')
        counts = recorder.diagnostics()
        for key, kind in (('scans: refused, no stamp', 'no stamp'), ('scans: refused, no frame', 'no frame'),
                          ('scans: refused, bad cloud', 'bad cloud'), ('scans: unusable', 'unusable'),
                          ('scans: waiting for their mount', 'nowhere')):
            self.assertEqual(int(counts.get(key, 0)), self.kinds[kind], key)

    def test_what_is_wrong_is_said_with_topic_value_and_expectation(self):
        recorder = self.recorders['cloud']
        self.assertTrue(recorder.log('scan on /cloud_in not used: header.stamp is 0'))
        self.assertTrue(recorder.log('scan on /cloud_in not used: fields are "x" "y": x, y and z expected'))
        self.assertIn('0 of 720 ranges are finite and within [0.1, 50) m: expected at least 20',
                      {status.reason for status in recorder.messages('status')})
        helpers.wait_until(lambda: any('no transform base_link -> nowhere' in text for _, text in recorder.levels()),
                           'word of the mount that is missing')

    def test_the_manager_lives(self):
        self.assertEqual(helpers.process_of('/manager'), self.pid)


if __name__ == '__main__':
    rospy.init_node('test_cloud_input')
    junit_runner.run(CloudInput)
