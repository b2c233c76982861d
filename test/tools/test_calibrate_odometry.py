#!/usr/bin/python3
"""scripts/calibrate_odometry: errors that are known are found, by the numbers alone and through a bag.

SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import re
import subprocess
import sys
import unittest
from pathlib import Path
from typing import Dict

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "ros"), str(ROOT / "test" / "accuracy"), str(ROOT / "scripts")]
import simulated_bag  # noqa: E402
from recording import halved  # noqa: E402
from script_case import BIN, ScriptCase, rename_topics  # noqa: E402
from wheel_calibration import CalibrationError, calibrate  # noqa: E402
from worse_wheels import worsen  # noqa: E402

MATCHING = np.array([0.004, 0.004, 0.002])  # std of a displacement [m, m, rad]


def drive(errors: np.ndarray, noise: np.ndarray, seed: int, pairs: int = 2000):
    """What wheels with these errors say of a robot that goes and turns anyhow, and what scans say; what these err by, and
    the headings."""
    random = np.random.default_rng(seed)
    x, yaw = random.uniform(0.05, 0.5, pairs), random.uniform(-0.5, 0.5, pairs)
    wheels = np.stack([x, random.normal(0.0, 0.01, pairs), yaw], axis=1)
    s, r, k, ahead, along_x, along_y = errors
    headings = random.uniform(-np.pi, np.pi, pairs)
    scans = np.stack([(1 + s) * wheels[:, 0] - ahead * (1 - np.cos(yaw)), (1 + s) * wheels[:, 1] + ahead * np.sin(yaw),
                      (1 + r) * yaw + k * np.hypot(wheels[:, 0], wheels[:, 1])], axis=1)
    way, turned = np.hypot(wheels[:, 0], wheels[:, 1]), np.abs(yaw)
    along = way * (along_x + 1j * along_y) * np.exp(-1j * headings)
    scans[:, 0] += along.real
    scans[:, 1] += along.imag
    place = np.sqrt(noise[0] ** 2 * way + noise[1] ** 2 * turned)
    std = np.stack([place, place, np.sqrt(noise[2] ** 2 * way + noise[3] ** 2 * turned)], axis=1)
    scans += std * random.normal(size=(pairs, 3)) + MATCHING * random.normal(size=(pairs, 3))
    return wheels, scans, np.tile(MATCHING ** 2, (pairs, 1)), headings


class NumbersTest(unittest.TestCase):
    ERRORS = np.array([-0.04, 0.03, 0.06, 0.09, 0.02, -0.01])
    NOISE = np.array([0.03, 0.05, 0.06, 0.08])

    def test_errors_and_noise_are_found(self) -> None:
        normalised = []
        for seed in range(20):
            found = calibrate(*drive(self.ERRORS, self.NOISE, seed))
            normalised.append((found.errors - self.ERRORS) / found.std)
            np.testing.assert_allclose(found.noise, self.NOISE, rtol=0.2, err_msg=f"seed {seed}")
        squares = np.mean(np.square(normalised), axis=0)
        self.assertTrue(np.all((squares > 0.3) & (squares < 1.9)), f"the std is not that of the errors: {squares}")

    def test_slips_are_nothing_systematic(self) -> None:
        wheels, scans, matching, headings = drive(self.ERRORS, self.NOISE, 3)
        wheels[::25, 2] += 0.8
        found = calibrate(wheels, scans, matching, headings)
        np.testing.assert_allclose(found.errors, self.ERRORS, atol=0.02)
        np.testing.assert_allclose(found.noise, self.NOISE, rtol=0.3)

    def test_what_a_log_does_not_tell_stays_open(self) -> None:
        wheels, scans, matching, headings = drive(self.ERRORS, self.NOISE, 4)
        wheels[:, 2] = scans[:, 2] = 0.0  # never turns
        found = calibrate(wheels, scans, matching, headings)
        self.assertGreater(found.std[1], 0.25)
        self.assertGreater(found.std[3], 0.4)
        self.assertLess(found.std[0], 0.01)

    def test_a_robot_that_faces_one_way_does_not_tell_way_and_floor_apart(self) -> None:
        wheels, scans, matching, headings = drive(self.ERRORS * np.array([1, 1, 1, 1, 0, 0]), self.NOISE, 5)
        wheels[:, 2] = scans[:, 2] = headings[:] = 0.0
        found = calibrate(wheels, scans, matching, headings)
        self.assertGreater(found.std[4], 0.02, "of the floor, which is not told")
        self.assertLess(found.std[0], 0.04, "of the way, which is, but for what a carpet may do")

    def test_wheels_of_another_drive_are_refused(self) -> None:
        wheels, scans, matching, headings = drive(self.ERRORS, self.NOISE, 6, pairs=50)
        with self.assertRaisesRegex(CalibrationError, r"each of 50 displacements, by \S+ m, \S+ m, \S+ rad \(median\): expected"):
            calibrate(wheels, scans + np.random.default_rng(6).choice([-5.0, 5.0], (50, 3)), matching, headings)


def weaving(t: float) -> np.ndarray:
    """Round the room's middle, to the left and to the right by turns."""
    def position(time: float) -> np.ndarray:
        u = 2 * np.pi * time / 60.0
        return (1.0 + 0.06 * np.sin(2 * np.pi * time / 5.0)) * np.array([2.8 * np.cos(u), 2.4 * np.sin(u)])

    ahead = position(t + 1e-4) - position(t - 1e-4)
    return np.array([*position(t), np.arctan2(ahead[1], ahead[0])])


def longer_and_turned(steps: np.ndarray) -> np.ndarray:
    """Wheels that say 5 % too much, turn too far to the left with the way, and turn about a point 0.1 m behind."""
    x, y, yaw = steps.T
    return np.stack([1.05 * x, 1.05 * y - 0.1 * yaw, yaw + 0.05 * np.hypot(x, y)], axis=1)


class BagTest(ScriptCase):
    SCRIPT = "calibrate_odometry"

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        simulated_bag.write(cls.path("drive.bag"), duration=60.0, path=weaving)
        simulated_bag.write(cls.path("short.bag"), duration=3.0, path=weaving)
        worsen(cls.path("drive.bag"), cls.path("worse.bag"), longer_and_turned)

    def told(self, bag: str, *arguments: str) -> Dict[str, float]:
        said = self.said(self.path(bag), *arguments)
        patterns = {"way": r"way is longer.* by +(\S+) %", "turn": r"with the way.* by +(\S+) °/m",
                    "ahead": r"laser is farther.* by +(\S+) m"}
        return {name: float(re.search(pattern, said).group(1)) for name, pattern in patterns.items()}

    def test_the_scale_of_the_simulated_wheels(self) -> None:
        told = self.told("drive.bag")
        self.assertAlmostEqual(told["way"], 100 * (1 / 1.03 - 1), delta=0.7)
        self.assertAlmostEqual(told["ahead"], 0.0, delta=0.01)

    def test_worse_wheels_are_told_to_be_worse_by_as_much(self) -> None:
        before, told = self.told("drive.bag"), self.told("worse.bag")
        self.assertAlmostEqual(told["way"], 100 * (1 / (1.03 * 1.05) - 1), delta=0.6)
        self.assertAlmostEqual(told["turn"] - before["turn"], -np.degrees(0.05), delta=0.4)
        self.assertAlmostEqual(told["ahead"] - before["ahead"], 0.1, delta=0.01)

    def test_the_parameters_can_be_given_to_replay(self) -> None:
        said = self.said(self.path("drive.bag"))
        params = Path(self.path("params.yaml"))
        params.write_text(said[said.index("# what is left"):], encoding="utf-8")
        replay = subprocess.run([str(BIN / "replay"), self.path("drive.bag"), "--params", str(params), "--trajectory",
                                 self.path("out.tum")],
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        self.assertEqual(replay.returncode, 0, replay.stdout)
        self.assertEqual(len(params.read_text(encoding="utf-8").strip().splitlines()), 5)

    def params(self, text: str) -> str:
        path = Path(self.path("given.yaml"))
        path.write_text(text, encoding="utf-8")
        return str(path)

    def test_the_laser_is_that_of_the_parameter_file(self) -> None:
        rename_topics(self.path("drive.bag"), self.path("front.bag"), {"/scan": "/front/scan", "/odom": "/wheels"})
        front = self.params("scan_topics: [front/scan]\n")
        self.assertEqual(self.told("front.bag", "--params", front, "--odom-topic", "wheels"), self.told("drive.bag"))

    def test_what_else_the_robot_has_is_left_out(self) -> None:
        others = self.params("use_imu: true\nuse_imu_orientation: true\nuse_pose_updates: true\nstandstill_time: 0.5\n"
                             "landmarks: lines\nlandmarks_only: true\n")
        self.assertEqual(self.told("drive.bag", "--params", others), self.told("drive.bag"))

    def test_of_two_lasers_the_first_or_the_one_that_is_named(self) -> None:
        halved(self.path("drive.bag"), self.path("halves.bag"))
        both = ("--params", self.params("scan_topics: [right/scan, left/scan]\n"))
        right, left = (self.told("halves.bag", "--scan-topic", side + "/scan") for side in ("right", "left"))
        self.assertNotEqual(right, left)
        self.assertEqual(self.told("halves.bag", *both), right)
        self.assertEqual(self.told("halves.bag", *both, "--scan-topic", "left/scan"), left)

    def test_clouds(self) -> None:
        simulated_bag.write(self.path("clouds.bag"), duration=20.0, path=weaving, clouds=True)
        self.assertAlmostEqual(self.told("clouds.bag", "--params", self.params("use_cloud_input: true\n"))["way"],
                               100 * (1 / 1.03 - 1), delta=2.0)

    def test_a_parameter_file_that_is_none_is_named(self) -> None:
        drive = self.path("drive.bag")
        text = self.params("a robot's notes\n")
        self.assertIn(f"--params {text}: expected lines 'parameter: value'", self.refused(drive, "--params", text))
        for other in (drive, self.params("method: [sckf\n"), "/no/such.yaml"):
            said = self.refused(drive, "--params", other)
            self.assertIn(f"--params {other}: expected a parameter file (YAML): ", said)
            self.assertNotIn("Traceback", said)

    def test_a_bad_parameter_is_that_of_the_file_that_was_given(self) -> None:
        bad = self.params("gate_probability: 1.5\n")
        self.assertIn(f"calibrate_odometry: parameter file {bad}: bad parameters:\n  gate_probability = 1.5: ",
                      self.refused(self.path("drive.bag"), "--params", bad))

    def test_too_short_a_log_is_refused(self) -> None:
        done = self.run_script(self.path("short.bag"))
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"calibrate_odometry: .*short.bag: \d+ displacements .* expected 30 or more")

    def test_a_bag_that_is_none(self) -> None:
        done = self.run_script("/no/such.bag")
        self.assertEqual(done.returncode, 1)
        self.assertIn("/no/such.bag", done.stderr)


if __name__ == "__main__":
    unittest.main()
