#!/usr/bin/python3
"""scripts/plot and what it stands on, with a robot that drives twice round a room whose walls are known."""
from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
from recording import read_recording  # noqa: E402
from revisit import Surface, align, closure, find_revisits, transformed  # noqa: E402
from trajectory import TrajectoryError, between, compose, read_tum  # noqa: E402

START = 1.0e9
PERIOD = 0.1
LASER = np.array([0.2, -0.05, 0.3])  # on the robot
ANGLES = np.radians(np.arange(-135.0, 135.1, 1.0))
# Corners of closed polygons: a room of 12 m by 9 m and three boxes in it.
WORLD = [[(-6, -4.5), (6, -4.5), (6, 4.5), (-6, 4.5)], [(-0.7, -0.6), (0.8, -0.6), (0.8, 0.5), (-0.7, 0.5)],
         [(4.6, 2.5), (5.4, 2.5), (5.4, 3.4), (4.6, 3.4)], [(-5, -4), (-3.8, -4), (-3.8, -3.6), (-5, -3.6)]]


def walls() -> np.ndarray:
    """Start and end of every wall (n x 2 x 2)."""
    return np.array([[a, b] for corners in WORLD for a, b in zip(corners, corners[1:] + corners[:1])], dtype=float)


def cast(world_from_laser: np.ndarray) -> np.ndarray:
    """The ranges of one scan: the nearest wall along every beam."""
    segments = walls()
    angles = ANGLES + world_from_laser[2]
    direction = np.column_stack((np.cos(angles), np.sin(angles)))[:, None, :]
    start, along = segments[None, :, 0] - world_from_laser[:2], (segments[:, 1] - segments[:, 0])[None]
    cross = direction[..., 0] * along[..., 1] - direction[..., 1] * along[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        range_ = (start[..., 0] * along[..., 1] - start[..., 1] * along[..., 0]) / cross
        share = (start[..., 0] * direction[..., 1] - start[..., 1] * direction[..., 0]) / cross
    hit = (range_ > 0) & (share >= 0) & (share <= 1)
    return np.where(hit, range_, np.inf).min(axis=1)


def two_rounds() -> np.ndarray:
    """Twice round a circle of 3.3 m, 0.3 m between scans."""
    steps = np.tile([0.3, 0.0, 0.3 / 3.3], (138, 1))
    return chain(np.array([0.0, -3.3, 0.0]), steps)


def chain(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
    poses = [start]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def drifting(truth: np.ndarray) -> np.ndarray:
    """What wheels say that see 3 % too much way and turn 0.2 degrees too far with every step."""
    steps = between(truth[:-1], truth[1:])
    steps[:, 0] *= 1.03
    steps[:, 2] += math.radians(0.2)
    return chain(np.zeros(3), steps)


TRUTH = two_rounds()
RANGES = [cast(compose(pose, LASER)) for pose in TRUTH]
CLOUDS = [transformed(LASER, np.column_stack((r * np.cos(ANGLES), r * np.sin(ANGLES)))) for r in RANGES]


class RevisitTest(unittest.TestCase):
    def test_icp_finds_the_pose_between_two_scans(self) -> None:
        expected = between(TRUTH[3], TRUTH[5])
        found = align(Surface(CLOUDS[3]), CLOUDS[5], expected + np.array([0.3, -0.2, 0.1]))
        self.assertGreater(found.overlap, 0.9)
        np.testing.assert_allclose(found.pose, expected, atol=0.005)

    def test_every_place_of_the_second_round_is_found_again(self) -> None:
        revisits = find_revisits(CLOUDS, TRUTH)
        self.assertGreater(len(revisits), 30)
        self.assertEqual(revisits[-1].second, len(TRUTH) - 1)
        for each in revisits:
            np.testing.assert_allclose(each.first_from_second, between(TRUTH[each.first], TRUTH[each.second]), atol=0.01)

    def test_the_truth_closes(self) -> None:
        for each in (closure(revisit, CLOUDS, TRUTH) for revisit in find_revisits(CLOUDS, TRUTH)):
            self.assertLess(each.translation, 0.01)
            self.assertLess(each.rotation, 0.005)
            self.assertLess(each.point_distance, 0.02)

    def test_a_drift_comes_out_as_it_was_put_in(self) -> None:
        wheels = drifting(TRUTH)
        revisit = find_revisits(CLOUDS, TRUTH)[-1]
        measured = closure(revisit, CLOUDS, wheels)
        miss = between(between(TRUTH[revisit.first], TRUTH[revisit.second]),
                       between(wheels[revisit.first], wheels[revisit.second]))
        self.assertGreater(np.hypot(*miss[:2]), 0.3)
        self.assertAlmostEqual(measured.translation, np.hypot(*miss[:2]), delta=0.02)
        self.assertAlmostEqual(measured.rotation, abs(miss[2]), delta=0.01)
        self.assertGreater(measured.point_distance, 0.1)

    def test_a_robot_that_never_comes_back_has_no_revisits(self) -> None:
        self.assertEqual(find_revisits(CLOUDS[:30], TRUTH[:30]), [])


def stamped(message: Any, frame: str, index: int) -> Any:
    message.header.frame_id = frame
    message.header.stamp = rospy.Time.from_sec(START + PERIOD * index)
    return message


def set_pose(target: Any, pose: np.ndarray) -> None:
    target.position.x, target.position.y = pose[0], pose[1]
    target.orientation.z, target.orientation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)


def scan_message(index: int, ranges: np.ndarray) -> LaserScan:
    scan = stamped(LaserScan(), "laser", index)
    scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max = ANGLES[0], math.radians(1.0), 0.1, 30.0
    scan.ranges = ranges[::-1].tolist()  # the laser hangs upside down
    return scan


def mount_message() -> TFMessage:
    """The laser upside down: rolled by half a turn, after the yaw."""
    mount = stamped(TransformStamped(), "base_link", 0)
    mount.child_frame_id = "laser"
    mount.transform.translation.x, mount.transform.translation.y = LASER[:2]
    mount.transform.rotation.x, mount.transform.rotation.y = math.cos(LASER[2] / 2), math.sin(LASER[2] / 2)
    return TFMessage([mount])


def write_bag(path: Path, latency: float = 0.004, estimate: bool = True, mount: bool = True) -> None:
    with rosbag.Bag(str(path), "w") as bag:
        if mount:
            bag.write("/tf_static", mount_message(), rospy.Time.from_sec(START))
        for index, (true_pose, wheel_pose, ranges) in enumerate(zip(TRUTH, drifting(TRUTH), RANGES)):
            arrival = rospy.Time.from_sec(START + PERIOD * index)
            odometry = stamped(Odometry(), "odom", index)
            set_pose(odometry.pose.pose, wheel_pose)
            bag.write("/odom", odometry, arrival)
            bag.write("/scan", scan_message(index, ranges), arrival)
            if estimate:
                pose = stamped(PoseWithCovarianceStamped(), "odom", index)
                set_pose(pose.pose.pose, true_pose)
                bag.write("/pose", pose, arrival + rospy.Duration.from_sec(latency))


class BagTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.bag = self.folder / "run.bag"

    def run_plot(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([str(SCRIPTS / "plot"), str(self.bag), *arguments], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, universal_newlines=True, check=False)

    def test_the_recording_is_read_with_the_laser_upside_down(self) -> None:
        write_bag(self.bag)
        recording = read_recording(str(self.bag))
        self.assertEqual(len(recording.clouds), len(TRUTH))
        np.testing.assert_allclose(recording.clouds[7][::-1], CLOUDS[7], atol=1e-5)
        np.testing.assert_allclose(between(recording.wheels.poses, drifting(TRUTH)), 0.0, atol=1e-6)
        assert recording.estimate is not None
        np.testing.assert_allclose(between(recording.estimate.poses, TRUTH), 0.0, atol=1e-6)
        np.testing.assert_allclose(recording.latencies, 0.004, atol=1e-5)

    def test_table_picture_and_trajectories(self) -> None:
        write_bag(self.bag)
        picture = self.folder / "run.png"
        done = self.run_plot("--latency", "--output", str(picture), "--tum", str(self.folder / "run"), "--scan-topic",
                             "scan", "--odom-topic", "odom")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"at the end +0\.\d\d m +\d+\.\d\d° +0\.0[01] m +0\.[0-3]\d°")
        self.assertRegex(done.stdout, r"median 4\.0 ms.*longest 4\.0 ms \(139 scans\)")
        self.assertEqual(picture.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        np.testing.assert_allclose(read_tum(self.folder / "run-estimate.tum").poses, TRUTH, atol=1e-6)

    def test_the_estimate_may_be_in_a_file(self) -> None:
        write_bag(self.bag)
        self.run_plot("--tum", str(self.folder / "run"))
        write_bag(self.bag, estimate=False)
        done = self.run_plot("--trajectory", str(self.folder / "run-estimate.tum"), "--name", "another")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("another", done.stdout)

    def check_complaint(self, complaint: str, *arguments: str) -> None:
        done = self.run_plot(*arguments)
        self.assertEqual(done.returncode, 1)
        self.assertIn(complaint, done.stderr)
        self.assertNotIn("Traceback", done.stderr)

    def test_a_picture_that_cannot_be_drawn_is_refused_before_anything_is_read(self) -> None:
        for output in ("picture.foo", str(self.folder)):
            done = self.run_plot("--output", output)
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, f"--output: expected a file, by its name one of .*png.*: {output}")

    def test_what_is_missing_is_named(self) -> None:
        self.check_complaint("run.bag")
        write_bag(self.bag, estimate=False)
        self.check_complaint("no estimate on /pose or /odometry/filtered")
        self.check_complaint("no wheel odometry on /wheels; see --odom-topic", "--odom-topic", "wheels")
        write_bag(self.bag, mount=False)
        self.check_complaint("TF does not lead from the scans' frame 'laser' to 'base_link'")
        with self.assertRaisesRegex(TrajectoryError, "expected a bag: .*not appear to be a bag"):
            read_recording(__file__)
        with self.assertRaisesRegex(TrajectoryError, f"^{self.folder}: expected a bag: Is a directory$"):
            read_recording(str(self.folder))

    def test_the_estimate_of_another_time_is_told_with_all_times(self) -> None:
        write_bag(self.bag)
        other = self.folder / "other.tum"
        other.write_text("1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n", encoding="utf-8")
        self.check_complaint(f"{other}: odometry and estimate together cover 0 scan(s): expected an estimate of {self.bag}: the "
                             "scans are from 1000000000.000 to 1000000013.800 s, the odometry from 1000000000.000 to "
                             "1000000013.800 s, the estimate from 1.000 to 2.000 s", "--trajectory", str(other))


if __name__ == "__main__":
    unittest.main()
