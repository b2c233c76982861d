"""What a bag holds of a run: the scans' points on the robot, the wheels' trajectory and the estimate."""
from __future__ import annotations

import copy
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple

import numpy as np
import rosbag

from trajectory import Trajectory, TrajectoryError


@dataclass(frozen=True)
class Topics:
    """Where things are in the bag. Of the estimate's topics the first that the bag has is taken."""
    scan: str = "/scan"
    odometry: str = "/odom"
    estimate: Tuple[str, ...] = ("/pose", "/odometry/filtered")
    base_frame: str = "base_link"


@dataclass(frozen=True)
class Recording:
    """Scans in the order of their stamps, points (n x 2) [m] in the robot's frame."""
    stamps: np.ndarray
    clouds: List[np.ndarray]
    wheels: Optional[Trajectory]
    estimate: Optional[Trajectory]
    latencies: np.ndarray  # [s] of the bag's clock from the scan's arrival to the estimate's, of scans that have both


@contextmanager
def opened(path: str | Path) -> Iterator[rosbag.Bag]:
    """A bag to read; a TrajectoryError where it is none."""
    try:
        with rosbag.Bag(str(path)) as bag:
            yield bag
    except (OSError, rosbag.ROSBagException) as error:
        raise TrajectoryError(f"{path}: expected a bag: {getattr(error, 'strerror', None) or error}") from error


def read_recording(path: str, topics: Topics = Topics()) -> Recording:
    """Raises TrajectoryError, which says what is missing."""
    messages = _read_messages(path, topics)
    scans = sorted(messages[topics.scan], key=lambda pair: pair[0].header.stamp)
    if not scans:
        raise TrajectoryError(f"{path}: no scans on {topics.scan}")
    transforms = _mounts(messages["/tf"] + messages["/tf_static"])
    mounts: Dict[str, np.ndarray] = {}
    for scan, _ in scans:
        frame = scan.header.frame_id.lstrip("/")
        if frame not in mounts:
            mounts[frame] = _mount(frame, topics.base_frame, transforms, path)
    clouds = [scan_points(scan, mounts[scan.header.frame_id.lstrip("/")]) for scan, _ in scans]
    estimates = next((messages[topic] for topic in topics.estimate if messages[topic]), [])
    return Recording(np.array([scan.header.stamp.to_sec() for scan, _ in scans]), clouds,
                     _trajectory(messages[topics.odometry]), _trajectory(estimates), _latencies(scans, estimates))


def halved(path: str, output: str, scan_topic: str = "/scan") -> None:
    """Writes the bag with each scan as those of two lasers: /right/scan and /left/scan."""
    with rosbag.Bag(path) as source, rosbag.Bag(output, "w") as out:
        for topic, message, stamp in source.read_messages():
            if topic != scan_topic:
                out.write(topic, message, stamp)
                continue
            middle = len(message.ranges) // 2
            for side, part in ("/right/scan", slice(0, middle)), ("/left/scan", slice(middle, None)):
                half = copy.copy(message)
                half.ranges, half.intensities = message.ranges[part], []
                half.angle_min = message.angle_min + (part.start or 0) * message.angle_increment
                half.angle_max = half.angle_min + (len(half.ranges) - 1) * message.angle_increment
                out.write(side, half, stamp)


def _read_messages(path: str, topics: Topics) -> Dict[str, List[Tuple[Any, float]]]:
    """Per topic the messages, each with the time of its record."""
    wanted = [topics.scan, topics.odometry, *topics.estimate, "/tf", "/tf_static"]
    messages: Dict[str, List[Tuple[Any, float]]] = {topic: [] for topic in wanted}
    with opened(path) as bag:
        for topic, message, time in bag.read_messages(wanted):
            messages[topic].append((message, time.to_sec()))
    return messages


def scan_points(scan: Any, base_from_laser: np.ndarray) -> np.ndarray:
    """The readings of a LaserScan message as points (n x 2) in the robot's plane; base_from_laser is 4 x 4."""
    ranges = np.asarray(scan.ranges, dtype=float)
    angles = scan.angle_min + scan.angle_increment * np.arange(ranges.size)
    with np.errstate(invalid="ignore"):
        valid = np.isfinite(ranges) & (ranges > scan.range_min) & (ranges < scan.range_max)
    ranges, angles = ranges[valid], angles[valid]
    in_laser = np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))
    return in_laser @ base_from_laser[:2, :2].T + base_from_laser[:2, 3]


def _trajectory(messages: Sequence[Tuple[Any, float]]) -> Optional[Trajectory]:
    """Of messages with a header and a pose with covariance; None if there are fewer than two."""
    rows: Dict[float, Tuple[float, float, float]] = {}
    for message, _ in messages:
        pose = message.pose.pose
        yaw = _yaw(_matrix(pose.position, pose.orientation))
        rows[message.header.stamp.to_sec()] = (pose.position.x, pose.position.y, yaw)
    if len(rows) < 2:
        return None
    stamps = np.array(sorted(rows))
    return Trajectory(stamps, np.array([rows[stamp] for stamp in stamps]))


def _latencies(scans: Sequence[Tuple[Any, float]], estimates: Sequence[Tuple[Any, float]]) -> np.ndarray:
    arrivals = {scan.header.stamp: time for scan, time in scans}
    return np.array([time - arrivals[estimate.header.stamp] for estimate, time in estimates
                     if estimate.header.stamp in arrivals])


def _mounts(messages: Sequence[Tuple[Any, float]]) -> Dict[str, Tuple[str, np.ndarray]]:
    """Each frame's parent, and its pose there; the first that was said, for what is fixed to the robot does not move."""
    transforms: Dict[str, Tuple[str, np.ndarray]] = {}
    for message, _ in messages:
        for each in message.transforms:
            matrix = _matrix(each.transform.translation, each.transform.rotation)
            transforms.setdefault(each.child_frame_id.lstrip("/"), (each.header.frame_id.lstrip("/"), matrix))
    return transforms


def _mount(frame: str, base_frame: str, transforms: Dict[str, Tuple[str, np.ndarray]], path: str) -> np.ndarray:
    """base_from_frame, 4 x 4."""
    result, current = np.eye(4), frame
    while current != base_frame:
        if current not in transforms:
            raise TrajectoryError(f"{path}: TF does not lead from the scans' frame '{frame}' to '{base_frame}'")
        current, matrix = transforms[current]
        result = matrix @ result
    return result


def _matrix(translation: Any, q: Any) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = [[1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y - q.z * q.w), 2 * (q.x * q.z + q.y * q.w)],
                      [2 * (q.x * q.y + q.z * q.w), 1 - 2 * (q.x * q.x + q.z * q.z), 2 * (q.y * q.z - q.x * q.w)],
                      [2 * (q.x * q.z - q.y * q.w), 2 * (q.y * q.z + q.x * q.w), 1 - 2 * (q.x * q.x + q.y * q.y)]]
    matrix[:3, 3] = translation.x, translation.y, translation.z
    return matrix


def _yaw(matrix: np.ndarray) -> float:
    return float(np.arctan2(matrix[1, 0], matrix[0, 0]))
