#!/usr/bin/python3
"""Landmarks through the nodelet: they are the corners and the walls of the room, rviz is shown them, and the topic status
counts them.
"""

import unittest

import numpy as np
import rospy
from visualization_msgs.msg import Marker, MarkerArray

import junit_runner
import run_helpers as helpers
import simulated_bag


class LandmarksOfARoom(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.recorder = helpers.Recorder()
        cls.arrays = {}
        subscriber = rospy.Subscriber('landmarks', MarkerArray,
                                      lambda array: cls.arrays.update({array.markers[0].header.stamp.to_nsec(): array}),
                                      queue_size=None)
        cls.recorder.wait_for_connection()
        helpers.wait_until(lambda: subscriber.get_num_connections() > 0, 'the topic landmarks')
        messages = simulated_bag.messages(duration=60.0)
        cls.scans = [message.header.stamp.to_nsec() for topic, message, _ in messages if topic == '/scan']
        helpers.Feeder(['/odom', '/scan', '/tf_static']).feed(messages)
        helpers.wait_until(lambda: max(cls.scans) in cls.arrays, 'the landmarks at the last scan')
        helpers.wait_until(lambda: len(cls.recorder.messages('status')) == len(cls.scans), 'the status of each scan')

    def crosses(self):
        """Where the landmarks are in odom at the end, n x 2: the first end of every second line."""
        markers = [m for m in self.arrays[max(self.scans)].markers if m.ns in ('landmarks', 'seen')]
        return np.array([(p.x, p.y) for marker in markers for p in marker.points[::4]])

    def test_they_are_corners_of_the_room(self):
        start = simulated_bag.truth(0.0)
        corners = np.array([corner for outline in simulated_bag.OUTLINES for corner in outline])
        found = np.array([simulated_bag.compose(start, [x, y, 0.0])[:2] for x, y in self.crosses()])
        distances = np.linalg.norm(found[:, None] - corners[None], axis=2).min(axis=1)
        self.assertGreaterEqual(len(found), 5)
        self.assertLess(distances.max(), 0.15, found)

    def walls(self):
        """Both ends of the walls that are landmarks, in odom at the end, n x 2 x 2."""
        markers = [m for m in self.arrays[max(self.scans)].markers if m.ns in ('lines', 'seen_lines')]
        return np.array([(p.x, p.y) for marker in markers for p in marker.points]).reshape(-1, 2, 2)

    def test_there_are_walls_of_the_room(self):
        """Each lies on a wall, within its ends, and has its band."""
        start = simulated_bag.truth(0.0)
        walls = self.walls()
        self.assertGreaterEqual(len(walls), 1)
        for wall in walls:
            ends = np.array([simulated_bag.compose(start, [x, y, 0.0])[:2] for x, y in wall])
            off = []
            for a, b in simulated_bag.walls():
                along = (b - a) / np.linalg.norm(b - a)
                beyond = np.maximum(-(ends - a) @ along, (ends - b) @ along).max()
                off.append(max(beyond, np.abs((ends - a) @ np.array([-along[1], along[0]])).max()))
            self.assertLess(min(off), 0.2, ends)
        bands = next(m for m in self.arrays[max(self.scans)].markers if m.ns == 'covariance_of_lines')
        self.assertEqual(len(bands.points), 64 * len(walls))

    def test_there_is_an_ellipse_about_each(self):
        array = self.arrays[max(self.scans)]
        ellipses = next(m for m in array.markers if m.ns == 'covariance')
        self.assertEqual({m.header.frame_id for m in array.markers}, {'my_odom'})
        self.assertEqual(ellipses.action, Marker.ADD)
        points = np.array([(p.x, p.y) for p in ellipses.points]).reshape(-1, 64, 2)
        self.assertEqual(len(points), len(self.crosses()))
        middles = points.mean(axis=1)
        for cross in self.crosses():
            self.assertLess(np.linalg.norm(middles - cross, axis=1).min(), 1e-3)

    def test_the_status_counts_them(self):
        statuses = self.recorder.messages('status')
        self.assertEqual(statuses[-1].landmarks, len(self.crosses()) + len(self.walls()))
        self.assertGreater(sum(status.landmarks_used for status in statuses), len(statuses))
        self.assertEqual(statuses[0].landmarks, 0)

    def test_the_estimate_is_where_the_robot_is(self):
        stamps, poses = self.recorder.trajectory('pose')
        start = simulated_bag.truth(0.0)
        truth = np.array([simulated_bag.between(start, simulated_bag.truth(t - simulated_bag.START)) for t in stamps])
        self.assertLess(np.linalg.norm(poses[:, :2] - truth[:, :2], axis=1).max(), 0.1)


if __name__ == '__main__':
    rospy.init_node('test_landmarks')
    junit_runner.run(LandmarksOfARoom)
