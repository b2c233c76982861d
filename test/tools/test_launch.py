#!/usr/bin/python3
"""The launch files: which parameters they set, and which they clear before; and what scripts/demo starts, as it runs."""
from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any

import rosbag
import roslaunch.config
import roslaunch.core
import roslaunch.xmlloader

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test" / "ros"))
import simulated_bag  # noqa: E402


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

    def test_a_rate_that_is_no_number_is_told_by_roslaunch(self) -> None:
        with self.assertRaisesRegex(roslaunch.core.RLException, r"(?s)could not convert string to float: 'foo'.*float\(rate\)"):
            load("replay.launch", "bag:=some.bag", "rate:=foo")
        parameters = load("replay.launch", "bag:=some.bag", "rate:=1e1").params  # as rosbag takes it, too
        self.assertEqual(parameters["/sckf_odometry/max_scan_delay"].value, 50.0)

    def test_the_demo_plays_a_log_records_it_and_ends(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            bag, record = f"{folder}/drive.bag", f"{folder}/run.bag"
            simulated_bag.write(bag, duration=10.0)
            with socket.socket() as unused:
                unused.bind(("localhost", 0))
                port = unused.getsockname()[1]
            environment = {**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}", "ROS_HOSTNAME": "localhost",
                           "ROS_LOG_DIR": folder}
            command = ["roslaunch", "--port", str(port), str(ROOT / "scripts" / "demo.launch"), f"bag:={bag}",
                       f"record:={record}", "rate:=2"]
            with open(f"{folder}/said", "w+", encoding="utf-8") as said:
                launch = subprocess.Popen(command, env=environment, stdout=said, stderr=subprocess.STDOUT)
                try:
                    launch.wait(timeout=120)
                except subprocess.TimeoutExpired:
                    launch.send_signal(signal.SIGINT)  # which ends all that it has started
                    launch.wait()
                said.seek(0)
                self.assertEqual(launch.returncode, 0, said.read())
            with rosbag.Bag(record) as recorded:
                topics = recorded.get_type_and_topic_info().topics
            with rosbag.Bag(bag) as played:
                scans = played.get_message_count("/scan")
            self.assertEqual(topics["/pose"].message_count, scans)
            self.assertGreater(topics["/odometry/filtered"].message_count, 100)
            plot = subprocess.run([str(ROOT / "scripts" / "plot"), record, "--latency", "--output", f"{folder}/run.png"],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
            self.assertEqual(plot.returncode, 0, plot.stdout)
            self.assertGreater((Path(folder) / "run.png").stat().st_size, 10000)


if __name__ == "__main__":
    unittest.main()
