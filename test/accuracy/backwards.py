#!/usr/bin/python3
"""Writes a log, and its reference, as if the robot had driven the same way backwards, from its end to its beginning."""
from __future__ import annotations

import argparse
import copy
import sys
from pathlib import Path

import rospy

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from commands import command, expect_another, opened, written  # noqa: E402
from trajectory import Trajectory, TrajectoryError, read_tum, write_tum  # noqa: E402


def turn_round(bag: Path, tum: Path, output_bag: Path, output_tum: Path) -> None:
    """Every stamp t becomes the sum of the log's first and last stamp less t. What has no stamp, or is latched, comes
    first."""
    expect_another(output_bag, bag)
    with opened(bag) as source:
        messages = [(topic, message) for topic, message, _ in source.read_messages()]
    moving = [(topic, message) for topic, message in messages if hasattr(message, "header")]
    stamps = [message.header.stamp.to_nsec() for _, message in moving]
    if not stamps:
        raise TrajectoryError(f"{bag}: no messages with a stamp")
    reference = read_tum(tum)
    both_ends = min(stamps) + max(stamps)
    turned = []
    for topic, message in moving:
        back = copy.copy(message)
        back.header = copy.copy(message.header)
        back.header.stamp = rospy.Time(nsecs=both_ends - message.header.stamp.to_nsec())
        turned.append((topic, back))
    turned.sort(key=lambda each: each[1].header.stamp)
    with written(output_bag) as out:
        for topic, message in messages:
            if not hasattr(message, "header"):
                out.write(topic, message, turned[0][1].header.stamp)
        for topic, message in turned:
            out.write(topic, message, message.header.stamp)
    write_tum(output_tum, Trajectory(1e-9 * both_ends - reference.stamps[::-1], reference.poses[::-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("bag", "tum", "output_bag", "output_tum"):
        parser.add_argument(name, type=Path)
    options = parser.parse_args()
    turn_round(options.bag, options.tum, options.output_bag, options.output_tum)


if __name__ == "__main__":
    command(main)
