#!/usr/bin/python3
"""scripts/consistency: by numbers whose statistics are known, and through a bag.

SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import importlib.machinery
import importlib.util
import re
import sys
import unittest
from pathlib import Path
from typing import Dict, List, Tuple

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "ros"), str(ROOT / "scripts")]
import simulated_bag  # noqa: E402
from script_case import ScriptCase  # noqa: E402
from trajectory import Trajectory, compose, write_tum  # noqa: E402

SCRIPT = ROOT / "scripts" / "consistency"
STEP_STD = np.array([0.01, 0.01, 0.01])  # [m, m, rad]
START_STD = np.array([0.05, 0.03, 0.08])
REFERENCE_STD = np.array([0.02, 0.02, 0.01])  # between two poses


def load_script():
    loader = importlib.machinery.SourceFileLoader("consistency", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("consistency", loader))
    sys.modules["consistency"] = module
    loader.exec_module(module)
    return module


consistency = load_script()


def row(stamp: float, pose: np.ndarray, P: np.ndarray) -> Dict[str, str]:
    told = {"stamp": stamp, "x": pose[0], "y": pose[1], "yaw": pose[2], "var_x": P[0, 0], "cov_xy": P[0, 1],
            "cov_xyaw": P[0, 2], "var_y": P[1, 1], "cov_yyaw": P[1, 2], "var_yaw": P[2, 2]}
    return {name: str(value) for name, value in told.items()}


def run_of_a_filter(random: np.random.Generator, noise: float) -> Tuple[List[Dict[str, str]], Trajectory]:
    """A robot that goes round; its estimate, `noise` times as wrong as it says, and a reference."""
    true = [np.array([3.0, -2.0, 1.0])]
    P = np.diag(START_STD ** 2)
    estimated = [true[0] + noise * START_STD * random.normal(size=3)]
    rows = [row(0.0, estimated[0], P)]
    step = np.array([0.3, 0.0, 0.05])
    for i in range(1, 40):
        true.append(compose(true[-1], step))
        before = estimated[-1]
        estimated.append(compose(before, step + noise * STEP_STD * random.normal(size=3)))
        F = consistency.lever(*(estimated[-1] - before)[:2])
        c, s = np.cos(before[2]), np.sin(before[2])
        G = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        P = F @ P @ F.T + G @ np.diag(STEP_STD ** 2) @ G.T
        rows.append(row(float(i), estimated[-1], P))
    reference = np.array([compose(pose, REFERENCE_STD / np.sqrt(2.0) * random.normal(size=3)) for pose in true])
    return rows, Trajectory(np.arange(40.0), reference)


class NumbersTest(unittest.TestCase):
    def test_the_autocorrelation_of_noise_that_remembers(self) -> None:
        random = np.random.default_rng(1)
        white = random.normal(size=(20000, 2))
        coloured = white.copy()
        for i in range(1, len(white)):
            coloured[i, 1] = 0.6 * coloured[i - 1, 1] + white[i, 1]
        found = consistency.autocorrelation(coloured)
        np.testing.assert_allclose(found[:, 0], 0.0, atol=0.03)
        np.testing.assert_allclose(found[:, 1], 0.6 ** np.arange(1, 6), atol=0.03)

    def nees(self, noise: float) -> Tuple[float, float]:
        """Mean NEES, and the share inside 3 sigma, of windows of 6 m; of an estimate that is so much worse than it says."""
        random = np.random.default_rng(2)
        found = [consistency.compare(*run_of_a_filter(random, noise), 6.0, np.diag(REFERENCE_STD ** 2))
                 for _ in range(400)]
        inside = np.concatenate([np.abs(window.errors) < 3.0 * window.std for window in found])
        return float(np.mean([window.nees for window in found])), float(inside.mean())

    def test_an_estimate_that_is_as_good_as_it_says(self) -> None:
        nees, inside = self.nees(1.0)
        self.assertAlmostEqual(nees, 3.0, delta=0.5)  # the mean of 400: 0.12
        self.assertGreater(inside, 0.993)

    def test_one_that_is_worse_is_found_out(self) -> None:
        nees, inside = self.nees(3.0)
        self.assertGreater(nees, 10.0)
        self.assertLess(inside, 0.9)

    def test_what_the_reference_does_not_know_is_no_window(self) -> None:
        rows, reference = run_of_a_filter(np.random.default_rng(3), 1.0)
        later = Trajectory(reference.stamps + 1000.0, reference.poses)
        self.assertIsNone(consistency.compare(rows, later, 6.0, np.eye(3)))


class BagTest(ScriptCase):
    SCRIPT = "consistency"

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        simulated_bag.write(cls.path("drive.bag"), duration=40.0)
        simulated_bag.write(cls.path("short.bag"), duration=3.0)
        stamps = np.array([stamp for topic, _, stamp in simulated_bag.messages(40.0) if topic == "/scan"])
        poses = simulated_bag.true_trajectory(stamps)
        write_tum(cls.path("true.tum"), Trajectory(stamps, poses))
        write_tum(cls.path("later.tum"), Trajectory(stamps + 500.0, poses))
        Path(cls.path("bold.yaml")).write_text(
            "method: dead_reckoning\nodometry_translation_per_meter: 0.001\nodometry_translation_per_radian: 0.001\n"
            "odometry_yaw_per_meter: 0.001\nodometry_yaw_per_radian: 0.001\n", encoding="utf-8")

    def windows(self, *arguments: str) -> Tuple[int, float, np.ndarray]:
        said = self.said(self.path("drive.bag"), "--reference", self.path("true.tum"), "--reference-std", "0", "0", "--length", "4", "--windows",
                         "6", *arguments)
        found = re.search(r"(\d+) windows of 4 m .* median (\S+) \(2.37\)\n.*: x (\S+), y (\S+), yaw (\S+) ", said)
        assert found is not None, said
        return int(found[1]), float(found[2]), np.array([float(found[i]) for i in (3, 4, 5)])

    def test_innovations_and_windows_of_a_drive(self) -> None:
        windows, nees, inside = self.windows()
        self.assertTrue(5 <= windows <= 7, windows)
        self.assertLess(nees, 11.3)  # of three degrees of freedom, 1 % are beyond
        self.assertGreater(inside.min(), 0.9)

    def test_a_covariance_that_is_too_small_is_found_out(self) -> None:
        _, nees, inside = self.windows("--params", self.path("bold.yaml"))
        self.assertGreater(nees, 100.0)
        self.assertLess(inside.min(), 0.5)

    def test_innovations_alone_need_no_reference(self) -> None:
        said = self.said(self.path("drive.bag"))
        rows = re.findall(r"^  (x|y|yaw) +mean square (\S+); +(.*)$", said, re.MULTILINE)
        self.assertEqual([axis for axis, _, _ in rows], ["x", "y", "yaw"], said)
        for _, mean_square, lags in rows:
            self.assertTrue(0.0 < float(mean_square) < 9.0, said)
            values = [float(lag) for lag in lags.split()]
            self.assertEqual(len(values), 5, said)
            self.assertTrue(all(abs(value) <= 1.0 for value in values), said)
        self.assertNotIn("windows", said)

    def test_a_reference_that_goes_on_after_the_bag_is_used_as_far_as_the_bag_goes(self) -> None:
        stamps = np.array([stamp for topic, _, stamp in simulated_bag.messages(80.0) if topic == "/scan"])
        write_tum(self.path("longer.tum"), Trajectory(stamps, simulated_bag.true_trajectory(stamps)))
        said = self.said(self.path("drive.bag"), "--reference", self.path("longer.tum"), "--length", "4", "--windows", "6")
        self.assertRegex(said, r"(?m)^[2-4] windows of 4 m ")

    def test_the_reference_of_another_time_is_told_with_both_times(self) -> None:
        said = self.refused(self.path("drive.bag"), "--reference", self.path("later.tum"), "--length", "4")
        self.assertRegex(said, r"later.tum: no window of 4 m .* from 15\d+\.\d+ to 15\d+\.\d+ s; expected the reference of "
                               r".*drive.bag, 1000\.000 to 10\d+\.\d+ s")

    def test_a_reference_is_read_before_the_bag(self) -> None:
        empty = self.path("empty.tum")
        Path(empty).touch()
        done = self.run_script(self.path("drive.bag"), "--reference", empty)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertIn("empty.tum: 0 pose(s), a trajectory needs at least two", done.stderr)

    def test_wrong_input(self) -> None:
        drive, true = self.path("drive.bag"), self.path("true.tum")
        self.assertIn("/no/such.bag", self.refused("/no/such.bag"))
        self.assertRegex(self.refused(self.path("short.bag")), r"short.bag: \d+ displacements .* expected 30 or more")
        self.assertRegex(self.refused(drive, "--reference", self.path("later.tum")), "later.tum: no window of 20 m")
        self.assertRegex(self.refused(drive, "--reference", true, "--length", "500"), "true.tum: no window of 500 m")
        self.assertIn("--length 0: expected more than 0 m", self.refused(drive, "--length", "0"))
        self.assertIn("--length inf: expected more than 0 m, finite", self.refused(drive, "--length", "inf"))
        self.assertIn("--windows 0: expected 1 or more", self.refused(drive, "--windows", "0"))
        self.assertIn("--reference-std: expected 0 or more, finite: nan", self.refused(drive, "--reference-std", "nan", "0"))


if __name__ == "__main__":
    unittest.main()
