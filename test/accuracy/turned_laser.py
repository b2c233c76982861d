#!/usr/bin/python3
"""Writes a log as if the laser were turned by some degrees to the left on the robot."""
from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from argument_types import within  # noqa: E402
from commands import command, rewritten  # noqa: E402
from trajectory import TrajectoryError  # noqa: E402


def turn_laser(bag: Path, output: Path, degrees: float, topic: str = "/scan") -> None:
    turn = math.radians(degrees)
    with rewritten(bag, output) as (source, out):
        if source.get_message_count(topic) == 0:
            raise TrajectoryError(f"{bag}: no scans on {topic}")
        for name, message, time in source.read_messages():
            if name == topic:
                message.angle_min += turn
                message.angle_max += turn
            out.write(name, message, time)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for argument in ("bag", "output_bag"):
        parser.add_argument(argument, type=Path)
    parser.add_argument("degrees", type=within(-360.0, 360.0))
    options = parser.parse_args()
    turn_laser(options.bag, options.output_bag, options.degrees)


if __name__ == "__main__":
    command(main)
