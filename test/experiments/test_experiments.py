#!/usr/bin/python3
"""The experiments of the paper, all in one run with few simulated robots: the numbers that matter, and the report.

The programs of the package are looked for in the folder SCKF_BIN_DIR, or as scripts/experiment does.
"""
from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Dict, List

import numpy as np

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
from experiment_base import read_table  # noqa: E402
from experiment_landmarks import rms_after_alignment  # noqa: E402
from experiment_logs import Estimates, end_error, mean_nees  # noqa: E402
from programs import ProgramError, find_program  # noqa: E402
from revisit import Revisit  # noqa: E402
from trajectory import Trajectory  # noqa: E402

RUNS = 20
FIGURES = ("four_methods", "four_methods_covariance", "line_matching", "line_matching_nees", "line_matching_ratios",
           "displacement_only", "displacement_only_covariance", "one_dimension", "visual_odometry", "complexity",
           "extensions_deskewing", "extensions_cloud_input", "extensions_odometry_models",
           "extensions_landmarks", "extensions_references", "extensions_several_lasers", "extensions_imu",
           "extensions_absolute_poses", "extensions_standstill", "extensions_calibration",
           "extensions_update_cost")


def experiment(arguments: List[str], **environment: str) -> subprocess.CompletedProcess:
    environment = {key: value for key, value in {**os.environ, **environment}.items() if key != "DISPLAY"}
    folder = os.environ.get("SCKF_BIN_DIR")
    return subprocess.run([str(SCRIPTS / "experiment"), *arguments, *(["--bin-dir", folder] if folder else [])],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, check=False,
                          env=environment)


class AllExperiments(unittest.TestCase):
    folder: tempfile.TemporaryDirectory
    report: str

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        done = experiment(["all", "--output", cls.folder.name, "--runs", str(RUNS)])
        if done.returncode != 0:
            raise AssertionError(done.stdout)
        cls.report = (Path(cls.folder.name) / "report.md").read_text(encoding="utf-8")

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    def numbers(self, name: str) -> Dict[str, float]:
        return json.loads((Path(self.folder.name) / f"{name}.json").read_text())

    def test_report_has_every_figure_the_command_and_the_versions(self) -> None:
        self.assertEqual(sorted(re.findall(r"\]\((\w+)\.png\)", self.report)), sorted(FIGURES))
        for figure in FIGURES:
            self.assertGreater((Path(self.folder.name) / f"{figure}.png").stat().st_size, 10000, figure)
        self.assertIn(f"experiment all --output {self.folder.name} --runs {RUNS}", self.report)
        self.assertRegex(self.report, r"Versions: sckf_odometry \d+\.\d+\.\d+.*numpy \d")

    def test_four_methods_tells_the_order_of_the_errors(self) -> None:
        n = self.numbers("four_methods")
        for kind in ("every_scan", "kept"):
            for method in ("sckf", "sckf_nc", "pseudo_absolute"):
                self.assertLess(n[f"{method}_{kind}_percent"], 0.5 * n[f"dead_reckoning_{kind}_percent"], method)
        names = {"sckf": "SC-KF", "sckf_nc": "SC-KF-NC", "pseudo_absolute": "pseudo-absolute",
                 "dead_reckoning": "dead reckoning"}
        order = sorted(names, key=lambda method: n[f"{method}_every_scan_percent"])
        self.assertIn("at every scan: " + ", ".join(names[method] for method in order), self.report)
        self.assertIn("0.50 m, 0.44 m, -0.11°, 0.40 %", self.report, "the paper's own figures")

    def test_line_matching_covariance_of_the_sckf_fits(self) -> None:
        n = self.numbers("line_matching")
        self.assertTrue(n["nees_low"] < n["sckf_nees"] < n["nees_high"], n)
        self.assertGreater(n["sckf_nees_share_in_band"], 0.7, "errors at neighbouring scans are much the same error")
        for axis in ("x", "y", "yaw"):
            self.assertGreater(n[f"sckf_inside_{axis}"], 0.98)
            self.assertTrue(0.7 < n[f"sckf_bound_{axis}"] < 1.5, axis)

    def test_line_matching_covariance_of_the_sckf_nc_is_far_too_large(self) -> None:
        n = self.numbers("line_matching")
        self.assertLess(n["sckf_nc_nees"], 0.85 * n["nees_low"])
        self.assertGreater(n["sckf_nc_bound_y"], 1.5)
        self.assertGreater(n["sckf_nc_bound_yaw"], 4.0)
        self.assertLess(n["rms_ratio_y"], 0.9)
        self.assertLess(n["rms_ratio_yaw"], 1.0)

    def test_displacement_only_covariance_is_smaller_with_c(self) -> None:
        n = self.numbers("displacement_only")
        for axis in ("x", "y", "yaw"):
            self.assertLess(n[f"ratio_{axis}"], 1.0, axis)
            self.assertGreater(n[f"share_below_{axis}"], 0.99, axis)

    def test_one_dimension_is_monotonic_with_c_and_has_a_valley_without(self) -> None:
        n = self.numbers("one_dimension")
        self.assertEqual(n["monotonic_with_c"], 1.0)
        self.assertAlmostEqual(n["valley_without_c"], 5.0, delta=0.5)
        self.assertLess(n["largest_deviation_from_curve"], 0.02)
        self.assertGreater(n["share_of_intervals_that_hold_the_filter"], 0.7)

    def test_visual_odometry_is_monotonic_with_c_and_has_a_valley_without(self) -> None:
        n = self.numbers("visual_odometry")
        for part in ("position", "attitude"):
            self.assertEqual(n[f"{part}_monotonic_with_c"], 1.0, part)
            self.assertTrue(0.3 < n[f"{part}_valley_without_c"] < 3.0, part)
            self.assertTrue(0.7 < n[f"{part}_scatter_over_covariance"] < 1.4, part)
            self.assertLess(n[f"{part}_scatter_over_covariance_without_c_dense"], 0.8, part)

    def test_complexity_is_linear_constant_and_quadratic(self) -> None:
        n = self.numbers("complexity")  # timings: the bounds tell the three apart, and no more
        self.assertTrue(0.5 < n["slope_sckf"] < 1.5, n)
        self.assertLess(abs(n["slope_sckf_nc"]), 0.4, n)
        self.assertTrue(1.5 < n["slope_dense"] < 2.7, n)

    def test_deskewing_takes_away_what_the_turning_adds(self) -> None:
        n = self.numbers("extensions")
        self.assertGreater(n["deskewing_without_yaw"], 50.0 * n["deskewing_with_yaw"])
        self.assertGreater(n["deskewing_without_position"], 10.0 * n["deskewing_with_position"])
        self.assertLess(n["deskewing_with_yaw"], 2.0 * n["deskewing_with_yaw_slow"], "as if it had not turned")

    def test_clouds_are_as_good_as_a_laser_within_the_band_of_heights(self) -> None:
        n = self.numbers("extensions")
        self.assertLess(n["cloud_input_cloud_720_position"], 2.1 * n["cloud_input_laser_position"])
        self.assertGreater(n["cloud_input_everything_position"], 5.0 * n["cloud_input_cloud_720_position"])

    def test_each_odometry_model_fits_the_robot_of_its_kind(self) -> None:
        n = self.numbers("extensions")
        nees = {(robot, model): n[f"odometry_models_{robot}_by_{model}"]
                for robot in ("omnidirectional", "differential", "ackermann")
                for model in ("omnidirectional", "differential", "ackermann")}
        for kind in ("omnidirectional", "differential", "ackermann"):
            self.assertTrue(1.5 < nees[kind, kind] < 4.5, f"{RUNS} runs of a {kind} robot: {nees}")
        self.assertGreater(nees["omnidirectional", "differential"], 1.3 * nees["omnidirectional", "omnidirectional"],
                           "its wheels slip to the side")
        self.assertGreater(nees["ackermann", "differential"], 2.0 * nees["ackermann", "ackermann"],
                           "an error of its way is one of its yaw")
        self.assertLess(nees["differential", "ackermann"], 0.1, "it turns on the spot, and is not believed")


    def section(self, name: str) -> Dict[str, float]:
        return {key[len(name) + 1:]: value for key, value in self.numbers("extensions").items()
                if key.startswith(name + "_")}

    def assert_consistent(self, n: Dict[str, float], *robots: str) -> None:
        """As well as so few robots tell; of 3 dimensions."""
        for name in robots:
            self.assertTrue(1.8 < n[f"{name}_nees"] < 4.5, f"{name}: {n}")

    def test_two_lasers_are_better_than_each(self) -> None:
        n = self.section("several_lasers")
        self.assert_consistent(n, "fast", "slow", "both")
        for kind, each in (("", ("fast", "slow")), ("mounted_", ("front", "rear"))):
            for one in each:
                self.assertLess(n[f"{kind}both_position"], 0.9 * n[f"{kind}{one}_position"], n)
        for half in ("right", "left"):
            # Where the half views of the simulated stairs go wrong, older scans do not.
            self.assertLess(n["log_both_drift_percent"], 0.6 * n[f"log_{half}_drift_percent"], n)
        self.assertLess(n["log_uncut_drift_percent"], n["log_both_drift_percent"], "nothing is lost between its halves")

    def test_an_imu_holds_the_heading_where_scans_do_not(self) -> None:
        n = self.section("imu")
        self.assert_consistent(n, *(f"{scans}_{name}" for scans in ("seeing", "blind")
                                    for name in ("wheels", "gyro", "orientation", "both")))
        self.assertLess(n["blind_gyro_yaw"], 0.8 * n["blind_wheels_yaw"])
        self.assertLess(n["blind_orientation_yaw"], 0.4 * n["blind_wheels_yaw"])
        self.assertLess(n["blind_both_yaw"], 0.75 * n["blind_orientation_yaw"])
        for name in ("gyro", "both"):
            self.assertTrue(0.5 < n[f"{name}_bias_nees"] < 1.7, n)
            self.assertLess(n[f"{name}_bias"], 0.5 * 0.02, "it is drawn with a std of 0.02 rad/s")

    def test_absolute_poses_hold_the_robot_in_map_and_leave_odom_alone(self) -> None:
        n = self.section("absolute_poses")
        self.assert_consistent(n, "seeing_without", "seeing_with", "blind_without", "blind_with", "every_sensor")
        self.assertTrue(4.3 < n["every_sensor_calibration_nees"] < 8.0, n)
        self.assertTrue(0.5 < n["every_sensor_bias_nees"] < 1.7, n)
        self.assertLess(n["blind_with_position"], 0.15, "they are told with a std of 0.1 m")
        self.assertGreater(n["blind_without_position"], 5.0 * n["blind_with_position"])
        self.assertLess(n["map_end"], 0.5 * n["odom_end"])
        self.assertEqual(n["odom_moved"], 0.0)
        self.assertLess(n["odom_step"], 0.005)
        self.assertGreater(n["map_step"], 10.0 * n["odom_step"], "or nothing corrects it")

    def test_a_robot_that_knows_that_it_stands_finds_the_bias_of_its_gyro(self) -> None:
        n = self.section("standstill")
        self.assert_consistent(n, "without", "with", "gyro_without", "gyro_with")
        self.assertLess(n["gyro_with_bias"], 0.6 * n["gyro_without_bias"])
        self.assertLess(n["gyro_with_yaw"], 0.6 * n["gyro_without_yaw"])

    def test_wheels_that_have_been_found_out_lead_a_blind_robot_better(self) -> None:
        n = self.section("calibration")
        self.assert_consistent(n, "with")
        self.assertTrue(4.3 < n["scale_nees"] < 8.0, n)
        self.assertGreater(n["without_nees"], 3.0 * n["with_nees"], "wheels that are taken for right")
        self.assertLess(n["scale"], 0.6 * 0.1, "it is drawn with a std of 0.1")
        self.assertLess(n["with_position"], 0.85 * n["without_position"])

    def test_more_references_drift_less_as_far_as_they_are_used(self) -> None:
        keys = ("drift_percent", "drift_deg_per_m", "older")
        numbers = self.section("references")
        n = {poses: {key: numbers[f"{poses}_{key}"] for key in keys} for poses in (2, 3, 4, 5, 8)}
        for figure in ("drift_percent", "drift_deg_per_m"):
            self.assertLess(n[5][figure], 0.85 * n[2][figure], n)
            self.assertLess(n[8][figure], 0.85 * n[2][figure], n)
        self.assertEqual(n[2]["older"], 0.0)
        for poses in (3, 4, 5, 8):
            self.assertLessEqual(n[poses]["older"], poses - 2)
        self.assertGreater(n[8]["older"], n[3]["older"] + 0.5)

    def test_an_update_is_linear_in_the_ranges_and_quadratic_in_the_states(self) -> None:
        n = self.section("update_cost")  # timings: the bounds tell the three apart, and no more
        self.assertTrue(0.5 < n["slope_ranges"] < 1.5, n)
        for name in ("clones", "landmarks"):
            self.assertTrue(0.3 < n[f"slope_{name}"] < 2.6, n)

    def test_with_landmarks_beside_displacements_the_second_pass_falls_on_the_first(self) -> None:
        n = self.numbers("extensions")
        self.assertLess(n["landmarks_none_end"], 0.1, n)
        self.assertLess(n["landmarks_only_end"], 2.0, "the wheels alone end 4.8 m off")
        self.assertLess(n["landmarks_lines_end"], 0.1, n)
        self.assertLess(n["landmarks_corners_end"], 0.095, n)
        self.assertLess(n["landmarks_corners_and_lines_end"], 0.08, n)
        self.assertEqual(len({n[f"landmarks_{key}_end"] for key in ("none", "corners", "lines", "corners_and_lines")}), 4,
                         "some had no part in it")


class CommandLine(unittest.TestCase):
    def test_refuses_what_there_is_not(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            for arguments, told in ((["five_methods", "--output", folder], "five_methods"),
                                    (["four_methods", "--output", folder, "--range-std", "1"], "--range-std"),
                                    (["complexity", "--output", folder, "--no-such"], "no-such"),
                                    (["complexity", "--output", folder, "--runs", "-1"], "--runs: expected a whole number"),
                                    (["visual_odometry", "--output", folder, "--runs", "1"], "--runs 1: expected 2 or"),
                                    (["complexity", "--output", folder, "--seed", "-1"], "--seed: expected a whole number"),
                                    (["line_matching", "--output", folder, "--laps", "0"], "--laps 0: expected 0.5 to 100"),
                                    (["four_methods", "--output", folder, "--scan-topic", ""], "--scan-topic: expected"),
                                    (["four_methods", "--output", folder, "--bag", "/no/such.bag"], "such.bag")):
                done = experiment(arguments)
                self.assertNotEqual(done.returncode, 0, arguments)
                self.assertIn(told, done.stdout)
                self.assertNotIn("Traceback", done.stdout)

    def test_a_number_out_of_its_range_is_refused_with_the_range(self) -> None:
        wrong = {"runs": ("-1", "foo", ""), "seed": ("-1", "1e3", "99999999999999999999"), "density": ("-1", "0", "nan"),
                 "field": ("0", "101"), "distance-std": ("0", "-1"), "range-std": ("0", "inf"),
                 "odometry-noise": ("0", "-1"), "spacing": ("0", "-1", "1e3"), "beams": ("0", "-4", "7", "9.5"),
                 "laps": ("0", "-1", "2 m"), "pixel-std": ("0", "-1"), "features": ("0", "-1"),
                 "far": ("1", "-1", "1e6"), "sweep": ("-1", "5"), "rings": ("1", "-1"), "pitch": ("3", "nan")}
        bin_dir = os.environ.get("SCKF_BIN_DIR")
        program = find_program("experiment_data", Path(bin_dir) if bin_dir else None)
        with tempfile.TemporaryDirectory() as folder:
            for option, values in wrong.items():
                for value in values:
                    done = subprocess.run([str(program), "one_dimension", "--output", folder, f"--{option}", value],
                                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                                          check=False)
                    self.assertEqual(done.returncode, 2, (option, value))
                    self.assertRegex(done.stdout, rf"^experiment_data: --{option} {value}: expected .*[0-9]")
            self.assertEqual(list(Path(folder).iterdir()), [])

    def test_scans_that_share_nothing_are_told(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            done = experiment(["one_dimension", "--output", folder, "--runs", "2", "--density", "0.01"])
        self.assertEqual(done.returncode, 1)
        self.assertIn("two scans share no feature: try a greater density", done.stdout)

    def test_a_parameter_changes_the_result(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            variances = []
            for std in ("0.2", "0.4"):
                done = experiment(["one_dimension", "--output", folder, "--runs", "2", "--distance-std", std])
                self.assertEqual(done.returncode, 0, done.stdout)
                table = np.genfromtxt(Path(folder) / "one_dimension_simulated.csv", delimiter=",", names=True)
                variances.append(table["with_c"])
        np.testing.assert_allclose(variances[1], 4.0 * variances[0], rtol=1e-6)

    def test_without_git_the_report_has_the_version_of_the_package_alone(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            done = experiment(["one_dimension", "--output", folder, "--runs", "2"], PATH=folder)
            self.assertEqual(done.returncode, 0, done.stdout)
            report = (Path(folder) / "report.md").read_text(encoding="utf-8")
        self.assertRegex(report, r"Versions: sckf_odometry \d+\.\d+\.\d+; ")

    def test_says_where_it_looked_for_a_program(self) -> None:
        with self.assertRaisesRegex(ProgramError, "/no/such/folder.*--bin-dir"):
            find_program("replay", Path("/no/such/folder"))


class Measures(unittest.TestCase):
    def test_end_error_is_the_one_on_paper(self) -> None:
        """Scans: the second pass ends 1 m ahead of the first. The estimate: 0.3 m further, 0.2 m left, 0.1 rad."""
        poses = np.array([[2.0, 1.0, math.pi / 2], [9.0, 9.0, 0.0], [1.8, 2.3, math.pi / 2 + 0.1]])
        estimates = Estimates(np.array([0.0, 1.0, 2.0]), poses, np.tile(np.eye(3), (3, 1, 1)))
        error = end_error(Revisit(0, 2, np.array([1.0, 0.0, 0.0])), estimates.stamps, estimates)
        np.testing.assert_allclose([error.x, error.y, error.yaw], [-0.2, 0.3, 0.1], atol=1e-12)

    def test_rms_after_alignment_leaves_out_where_the_whole_is(self) -> None:
        stamps = np.arange(4.0)
        square = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]])
        cos, sin = math.cos(0.7), math.sin(0.7)
        turned = square.copy()
        turned[:, :2] = square[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + [7.0, -3.0]
        self.assertAlmostEqual(rms_after_alignment(Trajectory(stamps, square), Trajectory(stamps, turned)), 0.0)
        larger = turned.copy()
        larger[:, :2] *= 1.5  # each corner is half a diagonal off by half
        self.assertAlmostEqual(rms_after_alignment(Trajectory(stamps, square), Trajectory(stamps, larger)),
                               0.5 * math.sqrt(2.0))

    def test_nees_is_three_where_the_covariance_is_right(self) -> None:
        random = np.random.default_rng(1)
        count = 4000
        covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.02, 0.001], [0.0, 0.001, 0.0004]])
        truth = np.column_stack((np.linspace(0.0, 50.0, count), np.zeros(count), np.zeros(count)))
        estimate = truth + random.multivariate_normal(np.zeros(3), covariance, count)
        estimate[0] = truth[0]
        stamps = 0.1 * np.arange(count)
        estimates = Estimates(stamps, estimate, np.tile(covariance, (count, 1, 1)))
        turned = np.array([5.0, -3.0, 1.0])  # a reference in a frame of its own
        cos, sin = math.cos(1.0), math.sin(1.0)
        reference = np.column_stack((turned[0] + cos * truth[:, 0], turned[1] + sin * truth[:, 0], np.full(count, 1.0)))
        self.assertAlmostEqual(mean_nees(Trajectory(stamps, reference), estimates), 3.0, delta=0.15)

    def test_a_table_may_have_texts_with_commas(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scans.csv"
            path.write_text('stamp,x,reason\n1.5,2.5,"its stamp, 1.5 s, is old"\n2.5,3.5,""\n')
            table = read_table(path)
        self.assertEqual(table["x"].tolist(), [2.5, 3.5])
        self.assertEqual(table["reason"].tolist(), ["its stamp; 1.5 s; is old", ""])


if __name__ == "__main__":
    unittest.main()
