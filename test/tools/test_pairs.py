#!/usr/bin/python3
"""scripts/pairs, with a simulated drive whose truth is known, and with a reference that is wrong at one scan.

SCKF_BIN_DIR is the folder of the programs under test.
"""
from __future__ import annotations

import math
import re
import sys
import unittest
from pathlib import Path
from typing import List

import matplotlib.image
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "ros"), str(ROOT / "scripts")]
import simulated_bag  # noqa: E402
from script_case import ScriptCase  # noqa: E402
from trajectory import Trajectory, write_tum  # noqa: E402

DURATION = 12.0
WRONG = 20  # the scan where the reference lies,
BY = 0.4  # [m] by so much


class PairsTest(ScriptCase):
    SCRIPT = "pairs"
    stamps: np.ndarray

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        simulated_bag.write(cls.path("drive.bag"), duration=DURATION)
        cls.stamps = np.array([stamp for topic, _, stamp in simulated_bag.messages(DURATION) if topic == "/scan"])
        poses = simulated_bag.true_trajectory(cls.stamps)
        write_tum(cls.path("true.tum"), Trajectory(cls.stamps, poses))
        poses = poses.copy()
        poses[WRONG, 0] += BY
        write_tum(cls.path("wrong.tum"), Trajectory(cls.stamps, poses))

    def pairs(self, *arguments: str) -> List[str]:
        return self.said(self.path("drive.bag"), *arguments).splitlines()

    def test_the_scan_where_the_reference_lies_comes_first(self) -> None:
        lines = self.pairs("--reference", self.path("wrong.tum"), "--count", "3")
        worst = [line for line in lines if re.match(r" *\d+\. ", line)]
        self.assertEqual(len(worst), 3, lines)
        first = re.match(r" *1\. (\S+) on (\S+):.* off by (-?\d+) mm, (-?\d+) mm, (\S+)°, NEES (\S+);", worst[0])
        assert first is not None, worst[0]
        self.assertIn(True, np.isclose(self.stamps[WRONG], [float(first[1]), float(first[2])], atol=2e-3), worst[0])
        self.assertAlmostEqual(math.hypot(float(first[3]), float(first[4])), 1e3 * BY, delta=30.0)
        self.assertLess(abs(float(first[5])), 1.0)
        self.assertGreater(float(first[6]), 100.0)

    def test_against_the_truth_the_covariance_is_right(self) -> None:
        said = "\n".join(self.pairs("--reference", self.path("true.tum"), "--reference-std", "1e-6", "1e-6"))
        nees = re.search(r"NEES.*: median (\S+) ", said)
        known = re.search(r"(\d+) displacements, (\d+) of them", said)
        assert nees is not None and known is not None, said
        self.assertEqual(known[1], known[2], said)
        self.assertEqual(int(known[1]), len(self.stamps) - 1)
        self.assertGreater(float(nees[1]), 0.3, said)
        self.assertLess(float(nees[1]), 5.0, said)

    def test_without_a_reference_they_come_by_nis(self) -> None:
        nis = [float(value) for value in re.findall(r"NIS (\S+);", "\n".join(self.pairs("--count", "1000")))]
        self.assertEqual(len(nis), len(self.stamps) - 1)
        self.assertEqual(nis, sorted(nis, reverse=True))

    def test_each_is_drawn(self) -> None:
        folder = Path(self.path("pictures"))
        self.pairs("--reference", self.path("wrong.tum"), "--count", "2", "--output", str(folder))
        self.assertEqual(sorted(file.name for file in folder.iterdir()), ["01.png", "02.png"])
        picture = matplotlib.image.imread(folder / "01.png")[..., :3]
        third = picture.shape[1] // 3
        for name, colour, panels in (("reference scan", "7a8fa6", (0, 1, 2)), ("scan", "e4572e", (0, 1, 2)),
                                     ("pairs", "3a8f5c", (1,)), ("ellipse", "6a3d9a", (1,))):
            rgb = np.array([int(colour[i:i + 2], 16) / 255.0 for i in (0, 2, 4)])
            for panel in panels:
                part = picture[:, panel * third:(panel + 1) * third]
                count = int((np.abs(part - rgb).max(axis=2) < 0.02).sum())
                self.assertGreater(count, 10, f"{name} in panel {panel}: {count} pixels")

    def test_what_cannot_be_is_said(self) -> None:
        self.assertIn("--by error needs --reference", self.refused(self.path("drive.bag"), "--by", "error"))
        self.assertIn("--count 0", self.refused(self.path("drive.bag"), "--count", "0"))
        self.assertIn("none.bag", self.refused(self.path("none.bag")))
        elsewhere = self.path("elsewhere.tum")
        Path(elsewhere).write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", encoding="utf-8")
        self.assertIn("no pose at the stamps", self.refused(self.path("drive.bag"), "--reference", elsewhere))


if __name__ == "__main__":
    unittest.main()
