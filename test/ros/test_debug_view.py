#!/usr/bin/python3
"""The topics debug/...: for each scan that was compared with a reference both scans where they were taken, and what is
between them.
"""

import unittest

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from sckf_odometry.msg import Status
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

import junit_runner
import run_helpers as helpers
import simulated_bag

MOUNT = simulated_bag.Mount(x=0.2)


def points(cloud):
    """n x 2; x, y, z are floats at the start of each point."""
    return np.frombuffer(cloud.data, np.float32).reshape(cloud.width * cloud.height, -1)[:, :2]


def placed(scan, pose, range_offset):
    """The points of a scan, n x 2, with base_link at a pose, and with what was known of its ranges' offset then."""
    angles = scan.angle_min + np.arange(len(scan.ranges)) * scan.angle_increment
    laser = simulated_bag.compose(pose, np.array([MOUNT.x, 0.0, 0.0]))
    ranges = np.array(scan.ranges)[:, None] + range_offset
    return laser[:2] + ranges * np.stack([np.cos(laser[2] + angles), np.sin(laser[2] + angles)], axis=1)


class DebugView(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        kinds = {'debug/reference_scan': PointCloud2, 'debug/aligned_scan': PointCloud2, 'debug/markers': MarkerArray,
                 'pose': PoseWithCovarianceStamped, 'status': Status}
        received = {topic: {} for topic in kinds}

        def keep(message, topic):
            header = message.markers[0].header if topic == 'debug/markers' else message.header
            received[topic][header.stamp.to_nsec()] = message

        subscribers = [rospy.Subscriber(topic, kind, keep, topic, queue_size=None) for topic, kind in kinds.items()]
        helpers.wait_until(lambda: all(each.get_num_connections() for each in subscribers), 'the node')
        messages = simulated_bag.messages(duration=10.0, mount=MOUNT)
        cls.scans = {message.header.stamp.to_nsec(): message for topic, message, _ in messages if topic == '/scan'}
        helpers.Feeder(['/odom', '/scan', '/tf_static']).feed(messages)
        helpers.wait_until(lambda: all(max(cls.scans) in received[topic] for topic in kinds), 'the last scan')
        cls.first, cls.compared = min(cls.scans), sorted(cls.scans)[1:]
        cls.reference, cls.aligned, cls.markers = (received[topic] for topic in list(kinds)[:3])
        cls.poses = {stamp: helpers.planar(message.pose.pose) for stamp, message in received['pose'].items()}
        stamps = sorted(cls.scans)
        cls.range_offsets = {stamps[0]: 0.0}  # of each scan: what those before it told
        cls.range_offsets.update({now: received['status'][last].range_offset for last, now in zip(stamps, stamps[1:])})

    def marker(self, stamp, name):
        return next(marker for marker in self.markers[stamp].markers if (marker.ns, marker.id) == (name, 0))

    def placed_at_its_pose(self, stamp):
        return placed(self.scans[stamp], self.poses[stamp], self.range_offsets[stamp])

    def ends_of_pairs(self, stamp):
        return np.array([(p.x, p.y) for p in self.marker(stamp, 'pairs').points])

    def test_there_is_one_of_each_for_every_scan_in_the_frame_of_the_estimate(self):
        for topic in self.reference, self.aligned, self.markers:
            self.assertEqual(sorted(topic), sorted(self.scans))
        frames = {cloud.header.frame_id for topic in (self.reference, self.aligned) for cloud in topic.values()}
        frames |= {marker.header.frame_id for array in self.markers.values() for marker in array.markers}
        self.assertEqual(frames, {'my_odom'})

    def test_the_first_scan_which_is_compared_with_nothing_clears_the_view(self):
        self.assertEqual(self.reference[self.first].width, 0)
        self.assertEqual(self.aligned[self.first].width, 0)
        self.assertEqual({marker.action for marker in self.markers[self.first].markers}, {Marker.DELETE})

    def test_the_aligned_scan_is_at_the_estimate(self):
        for stamp in self.compared:
            np.testing.assert_allclose(points(self.aligned[stamp]), self.placed_at_its_pose(stamp), atol=1e-4)

    def test_the_reference_is_an_earlier_scan_where_it_was_taken_and_is_kept_for_several(self):
        used = set()
        for stamp in self.compared:
            cloud = points(self.reference[stamp])
            its_stamp = next((earlier for earlier in self.scans if earlier < stamp and np.allclose(
                cloud, self.placed_at_its_pose(earlier), atol=1e-4)), None)
            self.assertIsNotNone(its_stamp, stamp)
            used.add(its_stamp)
        self.assertGreater(len(used), 1)
        self.assertLess(len(used), 0.5 * len(self.compared))

    def test_pairs_go_from_the_reference_to_the_aligned_scan(self):
        for stamp in self.compared:
            ends = self.ends_of_pairs(stamp)
            self.assertGreater(len(ends), 200)
            for these, cloud in (ends[::2], self.reference[stamp]), (ends[1::2], self.aligned[stamp]):
                distances = np.linalg.norm(these[:, None] - points(cloud)[None], axis=2).min(axis=1)
                self.assertLess(distances.max(), 1e-4)

    def test_the_ellipse_is_about_the_robot(self):
        for stamp in self.compared:
            ellipse = np.array([(p.x, p.y) for p in self.marker(stamp, 'covariance').points])
            self.assertLess(np.linalg.norm(ellipse[:-1].mean(axis=0) - self.poses[stamp][:2]), 0.05)


if __name__ == '__main__':
    rospy.init_node('test_debug_view')
    junit_runner.run(DebugView)
