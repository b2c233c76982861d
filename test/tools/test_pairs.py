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
import rosbag
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "ros"), str(ROOT / "scripts")]
import simulated_bag  # noqa: E402
from recording import halved  # noqa: E402
from script_case import ScriptCase  # noqa: E402
from trajectory import Trajectory, write_tum  # noqa: E402

DURATION = 12.0
WRONG = 20  # the scan where the reference lies,
BY = 0.4  # [m] by so much


def wheels_to_tf(bag: str, output: str) -> None:
    """The bag of a robot that tells its odometry on TF, and on no topic."""
    with rosbag.Bag(bag) as source, rosbag.Bag(output, "w") as out:
        for topic, message, stamp in source.read_messages():
            if topic != "/odom":
                out.write(topic, message, stamp)
                continue
            pose = message.pose.pose
            transform = TransformStamped(header=message.header, child_frame_id=message.child_frame_id)
            transform.transform.translation.x, transform.transform.translation.y = pose.position.x, pose.position.y
            transform.transform.rotation = pose.orientation
            out.write("/tf", TFMessage([transform]), stamp)


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

    def params(self, text: str) -> str:
        path = Path(self.path("params.yaml"))
        path.write_text(text, encoding="utf-8")
        return str(path)

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

    def test_the_lasers_are_those_of_the_parameter_file(self) -> None:
        halved(self.path("drive.bag"), self.path("halves.bag"))
        both = self.params("scan_topics: [right/scan, left/scan]\n")
        bag = self.path("halves.bag")
        self.assertIn("no sensor_msgs/LaserScan on /scan", self.refused(bag))
        of_both = re.search(r"(\d+) displacements", self.said(bag, "--params", both))
        assert of_both is not None
        self.assertGreater(int(of_both[1]), 1.9 * len(self.stamps))
        one = ("--params", both, "--scan-topic", "left/scan")
        folder = Path(self.path("left"))
        self.assertIn(f"{len(self.stamps) - 1} displacements",
                      self.said(bag, *one, "--count", "1", "--output", str(folder)))
        self.assertTrue((folder / "01.png").is_file())
        said = self.refused(bag, "--params", both, "--output", self.path("none"))
        self.assertIn("scans of two lasers have the same stamp", said)

    def test_wheels_on_tf_alone_are_enough_for_pictures(self) -> None:
        bag, folder = self.path("tf.bag"), Path(self.path("tf"))
        wheels_to_tf(self.path("drive.bag"), bag)
        params = self.params("use_tf_odometry: true\nodom_frame: sckf_odom\n")
        self.said(bag, "--params", params, "--count", "1", "--output", str(folder))
        self.assertTrue((folder / "01.png").is_file())

    def test_clouds_are_listed_and_not_drawn(self) -> None:
        simulated_bag.write(self.path("clouds.bag"), duration=DURATION, clouds=True)
        arguments = [self.path("clouds.bag"), "--params", self.params("use_cloud_input: true\n")]
        self.assertIn(f"{len(self.stamps) - 1} displacements", self.said(*arguments))
        said = self.refused(*arguments, "--output", self.path("none"))
        self.assertIn("use_cloud_input is true: --output draws laser scans only", said)

    def test_what_cannot_be_is_said(self) -> None:
        self.assertIn("--by error needs --reference", self.refused(self.path("drive.bag"), "--by", "error"))
        self.assertIn("--count 0", self.refused(self.path("drive.bag"), "--count", "0"))
        self.assertIn("none.bag", self.refused(self.path("none.bag")))
        for std in ("nan", "-1", "inf"):
            said = self.refused(self.path("drive.bag"), "--reference-std", "0.02", std)
            self.assertIn(f"--reference-std: expected 0 or more, finite: {std}", said)
        for option in ("--scan-topic", "--odom-topic"):
            self.assertIn(f"{option}: expected the name of a topic: ''", self.refused(self.path("drive.bag"), option, ""))
        elsewhere = self.path("elsewhere.tum")
        Path(elsewhere).write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", encoding="utf-8")
        said = self.refused(self.path("drive.bag"), "--reference", elsewhere)
        self.assertRegex(said, r"elsewhere.tum: no pose at the stamps of two scans .*: expected the reference of .*drive.bag, "
                               r"at its scans, 1000\.\d+ to 10\d+\.\d+ s")


if __name__ == "__main__":
    unittest.main()
