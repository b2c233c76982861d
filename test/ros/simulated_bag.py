#!/usr/bin/python3
"""A small world for tests: a robot drives through a room of straight walls; its bag has scans, odometry and the mount.

Everything comes from one seed, so that a test sees the same bag every time.
"""

import argparse
import math

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs import point_cloud2
from sensor_msgs.msg import Imu, LaserScan
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

START = 1000.0  # [s], time of the first message
ODOMETRY_RATE = 20.0  # [1/s]
IMU_RATE = 100.0  # [1/s]
MAP_FROM_ODOM = np.array([10.0, -5.0, 1.0])
POSE_STD = 0.05  # [m, rad] of the absolute poses
SCAN_PERIOD = 0.23  # [s]: no multiple of that of the odometry, so that odometry has to be interpolated

# A room with a niche, two boxes and a slanted wall: no two views of it are alike.
OUTLINES = [
    [(-5, -4), (3, -4), (3, -5), (5, -5), (5, 2), (3, 4), (-5, 4), (-5, 1), (-6, 1), (-6, -1), (-5, -1)],
    [(-1.0, -0.5), (0.6, -0.8), (0.9, 0.4), (-0.7, 0.8)],
    [(-4.3, 2.6), (-3.2, 2.6), (-3.2, 3.3), (-4.3, 3.3)],
]


def polygon(corners):
    """Its segments, n × 2 × 2."""
    begins = np.asarray(corners, dtype=float)
    return np.stack((begins, np.roll(begins, -1, axis=0)), axis=1)


def walls():
    """All segments, n × 2 × 2."""
    return np.concatenate([polygon(outline) for outline in OUTLINES])


class Mount:
    """Pose of the laser in base_link: translation, then rotation about z, then about y, then half a turn about x if
    upside down."""

    def __init__(self, x=0.0, y=0.0, z=0.3, yaw=0.0, pitch=0.0, upside_down=False, frame='laser'):
        self.x, self.y, self.z, self.yaw, self.pitch = x, y, z, yaw, pitch
        self.upside_down, self.frame = upside_down, frame

    def beams(self, angles):
        """Of beams at these angles in the laser's plane: the bearings in base_link, and the share of their length that
        is horizontal."""
        x, y = np.cos(angles) * math.cos(self.pitch), np.sin(-angles if self.upside_down else angles)
        return self.yaw + np.arctan2(y, x), np.hypot(x, y)

    def to_sensor(self, points):
        """Points of base_link, n × 3, in the sensor's frame."""
        (c, s), (cp, sp) = [(math.cos(angle), math.sin(angle)) for angle in (self.yaw, self.pitch)]
        rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        if self.upside_down:
            rotation = rotation @ np.diag([1, -1, -1])
        return (points - np.array([self.x, self.y, self.z])) @ rotation

    def quaternion(self):
        """x, y, z, w of Rz(yaw) Ry(pitch), times Rx(pi) if upside down."""
        c, s = math.cos(self.yaw / 2), math.sin(self.yaw / 2)
        cp, sp = math.cos(self.pitch / 2), math.sin(self.pitch / 2)
        x, y, z, w = -s * sp, c * sp, s * cp, c * cp
        return (w, z, -y, -x) if self.upside_down else (x, y, z, w)


def truth(t):
    """Pose of base_link t seconds after the start: round the box in the middle, weaving, once in a minute."""
    def position(time):
        u = 2 * math.pi * time / 60.0
        return np.array([3.0 * math.cos(u) - 0.5 * math.cos(3 * u), 2.4 * math.sin(u)])

    x, y = position(t)
    ahead = position(t + 1e-4) - position(t - 1e-4)
    return np.array([x, y, math.atan2(ahead[1], ahead[0])])


def swinging(t):
    """The same way with the head turned to and fro, at up to 1.9 rad/s."""
    return truth(t) + np.array([0.0, 0.0, 0.9 * math.sin(2 * math.pi * t / 3.0)])


def compose(a, b):
    c, s = math.cos(a[2]), math.sin(a[2])
    return np.array([a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], a[2] + b[2]])


def between(a, b):
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    yaw = math.atan2(math.sin(b[2] - a[2]), math.cos(b[2] - a[2]))
    return np.array([c * dx + s * dy, -s * dx + c * dy, yaw])


def cast(origin, bearings, segments):
    """Range along each bearing to the nearest segment, inf where there is none. origin: of all rays, or of each."""
    directions = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)[:, None, :]
    a = segments[None, :, 0, :] - np.atleast_2d(origin)[:, None, :]
    along = (segments[:, 1] - segments[:, 0])[None]
    cross = lambda p, q: p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
    with np.errstate(divide='ignore', invalid='ignore'):
        denominator = cross(directions, along)
        ranges = cross(a, along) / denominator
        share = cross(a, directions) / denominator
    hit = (ranges > 0) & (share >= 0) & (share <= 1)
    return np.where(hit, ranges, np.inf).min(axis=1)


def odometry(duration, rng, path=truth):
    """Poses in the wheels' own frame, which starts at the origin: scale and heading drift, and noise."""
    poses = [np.zeros(3)]
    steps = int(duration * ODOMETRY_RATE)
    for i in range(steps):
        motion = between(path(i / ODOMETRY_RATE), path((i + 1) / ODOMETRY_RATE))
        way = math.hypot(motion[0], motion[1])
        noise = rng.normal(size=3) * math.sqrt(way) * np.array([0.01, 0.01, 0.02])
        motion = motion * np.array([1.03, 1.0, 1.0]) + np.array([0.0, 0.0, 0.02 * way]) + noise
        poses.append(compose(poses[-1], motion))
    return poses


def odometry_message(stamp, pose):
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = 'odom'
    message.child_frame_id = 'base_link'
    message.pose.pose.position.x, message.pose.pose.position.y = pose[0], pose[1]
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    return message


def scan_message(stamp, path, mount, segments, rng, beams=360, noise=0.01, time_increment=0.0):
    """Taken along a path, a pose of each time t [s] after the stamp: beam i at i * time_increment."""
    message = LaserScan()
    message.header.stamp = stamp
    message.header.frame_id = mount.frame
    message.angle_min = -math.pi
    message.angle_increment = 2 * math.pi / beams
    message.angle_max = message.angle_min + (beams - 1) * message.angle_increment
    message.time_increment = time_increment
    message.range_min, message.range_max = 0.05, 30.0
    angles = message.angle_min + np.arange(beams) * message.angle_increment
    times = np.arange(beams) * time_increment if time_increment else [0.0]
    lasers = np.array([compose(path(t), np.array([mount.x, mount.y, 0.0])) for t in times])
    bearings, horizontal = mount.beams(angles)
    ranges = cast(lasers[:, :2], lasers[:, 2] + bearings, segments) / horizontal
    message.ranges = (ranges + rng.normal(size=beams) * noise).astype(np.float32).tolist()
    return message


def cloud_message(stamp, pose, mount, segments, rng, noise=0.01):
    """Walls at three heights, the floor around the robot, the robot's own roof, and points that are none."""
    bearings = np.radians(np.arange(-180.0, 180.0) + rng.uniform(-0.5, 0.5, 360))  # in base_link
    laser = compose(pose, np.array([mount.x, mount.y, 0.0]))
    ranges = cast(laser[:2], pose[2] + bearings, segments)
    rings = [(height, ranges + rng.normal(size=360) * noise) for height in (0.3, 0.6, 0.9)]
    rings += [(0.0, np.full(360, 1.5)), (1.6, np.full(360, 0.6)), (0.5, np.full(360, np.nan))]
    points = [np.column_stack([mount.x + r * np.cos(bearings), mount.y + r * np.sin(bearings), np.full(360, height)])
              for height, r in rings]
    header = Header(stamp=stamp, frame_id=mount.frame)
    return point_cloud2.create_cloud_xyz32(header, mount.to_sensor(np.concatenate(points)))


def multiply(p, q):
    """Of quaternions x, y, z, w."""
    (a, b, c, d), (x, y, z, w) = p, q
    return (d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z)


class ImuUnit:
    """An IMU, upside down, whose gyro has a bias [rad/s] and whose world is turned [rad]."""

    def __init__(self, bias=0.02, turned=2.0, noise=0.005):
        self.bias, self.turned, self.noise = bias, turned, noise
        self.mount = Mount(x=-0.1, z=0.5, yaw=0.4, upside_down=True, frame='imu_link')

    def message(self, t, rng):
        """Of t seconds after the start. The noise is that of the yaw rate [rad/s] and, as large, of the yaw [rad]."""
        message = Imu()
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(START + t), self.mount.frame
        rate = between(truth(t - 1e-3), truth(t + 1e-3))[2] / 2e-3 + self.bias + self.noise * rng.normal()
        message.angular_velocity.z = -rate  # upside down
        yaw = truth(t)[2] + self.turned + self.noise * rng.normal()
        q = message.orientation
        q.x, q.y, q.z, q.w = multiply((0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)), self.mount.quaternion())
        return message


def mount_message(stamp, *mounts):
    transforms = []
    for mount in mounts:
        transform = TransformStamped()
        transform.header.stamp = stamp
        transform.header.frame_id, transform.child_frame_id = 'base_link', mount.frame
        t, r = transform.transform.translation, transform.transform.rotation
        t.x, t.y, t.z = mount.x, mount.y, mount.z
        r.x, r.y, r.z, r.w = mount.quaternion()
        transforms.append(transform)
    return TFMessage(transforms)


def pose_update(t, rng):
    """Where the robot is in map t seconds after the start, but for noise."""
    x, y, yaw = compose(MAP_FROM_ODOM, between(truth(0.0), truth(t))) + POSE_STD * rng.normal(size=3)
    message = PoseWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = rospy.Time.from_sec(START + t), 'map'
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    for axis in (0, 1, 5):
        message.pose.covariance[7 * axis] = POSE_STD**2
    return message


def true_trajectory(stamps, path=truth):
    """Pose of base_link at these stamps [s] in the frame of its start: what a perfect estimator would say."""
    return np.array([between(path(0.0), path(stamp - START)) for stamp in stamps])


def messages(duration=45.0, mount=None, seed=1, beams=360, imu=None, path=truth, time_increment=0.0, clouds=False,
             poses=False):
    """(topic, message, stamp) in the order of time; with an ImuUnit its messages at IMU_RATE, too. time_increment: [s] from
    one beam to the next. clouds: of points, in the place of scans. poses: absolute ones in map, too, each second
    from the third on."""
    mount = mount or Mount(x=0.2)
    rng = np.random.default_rng(seed)
    segments = walls()
    mounts = [mount, imu.mount] if imu else [mount]
    out = [('/tf_static', mount_message(rospy.Time.from_sec(START), *mounts), START)]
    for i, pose in enumerate(odometry(duration, rng, path)):
        stamp = START + i / ODOMETRY_RATE
        out.append(('/odom', odometry_message(rospy.Time.from_sec(stamp), pose), stamp))
    t = 0.1
    while t < duration - 0.1 - beams * time_increment:
        stamp = rospy.Time.from_sec(START + t)
        if clouds:
            out.append(('/cloud_in', cloud_message(stamp, path(t), mount, segments, rng), START + t))
        else:
            scan = scan_message(stamp, lambda later, t=t: path(t + later), mount, segments, rng, beams,
                                time_increment=time_increment)
            out.append(('/scan', scan, START + t))
        t += SCAN_PERIOD
    if imu:
        stamps = np.arange(int(duration * IMU_RATE)) / IMU_RATE
        out += [('/imu', imu.message(t, rng), START + t) for t in stamps]
    if poses:
        out += [('/pose_update', pose_update(t, rng), START + t) for t in np.arange(3.0, duration)]
    return sorted(out, key=lambda entry: entry[2])


def write(file, **arguments):
    with rosbag.Bag(file, 'w') as bag:
        for topic, message, stamp in messages(**arguments):
            bag.write(topic, message, rospy.Time.from_sec(stamp))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bag')
    parser.add_argument('--duration', type=float, default=45.0, help='[s]')
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    write(arguments.bag, duration=arguments.duration, seed=arguments.seed)


if __name__ == '__main__':
    main()
