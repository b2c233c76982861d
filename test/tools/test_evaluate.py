#!/usr/bin/python3
"""scripts/evaluate against trajectories whose drift is known on paper."""
from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Sequence

import numpy as np

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
from trajectory import (Trajectory, TrajectoryError, between, compose, drift, read_tum, sample,  # noqa: E402
                        write_tum)

START = 1.0e9


def circle(count: int = 1001, step: float = 0.1, yaw_step: float = 0.01) -> Trajectory:
    """A round trip in equal chords; with the default 100 m long, with yaw_step 0 a straight line."""
    increments = np.tile([step, 0.0, yaw_step], (count - 1, 1))
    return integrate(increments)


def integrate(increments: np.ndarray) -> Trajectory:
    poses = [np.zeros(3)]
    for increment in increments:
        poses.append(compose(poses[-1], increment))
    return Trajectory(START + 0.1 * np.arange(len(poses)), np.array(poses))


def increments_of(trajectory: Trajectory) -> np.ndarray:
    return between(trajectory.poses[:-1], trajectory.poses[1:])


class DriftTest(unittest.TestCase):
    def check(self, reference: Trajectory, estimate: Trajectory, percent: float, deg_per_m: float) -> None:
        result = drift(reference, estimate)
        self.assertAlmostEqual(result.translation_percent, percent, places=6)
        self.assertAlmostEqual(result.rotation_deg_per_m, deg_per_m, places=6)

    def test_a_trajectory_does_not_drift_against_itself(self) -> None:
        self.check(circle(), circle(), 0.0, 0.0)

    def test_where_the_frame_is_and_how_it_is_turned_plays_no_part(self) -> None:
        reference = circle()
        moved = Trajectory(reference.stamps, compose(np.array([12.0, -7.0, 2.5]), reference.poses))
        self.check(reference, moved, 0.0, 0.0)

    def test_wheels_two_percent_too_large_drift_two_percent_on_a_straight_line(self) -> None:
        reference = circle(yaw_step=0.0)
        increments = increments_of(reference)
        increments[:, 0] *= 1.02
        self.check(reference, integrate(increments), 2.0, 0.0)

    def test_a_heading_that_turns_away_at_a_constant_rate(self) -> None:
        reference = circle(yaw_step=0.0)
        increments = increments_of(reference)
        increments[:, 2] += math.radians(0.05)  # at every 0.1 m
        result = drift(reference, integrate(increments), lengths=[10.0])
        self.assertAlmostEqual(result.rotation_deg_per_m, 0.5, places=6)
        # A chord of 100 steps that turn by a each: sum of exp(i·a·k), k = 0 … 99, against 100 steps straight on.
        end = 0.1 * np.exp(1j * math.radians(0.05) * np.arange(100)).sum()
        self.assertAlmostEqual(result.translation_percent, 100.0 * abs(end - 10.0) / 10.0, places=6)

    def test_every_length_weighs_the_same_however_many_segments_it_has(self) -> None:
        reference = circle(yaw_step=0.0)
        increments = increments_of(reference)
        increments[:, 2] += math.radians(0.05)
        result = drift(reference, integrate(increments), lengths=[5.0, 50.0])
        self.assertGreater(result.per_length[0].segments, result.per_length[1].segments)
        mean = 0.5 * (result.per_length[0].translation_percent + result.per_length[1].translation_percent)
        self.assertAlmostEqual(result.translation_percent, mean, places=12)

    def test_a_segment_starts_at_every_pose_and_ends_where_the_way_reaches_the_length(self) -> None:
        result = drift(circle(), circle(), lengths=[5.0, 100.0, 200.0])
        self.assertEqual([each.segments for each in result.per_length], [951, 1, 0])
        self.assertIsNone(result.per_length[2].translation_percent)

    def test_yaw_is_compared_across_the_half_turn(self) -> None:
        reference = circle(yaw_step=0.05)  # eight rounds
        increments = increments_of(reference)
        increments[:, 2] *= 1.01
        result = drift(reference, integrate(increments), lengths=[10.0])
        self.assertAlmostEqual(result.rotation_deg_per_m, math.degrees(0.05 * 0.01) / 0.1, places=6)

    def test_an_estimate_at_its_own_stamps_is_interpolated(self) -> None:
        reference = circle(yaw_step=0.0)
        between_stamps = Trajectory(reference.stamps[:-1] + 0.05, 0.5 * (reference.poses[:-1] + reference.poses[1:]))
        result = drift(reference, between_stamps)
        self.assertAlmostEqual(result.translation_percent, 0.0, places=5)
        self.assertEqual(result.covered, len(reference.stamps) - 2)

    def test_an_estimate_that_starts_late_and_ends_early_is_judged_where_it_is(self) -> None:
        reference = circle()
        part = Trajectory(reference.stamps[200:801], reference.poses[200:801])
        result = drift(reference, part, lengths=[5.0, 50.0])
        self.assertAlmostEqual(result.translation_percent, 0.0, places=9)
        self.assertEqual(result.covered, 601)
        self.assertEqual([each.segments for each in result.per_length], [551, 101])

    def test_a_gap_of_the_estimate_is_not_bridged(self) -> None:
        reference = circle()
        keep = np.r_[0:300, 400:1001]  # 10 s are missing
        result = drift(reference, Trajectory(reference.stamps[keep], reference.poses[keep]), max_gap=5.0)
        self.assertEqual(result.covered, 901)

    def test_no_common_time_is_an_error(self) -> None:
        late = circle()
        late = Trajectory(late.stamps + 1e4, late.poses)
        with self.assertRaisesRegex(TrajectoryError, "share no time"):
            drift(circle(), late)

    def test_a_way_too_short_for_every_length_is_an_error(self) -> None:
        with self.assertRaisesRegex(TrajectoryError, "no segment of 5 m"):
            drift(circle(count=20), circle(count=20))


class SampleTest(unittest.TestCase):
    def test_yaw_takes_the_shorter_way(self) -> None:
        two = Trajectory(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 3.1], [1.0, 2.0, -3.1]]))
        poses, covered = sample(two, np.array([0.5]))
        self.assertTrue(covered.all())
        np.testing.assert_allclose(poses[0, :2], [0.5, 1.0])
        self.assertAlmostEqual(abs(poses[0, 2]), math.pi, places=12)

    def test_nothing_is_extrapolated_but_stamps_of_fewer_digits_match(self) -> None:
        two = Trajectory(np.array([1.0, 2.0]), np.zeros((2, 3)))
        _, covered = sample(two, np.array([0.5, 0.9999, 1.0, 2.0, 2.0001, 2.5]))
        self.assertEqual(covered.tolist(), [False, True, True, True, True, False])


class FileTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def file(self, *lines: str) -> Path:
        path = self.folder / "some.tum"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def check_error(self, pattern: str, *lines: str) -> None:
        with self.assertRaisesRegex(TrajectoryError, pattern):
            read_tum(self.file(*lines))

    def test_what_is_written_is_read(self) -> None:
        path = self.folder / "circle.tum"
        write_tum(path, circle())
        read = read_tum(path)
        np.testing.assert_allclose(read.stamps, circle().stamps, atol=1e-6)
        np.testing.assert_allclose(read.poses, circle().poses, atol=1e-6)

    def test_comments_blank_lines_and_repeated_stamps(self) -> None:
        read = read_tum(self.file("# stamp x y z qx qy qz qw", "", "1 0 0 0 0 0 0 1", "2 1 0 0 0 0 0 1",
                                  "2 5 0 0 0 0 0 1 # the last counts"))
        self.assertEqual(read.poses[:, 0].tolist(), [0.0, 5.0])

    def test_a_tilted_robot_keeps_its_heading(self) -> None:
        half = math.sqrt(0.5)  # upside down and turned by 90 degrees
        read = read_tum(self.file(f"1 0 0 0 {half} {half} 0 0", "2 0 0 0 0 0 0 1"))
        self.assertAlmostEqual(read.poses[0, 2], math.pi / 2, places=12)

    def test_errors_name_file_and_line(self) -> None:
        good = "1 0 0 0 0 0 0 1"
        self.check_error(r"some.tum:2: 3 values, expected 8", good, "2 1 2")
        self.check_error(r"some.tum:3: could not convert.*'x'", good, "# note", "2 x 0 0 0 0 0 1")
        self.check_error(r"some.tum:2: .*not finite", good, "2 nan 0 0 0 0 0 1")
        self.check_error(r"some.tum:2: the quaternion's norm is 2", good, "2 0 0 0 0 0 0 2")
        self.check_error(r"some.tum:2: stamp 0.500000 is before", good, "0.5 0 0 0 0 0 0 1")
        self.check_error(r"some.tum: 1 pose", good)
        with self.assertRaisesRegex(TrajectoryError, "none.tum: No such file"):
            read_tum(self.folder / "none.tum")
        (self.folder / "binary.tum").write_bytes(b"\xff\xfe\x00")
        with self.assertRaisesRegex(TrajectoryError, "binary.tum: not a text file"):
            read_tum(self.folder / "binary.tum")


class CommandTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.reference, self.estimate = (Path(folder.name) / name for name in ("reference.tum", "estimate.tum"))
        straight = circle(yaw_step=0.0)
        increments = increments_of(straight)
        increments[:, 0] *= 1.02
        write_tum(self.reference, straight)
        write_tum(self.estimate, integrate(increments))

    def run_evaluate(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([str(SCRIPTS / "evaluate"), *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              universal_newlines=True, check=False)

    def test_table(self) -> None:
        done = self.run_evaluate(str(self.reference), str(self.estimate))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("1001 of 1001 reference poses (100.0 %)", done.stdout)
        self.assertRegex(done.stdout.splitlines()[-1], r"^ *mean +\d+ +2\.00 % +0\.0000 °/m$")

    def test_json_and_lengths(self) -> None:
        done = self.run_evaluate(str(self.reference), str(self.estimate), "--json", "--lengths", "2,8")
        result = json.loads(done.stdout)
        self.assertEqual([each["length"] for each in result["per_length"]], [2.0, 8.0])
        self.assertAlmostEqual(result["translation_percent"], 2.0, places=4)

    def test_the_reference_of_another_point_of_the_robot(self) -> None:
        body = circle()
        write_tum(self.estimate, body)
        write_tum(self.reference, Trajectory(body.stamps, compose(body.poses, np.array([-0.3, 0.1, 0.0]))))
        for point, drifts in ((["--point", "-0.3", "0.1"], False), ([], True)):
            done = self.run_evaluate(str(self.reference), str(self.estimate), "--json", *point)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads(done.stdout)["translation_percent"] > 1e-3, drifts, done.stdout)

    def test_bad_input_is_told_without_a_traceback(self) -> None:
        both = [str(self.reference), str(self.estimate)]
        for arguments in (["none.tum", str(self.estimate)], [*both, "--lengths=0"], [*both, "--point", "inf", "0"],
                          [*both, "--max-gap", "nan"], [*both, "--max-gap", "-1"], [*both, "--max-gap", "soon"],
                          [*both, "--lengths", "far"], [*both, "--point", "here", "0"]):
            done = self.run_evaluate(*arguments)
            self.assertNotEqual(done.returncode, 0)
            self.assertNotIn("Traceback", done.stderr)
            self.assertRegex(done.stderr, "none.tum: No such file|--lengths: expected lengths of more than 0 m, finite: 0|"
                             "--lengths: expected lengths in metres, as 5,10,20: far|--point: expected a number of metres: here|"
                             "--point: expected a finite number of metres: inf|"
                             "--max-gap: expected (0 or more, finite: (nan|-1)|a number: soon)")

    def test_two_that_share_no_time_are_named(self) -> None:
        write_tum(self.reference, Trajectory(circle().stamps + 1e4, circle().poses))
        done = self.run_evaluate(str(self.reference), str(self.estimate))
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"evaluate: {self.estimate} against {self.reference}: the two trajectories share no time: ", done.stderr)


@unittest.skipUnless(os.environ.get("SCKF_DATA"), "SCKF_DATA does not name the folder of recorded logs")
class RecordedLogTest(unittest.TestCase):
    """The wheels' drift that others have measured on these logs with the same definition."""

    def check(self, name: str, percent: float, deg_per_m: float) -> None:
        folder = Path(os.environ["SCKF_DATA"])
        result = drift(read_tum(folder / f"{name}.tum"), self.wheels(folder / f"{name}.bag"))
        self.assertAlmostEqual(result.translation_percent, percent, delta=0.005 * percent)
        self.assertAlmostEqual(result.rotation_deg_per_m, deg_per_m, delta=0.005 * deg_per_m)

    @staticmethod
    def wheels(bag: Path) -> Trajectory:
        import rosbag
        rows: Sequence[Sequence[float]]
        with rosbag.Bag(str(bag)) as opened:
            rows = [(m.header.stamp.to_sec(), m.pose.pose.position.x, m.pose.pose.position.y,
                     2.0 * math.atan2(m.pose.pose.orientation.z, m.pose.pose.orientation.w))
                    for _, m, _ in opened.read_messages(["/odom"])]
        table = np.array(rows)
        table = table[np.r_[np.diff(table[:, 0]) > 0.0, True]]
        return Trajectory(table[:, 0], table[:, 1:])

    def test_wheels(self) -> None:
        for name, percent, deg_per_m in (("intel", 26.8, 3.46), ("aces", 5.21, 0.323), ("freiburg-079", 9.73, 0.949),
                                         ("intel-raw", 39.9, 4.18)):
            with self.subTest(name):
                self.check(name, percent, deg_per_m)


if __name__ == "__main__":
    unittest.main()
