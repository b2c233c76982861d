#!/usr/bin/python3
"""Simulated places, of which the truth is known exactly, by default: how far the estimate drifts, beside what is allowed.

Each is hard in its own way; see simulated_places.py. Run with -s (pytest) or as it is to see the figures.
"""
from __future__ import annotations

import sys
import tempfile
import unittest
from pathlib import Path
from typing import Optional

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
from logs import run  # noqa: E402
from simulated_log import SEED, Laser, simulate  # noqa: E402
from trajectory import Drift, drift, read_tum  # noqa: E402

COVERAGE = 0.98  # share of the scans that the estimate must cover


class PlacesTest(unittest.TestCase):

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def simulate(self, place: str, wheels: str = "good", laser: Laser = Laser(), step: float = 0.5,
                 somebody: Optional[str] = None, seed: int = SEED) -> None:
        simulate(place, self.folder / "log.bag", self.folder / "log.tum", wheels, step, laser, somebody, seed)

    def drifted(self, *options: str | Path) -> Drift:
        run("replay", self.folder / "log.bag", "--trajectory", self.folder / "estimate.tum", *options)
        result = drift(read_tum(self.folder / "log.tum"), read_tum(self.folder / "estimate.tum"))
        self.assertGreaterEqual(result.covered, COVERAGE * result.reference_poses)
        return result

    def check(self, place: str, wheels: str, percent: float, deg_per_m: float, of_wheels: float,
              seed: int = SEED, laser: Laser = Laser(), step: float = 0.5) -> float:
        """The most that the estimate may drift, and the least that the wheels alone do. Returns what it does."""
        self.simulate(place, wheels, laser, step, seed=seed)
        estimate, alone = self.drifted(), self.drifted("--method", "dead_reckoning")
        said = (f"{place}, wheels {wheels}: {estimate.translation_percent:.2f} %, {estimate.rotation_deg_per_m:.4f} °/m (at most "
                f"{percent}, {deg_per_m}); wheels alone {alone.translation_percent:.2f} %")
        print("\n" + said)
        self.assertLessEqual(estimate.translation_percent, percent, said)
        self.assertLessEqual(estimate.rotation_deg_per_m, deg_per_m, said)
        self.assertGreaterEqual(alone.translation_percent, of_wheels, said)
        return estimate.translation_percent

    def test_a_corridor_with_doors(self) -> None:
        one = self.check("corridor", "good", 0.4, 0.008, 0.4)
        another = self.check("corridor", "good", 0.4, 0.008, 0.4, seed=1)
        self.assertNotEqual(one, another, "other doors")

    def test_a_corridor_with_doors_whose_way_the_wheels_tell_wrong(self) -> None:
        self.check("corridor", "drifting", 0.6, 0.007, 30.0)

    def test_a_corridor_on_whose_carpet_the_robot_is_taken_along(self) -> None:
        estimate = self.check("corridor", "carpet", 0.5, 0.007, 1.0)
        (self.folder / "smooth.yaml").write_text("calibration_floor_std: 0\n", encoding="utf-8")
        smooth = self.drifted("--params", self.folder / "smooth.yaml").translation_percent
        print(f"if it were a smooth floor {smooth:.2f} %")
        self.assertLess(estimate, 0.8 * smooth)

    def test_a_hotel_whose_doors_are_one_as_the_other(self) -> None:
        self.check("hotel", "slipping", 0.19, 0.005, 12.0)

    def test_two_bare_walls(self) -> None:
        self.check("bare", "freezing", 0.4, 0.005, 12.0)

    def test_a_museum_in_which_people_stroll(self) -> None:
        self.check("museum", "freezing", 0.12, 0.004, 40.0)

    def test_a_museum_whose_walls_are_mostly_out_of_reach(self) -> None:
        """Of a third of the scans nothing is seen, and of others a short wall, which falls on any other one."""
        self.simulate("museum", laser=Laser(reach=4.0))
        estimate = self.drifted().translation_percent
        print(f"\nmuseum, good wheels, 4 m of reach: {estimate:.2f} %")
        self.assertLess(estimate, 2.2)

    def test_a_museum_beyond_reach_where_a_number_below_range_max_stands_for_nothing(self) -> None:
        """An arc around the robot that goes along with it."""
        self.check("museum", "drifting", 0.9, 0.045, 20.0, laser=Laser(reach=8.0, no_return=8.19))

    def test_a_castle_of_rough_stone(self) -> None:
        self.check("castle", "slipping", 0.14, 0.007, 12.0)

    def test_a_campus_of_trees(self) -> None:
        self.check("campus", "drifting", 0.4, 0.01, 25.0)

    def test_wheels_that_freeze_where_the_laser_sees_little(self) -> None:
        """Scans that agree badly place the robot where they refute what the wheels tell."""
        self.check("campus", "freezing", 0.45, 0.009, 15.0)

    def test_wheels_that_slip_where_a_few_trees_are_seen_twice(self) -> None:
        """In a turn no scan fits, and the next ones agree badly with that one, but nowhere else at all."""
        self.check("campus", "slipping", 0.5, 0.012, 12.0)
        self.check("campus", "freezing", 0.7, 0.015, 15.0, seed=2)

    def test_wheels_that_slip_where_nothing_is_seen_between_the_trees(self) -> None:
        """Of a beam that meets nothing no free space is known: nothing tells against the wheels but trees that fall on trees."""
        self.check("campus", "slipping", 0.45, 0.008, 12.0, seed=2, laser=Laser(beams=361, reach=30.0))

    def test_trees_of_which_hardly_a_half_is_seen_again(self) -> None:
        """However near the robot is: most scans need no other reference for that."""
        self.check("campus", "good", 0.55, 0.01, 0.3, seed=3, step=0.2)

    def test_wheels_that_freeze_for_a_little_turn_are_found_out_by_several_trees(self) -> None:
        """By so little at each scan that most of what is seen lies nearly as well where the wheels lead."""
        self.check("campus", "freezing", 0.8, 0.014, 15.0, seed=3, step=0.2)

    def test_wheels_that_freeze_where_a_few_trees_are_seen_in_passing(self) -> None:
        """With 30 m of reach and a metre from scan to scan some thirty points are all there is."""
        self.check("campus", "freezing", 1.3, 0.018, 12.0, seed=3, laser=Laser(reach=30.0), step=1.0)

    def test_somebody_who_walks_before_the_robot_does_not_hold_it(self) -> None:
        self.simulate("bare", step=0.2, laser=Laser(beams=361, reach=12.0), somebody="ahead")
        estimate = self.drifted().translation_percent
        (self.folder / "held.yaml").write_text("moved_place_min_share: 0\n", encoding="utf-8")
        held = self.drifted("--params", self.folder / "held.yaml").translation_percent
        print(f"\nsomebody ahead between bare walls: {estimate:.2f} %, if no place is left out {held:.2f} %")
        self.assertLess(estimate, 1.3)
        self.assertGreater(held, 5.0 * estimate)


if __name__ == "__main__":
    unittest.main()
