#!/usr/bin/python3
"""Writes a log as if a crowd stood and moved around the robot now and then, and were all that the laser sees."""
from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from commands import command, rewritten  # noqa: E402
from trajectory import TrajectoryError  # noqa: E402

TIMES = 12  # in the whole log
SHARE = 0.06  # of the scans
WIDTH = 6  # [beams] of a person
DISTANCE = (0.3, 2.5)  # [m]
NOISE = 0.02  # [m] of a range


def crowd(bag: Path, output: Path, topic: str = "/scan") -> None:
    """In each crowd, people are somewhere else at every scan."""
    draws = np.random.default_rng(5)
    with rewritten(bag, output) as (source, out):
        scans = source.get_message_count(topic)
        if scans < TIMES:
            raise TrajectoryError(f"{bag}: {scans} scans on {topic}: expected {TIMES} or more")
        period = scans // TIMES
        crowded = max(1, round(SHARE * period))
        count = 0
        for name, message, time in source.read_messages():
            if name == topic:
                count += 1
                if count % period >= period - crowded:
                    beams = len(message.ranges)
                    people = draws.uniform(*DISTANCE, beams // WIDTH + 1)
                    message.ranges = list(np.repeat(people, WIDTH)[:beams] + draws.normal(0.0, NOISE, beams))
            out.write(name, message, time)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for argument in ("bag", "output_bag"):
        parser.add_argument(argument, type=Path)
    options = parser.parse_args()
    crowd(options.bag, options.output_bag)


if __name__ == "__main__":
    command(main)
