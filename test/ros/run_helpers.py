"""What the tests of the running nodelet share: recording what it publishes, feeding it, comparing trajectories."""

import copy
import math
import os
import subprocess
import threading
import time
import xmlrpc.client

import numpy as np
import rosgraph
import roslib.packages
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Log
from sckf_odometry.msg import Status
from sensor_msgs.msg import Imu, LaserScan, PointCloud2
from tf2_msgs.msg import TFMessage

TIMEOUT = 300.0  # [s] of wall time for whatever is waited for: machines can be slow
PLANE = [0, 1, 5]  # x, y, yaw among the six axes of a pose


def planar(pose):
    """x, y, yaw of a geometry_msgs/Pose in the plane."""
    q = pose.orientation
    return np.array([pose.position.x, pose.position.y, math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))])


def wrap(angle):
    return (angle + math.pi) % (2 * math.pi) - math.pi


def wait_until(condition, what, timeout=TIMEOUT):
    end = time.time() + timeout
    while not condition():
        if time.time() > end:
            raise AssertionError('waited %.0f s in vain for %s' % (timeout, what))
        time.sleep(0.05)


def subscribers(topic):
    """How many nodes subscribe to a topic, whether anybody publishes it or not."""
    state = rosgraph.Master(rospy.get_name()).getSystemState()[1]
    return sum(len(nodes) for name, nodes in state if name == rospy.resolve_name(topic))


def process_of(node):
    """Its number, by the node itself: the master knows nodes that have crashed, too."""
    uri = rosgraph.Master(rospy.get_name()).lookupNode(node)
    return xmlrpc.client.ServerProxy(uri).getPid(rospy.get_name())[2]


def wait_for_process_of(node):
    """Its number, as soon as it is there."""
    found = []

    def is_there():
        try:
            found.append(process_of(node))
        except (rosgraph.MasterException, OSError):
            return False
        return True

    wait_until(is_there, node)
    return found[0]


def wait_for_subscriber(topic):
    wait_until(lambda: subscribers(topic) > 0, 'a subscriber to ' + topic)


def play(bag, rate, clock=True):
    """rosbag play, until it ends."""
    # The queue of the player: at a rate of some hundred it publishes in lumps.
    command = ['/usr/bin/rosbag', 'play', '--quiet', '--delay=2', '--rate=%g' % rate, '--queue=10000', bag]
    subprocess.check_call(command + (['--clock'] if clock else []))


class Recorder:
    """Everything that a node of the package publishes below a namespace, and what it says."""

    TOPICS = {
        'odometry/filtered': Odometry,
        'pose': PoseWithCovarianceStamped,
        'pose_in_map': PoseWithCovarianceStamped,
        'path': Path,
        'path_odometry': Path,
        'cloud': PointCloud2,
        'status': Status,
    }

    def __init__(self, namespace='', node_name='sckf_odometry', in_map=False):
        self._lock = threading.Lock()
        self._messages = {topic: [] for topic in self.TOPICS}
        self._transforms = []
        self._log = []
        self._diagnostics = {}
        self._levels = []
        self._node_name = node_name
        self._subscribers = [
            rospy.Subscriber(namespace + topic, kind, self._record, topic, queue_size=None, tcp_nodelay=True)
            for topic, kind in self.TOPICS.items() if in_map or topic != 'pose_in_map'
        ]
        rospy.Subscriber('/tf', TFMessage, self._record_transforms, False, queue_size=None)
        rospy.Subscriber('/tf_static', TFMessage, self._record_transforms, True, queue_size=None)
        rospy.Subscriber('/rosout', Log, lambda message: self._log.append(message), queue_size=None)
        rospy.Subscriber('/diagnostics', DiagnosticArray, self._record_diagnostics, queue_size=None)

    def wait_for_connection(self):
        """Else the first messages of the node may be lost, on a busy machine."""
        wait_until(lambda: all(s.get_num_connections() > 0 for s in self._subscribers), 'the topics of the node')

    def _record(self, message, topic):
        with self._lock:
            self._messages[topic].append(message)

    def _record_transforms(self, message, static):
        with self._lock:
            self._transforms += [(transform, static) for transform in message.transforms]

    def _record_diagnostics(self, message):
        for status in message.status:
            if status.name.startswith(self._node_name + ':'):
                with self._lock:
                    self._diagnostics = {entry.key: entry.value for entry in status.values}
                    self._levels.append((status.level, status.message))

    def messages(self, topic):
        with self._lock:
            return list(self._messages[topic])

    def transforms(self, static=None):
        with self._lock:
            return [t for t, is_static in self._transforms if static is None or is_static == static]

    def diagnostics(self):
        with self._lock:
            return dict(self._diagnostics)

    def levels(self):
        """Level and summary of each report of the diagnostics."""
        with self._lock:
            return list(self._levels)

    def log(self, part):
        """Lines of the log that contain this text."""
        return [message.msg for message in list(self._log) if part in message.msg]

    def newest_stamp(self, topic):
        messages = self.messages(topic)
        return messages[-1].header.stamp.to_sec() if messages else 0.0

    def trajectory(self, topic):
        """Stamps [s], and n × 3 poses."""
        messages = self.messages(topic)
        return (np.array([m.header.stamp.to_sec() for m in messages]), np.array([planar(m.pose.pose) for m in messages]))


def covariance(message):
    """3 × 3 of x, y, yaw."""
    return np.array(message.pose.covariance).reshape(6, 6)[np.ix_(PLANE, PLANE)]


def difference(stamps, poses, other_stamps, other_poses):
    """Largest distance [m] and angle [rad] between two trajectories, the second interpolated at the stamps of the first."""
    inside = (stamps >= other_stamps[0]) & (stamps <= other_stamps[-1])
    assert inside.any(), 'no stamp in common'
    columns = [np.interp(stamps[inside], other_stamps, column) for column in other_poses.T[:2]]
    columns.append(np.interp(stamps[inside], other_stamps, np.unwrap(other_poses[:, 2])))
    delta = poses[inside] - np.array(columns).T
    return np.hypot(delta[:, 0], delta[:, 1]).max(), np.abs(wrap(delta[:, 2])).max()


def read_tum(path):
    """Stamps [s], and n × 3 poses, of a file with lines of: stamp x y z qx qy qz qw."""
    rows = np.loadtxt(path, ndmin=2)
    return rows[:, 0], np.column_stack([rows[:, 1], rows[:, 2], 2 * np.arctan2(rows[:, 6], rows[:, 7])])


def load_nodelet(manager, name, **parameters):
    """The process that keeps a nodelet of that name in the manager until it is terminated."""
    for key, value in parameters.items():
        rospy.set_param('%s/%s' % (name, key), value)
    namespace, _, node = name.rpartition('/')
    tool = roslib.packages.find_node('nodelet', 'nodelet')[0]
    return subprocess.Popen([tool, 'load', 'sckf_odometry/ScKfOdometryNodelet', manager, '__name:=' + node,
                             '__ns:=' + (namespace or '/')])


def accounted(diagnostics, kind, received):
    """Whether every message of a kind, 'scans' or 'odometry', has come, and ended or waits."""
    waiting = sum(int(value) for key, value in diagnostics.items()
                  if key.startswith(kind + ': waiting') or key == kind + ': held back')
    came = diagnostics.get(kind + ': received', diagnostics.get(kind + ': messages'))
    return came == str(received) and int(diagnostics[kind + ': together']) + waiting == received


def changed(message, **fields):
    """A copy with these fields, named as header__stamp, set."""
    message = copy.deepcopy(message)
    for name, value in fields.items():
        *path, last = name.split('__')
        part = message
        for step in path:
            part = getattr(part, step)
        setattr(part, last, value)
    return message


class Feeder:
    """Publishes messages as a robot would, in the order given, some times faster than their stamps say."""

    def __init__(self, topics):
        kinds = {'odom': Odometry, 'scan': LaserScan, 'cloud_in': PointCloud2, 'tf_static': TFMessage, 'tf': TFMessage,
                 'imu': Imu, 'pose_update': PoseWithCovarianceStamped}
        self._publishers = {
            topic: rospy.Publisher(topic, kinds[topic.split('/')[-1]], queue_size=None, latch=topic == '/tf_static',
                                   tcp_nodelay=True)
            for topic in topics
        }
        for topic, publisher in self._publishers.items():
            wait_until(lambda topic=topic, publisher=publisher: publisher.get_num_connections() >= subscribers(topic) > 0,
                       'every subscriber to ' + topic)

    def feed(self, messages, speed=20.0):
        begin, first = time.time(), messages[0][2]
        for topic, message, stamp in messages:
            time.sleep(max(0.0, begin + (stamp - first) / speed - time.time()))
            self._publishers[topic].publish(message)

    def close(self):
        """Before another feeder for a node that is started again: rospy of Debian 11 counts those who have gone as
        connected until it has something to send."""
        for publisher in self._publishers.values():
            publisher.unregister()


def data_file(name):
    """A recorded log, None where the folder that the environment variable SCKF_DATA names does not have it."""
    path = os.path.join(os.environ.get('SCKF_DATA', ''), name)
    return path if os.path.isfile(path) else None
