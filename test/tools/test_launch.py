#!/usr/bin/python3
"""The launch files, as roslaunch reads them: which parameters they set, and which they clear before."""
from __future__ import annotations

import os
import unittest
from pathlib import Path
from typing import Any

import roslaunch.config
import roslaunch.xmlloader

ROOT = Path(__file__).resolve().parents[2]


def load(name: str, *arguments: str) -> Any:
    """A roslaunch.config.ROSLaunchConfig."""
    config = roslaunch.config.ROSLaunchConfig()
    loader = roslaunch.xmlloader.XmlLoader()
    loader.load(str(ROOT / "launch" / name), config, argv=list(arguments), verbose=False)
    return config


class LaunchTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        os.environ["ROS_PACKAGE_PATH"] = f"{ROOT}:{os.environ.get('ROS_PACKAGE_PATH', '')}"

    def test_parameters_of_an_earlier_launch_are_cleared(self) -> None:
        for arguments in ((), ("standalone:=true",)):
            self.assertEqual(load("sckf_odometry.launch", *arguments).clear_params, ["/sckf_odometry/"])
        self.assertEqual(load("sckf_odometry.launch", "name:=other").clear_params, ["/other/"])

    def test_a_replays_own_delay_goes_to_the_node_whatever_its_name(self) -> None:
        for name in ("sckf_odometry", "other"):
            parameters = load("replay.launch", "bag:=some.bag", "rate:=10", f"name:={name}").params
            self.assertEqual(parameters[f"/{name}/max_scan_delay"].value, 50.0)
            self.assertEqual({key.split("/")[1] for key in parameters}, {name, "use_sim_time"})


if __name__ == "__main__":
    unittest.main()
