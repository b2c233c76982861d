#!/usr/bin/python3
"""Writes a log as if the laser were turned by some degrees to the left on the robot."""
from __future__ import annotations

import argparse
import math
from pathlib import Path

import rosbag


def turn_laser(bag: Path, output: Path, degrees: float, topic: str = "/scan") -> None:
    turn = math.radians(degrees)
    with rosbag.Bag(str(bag)) as source, rosbag.Bag(str(output), "w") as out:
        for name, message, time in source.read_messages():
            if name == topic:
                message.angle_min += turn
                message.angle_max += turn
            out.write(name, message, time)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    for argument in ("bag", "output_bag"):
        parser.add_argument(argument, type=Path)
    parser.add_argument("degrees", type=float)
    options = parser.parse_args()
    turn_laser(options.bag, options.output_bag, options.degrees)
