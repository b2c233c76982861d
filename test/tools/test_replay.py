#!/usr/bin/python3
"""replay, run as a person runs it: what it writes, that it writes the same every time, and what it says of wrong input.

SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import csv
import math
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any, Callable, Dict, List

import numpy as np
import rosbag
import rospy

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "ros"), str(ROOT / "scripts")]
import simulated_bag  # noqa: E402
from trajectory import Trajectory, between, read_tum  # noqa: E402

REPLAY = Path(os.environ.get("SCKF_BIN_DIR", ROOT / "build" / "devel" / "lib" / "sckf_odometry")) / "replay"
DURATION = 12.0
COLUMNS = ("stamp,x,y,yaw,var_x,cov_xy,cov_xyaw,var_y,cov_yyaw,var_yaw,"
           "reference_stamp,predicted_x,predicted_y,predicted_yaw,displacement_x,displacement_y,displacement_yaw,dimension,"
           "displacement_var_x,displacement_cov_xy,displacement_cov_xyaw,displacement_var_y,displacement_cov_yyaw,"
           "displacement_var_yaw,innovation_1,innovation_2,innovation_3,nis,"
           "normalised_x,normalised_y,normalised_yaw,"
           "pairs,overlap,agreement,misfit,new_reference,outcome,reason").split(",")


class ReplayTest(unittest.TestCase):
    folder: tempfile.TemporaryDirectory[str]
    bag: Path

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.bag = Path(cls.folder.name) / "drive.bag"
        simulated_bag.write(str(cls.bag), duration=DURATION)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    def path(self, name: str) -> Path:
        return Path(self.folder.name) / name

    def run_replay(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        command = [str(each) for each in (REPLAY, *arguments)]
        return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)

    def replay(self, *arguments: str | Path) -> str:
        done = self.run_replay(*arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def refused(self, *arguments: str | Path) -> str:
        """What it says; afterwards there is neither a file with the output's name nor a part of one."""
        output = self.path("refused.tum")
        done = self.run_replay(*arguments, "--trajectory", output)
        self.assertGreater(done.returncode, 0, "negative: it crashed; zero: it was content\n" + done.stdout)
        self.assertRegex(done.stderr, r"(?m)^replay: ")
        self.assertEqual([path.name for path in output.parent.glob(output.name + "*")], [])
        return done.stderr

    def changed_bag(self, name: str, change: Callable[[str, Any], str]) -> Path:
        """The bag with messages that were changed, and under the topics that were returned."""
        path = self.path(name)
        with rosbag.Bag(str(self.bag)) as source, rosbag.Bag(str(path), "w") as target:
            for topic, message, stamp in source.read_messages():
                target.write(change(topic, message), message, stamp)
        return path

    def trajectory(self, *arguments: str | Path) -> Trajectory:
        output = self.path("trajectory.tum")
        self.replay(self.bag, "--trajectory", output, *arguments)
        return read_tum(output)

    def table(self, *arguments: str | Path) -> List[Dict[str, str]]:
        output = self.path("table.csv")
        self.replay(self.bag, "--csv", output, *arguments)
        with open(output, newline="", encoding="utf-8") as file:
            rows = csv.reader(file)
            self.assertEqual(next(rows), COLUMNS)
            table = list(rows)
        self.assertTrue(all(len(row) == len(COLUMNS) for row in table))
        return [dict(zip(COLUMNS, row)) for row in table]

    def end_error(self, trajectory: Trajectory) -> np.ndarray:
        return between(simulated_bag.true_trajectory(trajectory.stamps[-1:])[0], trajectory.poses[-1])

    # ---- what it writes

    def test_a_part_of_the_bag(self) -> None:
        """Odometry is as often as 20 times a second: a scan may be left out for want of it at either end."""
        stamps = self.trajectory().stamps
        begin, end = simulated_bag.START + 3.0, simulated_bag.START + 5.0
        part = self.trajectory("--start", "3", "--duration", "2")
        inside = stamps[(stamps >= begin) & (stamps <= end)]
        self.assertTrue(set(np.round(part.stamps, 6)) <= set(np.round(inside, 6)), (part.stamps, inside))
        self.assertGreaterEqual(len(part.stamps), len(inside) - 2)
        self.assertEqual(list(self.trajectory("--start", "3", "--duration", "1e300").stamps),
                         list(self.trajectory("--start", "3").stamps))
        rest = self.trajectory("--start", "3").stamps
        self.assertEqual(rest[-1], stamps[-1])
        self.assertAlmostEqual(rest[0], part.stamps[0])

    def test_a_part_that_is_none(self) -> None:
        for option, value, expected in (("--start", "-1", "0 s or more"), ("--start", "nan", "0 s or more"),
                                        ("--start", "foo", "0 s or more"), ("--start", "3s", "0 s or more"),
                                        ("--duration", "0", "more than 0 s"), ("--duration", "-2", "more than 0 s"),
                                        ("--duration", "inf", "more than 0 s")):
            said = self.refused(self.bag, f"{option}={value}")
            self.assertIn(f"replay: {option} {value}: expected {expected}\n", said)
        self.assertRegex(self.refused(self.bag, "--start", "1000"), r"--start 1000: no more than the bag's 1[0-9.]+ s expected")

    def test_absolute_poses_and_an_imu_of_the_bag_are_used_if_asked_for(self) -> None:
        bag, params, out = self.path("others.bag"), self.path("others.yaml"), self.path("others.tum")
        in_map = self.path("in_map.tum")
        simulated_bag.write(str(bag), duration=DURATION, imu=simulated_bag.ImuUnit(), poses=True)
        params.write_text("use_imu: true\nuse_pose_updates: true\n", encoding="utf-8")
        self.replay(bag, "--trajectory", out, "--params", params, "--map-trajectory", in_map)
        with_imu = out.read_bytes()
        self.replay(bag, "--trajectory", out)
        self.assertNotEqual(with_imu, out.read_bytes())
        trajectory = read_tum(in_map)
        true = np.array([simulated_bag.compose(simulated_bag.MAP_FROM_ODOM, pose)
                         for pose in simulated_bag.true_trajectory(trajectory.stamps)])
        self.assertGreater(len(true), 30)
        self.assertLess(np.abs(trajectory.poses[:, :2] - true[:, :2]).max(), 0.2)

    def test_an_imu_or_poses_that_do_not_come_are_missed_aloud(self) -> None:
        params = self.path("missed.yaml")
        imu = "no sensor_msgs/Imu on /imu/data, expected with {}: true; see --imu-topic"
        poses = "no geometry_msgs/PoseWithCovarianceStamped on /pose_update, expected with use_pose_updates: true"
        for parameter, missed in (("use_imu", imu.format("use_imu")), ("use_pose_updates", poses),
                                  ("use_imu_orientation", imu.format("use_imu_orientation"))):
            params.write_text(f"{parameter}: true\n", encoding="utf-8")
            done = self.run_replay(self.bag, "--csv", "/dev/null", "--params", params, "--imu-topic", "imu/data")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(f"{self.bag}: {missed}", done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        there = self.path("there.bag")
        simulated_bag.write(str(there), duration=DURATION, imu=simulated_bag.ImuUnit(), poses=True)
        params.write_text("use_imu: true\nuse_pose_updates: true\n", encoding="utf-8")
        self.assertNotIn("expected with", self.run_replay(there, "--csv", "/dev/null", "--params", params).stderr)

    def test_the_trajectory_has_every_scan_and_is_right(self) -> None:
        scans = [stamp for topic, _, stamp in simulated_bag.messages(DURATION) if topic == "/scan"]
        trajectory = self.trajectory()
        np.testing.assert_allclose(trajectory.stamps, scans, rtol=0.0, atol=1e-6)
        off = self.end_error(trajectory)
        self.assertLess(math.hypot(off[0], off[1]), 0.05, off)
        self.assertLess(abs(off[2]), 0.02, off)

    def test_the_table_tells_of_every_scan(self) -> None:
        trajectory = self.trajectory()
        table = self.table()
        self.assertEqual(len(table), len(trajectory.stamps))
        self.assertEqual(table[0]["outcome"], "reference")
        self.assertEqual(table[0]["new_reference"], "1")
        self.assertEqual(table[0]["nis"], "")
        for row, stamp, pose in zip(table, trajectory.stamps, trajectory.poses):
            self.assertAlmostEqual(float(row["stamp"]), stamp, places=6)
            np.testing.assert_allclose([float(row[name]) for name in ("x", "y")], pose[:2], rtol=0.0, atol=1e-8)
            covariance = np.array([[float(row[name]) for name in names] for names in (
                ("var_x", "cov_xy", "cov_xyaw"), ("cov_xy", "var_y", "cov_yyaw"), ("cov_xyaw", "cov_yyaw", "var_yaw"))])
            self.assertGreater(np.linalg.eigvalsh(covariance).min(), -1e-12, covariance)
        for row in table[1:]:
            self.assertEqual(row["outcome"], "updated", row["reason"])
            self.assertEqual(row["reason"], "")
            self.assertEqual(row["dimension"], "3")
            self.assertLess(float(row["reference_stamp"]), float(row["stamp"]))
            squares = [float(row[f"normalised_{axis}"]) ** 2 for axis in ("x", "y", "yaw")]
            self.assertGreater(max(squares), 0.0)
            self.assertGreaterEqual(float(row["nis"]), max(squares) * (1 - 1e-6))  # any direction has its share of it
            self.assertGreater(int(row["pairs"]), 100)
            self.assertTrue(0.5 < float(row["overlap"]) <= 1.0, row["overlap"])
            self.assertTrue(0.9 < float(row["agreement"]) <= 1.0, row["agreement"])
            for name in COLUMNS[11:28]:
                self.assertTrue(math.isfinite(float(row[name])), name)

    def test_twice_the_same_bag_gives_the_same_bytes(self) -> None:
        written = []
        for run in ("1", "2"):
            files = [self.path(f"run{run}.{kind}") for kind in ("tum", "csv")]
            self.replay(self.bag, "--trajectory", files[0], "--csv", files[1])
            written.append([file.read_bytes() for file in files])
        self.assertEqual(written[0], written[1])
        self.assertGreater(len(written[0][0]), 1000)

    def test_it_says_how_many_scans_and_how_fast(self) -> None:
        scans = len(self.trajectory().stamps)
        said = self.replay(self.bag, "--csv", self.path("any.csv"))
        self.assertRegex(said, rf"(?m)^{scans} scans, 1 reference, {scans - 1} updated$")
        self.assertRegex(said, r"time of a scan: median [0-9.]+ ms")
        self.assertRegex(said, r"older references used [1-9][0-9]* times, by [1-9][0-9]* scans that became one")
        self.assertRegex(said, r"time of a scan that became a reference: median [0-9.]+ ms")
        self.assertRegex(said, r"[0-9]+ times real time")

    # ---- options

    def test_the_method_changes_the_estimate(self) -> None:
        wheels = self.trajectory("--method", "dead_reckoning")
        fused = self.trajectory("--method", "sckf")
        self.assertLess(np.linalg.norm(self.end_error(fused)[:2]), 0.5 * np.linalg.norm(self.end_error(wheels)[:2]))

    def test_the_method_of_the_command_line_stands_above_that_of_the_file(self) -> None:
        params = self.path("method.yaml")
        params.write_text("method: sckf\n", encoding="utf-8")
        by_both = self.trajectory("--params", params, "--method", "dead_reckoning")
        wheels = self.trajectory("--method", "dead_reckoning")
        np.testing.assert_array_equal(by_both.poses, wheels.poses)

    def test_parameters_are_read(self) -> None:
        params = self.path("every_scan.yaml")
        params.write_text("kf_dist_linear: 0.0\nkf_dist_angular: 0.0\n", encoding="utf-8")
        self.assertTrue(all(row["new_reference"] == "1" for row in self.table("--params", params)))
        self.assertFalse(all(row["new_reference"] == "1" for row in self.table()))

    def test_the_packages_own_parameter_file_states_the_defaults(self) -> None:
        by_file = self.trajectory("--params", ROOT / "config" / "sckf_odometry.yaml")
        np.testing.assert_array_equal(by_file.poses, self.trajectory().poses)

    def test_other_topics(self) -> None:
        names = {"/scan": "/front/scan", "/odom": "/wheels"}
        renamed = self.changed_bag("renamed.bag", lambda topic, message: names.get(topic, topic))
        output = self.path("renamed.tum")
        for slash in ("/", ""):
            self.replay(renamed, "--trajectory", output, "--scan-topic", slash + "front/scan", "--odom-topic", slash + "wheels")
            np.testing.assert_array_equal(read_tum(output).poses, self.trajectory().poses)

    # ---- wrong input

    def test_a_bad_parameter_is_refused_by_name_value_and_range(self) -> None:
        params = self.path("bad.yaml")
        params.write_text("gate_probability: 1.5\n", encoding="utf-8")
        said = self.refused(self.bag, "--params", params)
        self.assertIn(f"parameter file {params}: bad parameters:\n  gate_probability = 1.5: a number in (0, 1) expected", said)

    def test_an_unknown_parameter_is_named(self) -> None:
        params = self.path("unknown.yaml")
        params.write_text("kf_dist_linaer: 1.0\n", encoding="utf-8")
        done = self.run_replay(self.bag, "--trajectory", self.path("unknown.tum"), "--params", params)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("kf_dist_linaer", done.stderr)

    def test_a_parameter_file_that_is_missing_or_no_yaml_is_named(self) -> None:
        self.assertIn("nowhere.yaml", self.refused(self.bag, "--params", self.path("nowhere.yaml")))
        self.assertIn(f"parameter file {self.folder.name}: ", self.refused(self.bag, "--params", self.folder.name))
        params = self.path("broken.yaml")
        params.write_text("method: [sckf\n", encoding="utf-8")
        self.assertIn("broken.yaml", self.refused(self.bag, "--params", params))

    def test_an_unknown_method_is_refused_with_the_known_ones(self) -> None:
        said = self.refused(self.bag, "--method", "kalman")
        self.assertIn("kalman", said)
        self.assertIn("sckf_nc", said)

    def test_a_missing_bag_is_named(self) -> None:
        self.assertIn("nowhere.bag: expected a bag: ", self.refused(self.path("nowhere.bag")))

    def test_what_is_no_bag_is_refused(self) -> None:
        text, empty = self.path("text.bag"), self.path("empty.bag")
        text.write_text("not a bag\n", encoding="utf-8")
        empty.touch()
        for path in (text, empty):
            self.assertIn(f"{path}: expected a bag: ", self.refused(path))
        self.assertIn(f"{self.folder.name}: expected a bag: it is a folder", self.refused(self.folder.name))

    def test_what_is_no_name_of_a_topic_is_refused(self) -> None:
        for option in ("--scan-topic", "--odom-topic", "--imu-topic", "--pose-update-topic"):
            for name in ("", "/", "front scan", "~scan"):
                done = self.run_replay(self.bag, "--csv", "/dev/null", option, name)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertIn(f"replay: {option} '{name}': expected the name of a topic: ", done.stderr)

    def test_a_topic_without_scans_is_named(self) -> None:
        expected = "no sensor_msgs/LaserScan on /front/scan; see --scan-topic"
        self.assertIn(expected, self.refused(self.bag, "--scan-topic", "/front/scan"))
        self.assertIn(expected, self.refused(self.bag, "--scan-topic", "scan", "--scan-topic", "front/scan"))
        self.assertIn('"scan" and "/scan": both are /scan', self.refused(
            self.bag, "--scan-topic", "scan", "--scan-topic", "/scan"))

    def test_a_topic_without_odometry_is_named(self) -> None:
        self.assertIn("no nav_msgs/Odometry on /wheels; see --odom-topic",
                      self.refused(self.bag, "--odom-topic", "wheels"))
        params = self.path("tf_odometry.yaml")
        params.write_text("use_tf_odometry: true\n", encoding="utf-8")
        self.assertIn("no odometry on TF, odom -> base_link", self.refused(self.bag, "--params", params))

    def test_scans_alone_need_no_odometry_but_it_is_said(self) -> None:
        params, output = self.path("alone.yaml"), self.path("alone.tum")
        params.write_text("scans_alone: true\n", encoding="utf-8")
        done = self.run_replay(self.bag, "--trajectory", output, "--params", params, "--odom-topic", "/wheels")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("no nav_msgs/Odometry on /wheels; see --odom-topic: the scans carry on alone", done.stderr)
        self.assertGreater(len(read_tum(output).stamps), 10)

    def test_odometry_that_is_refused_throughout_is_said_once_with_a_count(self) -> None:
        def unknown_frame(topic: str, message: Any) -> str:
            if topic == "/odom":
                message.child_frame_id = "axle"
            return topic

        said = self.refused(self.changed_bag("axle.bag", unknown_frame))
        self.assertRegex(said, r"replay: .*: none of [0-9]{3} messages of odometry on /odom was used")
        self.assertLess(said.count('child_frame_id is "axle"'), 5, said)
        self.assertRegex(said, r"(?m)^[0-9]{3} of these, the last one: odometry at [0-9.]+ not used: child_frame_id is")

    def test_scans_without_any_pose_are_an_error(self) -> None:
        def far_away(topic: str, message: Any) -> str:
            if topic == "/scan":
                message.header.stamp -= rospy.Duration(1000)
            return topic

        said = self.refused(self.changed_bag("other_clock.bag", far_away))
        self.assertIn("no pose at any scan; the last one: no odometry: older than the odometry at hand: its stamp is", said)
        self.assertIn("are the clocks synchronised?", said)

    def test_a_trajectory_in_map_needs_absolute_poses(self) -> None:
        in_map = self.path("no_map.tum")
        self.assertIn("--map-trajectory: use_pose_updates: true expected",
                      self.refused(self.bag, "--map-trajectory", in_map))
        params = self.path("poses.yaml")
        params.write_text("use_pose_updates: true\n", encoding="utf-8")
        said = self.refused(self.bag, "--map-trajectory", in_map, "--params", params, "--pose-update-topic", "amcl_pose")
        self.assertIn("on /amcl_pose; see --pose-update-topic", said)
        self.assertFalse(in_map.exists())

    def test_an_output_that_cannot_be_written_is_named_with_the_reason(self) -> None:
        folder = self.path("folder")
        folder.mkdir()
        for output, reason in ((self.path("no_folder") / "out.tum", "No such file or directory"), (folder, "Is a directory")):
            done = self.run_replay(self.bag, "--trajectory", output)
            self.assertEqual(done.returncode, 1)
            self.assertIn(f"{output}: cannot be written: {reason}", done.stderr)
        self.assertEqual(list(self.path("").glob("*.part")), [])

    def test_an_output_replaces_no_input(self) -> None:
        before = self.bag.read_bytes()
        link = self.path("link.bag")
        link.symlink_to(self.bag)
        for option in ("--trajectory", "--csv"):
            for path in (self.bag, link):
                done = self.run_replay(self.bag, option, path)
                self.assertEqual(done.returncode, 2)
                self.assertIn(f"{option} {path}: expected another file than the bag", done.stderr)
        both = self.path("both")
        for same in (both, f"{both.parent}/./{both.name}", f"{both.parent}/none/../{both.name}"):
            done = self.run_replay(self.bag, "--csv", both, "--trajectory", same)
            self.assertIn("expected another file than --", done.stderr, same)
        params = self.path("kept.yaml")
        params.write_text("method: sckf\n")
        done = self.run_replay(self.bag, "--csv", params, "--params", params)
        self.assertEqual((done.returncode, params.read_text()), (2, "method: sckf\n"))
        self.assertIn(f"--csv {params}: expected another file than --params", done.stderr)
        self.assertEqual(self.bag.read_bytes(), before)

    def test_what_a_link_leads_to_is_written_and_a_device_as_it_is(self) -> None:
        link, target = self.path("link.tum"), self.path("target.tum")
        target.write_text("old")
        link.symlink_to(target)
        self.replay(self.bag, "--trajectory", link, "--csv", "/dev/null")
        self.assertTrue(link.is_symlink())
        self.assertGreater(len(target.read_text().splitlines()), 30)
        self.assertTrue(Path("/dev/null").is_char_device())

    def test_a_wrong_call_is_refused(self) -> None:
        for arguments in ((), (self.bag,), (self.bag, "--nonsense")):
            done = self.run_replay(*arguments)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertRegex(done.stderr, "^replay: ")

    def test_it_explains_itself(self) -> None:
        self.assertIn("usage: replay BAG", self.replay("--help"))


if __name__ == "__main__":
    unittest.main()
