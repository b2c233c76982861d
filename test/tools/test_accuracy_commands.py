#!/usr/bin/python3
"""The commands in test/accuracy: what they make of a log is seen there; here, what they say of what is none.

SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import subprocess
import sys
import unittest
from pathlib import Path
from typing import List, Tuple

import numpy as np
import rosbag

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "ros"), str(ROOT / "scripts")]
import simulated_bag  # noqa: E402
from script_case import FolderCase  # noqa: E402
from trajectory import Trajectory, write_tum  # noqa: E402

DURATION = 6.0


class CommandsTest(FolderCase):

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        simulated_bag.write(cls.path("drive.bag"), duration=DURATION)
        stamps = np.array([stamp for topic, _, stamp in simulated_bag.messages(DURATION) if topic == "/scan"])
        poses = simulated_bag.true_trajectory(stamps)
        write_tum(cls.path("true.tum"), Trajectory(stamps, poses))
        write_tum(cls.path("later.tum"), Trajectory(stamps + 500.0, poses))
        rosbag.Bag(cls.path("nothing.bag"), "w").close()
        Path(cls.path("empty")).touch()

    def refused(self, command: str, *arguments: str) -> Tuple[int, str]:
        """The exit code, and the line that it says last; of its outputs out.bag and out.tum there is none."""
        done = subprocess.run([sys.executable, str(ROOT / "test" / "accuracy" / command), *arguments],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        self.assertNotIn("Traceback", done.stderr)
        self.assertEqual(list(Path(self.folder.name).glob("out.*")), [])
        said = done.stderr.splitlines()
        if done.returncode == 1:
            self.assertEqual(len(said), 1, done.stderr)
        return done.returncode, said[-1]

    def on_bag(self, bag: str, output: str = "") -> List[Tuple[str, ...]]:
        """Each command with the bag; reference_noise.py writes none."""
        out, true, tum = output or self.path("out.bag"), self.path("true.tum"), self.path("out.tum")
        calls = [("backwards.py", bag, true, out, tum), ("crowd.py", bag, out), ("thinned.py", bag, true, out, tum, "2"),
                 ("turned_laser.py", bag, out, "3"), ("worse_wheels.py", bag, out, "slipping")]
        return calls if output else calls + [("reference_noise.py", bag, true)]

    def test_what_is_no_bag_is_named(self) -> None:
        for bag in ("none.bag", "empty", "true.tum", ""):
            for call in self.on_bag(self.path(bag)):
                code, said = self.refused(*call)
                self.assertEqual(code, 1, call)
                self.assertRegex(said, rf"^{call[0]}: {Path(self.path(bag))}: expected a bag: .")

    def test_what_a_bag_does_not_have_is_named(self) -> None:
        for call in self.on_bag(self.path("nothing.bag")):
            code, said = self.refused(*call)
            self.assertEqual(code, 1, call)
            self.assertRegex(said, rf"^{call[0]}: {self.path('nothing.bag')}: .*(scans on /scan|odometry on /odom|with a stamp)")

    def test_an_output_that_cannot_be_is_named_and_replaces_no_input(self) -> None:
        drive = self.path("drive.bag")
        before = Path(drive).read_bytes()
        for output, reason in ((self.path("none/out.bag"), "cannot be written: No such file or directory"),
                               (self.folder.name, "cannot be written: expected a file"),
                               (drive, "expected another file than the bag that is read")):
            for call in self.on_bag(drive, output):
                self.assertEqual(self.refused(*call), (1, f"{call[0]}: {output}: {reason}"))
        self.assertEqual(Path(drive).read_bytes(), before)
        out, tum = self.path("none/out.bag"), self.path("out.tum")
        self.assertEqual(self.refused("simulated_log.py", "bare", out, tum),
                         (1, f"simulated_log.py: {out}: cannot be written: No such file or directory"))

    def test_a_reference_that_is_none_or_of_another_log_is_named(self) -> None:
        drive, empty, later = self.path("drive.bag"), self.path("empty"), self.path("later.tum")
        out, tum = self.path("out.bag"), self.path("out.tum")
        none = f"{empty}: 0 pose(s), a trajectory needs at least two"
        self.assertEqual(self.refused("backwards.py", drive, empty, out, tum), (1, f"backwards.py: {none}"))
        self.assertEqual(self.refused("reference_noise.py", drive, empty), (1, f"reference_noise.py: {none}"))
        self.assertIn("reference_noise.py: no segment of 5 m or more that the reference and both estimates cover: they are "
                      "from 1500.", self.refused("reference_noise.py", drive, later)[1])
        self.assertIn(f"thinned.py: {later}: no pose at the scans that are left: expected the reference of the bag, 1000.",
                      self.refused("thinned.py", drive, later, self.path("thin.bag"), tum, "2")[1])

    def test_numbers_that_cannot_be_are_told_with_what_is_expected(self) -> None:
        drive, out, tum = self.path("drive.bag"), self.path("out.bag"), self.path("out.tum")
        for option, values, expected in (("--step", ("0", "-1", "nan", "far"), "0.01 to 10"),
                                         ("--beams", ("1", "-1", "many"), "a whole number, 2 to 100000"),
                                         ("--reach", ("0", "inf"), "0.1 to 1000"),
                                         ("--seed", ("-1", "1.5"), "a whole number, 0 or more")):
            for value in values:
                code, said = self.refused("simulated_log.py", "bare", out, tum, f"{option}={value}")
                self.assertEqual((code, said), (2, f"simulated_log.py: error: argument {option}: expected {expected}: {value}"))
        for value in ("0", "two"):
            code, said = self.refused("thinned.py", drive, self.path("true.tum"), out, tum, value)
            self.assertEqual((code, said), (2, f"thinned.py: error: argument every: expected a whole number, 1 or more: {value}"))
        self.assertIn("expected 2 or more", self.refused("thinned.py", drive, self.path("true.tum"), out, tum, "1000")[1])
        self.assertIn("degrees: expected -360 to 360: nan", self.refused("turned_laser.py", drive, out, "nan")[1])


if __name__ == "__main__":
    unittest.main()
