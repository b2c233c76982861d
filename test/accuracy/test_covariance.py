#!/usr/bin/python3
"""Whether the covariance can be believed on whole logs, one configuration for all: what the scripts pairs and consistency
find, beside what is allowed. Run with -s (pytest) or as it is to see the figures.
"""
from __future__ import annotations

import re
import sys
import unittest
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Tuple

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "tools")]
from logs import recorded, simulated  # noqa: E402
from script_case import ScriptCase  # noqa: E402
from simulated_log import simulate  # noqa: E402

EXACT = ("--reference-std", "0", "0")  # of a simulation


@dataclass(frozen=True)
class Found:
    """Of displacements, or of the last poses of windows: the least and the most that the median NEES may be, and the
    least share that must be inside of a bound. A covariance that is too large is none to be believed, either."""
    least: float
    most: float
    inside: float


class OnLogs(ScriptCase):
    PATTERN: str

    def check(self, log: str, bag: Path, tum: Path, bound: Found, *options: str) -> None:
        said = self.said(str(bag), "--reference", str(tum), *options)
        numbers = re.search(self.PATTERN, said, re.DOTALL)
        assert numbers is not None, said
        nees, *shares = map(float, numbers.groups())
        print(f"\n{log}, {self.SCRIPT}: median NEES {nees:.2f} ({bound.least} to {bound.most}, 2.37 is right), "
              f"inside {min(shares):.3f} (at least {bound.inside})")
        self.assertGreaterEqual(nees, bound.least, said)
        self.assertLessEqual(nees, bound.most, said)
        self.assertGreaterEqual(min(shares), bound.inside, said)

    def check_recorded(self, log: str, bound: Found) -> None:
        bag = recorded(log)
        self.check(log, bag, bag.with_suffix(".tum"), bound)

    def check_simulated(self, bound: Found) -> None:
        bag, tum = simulated(Path(self.folder.name))
        self.check("simulated", bag, tum, bound, *EXACT)

    def check_place(self, place: str, wheels: str, bound: Found) -> None:
        bag, tum = Path(self.path("place.bag")), Path(self.path("place.tum"))
        simulate(place, bag, tum, wheels)
        self.check(f"{place}, wheels {wheels}", bag, tum, bound, *EXACT)


class DisplacementsTest(OnLogs):
    """Inside: below the 99 % bound of chi squared."""
    SCRIPT = "pairs"
    PATTERN = r"NEES, with the reference's own error: median (\S+) .* (\S+) below 11.34"

    def test_intel(self) -> None:
        self.check_recorded("intel", Found(1.6, 2.1, 0.94))

    def test_aces(self) -> None:
        self.check_recorded("aces", Found(1.35, 1.8, 0.95))

    def test_freiburg_079(self) -> None:
        self.check_recorded("freiburg-079", Found(2.4, 3.1, 0.86))

    def test_simulated_log_of_mrpt(self) -> None:
        self.check_simulated(Found(1.5, 1.9, 0.955))

    def test_simulated_places(self) -> None:
        self.check_place("museum", "drifting", Found(0.9, 1.4, 0.985))
        self.check_place("campus", "good", Found(0.8, 1.3, 0.985))


class WindowsTest(OnLogs):
    """20 m from a pose that is known. Inside: of three sigma, in the worst of x, y and yaw."""
    SCRIPT = "consistency"
    PATTERN = r"NEES at their ends, median (\S+) .*inside 3 sigma: x (\S+), y (\S+), yaw (\S+) "

    def test_intel(self) -> None:
        self.check_recorded("intel", Found(0.5, 0.9, 0.985))

    def test_aces(self) -> None:
        self.check_recorded("aces", Found(1.1, 1.7, 0.98))

    def test_freiburg_079(self) -> None:
        self.check_recorded("freiburg-079", Found(1.9, 2.7, 0.925))

    def test_simulated_log_of_mrpt(self) -> None:
        self.check_simulated(Found(1.4, 2.5, 0.98))

    def test_simulated_places(self) -> None:
        """Where wheels err in the way, and scans see little of it, and where few beams see anything."""
        self.check_place("corridor", "drifting", Found(1.0, 2.6, 0.98))
        self.check_place("campus", "drifting", Found(0.4, 1.0, 0.98))


class WhitenessTest(ScriptCase):
    """Innovations: what goes on from scan to scan is an error that the filter has no state for."""
    SCRIPT = "consistency"

    def worst(self, log: str, bag: Path) -> Dict[str, float]:
        """Of each axis, at lags 1 to 5."""
        said = self.said(str(bag))
        lines = re.findall(r"^  (x|y|yaw) +mean square [^;]*;(.*)$", said, re.MULTILINE)
        self.assertEqual([axis for axis, _ in lines], ["x", "y", "yaw"], said)
        worst = {axis: max(abs(float(value)) for value in values.split()) for axis, values in lines}
        print(f"\n{log}, innovations: autocorrelation up to {worst}")
        return worst

    def test_intel(self) -> None:
        worst = self.worst("intel", recorded("intel"))
        self.assertLessEqual(worst["x"], 0.18)
        self.assertLessEqual(worst["y"], 0.065, "not white: the carpet takes the robot to one side")
        self.assertLessEqual(worst["yaw"], 0.14)

    def test_intel_raw(self) -> None:
        worst = self.worst("intel-raw", recorded("intel-raw"))
        self.assertLessEqual(worst["x"], 0.12)
        self.assertLessEqual(worst["y"], 0.22, "as 0.33 if it were a smooth floor")
        self.assertLessEqual(worst["yaw"], 0.1)

    def test_simulated_log_of_mrpt(self) -> None:
        worst = self.worst("simulated", simulated(Path(self.folder.name))[0])
        self.assertLessEqual(max(worst.values()), 0.22)


if __name__ == "__main__":
    unittest.main()
