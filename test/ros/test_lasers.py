#!/usr/bin/python3
"""Two lasers on one robot, through the nodelet: each is used, and one that dies leaves the other."""

import unittest

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import PointCloud2

import junit_runner
import run_helpers as helpers
import simulated_bag
from simulated_bag import Mount

REAR = Mount(x=-0.3, y=0.1, yaw=2.9, upside_down=True, frame='laser_rear')
DURATION = 30.0  # [s]
DIES = 20.0  # [s] of the drive: the rear laser
EVERY = 3  # scans of the front laser there is one of the rear one, which comes LATE seconds after its stamp
LATE = 0.2
DRAWN = {'/scan': 'debug/aligned_scan', '/rear/scan': 'debug/aligned_scan_2'}


def messages():
    out, scans = simulated_bag.messages(duration=DURATION, mount=Mount(x=0.2, frame='laser_front')), 0
    for topic, message, stamp in simulated_bag.messages(duration=DURATION, mount=REAR, seed=2):
        scans += topic == '/scan'
        if topic == '/tf_static':
            out.append((topic, message, stamp))
        elif topic == '/scan' and scans % EVERY == 0 and stamp < simulated_bag.START + DIES:
            out.append(('/rear/scan', message, stamp + LATE))
    return sorted(out, key=lambda entry: entry[2])


class Lasers(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.recorder = helpers.Recorder()
        sent = messages()
        cls.sent = {topic: len([t for t, _, _ in sent if t == topic]) for topic in ('/scan', '/rear/scan', '/odom')}
        cls.recorder.wait_for_connection()
        cls.drawn = {topic: set() for topic in DRAWN}
        views = [rospy.Subscriber(view, PointCloud2, cls.note_drawn, topic, queue_size=None)
                 for topic, view in DRAWN.items()]
        helpers.wait_until(lambda: all(view.get_num_connections() > 0 for view in views), 'the topics of the view')
        helpers.Feeder(['/odom', '/scan', '/rear/scan', '/tf_static']).feed(sent, speed=5.0)
        scans = cls.sent['/scan'] + cls.sent['/rear/scan']
        helpers.wait_until(lambda: helpers.accounted(cls.recorder.diagnostics(), 'scans', scans), 'all scans')
        helpers.wait_until(lambda: cls.silence(), 'the silence of the rear laser in the diagnostics')

    @classmethod
    def note_drawn(cls, cloud, topic):
        if cloud.width > 0:
            cls.drawn[topic].add(cloud.header.stamp.to_nsec())

    @classmethod
    def silence(cls):
        return [text for level, text in cls.recorder.levels()
                if level == DiagnosticStatus.WARN and 'no scans on /rear/scan for' in text]

    def statuses(self, topic):
        return [message for message in self.recorder.messages('status') if message.scan_topic == topic]

    def test_the_estimate_follows_the_truth(self):
        stamps, poses = self.recorder.trajectory('pose')
        distance, angle = helpers.difference(stamps, poses, stamps, simulated_bag.true_trajectory(stamps))
        self.assertLess(distance, 0.08)
        self.assertLess(angle, 0.02)
        self.assertGreater(stamps[-1], simulated_bag.START + DURATION - 1.0)

    def test_every_scan_of_both_is_used(self):
        for topic in ('/scan', '/rear/scan'):
            statuses = self.statuses(topic)
            # The last of the front laser may wait for one of the rear one.
            self.assertGreaterEqual(len(statuses), self.sent[topic] - 3, topic)
            self.assertEqual([m.outcome for m in statuses if not m.accepted], ['reference'], topic)

    def test_each_is_compared_with_its_own_references(self):
        for topic in ('/scan', '/rear/scan'):
            stamps = {m.header.stamp.to_nsec() for m in self.statuses(topic)}
            for message in self.statuses(topic)[1:]:
                reference = message.header.stamp - rospy.Duration(message.reference_age)
                nearest = min(abs(reference.to_nsec() - stamp) for stamp in stamps)
                self.assertLess(nearest, 1e6, 'a reference that is no scan of ' + topic)

    def test_rviz_is_shown_every_scan_of_both(self):
        for topic, drawn in self.drawn.items():
            compared = {m.header.stamp.to_nsec() for m in self.statuses(topic) if m.accepted}
            self.assertGreaterEqual(len(drawn & compared), len(compared) - 3, topic)

    def test_they_are_taken_in_the_order_of_their_stamps(self):
        stamps = [m.header.stamp.to_sec() for m in self.recorder.messages('status')]
        self.assertGreaterEqual(np.diff(stamps).min(), 0.0)

    def test_one_that_died_is_said_and_the_other_goes_on(self):
        text = self.silence()[-1]
        self.assertIn('wheels and other lasers carry on', text)
        self.assertNotIn('no scans on /scan for', text)
        after = [m for m in self.statuses('/scan') if m.header.stamp.to_sec() > simulated_bag.START + DIES + 1.0]
        self.assertGreater(len(after), 25)
        self.assertTrue(all(m.accepted for m in after))


if __name__ == '__main__':
    rospy.init_node('test_lasers')
    junit_runner.run(Lasers)
