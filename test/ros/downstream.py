"""Stands in for amcl and slam_gmapping where they are not installed, as in Debian: asks of TF what they ask of it."""

import collections
import threading
import time

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

CACHE = 600.0  # [s]: tests run faster than robots


class Downstream:
    """Takes scans in their order, each when TF tells the laser's pose in the odometry frame at the scan's stamp; until
    then it waits in a queue that drops its oldest, as a tf2_ros::MessageFilter does. Publishes map to odom with a stamp
    that lies ahead."""

    def __init__(self, odom_frame, base_frame, queue, publish_map, transform_tolerance=0.1):
        self.odom_frame, self.base_frame = odom_frame, base_frame
        self.taken = []  # (stamp [s], pose of base in odom, seconds that the scan had to wait)
        self.dropped = []  # stamps [s]
        self._lock = threading.Lock()
        self._waiting = collections.deque()
        self._queue = queue
        self._tolerance = rospy.Duration(transform_tolerance)
        self._map = rospy.Publisher('/tf', TFMessage, queue_size=100) if publish_map else None
        self.buffer = tf2_ros.Buffer(rospy.Duration(CACHE))
        self._listener = tf2_ros.TransformListener(self.buffer, queue_size=None)
        rospy.Subscriber('/scan', LaserScan, self._on_scan, queue_size=None, tcp_nodelay=True)
        rospy.Subscriber('/tf', TFMessage, lambda _: self._advance(), queue_size=None, tcp_nodelay=True)

    def _on_scan(self, message):
        with self._lock:
            self._waiting.append((message.header, time.time()))
            if len(self._waiting) > self._queue:
                self.dropped.append(self._waiting.popleft()[0].stamp.to_sec())
        self._advance()

    def _advance(self):
        with self._lock:
            while self._waiting:
                header, arrival = self._waiting[0]
                if not self.buffer.can_transform(self.odom_frame, header.frame_id, header.stamp):
                    return
                self._waiting.popleft()
                pose = self.buffer.lookup_transform(self.odom_frame, self.base_frame, header.stamp).transform
                self.taken.append((header.stamp.to_sec(), pose, time.time() - arrival))
                self._publish_map(header.stamp)

    def _publish_map(self, stamp):
        if not self._map:
            return
        transform = TransformStamped()
        transform.header.stamp = stamp + self._tolerance
        transform.header.frame_id, transform.child_frame_id = 'map', self.odom_frame
        transform.transform.translation.x, transform.transform.rotation.w = 10.0, 1.0
        self._map.publish([transform])
