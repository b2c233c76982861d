#!/usr/bin/python3
"""Whole logs through replay, one configuration for all: how far the estimate drifts, beside what is allowed.

At the end a table says what was measured, beside the bounds and beside the wheels alone: run with -s (pytest) or as it is
to see it.
"""
from __future__ import annotations

import csv
import sys
import tempfile
import unittest
from dataclasses import dataclass
from pathlib import Path
from typing import List, Optional, Sequence

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
from backwards import turn_round  # noqa: E402
from crowd import crowd  # noqa: E402
from logs import MALAGA, installed, recorded, run, simulated  # noqa: E402
from recording import halved, read_recording  # noqa: E402
from reference_noise import by_halves, shares  # noqa: E402
from revisit import closure, find_revisits  # noqa: E402
from thinned import thin, thin_reference  # noqa: E402
from trajectory import Trajectory, between, drift, read_tum, sample  # noqa: E402
from turned_laser import turn_laser  # noqa: E402
from worse_wheels import Told, freezing, slipping, worsen  # noqa: E402

COVERAGE = 0.98  # share of the reference's poses that the estimate must cover: scans that are left out show no drift


@dataclass(frozen=True)
class Figures:
    """Of a log: two numbers with the units that the log is measured in."""
    translation: float
    rotation: float


@dataclass(frozen=True)
class Row:
    log: str
    unit: str
    wheels: Figures
    measured: Figures
    bound: Figures


class DriftTest(unittest.TestCase):
    folder: tempfile.TemporaryDirectory[str]
    table: List[Row] = []

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()
        print(f"\n{'log':40}{'wheels alone':>24}{'measured':>24}{'at most':>24}")
        for row in cls.table:
            cells = [f"{each.translation:.2f} {row.unit.replace(',', f', {each.rotation:.3f}')}"
                     for each in (row.wheels, row.measured, row.bound)]
            print(f"{row.log:40}" + "".join(f"{cell:>24}" for cell in cells))

    def path(self, name: str) -> Path:
        return Path(self.folder.name) / name

    def replayed(self, bag: Path, method: Optional[str] = None, scans: Sequence[str] = ("/scan",)) -> Trajectory:
        output = self.path("trajectory.tum")
        topics = [argument for topic in scans for argument in ("--scan-topic", topic)]
        run("replay", bag, "--trajectory", output, *topics, *(["--method", method] if method else []))
        return read_tum(output)

    def drifted(self, bag: Path, reference: Trajectory, method: Optional[str] = None) -> Figures:
        result = drift(reference, self.replayed(bag, method))
        self.assertGreaterEqual(result.covered, COVERAGE * result.reference_poses)
        return Figures(result.translation_percent, result.rotation_deg_per_m)

    def check(self, row: Row) -> None:
        self.table.append(row)
        self.assertLessEqual(row.measured.translation, row.bound.translation, row)
        self.assertLessEqual(row.measured.rotation, row.bound.rotation, row)
        self.assertGreater(row.wheels.translation, 2.0 * row.measured.translation, row)
        self.assertGreater(row.wheels.rotation, 2.0 * row.measured.rotation, row)

    def check_drift(self, log: str, bag: Path, tum: Path, percent: float, deg_per_m: float) -> None:
        reference = read_tum(tum)
        self.check(Row(log, "%, °/m", self.drifted(bag, reference, "dead_reckoning"), self.drifted(bag, reference),
                       Figures(percent, deg_per_m)))

    def check_recorded(self, log: str, percent: float, deg_per_m: float) -> None:
        bag = recorded(log)
        self.check_drift(log, bag, bag.with_suffix(".tum"), percent, deg_per_m)

    def test_intel(self) -> None:
        self.check_recorded("intel", 0.86, 0.076)

    def test_two_lasers_that_see_half_each(self) -> None:
        bag = recorded("intel")
        halves = self.path("halves.bag")
        halved(str(bag), str(halves))
        reference = read_tum(bag.with_suffix(".tum"))
        both = drift(reference, self.replayed(halves, scans=("/right/scan", "/left/scan")))
        right = drift(reference, self.replayed(halves, scans=("/right/scan",)))
        self.assertGreaterEqual(both.covered, COVERAGE * both.reference_poses)
        print(f"\nintel, a laser for each half: {both.translation_percent:.2f} %, {both.rotation_deg_per_m:.3f} °/m; the "
              f"right one alone: {right.translation_percent:.2f} %, {right.rotation_deg_per_m:.3f} °/m")
        self.assertLess(both.translation_percent, 1.15)
        self.assertLess(both.rotation_deg_per_m, 0.11)
        self.assertLess(both.translation_percent, 0.9 * right.translation_percent)

    def test_intel_raw(self) -> None:
        self.check_recorded("intel-raw", 1.33, 0.072)

    def test_intel_raw_with_beams_as_its_reference_was_made(self) -> None:
        """The reference is that of intel, where the same scans begin at -90 degrees and not at -89.5."""
        turned = self.path("turned.bag")
        turn_laser(recorded("intel-raw"), turned, -0.5)
        self.check_drift("intel-raw, from -90°", turned, recorded("intel-raw").with_suffix(".tum"), 1.02, 0.072)

    def test_aces(self) -> None:
        self.check_recorded("aces", 1.2, 0.066)

    def test_freiburg_079(self) -> None:
        self.check_recorded("freiburg-079", 0.98, 0.096)

    def check_backwards(self, log: str, percent: float, deg_per_m: float) -> None:
        bag, tum = self.path("backwards.bag"), self.path("backwards.tum")
        turn_round(recorded(log), recorded(log).with_suffix(".tum"), bag, tum)
        self.check_drift(f"{log}, backwards", bag, tum, percent, deg_per_m)

    def test_a_robot_that_drives_backwards(self) -> None:
        """Its laser looks back to where it comes from: much of what it sees has no partner in the scan before."""
        self.check_backwards("intel", 1.1, 0.085)
        self.check_backwards("aces", 1.5, 0.076)
        self.check_backwards("freiburg-079", 1.18, 0.103)

    def check_thinned(self, log: str, every: int, percent: float, deg_per_m: float, told: Optional[Told] = None) -> None:
        bag, tum = self.path("thinned.bag"), self.path("thinned.tum")
        thin_reference(recorded(log).with_suffix(".tum"), tum, thin(recorded(log), bag, every))
        name = f"{log}, 1 of {every} scans"
        if told:
            worse = self.path("worse.bag")
            worsen(str(bag), str(worse), told)
            bag, name = worse, f"{name}, {told.__name__}"
        self.check_drift(name, bag, tum, percent, deg_per_m)

    def test_scans_that_are_far_apart(self) -> None:
        """1.1 m and 36 degrees, 1.5 m and 30 degrees; and 0.7 m where the wheels are wrong by twice that when reversing."""
        self.check_thinned("intel", 2, 0.95, 0.085)
        self.check_thinned("aces", 2, 1.3, 0.08)
        self.check_thinned("freiburg-079", 8, 1.1, 0.1)

    def test_scans_that_are_far_apart_and_wheels_that_slip(self) -> None:
        self.check_thinned("aces", 2, 1.5, 0.085, slipping)
        self.check_thinned("freiburg-079", 8, 1.12, 0.11, slipping)

    def test_scans_that_are_far_apart_and_wheels_that_freeze(self) -> None:
        self.check_thinned("intel", 2, 1.3, 0.11, freezing)
        self.check_thinned("aces", 2, 2.6, 0.17, freezing)

    def test_on_freiburg_the_reference_errs_by_more_than_the_estimate(self) -> None:
        """Even where the estimate has half of the scans."""
        bag = recorded("freiburg-079")
        for each in by_halves(bag, bag.with_suffix(".tum")):
            print(f"\nfreiburg-079, {each.length:g} m: halves differ by {each.estimates.percent:.2f} %, the reference "
                  f"errs by {each.reference.percent:.2f} %")
            self.assertLess(each.estimates.percent / np.sqrt(2.0), each.reference.percent)

    def check_worse(self, log: str, told: Told, percent: float, deg_per_m: float) -> None:
        bag = recorded(log)
        worse = self.path("worse.bag")
        worsen(str(bag), str(worse), told)
        self.check_drift(f"{log}, {told.__name__}", worse, bag.with_suffix(".tum"), percent, deg_per_m)

    def test_wheels_that_slip_by_5_to_15_degrees(self) -> None:
        self.check_worse("intel", slipping, 0.87, 0.08)
        self.check_worse("aces", slipping, 1.2, 0.068)
        self.check_worse("freiburg-079", slipping, 1.05, 0.105)

    def test_wheels_that_freeze_in_turns(self) -> None:
        self.check_worse("intel", freezing, 0.92, 0.085)
        self.check_worse("aces", freezing, 1.22, 0.068)
        self.check_worse("freiburg-079", freezing, 1.05, 0.105)

    def check_crowded(self, log: str, percent: float, deg_per_m: float) -> None:
        bag = recorded(log)
        crowded = self.path("crowded.bag")
        crowd(bag, crowded)
        self.check_drift(f"{log}, in crowds", crowded, bag.with_suffix(".tum"), percent, deg_per_m)

    def test_crowds_that_are_all_the_laser_sees(self) -> None:
        self.check_crowded("intel", 1.4, 0.15)
        self.check_crowded("freiburg-079", 1.5, 0.17)
        self.check_crowded("intel-raw", 1.6, 0.11)

    def test_simulated_log_of_mrpt(self) -> None:
        self.check_drift("simulated", *simulated(Path(self.folder.name)), 0.37, 0.0095)

    def test_wheels_that_are_right_are_not_given_up(self) -> None:
        """Among walls that are stairs, and not the same from two places, scans may fit better where the robot is not."""
        bag, tum = simulated(Path(self.folder.name))
        truth = read_tum(tum)
        draws = np.random.default_rng(1)

        def right(told: np.ndarray) -> np.ndarray:
            true, _ = sample(truth, read_recording(str(bag)).wheels.stamps, max_gap=1e9)
            steps = between(true[:-1], true[1:])
            way = np.hypot(steps[:, 0], steps[:, 1])
            std = np.column_stack((0.005 * np.sqrt(way), 0.0015 * np.sqrt(way), 0.002 * np.sqrt(way + abs(steps[:, 2]))))
            self.assertEqual(len(steps), len(told))
            return steps + std * draws.standard_normal(steps.shape)

        good = self.path("good.bag")
        worsen(str(bag), str(good), right)
        table = self.path("good.csv")
        run("replay", good, "--csv", table)
        worst = max(self.errors_of_displacements(table, truth))
        print(f"\nsimulated, wheels that are right: the worst displacement is {worst:.2f} m off")
        self.assertLess(worst, 0.3)

    def errors_of_displacements(self, table: Path, truth: Trajectory) -> List[float]:
        with open(table, encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if row["dimension"] == "3"]
        self.assertGreater(len(rows), 1000)
        ends = [sample(truth, np.array([float(row[name]) for row in rows]))[0] for name in ("reference_stamp", "stamp")]
        found = np.array([[float(row[f"displacement_{of}"]) for of in ("x", "y", "yaw")] for row in rows])
        return list(np.hypot(*between(between(*ends), found)[:, :2].T))

    def test_malaga_closes_on_its_second_pass(self) -> None:
        """No truth here, but the robot runs over its own way again: its scans fall on those of the first pass."""
        bag = self.path("malaga.bag")
        run("rawlog_to_bag", installed(MALAGA), bag)
        recording = read_recording(str(bag))
        poses = {}
        for method in ("sckf_multi", "dead_reckoning"):
            poses[method], covered = sample(self.replayed(bag, method), recording.stamps)
            self.assertGreaterEqual(covered.mean(), COVERAGE)
            inside = covered if method == "sckf_multi" else inside & covered
        clouds = [cloud for cloud, use in zip(recording.clouds, inside) if use]
        poses = {method: each[inside] for method, each in poses.items()}
        revisits = find_revisits(clouds, poses["sckf_multi"])
        self.assertGreater(len(revisits), 20)

        def median(method: str) -> Figures:
            closures = [closure(revisit, clouds, poses[method]) for revisit in revisits]
            return Figures(float(np.median([each.translation for each in closures])),
                           float(np.degrees(np.median([each.rotation for each in closures]))))

        self.check(Row("malaga", "m,°", median("dead_reckoning"), median("sckf_multi"), Figures(0.12, 0.6)))


class ReferenceNoiseTest(unittest.TestCase):

    @staticmethod
    def straight_ways(axes: Sequence[int]) -> List[Trajectory]:
        """Poses along a straight way, off by 0.02, 0.01 and 0.01 m or rad (std) in these of x, y and yaw."""
        random = np.random.default_rng(1)
        truth = np.column_stack([np.arange(0.0, 1000.0, 0.25), np.zeros(4000), np.zeros(4000)])
        ways = []
        for std in (0.02, 0.01, 0.01):
            poses = truth.copy()
            poses[:, axes] += random.normal(0.0, std, (4000, len(axes)))
            ways.append(Trajectory(np.arange(4000.0) * 0.1, poses))
        return ways

    def check(self, measured: float, expected: float) -> None:
        self.assertAlmostEqual(measured / expected, 1.0, delta=0.05)

    def test_three_errors_are_told_apart(self) -> None:
        reference, *estimates = self.straight_ways([0, 1])
        for each in shares(reference, estimates):
            at_ends = 100.0 * np.sqrt(2.0 * 2.0) / each.length  # of an std of each axis, in percent
            self.check(each.first.percent, at_ends * np.hypot(0.02, 0.01))
            self.check(each.estimates.percent, at_ends * 0.01 * np.sqrt(2.0))
            self.check(each.reference.percent, at_ends * 0.02)

    def test_so_are_those_of_the_yaw(self) -> None:
        reference, *estimates = self.straight_ways([2])
        for each in shares(reference, estimates):
            at_ends = np.degrees(np.sqrt(2.0)) / each.length
            self.check(each.first.deg_per_m, at_ends * np.hypot(0.02, 0.01))
            self.check(each.estimates.deg_per_m, at_ends * 0.01 * np.sqrt(2.0))
            self.check(each.reference.deg_per_m, at_ends * 0.02)


if __name__ == "__main__":
    unittest.main()
